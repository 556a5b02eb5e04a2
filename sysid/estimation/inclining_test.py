"""An inclining test: the height of the centre of mass from the heel that known weights cause.

A weight m_w carried athwartships by d heels a vehicle of mass m until ``tan(phi) = m_w d / (m h)``,
where h is how far the centre of mass hangs below the metacentre (Lewis 1988, Principles of Naval
Architecture I, ch. 3.7). A body of revolution has that on its axis, at the height of its centre of
buoyancy, afloat as under water."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from sitl.vehicle.config import VehicleConfig
from sysid.data.dataset import Log
from sysid.models.model_file import ParameterEstimate

Array = NDArray[np.float64]

AVERAGED_SHARE = 1.0 / 3.0
"""The last part of a move over which the heel is read: by then she has stopped rolling."""
MAX_ROLL_RMS_DEG = 0.5
"""Rolling more than this, rms, she has not settled."""
_LIKELY_HEIGHT_M = 0.02


class InclineError(RuntimeError):
    """The log shows no inclining test that can be used; the message says why."""


class WeightPeriod(NamedTuple):
    """What stood off the middle, and when, in vehicle seconds after arming."""

    moment_kgm: float
    """Mass times distance, to port."""
    from_s: float
    until_s: float


class InclinationReading(NamedTuple):
    moment_kgm: float
    roll_deg: float
    """Mean heel, to starboard."""
    fitted_deg: float


class Inclining(NamedTuple):
    height_m: ParameterEstimate
    """Of the centre of buoyancy above the centre of mass."""
    z_cm_m: ParameterEstimate
    """Up from the hull axis, as vehicle files have it."""
    list_deg: float
    """Heel with nothing moved."""
    readings: tuple[InclinationReading, ...]


def analyse(log: Log, moves: Sequence[WeightPeriod], vehicle: VehicleConfig) -> Inclining:
    """Fit height and list to the heel of every move; mass and centre of buoyancy are the vehicle
    file's.

    Raises InclineError.
    """
    if len({move.moment_kgm for move in moves}) < 2 or len(moves) < 3:
        raise InclineError(
            "an inclining test needs at least three moves with two different moments"
        )
    armed_s = [event.time_s for event in log.events if event.text.startswith("Armed")]
    if not armed_s:
        raise InclineError(
            f"{log.name}: the vehicle never said that it was armed, so no move can be dated"
        )
    moment = np.array([move.moment_kgm for move in moves])
    roll = np.array([_heel_rad(log, armed_s[-1], move) for move in moves])
    mass_kg = vehicle.ballast.mass_kg

    def heel(z: Array) -> Array:
        return np.asarray(np.arctan(z[1] - z[0] * moment))

    found = least_squares(
        lambda z: heel(z) - roll, np.array([1.0 / (mass_kg * _LIKELY_HEIGHT_M), 0.0])
    )
    per_moment, own_list = found.x.tolist()
    if per_moment <= 0.0:
        raise InclineError(
            f"{log.name}: she heels away from the weights; to_port_m is positive to port"
        )
    variance = 2.0 * found.cost / (len(moves) - 2)
    share = math.sqrt(variance * np.linalg.inv(found.jac.T @ found.jac)[0, 0]) / per_moment
    height_m = 1.0 / (mass_kg * per_moment)
    height = ParameterEstimate(height_m, height_m * share)
    readings = (
        InclinationReading(m, math.degrees(seen), math.degrees(fitted))
        for m, seen, fitted in zip(moment.tolist(), roll, heel(found.x), strict=True)
    )
    z_cm = ParameterEstimate(vehicle.ballast.z_cb_m - height_m, height.sd)
    return Inclining(height, z_cm, math.degrees(math.atan(own_list)), tuple(readings))


def _heel_rad(log: Log, armed_s: float, move: WeightPeriod) -> float:
    time_s = log.attitude.time_s - armed_s
    read_from_s = move.until_s - AVERAGED_SHARE * (move.until_s - move.from_s)
    roll = log.attitude.roll_rad[(time_s >= read_from_s) & (time_s < move.until_s)]
    if roll.size == 0:
        raise InclineError(
            f"{log.name}: holds no ATTITUDE from {read_from_s:g} to {move.until_s:g} s after arming"
        )
    if math.degrees(np.std(roll)) > MAX_ROLL_RMS_DEG:
        raise InclineError(
            f"{log.name}: still rolling by {math.degrees(np.std(roll)):.1f} deg rms before"
            f" {move.until_s:g} s; give each move longer, or calmer water"
        )
    return float(np.mean(roll))
