"""Samplers of a sweep: coverage, repeatability, and points that do not depend on the count."""

import numpy as np
import pytest

from sysid.sweep import points
from sysid.sweep.points import ParameterRange, Sampler


@pytest.mark.parametrize("sampler", list(Sampler))
def test_draw_same_seed_same_points_in_unit_cube(sampler: Sampler) -> None:
    drawn = points.draw(sampler, 37, 32, 5)
    assert drawn.shape == (37, 32)
    assert np.all((drawn >= 0.0) & (drawn <= 1.0))
    assert np.array_equal(drawn, points.draw(sampler, 37, 32, 5))
    assert not np.array_equal(drawn, points.draw(sampler, 37, 32, 6))


@pytest.mark.parametrize("sampler", [Sampler.SOBOL, Sampler.HALTON, Sampler.RANDOM])
def test_draw_more_points_keeps_the_first_ones(sampler: Sampler) -> None:
    assert np.array_equal(points.draw(sampler, 5, 8, 1), points.draw(sampler, 21, 8, 1)[:5])


@pytest.mark.parametrize("sampler", [Sampler.SOBOL, Sampler.LATIN_HYPERCUBE])
def test_draw_each_coordinate_is_evenly_covered(sampler: Sampler) -> None:
    counts = np.apply_along_axis(
        lambda column: np.bincount((column * 16).astype(int), minlength=16),
        0,
        points.draw(sampler, 64, 20, 3),
    )
    assert np.all(counts == 4)


def test_to_normal_maps_median_and_stays_finite_at_the_edges() -> None:
    assert points.to_normal(np.array([0.5]))[0] == 0.0
    assert np.all(np.isfinite(points.to_normal(np.array([0.0, 1.0]))))
    # 97.5 % quantile of the standard normal distribution, any statistical table
    assert points.to_normal(np.array([0.975]))[0] == pytest.approx(1.959964, abs=1e-6)


def test_to_ranges_is_linear() -> None:
    assert points.to_ranges([0.25, 1.0], [ParameterRange(-2.0, 2.0), ParameterRange(3.0, 5.0)]) == [
        -1.0,
        5.0,
    ]
