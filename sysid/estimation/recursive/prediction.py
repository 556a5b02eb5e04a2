"""One candidate vehicle predicting a test one step ahead: its normalised errors are what a
parameter is judged by.

The plane flies by its own nonlinear physics, and the noise filter carries what parts it from the
measured motion: the errors of a stable plane are the whitened ones of its free simulation, as in
`fit`. An unstable plane would soon be elsewhere; it takes over what the filter knows, twice as fast
as it runs away (a filter error method that leaks: Jategaonkar 2015, ch. 5). How fast makes no
difference to the errors of a linear plane."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sitl.vehicle.jit import entry_point
from sitl.vehicle.model import VehicleModel
from sysid.data.segments import RATE_HZ, Plane, Run
from sysid.estimation.map import fit
from sysid.estimation.map.fit import STRIDE
from sysid.models import greybox
from sysid.models.greybox import SUBMERGED_Z_M, Actuator, integrate
from sysid.models.linear_planes import LinearPlane
from sysid.models.noise import Filter

Array = NDArray[np.float64]

STEP_S = STRIDE / RATE_HZ
TICK_S = 1.0 / RATE_HZ
SEA_STATES = 4
"""Of the filter behind those of the plane: slow moment, wave (two), gyro bias."""
MIN_GROWTH_PER_S = 1e-3
"""A plane whose heading and depth merely stay where they are put has poles at zero."""
START_STEPS = 10
"""A test begins with the motion of its first second."""


class TestSamples(NamedTuple):
    """Consecutive tenths of a second of a test, k of them; MAVLink's axes."""

    measured: Array
    """(k, outputs): rate, angle, and depth in pitch, each the mean of the 50 Hz samples around the
    step's end."""
    command_rad: Array
    """(k, STRIDE): the tested surface over the ticks that led there; what led to the first step of
    all is not used."""
    thrust: Array
    """(k,): over those ticks, fraction of full."""


def empty_samples(plane: Plane) -> TestSamples:
    """Of a test that has not begun."""
    return TestSamples(
        np.zeros((0, 2 if plane == "yaw" else 3)), np.zeros((0, STRIDE)), np.zeros(0)
    )


def steps(run: Run, first: int = 0) -> TestSamples:
    """A run's steps from the ``first`` on. The last one stands half a step before the run's end."""
    what = fit.dataset(run)
    measured, command_rad = what.measured[:-1], what.run.command_rad
    ticks = command_rad[: STRIDE * (len(measured) - 1)].reshape(-1, STRIDE)
    command = np.concatenate([np.full((1, STRIDE), command_rad[0]), ticks])
    return TestSamples(
        measured[first:],
        command[first:],
        what.run.thrust[: STRIDE * len(measured) : STRIDE][first:],
    )


def concatenate(first: TestSamples, second: TestSamples) -> TestSamples:
    """One after the other."""
    return TestSamples(*(np.concatenate(parts) for parts in zip(first, second, strict=True)))


class Candidate(NamedTuple):
    """A vehicle, confined to the plane of a test."""

    model: VehicleModel
    actuator: Actuator
    inverse: Array
    """Of the plane's mass matrix (`greybox.constraint`)."""
    full_rps: float
    speed_mps: float
    """At which the test begins."""


class CandidateState(NamedTuple):
    """Where a candidate stands after its last step."""

    plane: Array
    """(u, v|w, rate, angle, z) in the paper's axes; z about SUBMERGED_Z_M."""
    rest: Array
    """The states of the noise filter, MAVLink's axes: what is measured beside the plane."""


def start(candidate: Candidate, steps: TestSamples) -> CandidateState:
    """From the mean motion over the first START_STEPS, as `greybox.measured_start` takes it from a
    run."""
    few = steps.measured[: START_STEPS // 2 + 1]
    plane = np.array(
        [candidate.speed_mps, 0.0, -float(np.mean(few[:, 0])), -float(few[0, 1]), SUBMERGED_Z_M]
    )
    if steps.measured.shape[1] > 2:
        depth_m = steps.measured[: START_STEPS + 1, 2]
        rate_mps = float(np.polyfit(STEP_S * np.arange(depth_m.size), depth_m, 1)[0])
        theta = float(few[0, 1])
        plane[1] = -(rate_mps + candidate.speed_mps * math.sin(theta)) / math.cos(theta)
    return CandidateState(plane, np.zeros(steps.measured.shape[1] + 1 + SEA_STATES))


def leak(plane: LinearPlane) -> float:
    """Share of the filter's motion that an unstable plane takes over at each step; 0 for a stable
    one."""
    growth_per_s = float(np.max(np.linalg.eigvals(plane.A).real))
    return 1.0 - math.exp(-2.0 * growth_per_s * STEP_S) if growth_per_s > MIN_GROWTH_PER_S else 0.0


def advance(
    candidate: Candidate,
    at: CandidateState,
    steps: TestSamples,
    done: int,
    by: Filter,
    leaking: float,
) -> tuple[CandidateState, Array]:
    """Through all ``steps`` but the first ``done``: where it stands then, and its white errors (k,
    outputs)."""
    command = np.append(
        steps.command_rad[1:].ravel(), 0.0
    )  # the last angle precedes whatever is commanded next
    duct = greybox.duct_angles(command, candidate.actuator, TICK_S)
    measured = (
        steps.measured - np.array([0.0, 0.0, steps.measured[0, -1]])[: steps.measured.shape[1]]
    )
    plane, rest = at.plane.copy(), at.rest.copy()
    white = _advance(
        plane,
        rest,
        done,
        duct,
        steps.thrust * candidate.full_rps,
        measured,
        by.transition,
        by.gains,
        by.whiteners,
        leaking,
        candidate.inverse,
        candidate.model,
    )
    return CandidateState(plane, rest), white


@entry_point
def _advance(
    x: Array,
    rest: Array,
    done: int,
    duct: Array,
    rps: Array,
    measured: Array,
    transition: Array,
    gains: Array,
    whiteners: Array,
    leaking: float,
    inverse: Array,
    model: VehicleModel,
) -> Array:
    """Predict, compare, correct; ``x`` and ``rest`` are moved in place. The filter's axes are minus
    the paper's."""
    total, outputs = measured.shape
    states, is_yaw = outputs + 1, outputs == 2
    white, e = np.empty((total - done, outputs)), np.empty(outputs)
    for k in range(done, total):
        if k > 0:
            a = STRIDE * (k - 1)
            x[:] = integrate(
                x, duct[a : a + STRIDE + 1], rps[k : k + 1], STRIDE, TICK_S, is_yaw, inverse, model
            )[1]
            rest[:] = transition @ rest
        gain, whitener = gains[min(k, len(gains) - 1)], whiteners[min(k, len(gains) - 1)]
        e[0] = measured[k, 0] + x[2] - rest[1] - rest[-1]
        e[1] = measured[k, 1] + x[3] - rest[2]
        if not is_yaw:
            e[2] = measured[k, 2] + (x[4] - SUBMERGED_Z_M) - rest[3]
        white[k - done] = whitener @ e
        for i in range(rest.size):
            for j in range(outputs):
                rest[i] += gain[i, j] * e[j]
        for i in range(states):
            x[1 + i] -= leaking * rest[i]
            rest[i] -= leaking * rest[i]
    return white


def free_error(white: Array, by: Filter) -> Array:
    """What a free simulation would leave, (k, outputs): the residual that the filter whitens to
    ``white``."""
    return _unwhiten(white, by.transition, by.output, by.gains, by.whiteners)


@entry_point
def _unwhiten(
    white: Array, transition: Array, output: Array, gains: Array, whiteners: Array
) -> Array:
    """The inverse of `noise.whiten`."""
    left, x = np.empty_like(white), np.zeros(transition.shape[0])
    for k in range(len(white)):
        last = min(k, len(gains) - 1)
        e = np.linalg.solve(whiteners[last], white[k])
        left[k] = e + output @ x
        x = transition @ (x + gains[last] @ e)
    return left
