"""Recursive estimator: knowledge between tests, state within a test, and the update of both.

Gauss-Newton on the innovations of the nonlinear plane, with the likelihood, prior and parameters of
`fit`. With e(z) the whitened errors (m,) about z0 and H = de/dz (m, p), a step adds the linearised
measurement::

    e(z0) + H (z - z0) ~ N(0, I)   <=>   H z = H z0 - e(z0) + v

to the square-root information (`square_root_information`, with y = H z0 - e). Within a test, the
errors are linearised about the estimate at its start. After the test they are linearised again
about the new estimate, until it converges. The noise levels are estimated again after the first,
second, fourth, eighth ... test of a plane.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sitl.vehicle import propeller
from sitl.vehicle.config import VehicleFileError
from sysid.estimation.map import steady_state
from sysid.estimation.map.datasets import STEP_S
from sysid.estimation.map.gauss_newton import Z_LIMIT
from sysid.estimation.map.problem import DIFFERENCE, SPEED_PARAMETERS, Prior
from sysid.estimation.recursive import prediction, square_root_information
from sysid.estimation.recursive.prediction import (
    START_STEPS,
    Candidate,
    CandidateState,
    TestSamples,
)
from sysid.estimation.recursive.square_root_information import Information
from sysid.models import greybox, noise, parameters
from sysid.models.noise import Filter, Noise
from sysid.models.parameters import PARAMETERS, CandidateVehicle
from sysid.planes import Plane

Array = NDArray[np.float64]

MAX_LINEARISATIONS = 4
"""Maximum number of linearisations of a finished test."""
CONVERGED_SD = 0.1
"""Change of the estimate, in its own standard deviations, below which it has converged."""
MAX_STEP_SD = 1.0
"""Largest change of a parameter between two linearisations, in prior standard deviations."""
HALVINGS = 6
"""Maximum number of halvings of a step that leads to an impossible vehicle."""
FILTER_STEPS = 600
"""Number of filter steps with gains of their own.

The gains have converged by then and are repeated.
"""


class FinishedTest(NamedTuple):
    """Finished test and the information that it contributed."""

    plane: Plane
    steps: TestSamples
    information: Information


class Knowledge(NamedTuple):
    """Knowledge between tests: prior, noise levels, and the tests of this dive."""

    prior: Prior
    noise: dict[Plane, Noise]
    """Noise levels of each plane."""
    tests: tuple[FinishedTest, ...]
    information: Information
    """Information about z from the prior and all tests."""
    z: Array
    """(p,), point of linearisation: the estimate, within the bounds of `fit`."""
    trimmed: frozenset[Plane] = frozenset()
    """Planes whose prior actuator bias is known."""


class CandidateSet(NamedTuple):
    """Vehicle at z, and vehicles perturbed by DIFFERENCE along each parameter of the plane."""

    z: Array
    active: list[int]
    """Indices of these parameters."""
    candidates: tuple[Candidate, ...]
    """Candidate at z, then one for each active parameter."""
    filter: Filter
    leak_share: float
    """`prediction.leak` of the plane at z."""


class CandidateTracking(NamedTuple):
    """Simulation of every candidate along the measured motion."""

    candidate_set: CandidateSet
    states: tuple[CandidateState, ...]
    """State of each candidate after the last step."""
    information: Information
    """Information from this test alone."""


class TestState(NamedTuple):
    """State within a test."""

    knowledge: Knowledge
    plane: Plane
    steps: TestSamples
    """Samples of the test received so far."""
    tracking: CandidateTracking | None
    """Simulated candidates; None until the test has lasted START_STEPS."""


def prior_knowledge(prior: Prior, levels: dict[Plane, Noise] | None = None) -> Knowledge:
    """Return the knowledge before the first test.

    Parameters
    ----------
    prior : Prior
        Prior of the parameters.
    levels : dict, optional
        Noise levels of each plane; by default those of `Noise`.

    Returns
    -------
    Knowledge
        Knowledge without tests.
    """
    information = square_root_information.from_normal(prior.mean, prior.covariance)
    return Knowledge(
        prior=prior,
        noise={Plane.YAW: Noise(), Plane.PITCH: Noise(), **(levels or {})},
        tests=(),
        information=information,
        z=prior.mean,
    )


def begin(knowledge: Knowledge, plane: Plane, held_rad: float) -> TestState:
    """Begin a test of a plane.

    Parameters
    ----------
    knowledge : Knowledge
        Knowledge before the test.
    plane : Plane
        Plane of the test.
    held_rad : float
        Mean command of straight flight before the test, rad.

    Returns
    -------
    TestState
        State without samples.
    """
    trimmed_knowledge = (
        knowledge if plane in knowledge.trimmed else _with_trim(knowledge, plane, held_rad)
    )
    return TestState(
        knowledge=trimmed_knowledge,
        plane=plane,
        steps=prediction.empty_samples(plane),
        tracking=None,
    )


def _with_trim(knowledge: Knowledge, plane: Plane, held_rad: float) -> Knowledge:
    """Add the actuator bias at which the prior vehicle is in trim.

    `steady_state.trim_biases` uses all runs.
    """
    prior = knowledge.prior
    nominal = parameters.candidate_vehicle(prior.config, prior.biases_rad, prior.mean)
    level_rad = steady_state.level_surface_rad(nominal, plane)
    return knowledge._replace(
        prior=prior._replace(biases_rad={**prior.biases_rad, plane: level_rad - held_rad}),
        trimmed=knowledge.trimmed | {plane},
    )


def update(state: TestState, steps: TestSamples) -> TestState:
    """Add one or several steps to a test; the division into calls does not change the result.

    Parameters
    ----------
    state : TestState
        State before the steps.
    steps : TestSamples
        New samples.

    Returns
    -------
    TestState
        State after the steps.
    """
    done = len(state.steps.thrust)
    samples = prediction.concatenate(state.steps, steps)
    tracking = state.tracking
    if tracking is not None:
        tracking = _absorb(tracking, samples, done)
    elif len(samples.thrust) > START_STEPS:
        tracking = _track(state.knowledge, state.plane, samples, state.knowledge.z)
    return state._replace(steps=samples, tracking=tracking)


def finish(state: TestState) -> Knowledge:
    """Finish a test and return the knowledge with it.

    Parameters
    ----------
    state : TestState
        State of the estimator at the end of the test.

    Returns
    -------
    Knowledge
        Knowledge with the test; a test shorter than START_STEPS contributes nothing.
    """
    knowledge = state.knowledge
    if state.tracking is None:
        return knowledge
    test_information, z = _iterate_test(knowledge, state.plane, state.steps, state.tracking)
    tests = (*knowledge.tests, FinishedTest(state.plane, state.steps, test_information))
    knowledge = knowledge._replace(
        tests=tests,
        information=square_root_information.combine(knowledge.information, test_information),
        z=z,
    )
    count = sum(test.plane == state.plane for test in tests)
    return with_new_noise(knowledge, state.plane) if count & (count - 1) == 0 else knowledge


def with_new_noise(knowledge: Knowledge, plane: Plane) -> Knowledge:
    """Estimate the noise levels of a plane from its tests, and weight all its tests with them."""
    prior, z, previous_levels = knowledge.prior, knowledge.z, knowledge.noise[plane]
    vehicle = parameters.candidate_vehicle(prior.config, prior.biases_rad, z)
    linear = steady_state.linear_plane(vehicle, plane)
    noise_filter = noise.build(linear, previous_levels, STEP_S, FILTER_STEPS)
    residuals = [
        _free_residuals(vehicle, test, noise_filter, prediction.leak(linear))
        for test in knowledge.tests
        if test.plane == plane
    ]
    levels = noise.estimate(linear, residuals, STEP_S, previous_levels)
    knowledge = knowledge._replace(noise={**knowledge.noise, plane: levels})
    tests = tuple(
        test._replace(information=_track(knowledge, plane, test.steps, z).information)
        if test.plane == plane
        else test
        for test in knowledge.tests
    )
    information = square_root_information.from_normal(prior.mean, prior.covariance)
    for test in tests:
        information = square_root_information.combine(information, test.information)
    return knowledge._replace(
        tests=tests,
        information=information,
        z=_limited_step(prior, z, square_root_information.mean(information)),
    )


def linearise(knowledge: Knowledge, plane: Plane, z: Array, thrust: float) -> CandidateSet:
    """Return the candidates of a test that begins at a thrust (fraction of full)."""
    prior, active = knowledge.prior, parameters.parameters_of_planes([plane])
    vehicle = parameters.candidate_vehicle(prior.config, prior.biases_rad, z)
    nominal = _candidate(vehicle, plane, steady_state.cruise_speed_mps(vehicle, thrust))
    perturbed = tuple(_perturb(knowledge, plane, z, thrust, nominal, i) for i in active)
    linear = steady_state.linear_plane(vehicle, plane)
    noise_filter = noise.build(linear, knowledge.noise[plane], STEP_S, FILTER_STEPS)
    return CandidateSet(
        z=z,
        active=active,
        candidates=(nominal, *perturbed),
        filter=noise_filter,
        leak_share=prediction.leak(linear),
    )


def _perturb(
    knowledge: Knowledge, plane: Plane, z: Array, thrust: float, nominal: Candidate, i: int
) -> Candidate:
    """Return the candidate perturbed along parameter ``i``.

    Unchanged quantities are copied from ``nominal``.
    """
    prior, perturbed_z = knowledge.prior, z.copy()
    perturbed_z[i] += DIFFERENCE
    if PARAMETERS[i].part == "tailcone":
        return nominal._replace(
            actuator=parameters.actuators(prior.config, prior.biases_rad, perturbed_z)[plane]
        )
    vehicle = parameters.candidate_vehicle(prior.config, prior.biases_rad, perturbed_z)
    changes_speed = PARAMETERS[i].name in SPEED_PARAMETERS
    return _candidate(
        vehicle,
        plane,
        steady_state.cruise_speed_mps(vehicle, thrust) if changes_speed else nominal.speed_mps,
    )


def _candidate(vehicle: CandidateVehicle, plane: Plane, speed_mps: float) -> Candidate:
    """Reduce a vehicle to a plane."""
    model, actuator = vehicle.model, vehicle.actuators[plane]
    return Candidate(
        model=model,
        actuator=actuator,
        inverse=greybox.constraint(model, plane),
        full_rps=propeller.rps(1.0, model),
        speed_mps=speed_mps,
    )


def _track(knowledge: Knowledge, plane: Plane, steps: TestSamples, z: Array) -> CandidateTracking:
    """Simulate a test from its start, linearised about z."""
    candidate_set = linearise(knowledge, plane, z, float(steps.thrust[0]))
    states = tuple(
        prediction.start(candidate, steps, candidate_set.filter)
        for candidate in candidate_set.candidates
    )
    return _absorb(
        CandidateTracking(candidate_set, states, square_root_information.empty(z.size)), steps, 0
    )


def _absorb(tracking: CandidateTracking, steps: TestSamples, done: int) -> CandidateTracking:
    """Advance all candidates through the new steps and add the information of their differences."""
    candidate_set = tracking.candidate_set
    ends = [
        prediction.advance(
            candidate, state, steps, done, candidate_set.filter, candidate_set.leak_share
        )
        for candidate, state in zip(candidate_set.candidates, tracking.states, strict=True)
    ]
    errors = np.column_stack([white.ravel() for _, white in ends])
    rows = np.zeros((errors.shape[0], candidate_set.z.size))
    rows[:, candidate_set.active] = (errors[:, 1:] - errors[:, :1]) / DIFFERENCE
    information = square_root_information.absorb(
        tracking.information, rows, rows @ candidate_set.z - errors[:, 0]
    )
    return CandidateTracking(candidate_set, tuple(state for state, _ in ends), information)


def _iterate_test(
    knowledge: Knowledge, plane: Plane, steps: TestSamples, tracking: CandidateTracking
) -> tuple[Information, Array]:
    """Linearise a finished test until the estimate converges.

    Return its information and the estimate.
    """
    z = tracking.candidate_set.z
    for _ in range(MAX_LINEARISATIONS):
        information = square_root_information.combine(knowledge.information, tracking.information)
        z = _limited_step(
            knowledge.prior, tracking.candidate_set.z, square_root_information.mean(information)
        )
        if np.linalg.norm(
            information.root @ (z - tracking.candidate_set.z)
        ) < CONVERGED_SD * math.sqrt(z.size):
            break
        tracking = _track(knowledge, plane, steps, z)
    return tracking.information, z


def _limited_step(prior: Prior, z: Array, target: Array) -> Array:
    """Return the point of the next linearisation, a limited step from ``z`` towards ``target``.

    Far from the optimum the linearisation gives the direction better than the distance. Not every z
    is a possible vehicle: its mass matrix may lose positive definiteness. Then the step is halved.
    """
    step = np.clip(target - z, -MAX_STEP_SD, MAX_STEP_SD)
    for _ in range(HALVINGS):
        candidate_z = np.clip(z + step, -Z_LIMIT, Z_LIMIT)
        try:
            parameters.candidate_vehicle(prior.config, prior.biases_rad, candidate_z)
        except VehicleFileError:
            step = 0.5 * step
        else:
            return candidate_z
    return z


def _free_residuals(
    vehicle: CandidateVehicle, test: FinishedTest, noise_filter: Filter, leak_share: float
) -> Array:
    """Return the residuals of a free simulation of a test, (k, outputs)."""
    candidate = _candidate(
        vehicle, test.plane, steady_state.cruise_speed_mps(vehicle, float(test.steps.thrust[0]))
    )
    white = prediction.advance(
        candidate,
        prediction.start(candidate, test.steps, noise_filter),
        test.steps,
        0,
        noise_filter,
        leak_share,
    )[1]
    return prediction.free_error(white, noise_filter)
