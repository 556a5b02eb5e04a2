"""The simulated disturbance has the identified size and scales with its factor."""

from itertools import islice

import numpy as np
import pytest

from sysid.control_analysis.loop_transfer import TICK_S
from sysid.monte_carlo import disturbance
from sysid.test_design.prior import DesignPrior
from tests.sysid.monte_carlo.conftest import silent


def accelerations(known: DesignPrior, times: float, ticks: int) -> np.ndarray:  # type: ignore[type-arg]
    vehicle = known.vehicle(known.mean)
    pushed = disturbance.wrenches(vehicle, known.noise, times, np.random.default_rng(2))
    blocks = islice(pushed, -(-ticks // disturbance.BLOCK))
    return np.concatenate(list(blocks))[:ticks] @ vehicle.model.inertia.M_inverse.T


def test_wrenches_rms_equals_noise_model(known: DesignPrior) -> None:
    rms_of, level = accelerations(known, 1.0, 100_000), known.noise["yaw"]
    assert np.std(rms_of[:, 5]) == pytest.approx(
        np.hypot(level.slow_radps2, level.wave_radps2), rel=0.1
    )
    assert np.std(rms_of[:, 1]) * TICK_S**0.5 == pytest.approx(level.force_mps15, rel=0.02)
    assert np.all(np.abs(rms_of[:, (0, 3)]) < 1e-9)


def test_wrenches_factor_scales_same_draws(known: DesignPrior) -> None:
    assert accelerations(known, 2.0, 3000) == pytest.approx(2.0 * accelerations(known, 1.0, 3000))


def test_wrenches_zero_factor_is_zero(known: DesignPrior) -> None:
    still = known._replace(noise={"yaw": silent(), "pitch": silent()})
    assert np.all(accelerations(still, 1.0, 100) == 0.0)
