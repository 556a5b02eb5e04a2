"""Profile likelihood where the interval is known: Gaussian problems, and one whose cost is no
parabola."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sysid.estimation import profile_likelihood
from sysid.estimation.profile_likelihood import LeastSquaresEstimate

WIDE = np.full(2, 1e6)


@settings(max_examples=20)
@given(st.integers(0, 10_000), st.sampled_from([0.68, 0.95, 0.99]))
def test_a_gaussian_problem_has_symmetric_intervals(seed: int, level: float) -> None:
    """Estimate plus and minus the normal quantile times the standard deviation, for any linear
    combination."""
    from scipy.stats import norm

    rng = np.random.default_rng(seed)
    A, weights = rng.standard_normal((12, 2)), rng.standard_normal(2)
    b = rng.standard_normal(12)
    best = np.linalg.lstsq(A, b, rcond=None)[0]
    sd = math.sqrt(weights @ np.linalg.inv(A.T @ A) @ weights)
    problem = LeastSquaresEstimate(lambda x: A @ x - b, lambda x: A, -WIDE, WIDE)
    found = profile_likelihood.interval(problem, best, lambda x: float(weights @ x), sd, level)
    half = sd * norm.ppf(0.5 * (1.0 + level))
    assert found.low == pytest.approx(weights @ best - half, abs=0.02 * sd)
    assert found.high == pytest.approx(weights @ best + half, abs=0.02 * sd)


def test_a_ratio_has_fiellers_interval() -> None:
    """x/y of two Gaussian measurements: the exact interval is Fieller's (1954), and far from
    symmetric."""
    measured, sds = np.array([2.0, 1.0]), np.array([0.2, 0.3])
    problem = LeastSquaresEstimate(
        lambda x: (x - measured) / sds, lambda x: np.diag(1.0 / sds), -WIDE, WIDE
    )
    sd = 2.0 * math.hypot(0.2 / 2.0, 0.3)
    found = profile_likelihood.interval(problem, measured, lambda x: float(x[0] / x[1]), sd)
    q = 1.959964**2
    roots = np.roots([1.0 - q * 0.3**2, -2.0 * 2.0, 4.0 - q * 0.2**2])
    assert (found.low, found.high) == pytest.approx(sorted(roots), rel=0.01)


def test_what_the_data_do_not_bound_is_infinite() -> None:
    """The same ratio with a denominator that may be zero: high values all fit."""
    measured, sds = np.array([2.0, 0.5]), np.array([0.2, 0.3])
    problem = LeastSquaresEstimate(
        lambda x: (x - measured) / sds, lambda x: np.diag(1.0 / sds), -WIDE, WIDE
    )
    found = profile_likelihood.interval(problem, measured, lambda x: float(x[0] / x[1]), 2.5)
    assert math.isinf(found.high)
    assert 1.0 < found.low < 4.0
