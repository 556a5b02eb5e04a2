"""The recursive estimator: knowledge between tests, a state within one, and the step from a state
to the next.

Gauss-Newton on the innovations of the nonlinear plane, the same likelihood, prior and parameters as
`fit`. Within a test the errors are linearised where it began; when it is over they are linearised
anew about what it told, until that stands still. The noise levels are renewed after the first,
second, fourth, eighth ... test of a plane."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sitl.vehicle import propeller
from sitl.vehicle.config import VehicleFileError
from sysid.data.segments import Plane
from sysid.estimation.map import fit
from sysid.estimation.map.fit import DIFFERENCE, Z_LIMIT, Prior
from sysid.estimation.map.problem import SPEED_PARAMETERS
from sysid.estimation.recursive import prediction, square_root_information
from sysid.estimation.recursive.prediction import (
    START_STEPS,
    STEP_S,
    Candidate,
    CandidateState,
    TestSamples,
)
from sysid.estimation.recursive.square_root_information import Information
from sysid.models import greybox, noise, parameters
from sysid.models.noise import Filter, Noise
from sysid.models.parameters import PARAMETERS, CandidateVehicle

Array = NDArray[np.float64]

MAX_LINEARISATIONS = 4
"""Linearisations of a finished test, at most."""
CONVERGED_SD = 0.1
"""Move of the estimate, in its own standard deviations, below which it stands still."""
MAX_STEP_SD = 1.0
"""Prior standard deviations that a parameter may move between two linearisations."""
HALVINGS = 6
FILTER_STEPS = 600
"""A filter's gains have settled long before; later steps repeat the last ones."""


class FinishedTest(NamedTuple):
    """A finished test and what it told."""

    plane: Plane
    steps: TestSamples
    told: Information


class Knowledge(NamedTuple):
    """Between tests: the prior, and what the tests of this dive told."""

    prior: Prior
    noise: dict[Plane, Noise]
    tests: tuple[FinishedTest, ...]
    whole: Information
    """Of z, from the prior and all tests."""
    z: Array
    """Where errors are linearised: the estimate, within the bounds of `fit`."""
    trimmed: frozenset[Plane] = frozenset()
    """Planes whose actuator's prior bias is known."""


class CandidateSet(NamedTuple):
    """The vehicle at z, and moved by DIFFERENCE along each parameter that its plane depends on."""

    z: Array
    active: list[int]
    """Indices of these parameters."""
    candidates: tuple[Candidate, ...]
    """The one at z, then one a parameter."""
    filter: Filter
    leaking: float
    """As `prediction.leak` says of the plane at z."""


class CandidateTracking(NamedTuple):
    """Every candidate beside the measured motion."""

    about: CandidateSet
    motions: tuple[CandidateState, ...]
    """After the last step."""
    told: Information
    """By this test alone."""


class TestState(NamedTuple):
    """Within a test."""

    knowledge: Knowledge
    plane: Plane
    steps: TestSamples
    """What has been received of the test."""
    tracking: CandidateTracking | None
    """None until the test has lasted START_STEPS."""


def prior_knowledge(prior: Prior, levels: dict[Plane, Noise] | None = None) -> Knowledge:
    """What is known before the first test."""
    whole = square_root_information.from_normal(prior.mean, prior.covariance)
    return Knowledge(
        prior, {"yaw": Noise(), "pitch": Noise(), **(levels or {})}, (), whole, prior.mean
    )


def begin(knowledge: Knowledge, plane: Plane, held_rad: float) -> TestState:
    """A test of a plane begins; ``held_rad`` is the mean command that steered her straight before
    it."""
    known = knowledge if plane in knowledge.trimmed else _with_trim(knowledge, plane, held_rad)
    return TestState(known, plane, prediction.empty_samples(plane), None)


def _with_trim(knowledge: Knowledge, plane: Plane, held_rad: float) -> Knowledge:
    """With the bias at which the prior vehicle would have flown straight too (`fit.trim_biases`
    takes all runs')."""
    prior = knowledge.prior
    nominal = parameters.candidate_vehicle(prior.config, prior.biases_rad, prior.mean)
    level = 0.0 if plane == "yaw" else fit.level_elevator_rad(nominal.config, nominal.model)
    return knowledge._replace(
        prior=prior._replace(biases_rad={**prior.biases_rad, plane: level - held_rad}),
        trimmed=knowledge.trimmed | {plane},
    )


def update(state: TestState, steps: TestSamples) -> TestState:
    """One step further, or several: the result is the same."""
    done, seen, tracking = (
        len(state.steps.thrust),
        prediction.concatenate(state.steps, steps),
        state.tracking,
    )
    if tracking is not None:
        tracking = _absorb(tracking, seen, done)
    elif len(seen.thrust) > START_STEPS:
        tracking = _track(state.knowledge, state.plane, seen, state.knowledge.z)
    return state._replace(steps=seen, tracking=tracking)


def information_with_test(state: TestState) -> Information:
    """What is known during a test."""
    known = state.knowledge.whole
    return square_root_information.combine(known, state.tracking.told) if state.tracking else known


def relinearise(state: TestState) -> TestState:
    """The same test, linearised about what it has told so far."""
    if state.tracking is None:
        return state
    z = _limited_step(
        state.knowledge.prior,
        state.tracking.about.z,
        square_root_information.mean(information_with_test(state)),
    )
    return state._replace(tracking=_track(state.knowledge, state.plane, state.steps, z))


def finish(state: TestState) -> Knowledge:
    """The test is over: what is known with it. One of less than START_STEPS told nothing."""
    known = state.knowledge
    if state.tracking is None:
        return known
    told, z = _iterate_test(known, state.plane, state.steps, state.tracking)
    tests = (*known.tests, FinishedTest(state.plane, state.steps, told))
    known = known._replace(
        tests=tests, whole=square_root_information.combine(known.whole, told), z=z
    )
    count = sum(test.plane == state.plane for test in tests)
    return with_new_noise(known, state.plane) if count & (count - 1) == 0 else known


def with_new_noise(knowledge: Knowledge, plane: Plane) -> Knowledge:
    """Noise levels from what the plane's tests leave unexplained, and the tests weighed anew by
    them."""
    prior, z, before = knowledge.prior, knowledge.z, knowledge.noise[plane]
    vehicle = parameters.candidate_vehicle(prior.config, prior.biases_rad, z)
    linear = fit.linear_plane(vehicle, plane)
    by = noise.build(linear, before, STEP_S, FILTER_STEPS)
    left = [
        _free_residuals(vehicle, test, by, prediction.leak(linear))
        for test in knowledge.tests
        if test.plane == plane
    ]
    levels = noise.estimate(linear, left, STEP_S, before)
    knowledge = knowledge._replace(noise={**knowledge.noise, plane: levels})
    tests = tuple(
        test._replace(told=_track(knowledge, plane, test.steps, z).told)
        if test.plane == plane
        else test
        for test in knowledge.tests
    )
    found = square_root_information.from_normal(prior.mean, prior.covariance)
    for test in tests:
        found = square_root_information.combine(found, test.told)
    return knowledge._replace(
        tests=tests, whole=found, z=_limited_step(prior, z, square_root_information.mean(found))
    )


def linearise(knowledge: Knowledge, plane: Plane, z: Array, thrust: float) -> CandidateSet:
    """The candidates of a test that begins at a thrust (fraction of full)."""
    prior, active = knowledge.prior, parameters.parameters_of_planes([plane])
    vehicle = parameters.candidate_vehicle(prior.config, prior.biases_rad, z)
    first = _candidate(vehicle, plane, fit.cruise_speed_mps(vehicle, thrust))
    moved = tuple(_perturb(knowledge, plane, z, thrust, first, i) for i in active)
    linear = fit.linear_plane(vehicle, plane)
    by = noise.build(linear, knowledge.noise[plane], STEP_S, FILTER_STEPS)
    return CandidateSet(z, active, (first, *moved), by, prediction.leak(linear))


def _perturb(
    knowledge: Knowledge, plane: Plane, z: Array, thrust: float, first: Candidate, i: int
) -> Candidate:
    """The candidate moved along parameter ``i``; what that leaves alone is taken from ``first``."""
    prior, there = knowledge.prior, z.copy()
    there[i] += DIFFERENCE
    if PARAMETERS[i].part == "tailcone":
        return first._replace(
            actuator=parameters.actuators(prior.config, prior.biases_rad, there)[plane]
        )
    vehicle = parameters.candidate_vehicle(prior.config, prior.biases_rad, there)
    faster = PARAMETERS[i].name in SPEED_PARAMETERS
    return _candidate(
        vehicle, plane, fit.cruise_speed_mps(vehicle, thrust) if faster else first.speed_mps
    )


def _candidate(vehicle: CandidateVehicle, plane: Plane, speed_mps: float) -> Candidate:
    model, actuator = vehicle.model, vehicle.actuators[plane]
    return Candidate(
        model, actuator, greybox.constraint(model, plane), propeller.rps(1.0, model), speed_mps
    )


def _track(knowledge: Knowledge, plane: Plane, steps: TestSamples, z: Array) -> CandidateTracking:
    """A test from its start, linearised about z."""
    about = linearise(knowledge, plane, z, float(steps.thrust[0]))
    motions = tuple(prediction.start(candidate, steps) for candidate in about.candidates)
    return _absorb(
        CandidateTracking(about, motions, square_root_information.empty(z.size)), steps, 0
    )


def _absorb(tracking: CandidateTracking, steps: TestSamples, done: int) -> CandidateTracking:
    """All candidates through the steps after the first ``done``; what their differences tell."""
    about = tracking.about
    ends = [
        prediction.advance(candidate, at, steps, done, about.filter, about.leaking)
        for candidate, at in zip(about.candidates, tracking.motions, strict=True)
    ]
    errors = np.column_stack([white.ravel() for _, white in ends])
    rows = np.zeros((errors.shape[0], about.z.size))
    rows[:, about.active] = (errors[:, 1:] - errors[:, :1]) / DIFFERENCE
    told = square_root_information.absorb(tracking.told, rows, rows @ about.z - errors[:, 0])
    return CandidateTracking(about, tuple(at for at, _ in ends), told)


def _iterate_test(
    known: Knowledge, plane: Plane, steps: TestSamples, tracking: CandidateTracking
) -> tuple[Information, Array]:
    """What a test told, linearised until the estimate stands still; and where that is."""
    z = tracking.about.z
    for _ in range(MAX_LINEARISATIONS):
        found = square_root_information.combine(known.whole, tracking.told)
        z = _limited_step(known.prior, tracking.about.z, square_root_information.mean(found))
        if np.linalg.norm(found.root @ (z - tracking.about.z)) < CONVERGED_SD * math.sqrt(z.size):
            break
        tracking = _track(known, plane, steps, z)
    return tracking.told, z


def _limited_step(prior: Prior, z: Array, wanted: Array) -> Array:
    """A cautious move: far off, the linearisation tells the direction better than the distance.

    Not all of z are vehicles: a mass matrix may lose its positive sign. Then half of the way must
    do."""
    move = np.clip(wanted - z, -MAX_STEP_SD, MAX_STEP_SD)
    for _ in range(HALVINGS):
        there = np.clip(z + move, -Z_LIMIT, Z_LIMIT)
        try:
            parameters.candidate_vehicle(prior.config, prior.biases_rad, there)
        except VehicleFileError:
            move = 0.5 * move
        else:
            return there
    return z


def _free_residuals(
    vehicle: CandidateVehicle, test: FinishedTest, by: Filter, leaking: float
) -> Array:
    """What a free simulation of a vehicle would leave of a test, (k, outputs)."""
    candidate = _candidate(
        vehicle, test.plane, fit.cruise_speed_mps(vehicle, float(test.steps.thrust[0]))
    )
    white = prediction.advance(
        candidate, prediction.start(candidate, test.steps), test.steps, 0, by, leaking
    )[1]
    return prediction.free_error(white, by)
