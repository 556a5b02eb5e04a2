"""Profile-likelihood intervals with known references: Gaussian problems and a ratio."""

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
def test_interval_gaussian_problem_is_symmetric(seed: int, level: float) -> None:
    """Reference: estimate plus and minus the normal quantile times the standard deviation."""
    from scipy.stats import norm

    rng = np.random.default_rng(seed)
    A, weights = rng.standard_normal((12, 2)), rng.standard_normal(2)
    b = rng.standard_normal(12)
    best = np.asarray(np.linalg.lstsq(A, b, rcond=None)[0], np.float64)
    sd = math.sqrt(weights @ np.linalg.inv(A.T @ A) @ weights)
    problem = LeastSquaresEstimate(lambda x: A @ x - b, lambda x: A, -WIDE, WIDE)
    interval = profile_likelihood.interval(problem, best, lambda x: float(weights @ x), sd, level)
    half = sd * norm.ppf(0.5 * (1.0 + level))
    assert interval.low == pytest.approx(weights @ best - half, abs=0.02 * sd)
    assert interval.high == pytest.approx(weights @ best + half, abs=0.02 * sd)


def test_interval_ratio_matches_fieller() -> None:
    """Reference: Fieller's (1954) exact interval of x/y, which is far from symmetric."""
    measured, sds = np.array([2.0, 1.0]), np.array([0.2, 0.3])
    problem = LeastSquaresEstimate(
        lambda x: (x - measured) / sds, lambda x: np.diag(1.0 / sds), -WIDE, WIDE
    )
    sd = 2.0 * math.hypot(0.2 / 2.0, 0.3)
    interval = profile_likelihood.interval(problem, measured, lambda x: float(x[0] / x[1]), sd)
    q = 1.959964**2
    roots = np.roots([1.0 - q * 0.3**2, -2.0 * 2.0, 4.0 - q * 0.2**2])
    assert (interval.low, interval.high) == pytest.approx(sorted(roots), rel=0.01)


def test_interval_unbounded_end_is_infinite() -> None:
    """Ratio with a denominator that may be zero: all large values fit."""
    measured, sds = np.array([2.0, 0.5]), np.array([0.2, 0.3])
    problem = LeastSquaresEstimate(
        lambda x: (x - measured) / sds, lambda x: np.diag(1.0 / sds), -WIDE, WIDE
    )
    interval = profile_likelihood.interval(problem, measured, lambda x: float(x[0] / x[1]), 2.5)
    assert math.isinf(interval.high)
    assert 1.0 < interval.low < 4.0
