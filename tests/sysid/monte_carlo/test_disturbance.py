"""The simulated disturbance has the identified size and scales with its factor."""

from itertools import islice

import numpy as np
import pytest
from numpy.typing import NDArray

from mavlink_io.tick import TICK_S
from sysid.models.noise import Noise
from sysid.monte_carlo import disturbance, instruments
from sysid.monte_carlo.dynamics import DEPTH
from sysid.planes import Plane
from sysid.test_design.prior import DesignPrior
from tests.sysid.monte_carlo.conftest import silent


def accelerations(known: DesignPrior, times: float, ticks: int) -> NDArray[np.float64]:
    vehicle = known.vehicle(known.mean)
    pushed = disturbance.wrenches(vehicle, known.noise, times, np.random.default_rng(2))
    blocks = islice(pushed, -(-ticks // disturbance.BLOCK))
    return np.concatenate(list(blocks))[:ticks] @ vehicle.model.inertia.M_inverse.T


def test_wrenches_rms_equals_noise_model(known: DesignPrior) -> None:
    rms_of, level = accelerations(known, 1.0, 100_000), known.noise[Plane.YAW]
    assert np.std(rms_of[:, 5]) == pytest.approx(
        np.hypot(level.slow_radps2, level.wave_radps2), rel=0.1
    )
    assert np.std(rms_of[:, 1]) * TICK_S**0.5 == pytest.approx(level.force_mps15, rel=0.02)
    assert np.all(np.abs(rms_of[:, (0, 3)]) < 1e-9)


def test_wrenches_factor_scales_same_draws(known: DesignPrior) -> None:
    assert accelerations(known, 2.0, 3000) == pytest.approx(2.0 * accelerations(known, 1.0, 3000))


def test_wrenches_zero_factor_is_zero(known: DesignPrior) -> None:
    still = known._replace(noise={Plane.YAW: silent(), Plane.PITCH: silent()})
    assert np.all(accelerations(still, 1.0, 100) == 0.0)


def depth_errors_m(levels: dict[Plane, Noise], times: float) -> NDArray[np.float64]:
    blocks = islice(instruments.errors(levels, np.random.default_rng(4), times), 200)
    return np.concatenate([block[:, DEPTH] for block in blocks])


@pytest.mark.parametrize("times", [1.0, 2.0])
def test_depth_errors_contain_pressure_of_waves(times: float) -> None:
    levels = {Plane.YAW: silent(), Plane.PITCH: silent(wave_depth_m=0.03)}
    # 4,096 s of a band 0.03 Hz wide hold about 120 independent amplitudes.
    assert np.std(depth_errors_m(levels, times)) == pytest.approx(0.03 * times, rel=0.15)


def test_depth_errors_without_waves_are_white() -> None:
    errors = depth_errors_m(
        {Plane.YAW: silent(), Plane.PITCH: silent()._replace(depth_m=0.01)}, 1.0
    )
    assert abs(np.corrcoef(errors[1:], errors[:-1])[0, 1]) < 0.01
