"""What an anomaly would add to a run's residuals: the run simulated with it, less the run without.

A slip is a step of the surface that the command does not know; a gust is told by the slip and the
return 5 s later that would push as hard. Both may come at any time, so there is one signature a
second."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sitl.vehicle import propeller
from sysid.data.segments import RATE_HZ, Plane, Run
from sysid.estimation.map import fit
from sysid.estimation.map.fit import Dataset
from sysid.models import greybox, linear_planes, noise
from sysid.models.noise import Filter
from sysid.models.parameters import CandidateVehicle

Array = NDArray[np.float64]
Kind = Literal["actuator slip", "actuator offset", "gain error", "gust", "speed off"]

EVERY_S = 1.0
"""Between the times at which a slip or a gust is looked for."""
MARGIN_S = 2.0
"""From the ends of a run: what happens there leaves no trace, or is the start itself."""
GUST_S = 5.0
SMALL_RAD, SMALL_SHARE = math.radians(0.1), 0.01
"""The anomalies simulated: small, so that the signature is a slope."""


class Signature(NamedTuple):
    """Of one kind of anomaly in one run."""

    kind: Kind
    times_s: Array
    """(k,) since the test began, when the duct first felt it; NaN for what lasts throughout."""
    white: Array
    """(k, samples x outputs): whitened residual per unit of ``size``."""
    unit: Literal["deg", "%", "deg/s2"]


def signatures(vehicle: CandidateVehicle, what: Dataset, by: Filter) -> list[Signature]:
    """All that are looked for; angles at the duct in degrees, accelerations in deg/s^2, errors in
    percent."""
    run, actuator = what.run, vehicle.actuators[what.run.plane]
    speed_mps = fit.cruise_speed_mps(vehicle, float(run.thrust[0]))
    duct = greybox.duct_along(run, run.plane, actuator)
    stretched = greybox.duct_along(_scale_deflections(run), run.plane, actuator)
    first, faster = (
        greybox.first_state(run, what.start, k * speed_mps) for k in (1.0, 1.0 + SMALL_SHARE)
    )
    before = _track(vehicle, what, first, duct)
    rows = np.arange(_rows(MARGIN_S), len(before) - _rows(MARGIN_S), _rows(EVERY_S))
    slips = [_simulate_slip(vehicle, what, before, duct, int(row)) for row in rows]
    offset, gain = (
        _track(vehicle, what, first, angles) for angles in (duct + SMALL_RAD, stretched)
    )
    speed = _track(vehicle, what, faster, duct, 1.0 + SMALL_SHARE)

    def white(tracks: Sequence[Array], size: float) -> Array:
        moves = [before - track for track in tracks]  # the other way round than in the paper's axes
        measured = [np.ascontiguousarray(move[:, 2 : 2 + what.measured.shape[1]]) for move in moves]
        return np.stack([noise.whiten_residual(move, by).ravel() for move in measured]) / size

    times_s, always = run.time_s[rows * fit.STRIDE], np.array([math.nan])
    by_degree, percents = white(slips, math.degrees(SMALL_RAD)), 100.0 * SMALL_SHARE
    return [
        Signature("actuator slip", times_s, by_degree, "deg"),
        Signature("gust", times_s, _pulses(by_degree) / _push_per_s2(vehicle, run), "deg/s2"),
        Signature("actuator offset", always, white([offset], math.degrees(SMALL_RAD)), "deg"),
        Signature("gain error", always, white([gain], percents), "%"),
        Signature("speed off", always, white([speed], percents), "%"),
    ]


def _rows(seconds: float) -> int:
    return round(seconds * RATE_HZ / fit.STRIDE)


def _simulate_slip(
    vehicle: CandidateVehicle, what: Dataset, before: Array, duct_rad: Array, row: int
) -> Array:
    """The track from ``row`` on with the duct a little off; nothing differs earlier."""
    late = _track(
        vehicle, what, before[row], duct_rad[row * fit.STRIDE :] + SMALL_RAD, first_row=row
    )
    return np.vstack([before[:row], late])


def _track(
    vehicle: CandidateVehicle,
    what: Dataset,
    first: Array,
    duct_rad: Array,
    faster: float = 1.0,
    first_row: int = 0,
) -> Array:
    """States (rows, 5) in the paper's axes: u, v or w, rate, angle, z."""
    run, model, start = what.run, vehicle.model, first_row * fit.STRIDE
    rps = faster * run.thrust[start:] * propeller.rps(1.0, model)
    around = None if what.around is None else what.around[start:]
    return greybox.integrate(
        first,
        duct_rad,
        rps,
        fit.STRIDE,
        1.0 / RATE_HZ,
        run.plane == "yaw",
        greybox.constraint(model, run.plane),
        model,
        around,
    )


def departure_rad(run: Run) -> Array:
    """How far a test moved its surface from where the loop had held it, from the start of the test
    on."""
    return (run.command_rad - _held_deflection_rad(run, run.plane))[~run.preroll]


def _held_deflection_rad(run: Run, plane: Plane) -> float:
    """Where the loop held a surface before the test."""
    command = run.rudder_rad if plane == "yaw" else run.elevator_rad
    trim_rad = run.rudder_trim_rad if plane == "yaw" else run.elevator_trim_rad
    return float(np.mean(command[run.preroll])) if run.preroll.any() else trim_rad


def _scale_deflections(run: Run) -> Run:
    """The same run, its surfaces a little farther from where they were held."""

    def farther(command_rad: Array, plane: Plane) -> Array:
        return command_rad + SMALL_SHARE * (command_rad - _held_deflection_rad(run, plane))

    rudder, elevator = run.earlier_rad
    return replace(
        run,
        rudder_rad=farther(run.rudder_rad, "yaw"),
        elevator_rad=farther(run.elevator_rad, "pitch"),
        earlier_rad=(farther(rudder, "yaw"), farther(elevator, "pitch")),
    )


def _pulses(steps: Array) -> Array:
    late = round(GUST_S / EVERY_S)
    back = np.zeros_like(steps)
    back[:-late] = steps[late:]
    return steps - back


def _push_per_s2(vehicle: CandidateVehicle, run: Run) -> float:
    """Angular acceleration per unit of duct angle."""
    return linear_planes.small_signal(fit.linear_plane(vehicle, run.plane)).b1_per_s2
