"""Score tests on linear Gaussian data with known parameters, with and without an anomaly."""

import math
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.stats import norm

from sysid.screening.anomaly_models import Signature
from sysid.screening.score_test import (
    Scores,
    evaluate,
    exceedance,
    inflation,
    scores,
    statistics_over_time,
)

Array = NDArray[np.float64]

SAMPLES, PARAMETERS, RUNS = 120, 4, 5
RNG = np.random.default_rng(11)


class World(NamedTuple):
    """Runs that share parameters: e = J z + a size + white noise."""

    slopes: list[Array]
    signatures: list[Signature]
    """Signatures, equal in every run."""


def first_order(steps: int, time_constant: float) -> Array:
    return 1.0 - np.exp(-np.arange(steps) / time_constant)


@pytest.fixture(scope="module")
def world() -> World:
    slips = np.zeros((25, SAMPLES))
    for k in range(len(slips)):
        slips[k, 4 * k :] = first_order(SAMPLES - 4 * k, 15.0)
    wave = np.sin(np.arange(SAMPLES) / 9.0)
    always = np.array([math.nan])
    marks = [
        Signature("actuator slip", np.arange(25.0), slips, "deg"),
        Signature("actuator offset", always, np.ones((1, SAMPLES)), "deg"),
        Signature("gain error", always, wave[None], "%"),
    ]
    slopes = [
        np.column_stack(
            [
                wave,
                np.ones(SAMPLES),
                np.cos(np.arange(SAMPLES) / 30.0),
                RNG.standard_normal(SAMPLES),
            ]
        )
        for _ in range(RUNS)
    ]
    return World(slopes, marks)


def fit_and_test(
    world: World, rng: np.random.Generator, anomaly: Array | float = 0.0, run: int = 2
) -> Scores:
    """Fit all runs of one sample jointly (prior: unit normal) and test one of them."""
    z = rng.standard_normal(PARAMETERS)
    measured = [J @ z + rng.standard_normal(SAMPLES) for J in world.slopes]
    measured[run] = measured[run] + anomaly
    information = np.eye(PARAMETERS) + sum(J.T @ J for J in world.slopes)
    covariance = np.asarray(np.linalg.inv(information), np.float64)
    best = covariance @ sum(J.T @ y for J, y in zip(world.slopes, measured, strict=True))
    return scores(
        world.signatures, measured[run] - world.slopes[run] @ best, world.slopes[run], covariance
    )


@pytest.fixture(scope="module")
def clean(world: World) -> list[Scores]:
    rng = np.random.default_rng(5)
    return [fit_and_test(world, rng) for _ in range(2500)]


def test_scores_clean_runs_false_alarm_rate(clean: list[Scores]) -> None:
    """The bound over all times and kinds is close to the true probability."""
    share = float(np.mean([run_scores.p_value <= 0.01 for run_scores in clean]))
    assert 0.004 < share < 0.01 + 3.0 * math.sqrt(0.01 / len(clean))


def test_scores_statistic_is_standard_normal(clean: list[Scores]) -> None:
    gain = [
        next(anomaly.statistic for anomaly in run_scores.anomalies if anomaly.kind == "gain error")
        for run_scores in clean
    ]
    assert np.mean(gain) == pytest.approx(0.0, abs=4.0 / math.sqrt(len(clean)))
    assert np.std(gain) == pytest.approx(1.0, abs=4.0 / math.sqrt(2 * len(clean)))


@pytest.mark.parametrize("kind", ["actuator slip", "actuator offset", "gain error"])
def test_scores_recover_kind_size_and_time(world: World, kind: str) -> None:
    """The simulated anomaly is usually the most likely one.

    Its size is within its standard deviation.
    """
    signature = next(s for s in world.signatures if s.kind == kind)
    anomaly = 2.0 * signature.white[len(signature.white) // 2]
    rng, size_errors_sd, time_errors_s, named_count = np.random.default_rng(7), [], [], 0
    for _ in range(200):
        run_scores = fit_and_test(world, rng, anomaly)
        assert run_scores.p_value < 1e-4
        named_count += run_scores.anomalies[0].kind == kind
        estimated = next(a for a in run_scores.anomalies if a.kind == kind)
        time_errors_s.append(
            0.0
            if estimated.at_s is None
            else abs(estimated.at_s - signature.times_s[len(signature.white) // 2])
        )
        size_errors_sd.append((estimated.size - 2.0) / estimated.sd)
    assert named_count >= 160  # an offset and a slip at the start are similar
    assert np.mean(time_errors_s) < 1.5
    # The time with the largest statistic is chosen, so that the size has a small positive bias.
    assert abs(np.mean(size_errors_sd)) < 0.5
    assert np.std(size_errors_sd) == pytest.approx(1.0, abs=0.2)


def test_scores_match_leave_one_run_out_estimate(world: World) -> None:
    """Reference: generalised least squares of an anomaly in one run, parameters from the others."""
    rng = np.random.default_rng(8)
    state = rng.bit_generator.state
    run_scores = fit_and_test(world, rng, 0.3 * world.signatures[1].white[0])
    rng.bit_generator.state = state
    z = rng.standard_normal(PARAMETERS)
    measured = [J @ z + rng.standard_normal(SAMPLES) for J in world.slopes]
    measured[2] += 0.3
    others = [k for k in range(RUNS) if k != 2]
    other_runs_covariance = np.linalg.inv(
        np.eye(PARAMETERS) + sum(world.slopes[k].T @ world.slopes[k] for k in others)
    )
    other_runs_z = other_runs_covariance @ sum(world.slopes[k].T @ measured[k] for k in others)
    J, a = world.slopes[2], np.ones(SAMPLES)
    weight = np.linalg.inv(np.eye(SAMPLES) + J @ other_runs_covariance @ J.T)
    size = (a @ weight @ (measured[2] - J @ other_runs_z)) / (a @ weight @ a)
    offset = next(x for x in run_scores.anomalies if x.kind == "actuator offset")
    assert offset.size == pytest.approx(size, rel=1e-6)
    assert offset.sd == pytest.approx(1.0 / math.sqrt(a @ weight @ a), rel=1e-6)


@settings(max_examples=12)
@given(st.floats(0.3, 0.98), st.integers(0, 20), st.floats(2.5, 4.0))
def test_exceedance_bounds_probability_of_a_chain(
    correlation: float, steps: int, level: float
) -> None:
    """A first-order chain is rougher than a smooth path; the bound must hold for it too."""
    rng = np.random.default_rng(9)
    chain = np.empty((5000, steps + 1))
    chain[:, 0] = rng.standard_normal(5000)
    for k in range(steps):
        chain[:, k + 1] = correlation * chain[:, k] + math.sqrt(
            1.0 - correlation**2
        ) * rng.standard_normal(5000)
    share = float(np.mean(np.max(np.abs(chain), axis=1) > level))
    bound = exceedance(level, np.full(steps, correlation))
    assert share <= bound + 4.0 * math.sqrt(bound / 5000)
    assert bound >= 2.0 * norm.sf(level)  # probability at a single point


def test_inflation_of_other_runs_prevents_false_alarms(world: World) -> None:
    """Residuals three times as large as the noise model says, in every run, are no anomaly.

    Of 40 runs at most 2 are expected below 1 % (95 %); the median of few runs doubles the rate.
    """
    rng, slopes = np.random.default_rng(8), np.zeros((SAMPLES, 1))
    runs = [
        statistics_over_time(
            world.signatures[:1], 3.0 * rng.standard_normal(SAMPLES), slopes, np.eye(1)
        )
        for _ in range(40)
    ]
    raw = [evaluate(run).p_value for run in runs]
    scaled = [evaluate(run, inflation(o for o in runs if o is not run)).p_value for run in runs]
    assert np.mean(np.array(raw) < 0.01) > 0.5
    assert np.sum(np.array(scaled) < 0.01) <= 3


def test_inflation_ignores_one_anomalous_run(world: World) -> None:
    rng, slopes = np.random.default_rng(9), np.zeros((SAMPLES, 1))
    residuals = [rng.standard_normal(SAMPLES) for _ in range(7)]
    residuals[0] = residuals[0] + 5.0
    others = [statistics_over_time(world.signatures[:1], r, slopes, np.eye(1)) for r in residuals]
    assert inflation(others)["actuator slip"] < 3.0
