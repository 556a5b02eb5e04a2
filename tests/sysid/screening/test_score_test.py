"""Score tests on data of which everything is known: linear, Gaussian, with and without an
anomaly."""

import math
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.stats import norm

from sysid.screening.anomaly_models import Signature
from sysid.screening.score_test import Scores, exceedance, scores

Array = NDArray[np.float64]

SAMPLES, PARAMETERS, RUNS = 120, 4, 5
RNG = np.random.default_rng(11)


class World(NamedTuple):
    """Runs that share parameters: e = J z + a size + white noise."""

    slopes: list[Array]
    signatures: list[Signature]
    """The same in every run."""


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


def judged(
    world: World, rng: np.random.Generator, anomaly: Array | float = 0.0, run: int = 2
) -> Scores:
    """Fit all runs of one draw jointly (prior: unit normal), then test one."""
    z = rng.standard_normal(PARAMETERS)
    measured = [J @ z + rng.standard_normal(SAMPLES) for J in world.slopes]
    measured[run] = measured[run] + anomaly
    covariance = np.linalg.inv(np.eye(PARAMETERS) + sum(J.T @ J for J in world.slopes))
    best = covariance @ sum(J.T @ y for J, y in zip(world.slopes, measured, strict=True))
    return scores(
        world.signatures, measured[run] - world.slopes[run] @ best, world.slopes[run], covariance
    )


@pytest.fixture(scope="module")
def clean(world: World) -> list[Scores]:
    rng = np.random.default_rng(5)
    return [judged(world, rng) for _ in range(2500)]


def test_one_clean_run_in_a_hundred_is_flagged(clean: list[Scores]) -> None:
    """At most, and hardly fewer: the bound over all times and kinds is close to the truth."""
    share = float(np.mean([found.p_value <= 0.01 for found in clean]))
    assert 0.004 < share < 0.01 + 3.0 * math.sqrt(0.01 / len(clean))


def test_a_single_statistic_is_standard_normal(clean: list[Scores]) -> None:
    gain = [next(a.statistic for a in found.anomalies if a.kind == "gain error") for found in clean]
    assert np.mean(gain) == pytest.approx(0.0, abs=4.0 / math.sqrt(len(clean)))
    assert np.std(gain) == pytest.approx(1.0, abs=4.0 / math.sqrt(2 * len(clean)))


@pytest.mark.parametrize("kind", ["actuator slip", "actuator offset", "gain error"])
def test_what_is_there_is_named_sized_and_dated(world: World, kind: str) -> None:
    """Over many draws the likeliest is the one put in, as large as it was within what it claims of
    itself."""
    mark = next(s for s in world.signatures if s.kind == kind)
    put_in = 2.0 * mark.white[len(mark.white) // 2]
    rng, away, late, named = np.random.default_rng(7), [], [], 0
    for _ in range(200):
        found = judged(world, rng, put_in)
        assert found.p_value < 1e-4
        named += found.anomalies[0].kind == kind
        first = next(a for a in found.anomalies if a.kind == kind)
        late.append(
            0.0 if first.at_s is None else abs(first.at_s - mark.times_s[len(mark.white) // 2])
        )
        away.append((first.size - 2.0) / first.sd)
    assert named >= 160  # an offset and a slip at the very start are next of kin
    assert np.mean(late) < 1.5
    # The time of a slip is chosen to make it large: its size is a little more than it was.
    assert abs(np.mean(away)) < 0.5
    assert np.std(away) == pytest.approx(1.0, abs=0.2)


def test_it_is_the_estimate_that_a_fit_of_the_other_runs_would_give(world: World) -> None:
    """Generalised least squares of one anomaly in one run, parameters from the rest: done the long
    way."""
    rng = np.random.default_rng(8)
    state = rng.bit_generator.state
    found = judged(world, rng, 0.3 * world.signatures[1].white[0])
    rng.bit_generator.state = state
    z = rng.standard_normal(PARAMETERS)
    measured = [J @ z + rng.standard_normal(SAMPLES) for J in world.slopes]
    measured[2] += 0.3
    others = [k for k in range(RUNS) if k != 2]
    without = np.linalg.inv(
        np.eye(PARAMETERS) + sum(world.slopes[k].T @ world.slopes[k] for k in others)
    )
    rest = without @ sum(world.slopes[k].T @ measured[k] for k in others)
    J, a = world.slopes[2], np.ones(SAMPLES)
    weight = np.linalg.inv(np.eye(SAMPLES) + J @ without @ J.T)
    size = (a @ weight @ (measured[2] - J @ rest)) / (a @ weight @ a)
    offset = next(x for x in found.anomalies if x.kind == "actuator offset")
    assert offset.size == pytest.approx(size, rel=1e-6)
    assert offset.sd == pytest.approx(1.0 / math.sqrt(a @ weight @ a), rel=1e-6)


@settings(max_examples=12)
@given(st.floats(0.3, 0.98), st.integers(0, 20), st.floats(2.5, 4.0))
def test_a_course_exceeds_its_level_no_oftener_than_the_bound_says(
    alike: float, steps: int, level: float
) -> None:
    """A first-order chain is rougher than any smooth course: the bound must hold for it as well."""
    rng = np.random.default_rng(9)
    chain = np.empty((5000, steps + 1))
    chain[:, 0] = rng.standard_normal(5000)
    for k in range(steps):
        chain[:, k + 1] = alike * chain[:, k] + math.sqrt(1.0 - alike**2) * rng.standard_normal(
            5000
        )
    share = float(np.mean(np.max(np.abs(chain), axis=1) > level))
    bound = exceedance(level, np.full(steps, alike))
    assert share <= bound + 4.0 * math.sqrt(bound / 5000)
    assert bound >= 2.0 * norm.sf(level)  # what a single point exceeds
