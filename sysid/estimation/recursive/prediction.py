"""One-step predictions of a test by one candidate vehicle.

Their whitened errors update the estimate.

The nonlinear plane model is simulated, and the noise filter carries the difference to the measured
motion. For a stable plane the errors are the whitened residuals of a free simulation, as in `fit`.
The simulation of an unstable plane would diverge; it takes over a part of the filter's state at
every step, at twice the rate of its divergence (filter error method with a leak: Jategaonkar 2015,
ch. 5). For a linear plane this part does not change the errors.

Symbols: x plane states in the paper's axes, d filter states (difference from the measured motion,
disturbance, gyro bias) in MAVLink's axes, Phi transition, C output matrix, K_k gain and W_k
whitener of `sysid.models.noise.Filter`, l leak. For each step k::

    x <- f(x, delta),    d <- Phi d
    e = y - y(x) - C d,    white_k = W_k e
    d <- d + K_k e;    x <- x - l d,    d <- (1 - l) d   (plane states only)
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mavlink_io.jit import entry_point
from sitl.vehicle.model import VehicleModel
from sysid.data.runs import RATE_HZ, Run
from sysid.estimation.map import datasets
from sysid.estimation.map.datasets import STEP_S, STRIDE
from sysid.models import greybox
from sysid.models.greybox import SUBMERGED_Z_M, Actuator, integrate
from sysid.models.linear_planes import LinearPlane
from sysid.models.noise import Filter
from sysid.planes import PLANES, Plane

Array = NDArray[np.float64]

TICK_S = 1.0 / RATE_HZ
"""Step of the 50 Hz grid, s."""
MIN_GROWTH_PER_S = 1e-3
"""Smallest real part of a pole, 1/s, of an unstable plane. Heading and depth have poles at zero."""
START_STEPS = 10
"""Number of steps whose mean motion starts the simulation: one second."""


class TestSamples(NamedTuple):
    """Consecutive steps of a test, k of them, in MAVLink's axes."""

    measured: Array
    """(k, outputs): rate (rad/s), angle (rad) and, in pitch, depth (m).

    Each value is the mean of the 50 Hz samples around the end of the step.
    """
    command_rad: Array
    """(k, STRIDE): command of the tested surface during the step, rad.

    The first row of a test is not used.
    """
    thrust: Array
    """(k,): thrust during the step, fraction of full."""


def empty_samples(plane: Plane) -> TestSamples:
    """Return the samples of a test that has not begun."""
    return TestSamples(np.zeros((0, PLANES[plane].n_outputs)), np.zeros((0, STRIDE)), np.zeros(0))


def steps(run: Run, first: int = 0) -> TestSamples:
    """Return the steps of a run from index ``first`` on.

    Parameters
    ----------
    run : Run
        Run of a test at RATE_HZ.
    first : int
        Index of the first step.

    Returns
    -------
    TestSamples
        Measurements, commands and thrust of each step; the last ends half a step before the run.
    """
    data = datasets.dataset(run)
    measured, command_rad = data.measured[:-1], data.run.command_rad
    ticks = command_rad[: STRIDE * (len(measured) - 1)].reshape(-1, STRIDE)
    commands = np.concatenate([np.full((1, STRIDE), command_rad[0]), ticks])
    return TestSamples(
        measured[first:],
        commands[first:],
        data.run.thrust[: STRIDE * len(measured) : STRIDE][first:],
    )


def concatenate(first: TestSamples, second: TestSamples) -> TestSamples:
    """Join two parts of a test."""
    return TestSamples(*(np.concatenate(parts) for parts in zip(first, second, strict=True)))


class Candidate(NamedTuple):
    """Vehicle reduced to the plane of a test."""

    model: VehicleModel
    actuator: Actuator
    inverse: Array
    """(3, 3), inverse mass matrix of the plane (`greybox.constraint`)."""
    full_rps: float
    """Shaft speed at full thrust, 1/s."""
    speed_mps: float
    """Speed at the start of the test, m/s."""


class CandidateState(NamedTuple):
    """State of a candidate after its last step."""

    plane: Array
    """(u, v or w, rate, angle, z) in the paper's axes, SI units; z relative to SUBMERGED_Z_M."""
    filter_state: Array
    """States of the noise filter in MAVLink's axes: measured motion minus the plane's motion."""


def start(candidate: Candidate, steps: TestSamples, noise_filter: Filter) -> CandidateState:
    """Return the initial state.

    Mean motion over the first START_STEPS, as in `greybox.initial_motion`.
    """
    # Measured rate, angle and depth in FRD have the opposite sign of the states in FLU. Heave (FRD)
    # from depth' = w cos(theta) - U sin(theta), with depth' from a straight line over START_STEPS.
    first_rows = steps.measured[: START_STEPS // 2 + 1]
    plane = np.array(
        [
            candidate.speed_mps,
            0.0,
            -float(np.mean(first_rows[:, 0])),
            -float(first_rows[0, 1]),
            SUBMERGED_Z_M,
        ]
    )
    if steps.measured.shape[1] > 2:
        depth_m = steps.measured[: START_STEPS + 1, 2]
        rate_mps = float(np.polyfit(STEP_S * np.arange(depth_m.size), depth_m, 1)[0])
        theta = float(first_rows[0, 1])
        plane[1] = -(rate_mps + candidate.speed_mps * math.sin(theta)) / math.cos(theta)
    return CandidateState(plane, np.zeros(noise_filter.transitions.shape[1]))


def leak(plane: LinearPlane) -> float:
    """Return the share of the filter's plane states that moves to the plane per step.

    It is 0 for a stable plane.
    """
    growth_per_s = float(np.max(np.linalg.eigvals(plane.A).real))
    return 1.0 - math.exp(-2.0 * growth_per_s * STEP_S) if growth_per_s > MIN_GROWTH_PER_S else 0.0


def advance(
    candidate: Candidate,
    state: CandidateState,
    steps: TestSamples,
    done: int,
    noise_filter: Filter,
    leak_share: float,
) -> tuple[CandidateState, Array]:
    """Simulate all ``steps`` after the first ``done``.

    Return the state and the whitened errors (k, outputs).
    """
    command = np.append(
        steps.command_rad[1:].ravel(), 0.0
    )  # the last command has no effect within the steps
    duct = greybox.duct_angles(command, candidate.actuator, TICK_S)
    measured = (
        steps.measured - np.array([0.0, 0.0, steps.measured[0, -1]])[: steps.measured.shape[1]]
    )
    plane, filter_state = state.plane.copy(), state.filter_state.copy()
    white = _advance(
        plane,
        filter_state,
        done,
        duct,
        steps.thrust * candidate.full_rps,
        measured,
        noise_filter.transitions[0],
        noise_filter.output,
        noise_filter.gains,
        noise_filter.whiteners,
        leak_share,
        candidate.inverse,
        candidate.model,
    )
    return CandidateState(plane, filter_state), white


@entry_point
def _advance(
    x: Array,
    filter_state: Array,
    done: int,
    duct: Array,
    rps: Array,
    measured: Array,
    transition: Array,
    output: Array,
    gains: Array,
    whiteners: Array,
    leak_share: float,
    inverse: Array,
    model: VehicleModel,
) -> Array:
    """Predict, compare, correct for each step; ``x`` and ``filter_state`` are changed in place.

    The filter's axes (MAVLink) have the opposite sign of the paper's.
    """
    # Equations: module docstring. Filter states: those of the plane (cross speed, rate, angle and,
    # in pitch, depth), then those of the noise (``sysid.models.noise``).
    total, outputs = measured.shape
    states, is_yaw = outputs + 1, outputs == 2
    white, innovation = np.empty((total - done, outputs)), np.empty(outputs)
    for k in range(done, total):
        if k > 0:
            first_tick = STRIDE * (k - 1)
            x[:] = integrate(
                x,
                duct[first_tick : first_tick + STRIDE + 1],
                rps[k : k + 1],
                STRIDE,
                TICK_S,
                is_yaw,
                inverse,
                model,
            )[1]
            filter_state[:] = transition @ filter_state
        gain, whitener = gains[min(k, len(gains) - 1)], whiteners[min(k, len(gains) - 1)]
        for i in range(outputs):
            innovation[i] = measured[k, i] + (x[4] - SUBMERGED_Z_M if i == 2 else x[2 + i])
            for j in range(filter_state.size):
                innovation[i] -= output[i, j] * filter_state[j]
        white[k - done] = whitener @ innovation
        for i in range(filter_state.size):
            for j in range(outputs):
                filter_state[i] += gain[i, j] * innovation[j]
        for i in range(states):
            x[1 + i] -= leak_share * filter_state[i]
            filter_state[i] -= leak_share * filter_state[i]
    return white


def free_error(white: Array, noise_filter: Filter) -> Array:
    """Return the residual (k, outputs) of a free simulation, from its whitened errors."""
    return _unwhiten(
        white,
        noise_filter.transitions[0],
        noise_filter.output,
        noise_filter.gains,
        noise_filter.whiteners,
    )


@entry_point
def _unwhiten(
    white: Array, transition: Array, output: Array, gains: Array, whiteners: Array
) -> Array:
    """Inverse of `noise.whiten_residual`.

    E_k = W_k^-1 white_k, r_k = e_k + C x, x <- Phi (x + K_k e_k).
    """
    residual, x = np.empty_like(white), np.zeros(transition.shape[0])
    for k in range(len(white)):
        gain_index = min(k, len(gains) - 1)
        e = np.linalg.solve(whiteners[gain_index], white[k])
        residual[k] = e + output @ x
        x = transition @ (x + gains[gain_index] @ e)
    return residual
