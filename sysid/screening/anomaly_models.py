"""Signatures of anomalies: the change of a run's whitened residual for an anomaly of unit size.

A signature is the run simulated with the anomaly minus the run simulated without it, passed through
the noise filter. A slip is a step of the surface that is not in the command. A gust is an angular
acceleration over GUST_S; it is composed of a slip and its return GUST_S later, scaled to the same
acceleration. Both may begin at any time, so that there is one signature for every second.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sitl.vehicle import propeller
from sysid.data.runs import RATE_HZ, Run
from sysid.estimation.map import steady_state
from sysid.estimation.map.datasets import STRIDE, Dataset
from sysid.models import greybox, linear_planes, noise
from sysid.models.noise import Filter
from sysid.models.parameters import CandidateVehicle
from sysid.planes import PLANES, Plane

Array = NDArray[np.float64]
Kind = Literal["actuator slip", "actuator offset", "gain error", "gust", "speed off"]

SEARCH_INTERVAL_S = 1.0
"""Distance between the times at which a slip or a gust is sought, s."""
MARGIN_S = 2.0
"""Margin at both ends of a run without search, s.

A late anomaly has no effect, and an early one cannot be distinguished from the initial state.
"""
GUST_S = 5.0
"""Duration of a gust, s."""
SMALL_RAD = math.radians(0.1)
"""Duct angle of the simulated anomalies, rad: small, so that the signature is a derivative."""
SMALL_SHARE = 0.01
"""Relative gain or speed error of the simulated anomalies: small for the same reason."""


class Signature(NamedTuple):
    """Signatures of one kind of anomaly in one run."""

    kind: Kind
    times_s: Array
    """(k,), s since the start of the test at which the anomaly acts first.

    NaN if it acts throughout.
    """
    white: Array
    """(k, samples x outputs), whitened residual per unit of the anomaly."""
    unit: Literal["deg", "%", "deg/s2"]
    """Unit of the size of the anomaly."""


def signatures(
    vehicle: CandidateVehicle, dataset: Dataset, noise_filter: Filter
) -> list[Signature]:
    """Compute the signatures of all kinds of anomaly for one run.

    Parameters
    ----------
    vehicle : CandidateVehicle
        Fitted vehicle.
    dataset : Dataset
        Run.
    noise_filter : Filter
        Noise filter of the run.

    Returns
    -------
    list of Signature
        Sizes are duct angles (deg), angular accelerations (deg/s^2) or relative errors (%).
    """
    run, actuator = dataset.run, vehicle.actuators[dataset.run.plane]
    speed_mps = steady_state.cruise_speed_mps(vehicle, float(run.thrust[0]))
    duct = greybox.duct_along(run, run.plane, actuator)
    scaled_duct = greybox.duct_along(_scale_deflections(run), run.plane, actuator)
    first, faster_start = (
        greybox.first_state(run, dataset.start, k * speed_mps) for k in (1.0, 1.0 + SMALL_SHARE)
    )
    nominal_track = _track(vehicle, dataset, first, duct)
    rows = np.arange(
        _rows(MARGIN_S), len(nominal_track) - _rows(MARGIN_S), _rows(SEARCH_INTERVAL_S)
    )
    slip_tracks = [_simulate_slip(vehicle, dataset, nominal_track, duct, int(row)) for row in rows]
    offset_track, gain_track = (
        _track(vehicle, dataset, first, angles) for angles in (duct + SMALL_RAD, scaled_duct)
    )
    speed_track = _track(vehicle, dataset, faster_start, duct, 1.0 + SMALL_SHARE)

    def white(tracks: Sequence[Array], size: float) -> Array:
        """Return the whitened change of the outputs per unit of the anomaly."""
        # MAVLink's axes have the opposite sign of the paper's: nominal minus changed.
        changes = nominal_track[..., None] - np.stack(tracks, axis=-1)
        outputs = changes[:, 2 : 2 + dataset.measured.shape[1]]
        by_track = np.moveaxis(noise.whiten_columns(outputs, noise_filter), -1, 0)
        return np.ascontiguousarray(by_track).reshape(len(tracks), -1) / size

    slip_times_s, no_time = run.time_s[rows * STRIDE], np.array([math.nan])
    per_degree, percents = white(slip_tracks, math.degrees(SMALL_RAD)), 100.0 * SMALL_SHARE
    return [
        Signature(kind="actuator slip", times_s=slip_times_s, white=per_degree, unit="deg"),
        Signature(
            kind="gust",
            times_s=slip_times_s,
            white=_pulses(per_degree) / _push_per_s2(vehicle, run),
            unit="deg/s2",
        ),
        Signature(
            kind="actuator offset",
            times_s=no_time,
            white=white([offset_track], math.degrees(SMALL_RAD)),
            unit="deg",
        ),
        Signature(
            kind="gain error", times_s=no_time, white=white([gain_track], percents), unit="%"
        ),
        Signature(
            kind="speed off", times_s=no_time, white=white([speed_track], percents), unit="%"
        ),
    ]


def sizes_of_test(vehicle: CandidateVehicle, run: Run) -> dict[Kind, float]:
    """Return the size of each kind of anomaly that is as large as the test itself.

    Parameters
    ----------
    vehicle : CandidateVehicle
        Fitted vehicle.
    run : Run
        Test.

    Returns
    -------
    dict
        The largest deflection of the tested surface from its mean before the test (deg), the
        angular acceleration by it (deg/s^2), or 100 %.
    """
    largest_deg = math.degrees(size_rad(run))
    return {
        "actuator slip": largest_deg,
        "actuator offset": largest_deg,
        "gain error": 100.0,
        "gust": largest_deg * abs(_push_per_s2(vehicle, run)),
        "speed off": 100.0,
    }


def _rows(seconds: float) -> int:
    """Return the number of fit samples in a time span."""
    return round(seconds * RATE_HZ / STRIDE)


def _simulate_slip(
    vehicle: CandidateVehicle, dataset: Dataset, nominal_track: Array, duct_rad: Array, row: int
) -> Array:
    """Track with a small duct angle added from ``row`` on.

    It equals the nominal track before ``row``.
    """
    changed_track = _track(
        vehicle,
        dataset,
        nominal_track[row],
        duct_rad[row * STRIDE :] + SMALL_RAD,
        first_row=row,
    )
    return np.vstack([nominal_track[:row], changed_track])


def _track(
    vehicle: CandidateVehicle,
    dataset: Dataset,
    first: Array,
    duct_rad: Array,
    speed_ratio: float = 1.0,
    first_row: int = 0,
) -> Array:
    """Simulate the states (rows, 5) in the paper's axes.

    U, v or w, rate, angle, z (m, m/s, rad, rad/s).

    ``speed_ratio`` scales the shaft speed and a measured speed; ``first`` is the state at row
    ``first_row``.
    """
    run, model, first_sample = dataset.run, vehicle.model, first_row * STRIDE
    rps = speed_ratio * run.thrust[first_sample:] * propeller.rps(1.0, model)
    cross_plane_inputs = (
        None
        if dataset.cross_plane_inputs is None
        else dataset.cross_plane_inputs[first_sample:] * _speed_scale(speed_ratio)
    )
    return greybox.integrate(
        first,
        duct_rad,
        rps,
        STRIDE,
        1.0 / RATE_HZ,
        PLANES[run.plane].is_yaw,
        greybox.constraint(model, run.plane),
        model,
        cross_plane_inputs,
    )


def _speed_scale(speed_ratio: float) -> Array:
    """Return factors of the known inputs that scale the measured speed alone."""
    factors = np.ones(greybox.N_COUPLING)
    factors[greybox.SPEED] = speed_ratio
    return factors


def size_rad(run: Run) -> float:
    """Return the largest deflection of the tested surface from its mean before the test, rad."""
    return float(np.max(np.abs(departure_rad(run))))


def departure_rad(run: Run) -> Array:
    """Return the deflection (rad) of the tested surface in the test from its mean before it."""
    return (run.command_rad - _held_deflection_rad(run, run.plane))[run.under_test]


def _held_deflection_rad(run: Run, plane: Plane) -> float:
    """Return the mean command before the test, rad; without a pre-roll the trim command."""
    if not run.preroll.any():
        return run.in_plane(plane).trim_rad
    return float(np.mean(run.in_plane(plane).command_rad[run.preroll]))


def _scale_deflections(run: Run) -> Run:
    """Copy of a run whose deflections from the pre-test mean are scaled by 1 + SMALL_SHARE."""

    def scaled(command_rad: Array, plane: Plane) -> Array:
        return command_rad + SMALL_SHARE * (command_rad - _held_deflection_rad(run, plane))

    earlier_rudder_rad, earlier_elevator_rad = run.earlier_rad
    return replace(
        run,
        rudder_rad=scaled(run.rudder_rad, Plane.YAW),
        elevator_rad=scaled(run.elevator_rad, Plane.PITCH),
        earlier_rad=(
            scaled(earlier_rudder_rad, Plane.YAW),
            scaled(earlier_elevator_rad, Plane.PITCH),
        ),
    )


def _pulses(steps: Array) -> Array:
    """Step signatures minus the same steps GUST_S later."""
    rows_later = round(GUST_S / SEARCH_INTERVAL_S)
    return_steps = np.zeros_like(steps)
    return_steps[:-rows_later] = steps[rows_later:]
    return steps - return_steps


def _push_per_s2(vehicle: CandidateVehicle, run: Run) -> float:
    """Return the angular acceleration per unit of duct angle, 1/s^2."""
    return linear_planes.small_signal(steady_state.linear_plane(vehicle, run.plane)).b1_per_s2
