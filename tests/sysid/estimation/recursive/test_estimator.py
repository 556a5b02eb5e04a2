"""The recursive estimate on tests in a disturbed sea: what it is fed with, what it says, and beside
the batch."""

import numpy as np
import pytest

from sitl.vehicle import config
from sysid.data.segments import Plane, Run
from sysid.estimation.map import fit
from sysid.estimation.map.fit import Prior
from sysid.estimation.recursive import (
    estimator,
    prediction,
    report,
    square_root_information,
)
from sysid.estimation.recursive.estimator import Knowledge
from sysid.estimation.recursive.prediction import STEP_S, TestSamples
from sysid.models import noise, parameters
from sysid.models.parameters import NAMES
from tests.sysid import sea

DOUBLETS: tuple[tuple[Plane, float, float], ...] = (
    ("yaw", 4.0, 5.0),
    ("yaw", -6.0, 5.0),
    ("pitch", 4.0, 4.0),
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
        bench, {"yaw": 0.0, "pitch": 0.0}, np.zeros(len(NAMES)), parameters.prior_covariance()
    )


def taught(known: Knowledge, runs: list[Run]) -> Knowledge:
    for run in runs:
        state = estimator.begin(known, run.plane, float(np.mean(run.command_rad[run.preroll])))
        known = estimator.finish(estimator.update(state, prediction.steps(run)))
    return known


def part(steps: TestSamples, first: int, last: int) -> TestSamples:
    return TestSamples(*(column[first:last] for column in steps))


def test_it_ends_where_the_batch_estimate_ends(flown: list[Run], prior: Prior) -> None:
    known = taught(estimator.prior_knowledge(prior), flown)
    model = parameters.candidate_vehicle(prior.config, prior.biases_rad, prior.mean).model
    together = prior._replace(biases_rad=fit.trim_biases(prior.config, model, flown))
    batch = fit.fit(flown, together)
    for plane in ("yaw", "pitch"):
        online = report.read(known.prior, known.information, plane, 0.8)
        beside = report.read(
            together, square_root_information.from_normal(batch.z, batch.covariance), plane, 0.8
        )
        for name, number in online.numbers.items():
            other = beside.numbers[name]
            assert abs(number.value - other.value) < 1.5 * other.sd, name
            assert number.sd == pytest.approx(other.sd, rel=0.35), name


def test_each_test_makes_it_surer_of_its_plane(flown: list[Run], prior: Prior) -> None:
    at_first = estimator.prior_knowledge(prior)
    after = taught(at_first, flown[:2])
    for name, number in report.read(after.prior, after.information, "yaw", 0.8).numbers.items():
        assert number.sd < number.before, name
    assert report.read(after.prior, after.information, "yaw", 0.8).numbers["b1_per_s2"].sd < 0.05


@pytest.mark.parametrize("size", [1, 7, 1000])
def test_it_does_not_matter_how_many_steps_come_at_once(
    flown: list[Run], prior: Prior, size: int
) -> None:
    run, known = flown[0], estimator.prior_knowledge(prior)
    steps = part(prediction.steps(run), 0, 90)
    whole = estimator.update(estimator.begin(known, "yaw", -0.1), steps)
    state = estimator.begin(known, "yaw", -0.1)
    for first in range(0, 90, size):
        state = estimator.update(state, part(steps, first, first + size))
    told, expected = estimator.information_with_test(state), estimator.information_with_test(whole)
    np.testing.assert_allclose(
        square_root_information.mean(told),
        square_root_information.mean(expected),
        rtol=1e-5,
        atol=1e-6,
    )
    np.testing.assert_allclose(
        square_root_information.covariance(told),
        square_root_information.covariance(expected),
        rtol=1e-5,
        atol=1e-8,
    )


def test_the_errors_of_a_stable_plane_are_those_of_its_whitened_simulation(
    flown: list[Run], prior: Prior
) -> None:
    """The batch estimate whitens by `noise`, with code of its own."""
    run = flown[0]
    known = estimator.begin(
        estimator.prior_knowledge(prior), "yaw", float(np.mean(run.command_rad[run.preroll]))
    ).knowledge
    steps = prediction.steps(run)
    about = estimator.linearise(known, "yaw", known.z, float(steps.thrust[0]))
    assert about.leak_share == 0.0
    first = about.candidates[0]
    white = prediction.advance(first, prediction.start(first, steps), steps, 0, about.filter, 0.0)[
        1
    ]
    vehicle = parameters.candidate_vehicle(known.prior.config, known.prior.biases_rad, known.z)
    by = noise.build(fit.linear_plane(vehicle, "yaw"), noise.Noise(), STEP_S, len(white) + 1)
    expected = noise.whiten_residual(fit.residuals(vehicle, [fit.dataset(run)])[0], by)
    np.testing.assert_allclose(
        white, expected[: len(white)], atol=0.1
    )  # the two begin a sample's noise apart
    assert np.sqrt(np.mean((white - expected[: len(white)]) ** 2)) < 0.03
    back = prediction.free_error(white, about.filter)
    np.testing.assert_allclose(
        noise.whiten_residual(back, by._replace(gains=about.filter.gains[: len(white)])),
        white,
        atol=1e-6,
    )


def test_an_unstable_plane_stays_where_it_was_measured() -> None:
    """Of its own accord she would be turned round within the minute."""
    remus = config.load("remus100")
    prior = Prior(
        remus, {"yaw": 0.0, "pitch": 0.0}, np.zeros(len(NAMES)), parameters.prior_covariance()
    )
    hold = sea.Hold(0.49, 0.76, 0.04, 0.54, 0.67, 0.2, 0.01)
    runs = [
        sea.fly(remus, "yaw", sea.doublet(s * 0.6, 20.0), seed=seed, hold=hold)
        for seed, s in enumerate((1.0, -1.0))
    ]
    assert (
        prediction.leak(
            fit.linear_plane(
                parameters.candidate_vehicle(remus, prior.biases_rad, prior.mean), "yaw"
            )
        )
        > 0.0
    )
    known = taught(estimator.prior_knowledge(prior), runs)
    found = report.read(known.prior, known.information, "yaw", 0.8).numbers
    truth = report.numbers(
        parameters.candidate_vehicle(remus, prior.biases_rad, prior.mean), "yaw", 0.8
    )
    for name, true in zip(("b1_per_s2", "p_slow_per_s", "delay_s"), truth[[1, 3, 4]], strict=True):
        assert abs(found[name].value - true) < 4.0 * found[name].sd, name
    assert found["p_slow_per_s"].sd < 0.4 * found["p_slow_per_s"].before


def test_a_test_too_short_to_begin_with_tells_nothing(flown: list[Run], prior: Prior) -> None:
    known = estimator.prior_knowledge(prior)
    state = estimator.update(
        estimator.begin(known, "yaw", 0.0), part(prediction.steps(flown[0]), 0, 5)
    )
    np.testing.assert_array_equal(estimator.finish(state).information.root, known.information.root)
