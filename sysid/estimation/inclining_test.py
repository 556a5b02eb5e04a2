"""Inclining test: height of the centre of mass from the heel under known weights.

Symbols: m vehicle mass (kg), w weight moved to port (kg), d its distance from the middle (m), h
height of the metacentre above the centre of mass (m), phi heel (rad, positive to starboard), phi0
list without weights::

    tan(phi) = tan(phi0) - w d / (m h)

(Lewis 1988, Principles of Naval Architecture I, ch. 3.7). The metacentre of a body of revolution is
on its axis at the height of the centre of buoyancy, at the surface as well as under water.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from mavlink_io.errors import ErrorCode, OperationError
from sitl.vehicle.config import VehicleConfig
from sysid.data.dataset import Log
from sysid.data.events import Armed
from sysid.models.model_file import ParameterEstimate

Array = NDArray[np.float64]

AVERAGED_SHARE = 1.0 / 3.0
"""Last part of a weight's period over which the heel is averaged.

The roll motion has decayed by then.
"""
MAX_ROLL_RMS_DEG = 0.5
"""Largest roll standard deviation of a settled vehicle, deg."""
_LIKELY_HEIGHT_M = 0.02
"""Initial value of the search for h, m."""


class InclineError(OperationError):
    """The log contains no usable inclining test; the message names the reason."""

    code = ErrorCode.INCLINING_TEST


class WeightPeriod(NamedTuple):
    """Period with a weight off the middle, in vehicle time after arming."""

    moment_kgm: float
    """Mass times distance, kg m, positive to port."""
    from_s: float
    until_s: float


class InclinationReading(NamedTuple):
    """Heel in one period."""

    moment_kgm: float
    """Mass times distance, kg m, positive to port."""
    roll_deg: float
    """Measured mean heel, positive to starboard."""
    fitted_deg: float
    """Heel by the fitted equation."""


class Inclining(NamedTuple):
    """Result of an inclining test."""

    height_m: ParameterEstimate
    """Height h of the centre of buoyancy above the centre of mass."""
    z_cm_m: ParameterEstimate
    """Centre of mass above the hull axis, positive up, as in vehicle files."""
    list_deg: float
    """Heel without weights."""
    readings: tuple[InclinationReading, ...]


def analyse(log: Log, moves: Sequence[WeightPeriod], vehicle: VehicleConfig) -> Inclining:
    """Fit height and list to the heel of all periods by least squares.

    Parameters
    ----------
    log : Log
        Log of the test, with attitude and the `Armed` event.
    moves : sequence of WeightPeriod
        Periods of the weights, at least three with two different moments.
    vehicle : VehicleConfig
        Vehicle file with mass and centre of buoyancy.

    Returns
    -------
    Inclining
        Height of the centre of buoyancy above the centre of mass, with its standard deviation.

    Raises
    ------
    InclineError
        The log or the periods cannot be used.
    """
    # phi_i = arctan(b - a M_i), with M_i = w d (kg m), a = 1/(m h) and b = tan(phi0); a and b by
    # least squares. Residual variance: sum r^2 / (n - 2); relative sd of h = relative sd of a.
    if len({period.moment_kgm for period in moves}) < 2 or len(moves) < 3:
        raise InclineError(
            "an inclining test needs at least three moves with two different moments"
        )
    armed_s = [event.time_s for event in log.events if isinstance(event.value, Armed)]
    if not armed_s:
        raise InclineError(
            f"{log.name}: does not hold the arming of the vehicle, so the times of the moves are"
            " unknown"
        )
    moments_kgm = np.array([period.moment_kgm for period in moves])
    roll_rad = np.array([_heel_rad(log, armed_s[-1], period) for period in moves])
    mass_kg = vehicle.ballast.mass_kg

    def heel_rad(unknowns: Array) -> Array:
        return np.asarray(np.arctan(unknowns[1] - unknowns[0] * moments_kgm))

    solution = least_squares(
        lambda unknowns: heel_rad(unknowns) - roll_rad,
        np.array([1.0 / (mass_kg * _LIKELY_HEIGHT_M), 0.0]),
    )
    per_moment, tan_list = solution.x.tolist()
    if per_moment <= 0.0:
        raise InclineError(
            f"{log.name}: the vehicle heels away from the weights; to_port_m is positive to port"
        )
    variance = 2.0 * solution.cost / (len(moves) - 2)
    relative_sd = (
        math.sqrt(variance * np.linalg.inv(solution.jac.T @ solution.jac)[0, 0]) / per_moment
    )
    height_m = 1.0 / (mass_kg * per_moment)
    height = ParameterEstimate(height_m, height_m * relative_sd)
    readings = (
        InclinationReading(moment_kgm, math.degrees(measured), math.degrees(fitted_rad))
        for moment_kgm, measured, fitted_rad in zip(
            moments_kgm.tolist(), roll_rad, heel_rad(solution.x), strict=True
        )
    )
    z_cm = ParameterEstimate(vehicle.ballast.z_cb_m - height_m, height.sd)
    return Inclining(
        height_m=height,
        z_cm_m=z_cm,
        list_deg=math.degrees(math.atan(tan_list)),
        readings=tuple(readings),
    )


def _heel_rad(log: Log, armed_s: float, period: WeightPeriod) -> float:
    """Return the mean heel over the last part of a period, rad."""
    time_s = log.attitude.time_s - armed_s
    average_from_s = period.until_s - AVERAGED_SHARE * (period.until_s - period.from_s)
    roll = log.attitude.roll_rad[(time_s >= average_from_s) & (time_s < period.until_s)]
    if roll.size == 0:
        raise InclineError(
            f"{log.name}: holds no ATTITUDE from {average_from_s:g} to {period.until_s:g} s after"
            " arming"
        )
    if math.degrees(np.std(roll)) > MAX_ROLL_RMS_DEG:
        raise InclineError(
            f"{log.name}: still rolling by {math.degrees(np.std(roll)):.1f} deg rms before"
            f" {period.until_s:g} s; give each move longer, or calmer water"
        )
    return float(np.mean(roll))
