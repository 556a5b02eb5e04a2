"""Largest safe sizes: verified on other samples, and not smaller than necessary."""

import math

import numpy as np
import pytest

from sitl.vehicle.config import VehicleFileError
from sysid.planes import Plane
from sysid.test_design import safety_margins
from sysid.test_design.prior import DesignPrior
from sysid.test_design.safety_margins import ExcursionLimits, VehicleSample
from sysid.test_design.simulate import Manoeuvre

TESTS = [
    Manoeuvre(Plane.YAW, "3211", 3.0, 11),
    Manoeuvre(Plane.YAW, "prbs", 3.0, 30, stop_hz=0.5, seed=3, loop_on=True),
    Manoeuvre(Plane.PITCH, "3211", 3.0, 7),
    Manoeuvre(Plane.PITCH, "prbs", 3.0, 30, stop_hz=0.5, seed=3, loop_on=True),
]


@pytest.mark.slow
@pytest.mark.parametrize("what", TESTS, ids=lambda m: f"{m.plane} {m.wave}")
def test_size_other_samples_stay_within_limits(
    bench: DesignPrior,
    gains: dict[str, float],
    samples: dict[Plane, list[VehicleSample]],
    what: Manoeuvre,
) -> None:
    """Limit: 1 %. Of 300 other samples, more than 10 violations have a probability of 0.1 %."""
    limits = ExcursionLimits()
    found = safety_margins.max_size_within_limits(what, 9.0, samples[what.plane], limits)
    assert found is not None
    sized, _ = found
    fresh = safety_margins.sample_vehicles(bench, what.plane, gains, 300, 30.0, seed=77)
    left = [
        safety_margins.excursion(what.plane, [one], limits).probability > 0.5
        for one in safety_margins.responses(sized, fresh)
    ]
    assert np.sum(left) <= 10


@pytest.mark.parametrize("what", TESTS, ids=lambda m: f"{m.plane} {m.wave}")
def test_size_increased_by_half_exceeds_limits(
    samples: dict[Plane, list[VehicleSample]], what: Manoeuvre
) -> None:
    limits = ExcursionLimits(rate_limited=1.0, stopped=1.0)
    found = safety_margins.max_size_within_limits(what, 15.0, samples[what.plane], limits)
    assert found is not None
    grown = found[0]._replace(size_deg=1.5 * found[0].size_deg)
    beyond = safety_margins.excursion(
        what.plane, safety_margins.responses(grown, samples[what.plane]), limits
    ).probability
    assert beyond > safety_margins.MAX_PROBABILITY


def test_size_tighter_limits_is_smaller(samples: dict[Plane, list[VehicleSample]]) -> None:
    sizes = []
    for pitch_deg in (15.0, 8.0):
        found = safety_margins.max_size_within_limits(
            TESTS[2], 9.0, samples[Plane.PITCH], ExcursionLimits(pitch_rad=math.radians(pitch_deg))
        )
        assert found is not None
        sizes.append(found[0].size_deg)
    assert sizes[1] < 0.8 * sizes[0]


def test_size_limit_below_disturbance_is_none(
    samples: dict[Plane, list[VehicleSample]],
) -> None:
    assert (
        safety_margins.max_size_within_limits(
            TESTS[2], 9.0, samples[Plane.PITCH], ExcursionLimits(pitch_rate_radps=math.radians(0.2))
        )
        is None
    )


def test_size_closed_loop_leaves_travel_for_feedback(
    samples: dict[Plane, list[VehicleSample]],
) -> None:
    """With 3 deg of travel beside the trim, a closed-loop test is smaller."""
    found = safety_margins.max_size_within_limits(
        TESTS[1], 3.0, samples[Plane.YAW], ExcursionLimits()
    )
    assert found is not None
    assert found[0].size_deg < 2.8


def test_sample_vehicles_impossible_ones_are_drawn_again(
    bench: DesignPrior, gains: dict[str, float]
) -> None:
    """A wide prior contains masses that are impossible for the hull."""
    wide = bench._replace(covariance=25.0 * bench.covariance)
    drawn = (
        np.random.default_rng(0).standard_normal((40, bench.mean.size))
        @ np.linalg.cholesky(wide.covariance).T
    )
    assert any(_cannot_be(wide, z) for z in drawn)
    assert len(safety_margins.sample_vehicles(wide, Plane.YAW, gains, 10, 5.0, seed=1)) == 10


def _cannot_be(belief: DesignPrior, z: np.ndarray) -> bool:
    try:
        belief.vehicle(z)
    except VehicleFileError:
        return True
    return False


def test_sample_vehicles_seed_determines_samples(
    bench: DesignPrior, gains: dict[str, float]
) -> None:
    first, again, other = (
        safety_margins.sample_vehicles(bench, Plane.YAW, gains, 3, 10.0, seed) for seed in (1, 1, 2)
    )
    for one, same in zip(first, again, strict=True):
        np.testing.assert_array_equal(one.held_motion, same.held_motion)
        np.testing.assert_array_equal(one.free_motion, same.free_motion)
    assert not np.array_equal(first[0].held_motion, other[0].held_motion)
