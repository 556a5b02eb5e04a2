"""Recursive estimate on tests with disturbances.

Its updates, its report, and the batch estimate.
"""

from dataclasses import replace

import numpy as np
import pytest
from msgspec import structs

from sitl.vehicle import config
from sysid.data.runs import Run
from sysid.estimation.map import datasets, fit, steady_state
from sysid.estimation.map.datasets import STEP_S
from sysid.estimation.map.problem import Prior
from sysid.estimation.recursive import (
    estimator,
    intervals,
    prediction,
    report,
)
from sysid.estimation.recursive.estimator import Knowledge
from sysid.estimation.recursive.intervals import Estimate
from sysid.estimation.recursive.prediction import TestSamples
from sysid.models import noise, parameters
from sysid.models.parameters import NAMES
from sysid.planes import PLANES, Plane
from tests.sysid import sea

DOUBLETS: tuple[tuple[Plane, float, float], ...] = (
    (Plane.YAW, 4.0, 5.0),
    (Plane.YAW, -6.0, 5.0),
    (Plane.PITCH, 4.0, 4.0),
)


@pytest.fixture(scope="module")
def flown(field: config.VehicleConfig) -> list[Run]:
    return [
        sea.fly(
            field,
            plane,
            sea.doublet(degrees, half_s),
            name=f"test/{number}",
            seed=number,
            trim_rad=(0.1, 0.0),
        )
        for number, (plane, degrees, half_s) in enumerate(DOUBLETS)
    ]


@pytest.fixture(scope="module")
def prior(bench: config.VehicleConfig) -> Prior:
    return Prior(
        bench,
        dict.fromkeys(PLANES, 0.0),
        np.zeros(len(NAMES)),
        parameters.prior_covariance(),
    )


def learn(known: Knowledge, runs: list[Run]) -> Knowledge:
    for run in runs:
        state = estimator.begin(known, run.plane, float(np.mean(run.command_rad[run.preroll])))
        known = estimator.finish(estimator.update(state, prediction.steps(run)))
    return known


def part(steps: TestSamples, first: int, last: int) -> TestSamples:
    return TestSamples(*(column[first:last] for column in steps))


@pytest.mark.slow
def test_finish_all_tests_matches_batch_estimate(flown: list[Run], prior: Prior) -> None:
    knowledge = learn(estimator.prior_knowledge(prior), flown)
    model = parameters.candidate_vehicle(prior.config, prior.biases_rad, prior.mean).model
    batch_prior = prior._replace(biases_rad=steady_state.trim_biases(prior.config, model, flown))
    batch = fit.fit(flown, batch_prior)
    for plane in PLANES:
        recursive_report = report.read(knowledge.prior, intervals.estimate(knowledge), plane, 0.8)
        batch_estimate = Estimate(batch.z, batch.covariance)
        batch_report = report.read(batch_prior, batch_estimate, plane, 0.8)
        for name, number in recursive_report.numbers.items():
            batch_number = batch_report.numbers[name]
            assert abs(number.value - batch_number.value) < 1.5 * batch_number.sd, name
            assert number.sd == pytest.approx(batch_number.sd, rel=0.35), name


def test_finish_reduces_standard_deviations(flown: list[Run], prior: Prior) -> None:
    before = estimator.prior_knowledge(prior)
    after = learn(before, flown[:2])
    numbers = report.read(after.prior, intervals.estimate(after), Plane.YAW, 0.8).numbers
    for name, number in numbers.items():
        assert number.sd < number.prior_sd, name
    assert numbers["b1_per_s2"].sd < 0.05


@pytest.mark.parametrize("size", [1, 7, 1000])
def test_update_division_into_steps_does_not_matter(
    flown: list[Run], prior: Prior, size: int
) -> None:
    run, knowledge = flown[0], estimator.prior_knowledge(prior)
    steps = part(prediction.steps(run), 0, 90)
    at_once = estimator.update(estimator.begin(knowledge, Plane.YAW, -0.1), steps)
    state = estimator.begin(knowledge, Plane.YAW, -0.1)
    for first in range(0, 90, size):
        state = estimator.update(state, part(steps, first, first + size))
    estimate = intervals.estimate(knowledge, state)
    expected = intervals.estimate(knowledge, at_once)
    np.testing.assert_allclose(estimate.z, expected.z, rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(estimate.covariance, expected.covariance, rtol=1e-5, atol=1e-8)


def test_advance_stable_plane_matches_whitened_simulation(flown: list[Run], prior: Prior) -> None:
    """Reference: the batch estimate's whitening by `noise`, a separate implementation."""
    run = flown[0]
    knowledge = estimator.begin(
        estimator.prior_knowledge(prior), Plane.YAW, float(np.mean(run.command_rad[run.preroll]))
    ).knowledge
    steps = prediction.steps(run)
    candidate_set = estimator.linearise(knowledge, Plane.YAW, knowledge.z, float(steps.thrust[0]))
    assert candidate_set.leak_share == 0.0
    nominal = candidate_set.candidates[0]
    white = prediction.advance(
        nominal,
        prediction.start(nominal, steps, candidate_set.filter),
        steps,
        0,
        candidate_set.filter,
        0.0,
    )[1]
    vehicle = parameters.candidate_vehicle(
        knowledge.prior.config, knowledge.prior.biases_rad, knowledge.z
    )
    noise_filter = noise.build(
        steady_state.linear_plane(vehicle, Plane.YAW), noise.Noise(), STEP_S, len(white) + 1
    )
    (residual,) = datasets.residuals(vehicle, [datasets.dataset(run)])
    expected = noise.whiten_residual(residual, noise_filter)
    np.testing.assert_allclose(
        white, expected[: len(white)], atol=0.1
    )  # the two begin a sample's noise apart
    assert np.sqrt(np.mean((white - expected[: len(white)]) ** 2)) < 0.03
    residual = prediction.free_error(white, candidate_set.filter)
    np.testing.assert_allclose(
        noise.whiten_residual(
            residual, noise_filter._replace(gains=candidate_set.filter.gains[: len(white)])
        ),
        white,
        atol=1e-6,
    )


def test_finish_unstable_plane_is_recovered() -> None:
    """A free simulation of this vehicle would diverge within a minute."""
    remus = config.load("remus100")
    coefficients = structs.replace(remus.linear, N_v_kgmps=1.5 * remus.linear.N_v_kgmps)
    remus = structs.replace(remus, linear=coefficients)
    prior = Prior(
        remus,
        dict.fromkeys(PLANES, 0.0),
        np.zeros(len(NAMES)),
        parameters.prior_covariance(),
    )
    hold = sea.Hold(0.49, 0.76, 0.04, 0.54, 0.67, 0.2, 0.01)
    runs = [
        sea.fly(remus, Plane.YAW, sea.doublet(sign * 0.6, 20.0), seed=seed, hold=hold)
        for seed, sign in enumerate((1.0, -1.0))
    ]
    assert (
        prediction.leak(
            steady_state.linear_plane(
                parameters.candidate_vehicle(remus, prior.biases_rad, prior.mean), Plane.YAW
            )
        )
        > 0.0
    )
    knowledge = learn(estimator.prior_knowledge(prior), runs)
    numbers = report.read(knowledge.prior, intervals.estimate(knowledge), Plane.YAW, 0.8).numbers
    truth = report.numbers(
        parameters.candidate_vehicle(remus, prior.biases_rad, prior.mean), Plane.YAW, 0.8
    )
    for name, true in zip(("b1_per_s2", "p_slow_per_s", "delay_s"), truth[[1, 3, 4]], strict=True):
        assert abs(numbers[name].value - true) < 4.0 * numbers[name].sd, name
    assert numbers["p_slow_per_s"].sd < 0.4 * numbers["p_slow_per_s"].prior_sd


def test_finish_short_test_changes_nothing(flown: list[Run], prior: Prior) -> None:
    knowledge = estimator.prior_knowledge(prior)
    state = estimator.update(
        estimator.begin(knowledge, Plane.YAW, 0.0), part(prediction.steps(flown[0]), 0, 5)
    )
    np.testing.assert_array_equal(
        estimator.finish(state).information.root, knowledge.information.root
    )


def test_waves_on_measured_depth_are_estimated(flown: list[Run], prior: Prior) -> None:
    """The filter has more states once the tests show the pressure of waves."""
    still = flown[2]
    waves_m = 0.03 * np.sin(2.0 * np.pi * 0.16 * still.time_s)
    known = learn(
        estimator.prior_knowledge(prior),
        [replace(still, name=f"test/{n}", depth_m=still.depth_m + waves_m) for n in range(3)],
    )
    assert known.noise[Plane.PITCH].wave_depth_m == pytest.approx(0.03 / np.sqrt(2.0), rel=0.5)
    assert np.all(np.isfinite(known.z))
