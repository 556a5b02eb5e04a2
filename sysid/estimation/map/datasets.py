"""Data of the joint fit: runs sampled for the fit, and their residuals for a candidate vehicle."""

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.data.runs import RATE_HZ, Run
from sysid.estimation.map.coupling_inputs import cross_plane_inputs
from sysid.estimation.map.steady_state import cruise_speed_mps, linear_plane
from sysid.models import greybox
from sysid.models.greybox import InitialMotion
from sysid.models.parameters import CandidateVehicle
from sysid.planes import PLANES, Plane

Array = NDArray[np.float64]

STRIDE = 5
"""Samples of the 50 Hz grid per step of the fit: 10 Hz, five times the bandwidth of the vehicle."""
STEP_S = STRIDE / RATE_HZ
"""Step of the fit."""

DUCT_SETTLING_S, MAX_START_S = 3.0, -1.0
"""Start of the fitted part of a run: s after the first sample, but not later than MAX_START_S.

The part before it serves only to compute the duct angle. The loops move the duct before a test, and
it follows its command with a delay. With the duct angle assumed equal to the command at the first
sample, lag and effectiveness were wrong by one standard deviation in every campaign. MAX_START_S is
relative to the start of the test.
"""
UNSTABLE_GROWTH = 0.5
"""Exponent by which a small error of an unstable plane may grow from the start to the test.

The simulation follows the recorded commands without feedback. Over 12 s of steady flight before a
test, disturbances made the simulation of a vehicle with a pole of 0.4 1/s turn at 8 deg/s, with the
true parameters: the whitened residuals are linear in the disturbance only while it remains small,
and the estimate was off by 1 dB and 9 deg at crossover.
"""


class Dataset(NamedTuple):
    """One run as the fit uses it."""

    run: Run
    start: InitialMotion
    """Measured motion at the first sample."""
    measured: Array
    """(samples, outputs) at 10 Hz.

    Rate (rad/s), angle (rad) and, in pitch, depth (m). Each value is the mean of the 50 Hz samples
    around it.
    """
    cross_plane_inputs: Array | None = None
    """(50 Hz samples, N_COUPLING), motion of the other plane as `greybox.integrate` takes it.

    None if it is neglected.
    """


def max_lead_s(vehicle: CandidateVehicle, plane: Plane) -> float:
    """Return the longest time before a test from which its motion can be simulated.

    Parameters
    ----------
    vehicle : CandidateVehicle
        Vehicle.
    plane : Plane
        Plane of the test.

    Returns
    -------
    float
        `UNSTABLE_GROWTH` over the real part of the rightmost pole in level flight, s; infinite for
        a stable plane.
    """
    pole = float(np.max(np.linalg.eigvals(linear_plane(vehicle, plane).A).real))
    return UNSTABLE_GROWTH / pole if pole > 0.0 else math.inf


def dataset(run: Run, lead_s: float = math.inf) -> Dataset:
    """Prepare a run for the fit.

    Parameters
    ----------
    run : Run
        Run on the 50 Hz grid.
    lead_s : float
        Longest part before the test that is used, s; at least the part after MAX_START_S is.

    Returns
    -------
    Dataset
        The run from the time on at which the duct angle is known, without cross-plane inputs.
    """
    settled_s = max(run.time_s[0], min(run.time_s[0] + DUCT_SETTLING_S, MAX_START_S))
    run = run.since(max(settled_s, min(-lead_s, MAX_START_S)))
    columns = (run.rate_radps, run.angle_rad, run.depth_m)[: PLANES[run.plane].n_outputs]
    return Dataset(
        run, greybox.initial_motion(run), np.column_stack([_decimate(column) for column in columns])
    )


def with_coupling_inputs(vehicle: CandidateVehicle, data: Dataset) -> Dataset:
    """Add the motion of the other plane, computed from the measured motion.

    Parameters
    ----------
    vehicle : CandidateVehicle
        Vehicle whose linear plane gives the sway or heave that is not measured.
    data : Dataset
        Run.

    Returns
    -------
    Dataset
        The same run with ``cross_plane_inputs``.
    """
    run, speed_mps = data.run, cruise_speed_mps(vehicle, float(data.run.thrust[0]))
    if not run.both:
        return data._replace(cross_plane_inputs=greybox.known_inputs(run, speed_mps))
    other = PLANES[run.plane].other
    return data._replace(
        cross_plane_inputs=cross_plane_inputs(
            run, linear_plane(vehicle, other), vehicle.actuators[other], speed_mps
        )
    )


def max_leads_s(runs: Sequence[Run], vehicle: CandidateVehicle) -> dict[Plane, float]:
    """Return `max_lead_s` of each plane that has runs.

    Parameters
    ----------
    runs : sequence of Run
        Runs of one or both planes.
    vehicle : CandidateVehicle
        Vehicle.

    Returns
    -------
    dict
        Time before a test by plane, s.
    """
    tested = {run.plane for run in runs}
    return {plane: max_lead_s(vehicle, plane) for plane in Plane if plane in tested}


def datasets_of(
    runs: Sequence[Run], vehicle: CandidateVehicle, leads_s: Mapping[Plane, float]
) -> dict[Plane, tuple[Dataset, ...]]:
    """Prepare the runs, plane by plane.

    Parameters
    ----------
    runs : sequence of Run
        Runs of one or both planes.
    vehicle : CandidateVehicle
        Vehicle that computes the motion of the other plane.
    leads_s : mapping
        Longest part before the tests that is used, by plane, s.

    Returns
    -------
    dict
        Data sets with cross-plane inputs by plane.
    """
    return {
        plane: tuple(
            with_coupling_inputs(vehicle, dataset(run, lead_s))
            for run in runs
            if run.plane == plane
        )
        for plane, lead_s in leads_s.items()
    }


def _decimate(values: Array) -> Array:
    """Return the centred means of STRIDE samples at every STRIDE-th sample.

    The end samples are repeated outwards.
    """
    padded = np.pad(values, STRIDE // 2, mode="edge")
    return np.convolve(padded, np.full(STRIDE, 1.0 / STRIDE), mode="valid")[::STRIDE]


def residuals(vehicle: CandidateVehicle, datasets: Sequence[Dataset]) -> list[Array]:
    """Return measured minus simulated outputs of each run.

    Parameters
    ----------
    vehicle : CandidateVehicle
        Vehicle to simulate.
    datasets : sequence of Dataset
        Runs.

    Returns
    -------
    list of ndarray, (samples, outputs)
        Residuals of rate (rad/s), angle (rad) and, in pitch, depth (m).
    """
    speeds_mps = cruise_speeds_mps(vehicle, datasets)
    return [_residual(vehicle, data, speeds_mps[float(data.run.thrust[0])]) for data in datasets]


def cruise_speeds_mps(vehicle: CandidateVehicle, datasets: Iterable[Dataset]) -> dict[float, float]:
    """Return the steady straight speed for each thrust of the runs.

    Parameters
    ----------
    vehicle : CandidateVehicle
        Vehicle.
    datasets : iterable of Dataset
        Runs.

    Returns
    -------
    dict
        Speed, m/s, by thrust (fraction of full shaft speed).
    """
    thrusts = {float(data.run.thrust[0]) for data in datasets}
    return {thrust: cruise_speed_mps(vehicle, thrust) for thrust in thrusts}


def _residual(vehicle: CandidateVehicle, data: Dataset, speed_mps: float) -> Array:
    """Return the residual of one run."""
    actuator = vehicle.actuators[data.run.plane]
    motion = greybox.simulate(
        vehicle.model, actuator, data.run, data.start, STRIDE, speed_mps, data.cross_plane_inputs
    )
    columns = (motion.rate_radps, motion.angle_rad, motion.depth_m)
    outputs = np.column_stack(columns[: PLANES[data.run.plane].n_outputs])
    return data.measured - with_sensor_lags(outputs, vehicle.sensor_lags_s, STRIDE)


def with_sensor_lags(outputs: Array, lags_s: tuple[float, float], stride: int) -> Array:
    """Return outputs whose angle and depth lag behind the rate, to first order in the lags.

    Parameters
    ----------
    outputs : ndarray, (samples, outputs) or (samples, outputs, columns)
        Rate, angle and, in pitch, depth, or their derivatives by parameters.
    lags_s : tuple of float
        Lags of angle and depth, s.
    stride : int
        Samples of the 50 Hz grid per row.

    Returns
    -------
    ndarray
        angle - lag rate, depth - lag depth', in place of angle and depth.
    """
    late = outputs.copy()
    late[:, 1] -= lags_s[0] * outputs[:, 0]
    if outputs.shape[1] > 2:
        late[:, 2] -= lags_s[1] * depth_rate(outputs, stride)
    return late


def depth_rate(outputs: Array, stride: int) -> Array:
    """Return the derivative of the depth, the third output, by time."""
    # Central differences inside and one-sided ones at the ends, as `numpy.gradient`.
    depth, slope = outputs[:, 2], np.empty_like(outputs[:, 2])
    slope[1:-1] = (depth[2:] - depth[:-2]) / 2.0
    slope[0], slope[-1] = depth[1] - depth[0], depth[-1] - depth[-2]
    return slope * (RATE_HZ / stride)
