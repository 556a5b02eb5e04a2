"""What pushes a rehearsed vehicle is the identified noise: its size, and the same sea however
loud."""

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
    return np.array(list(islice(pushed, ticks))) @ vehicle.model.inertia.M_inverse.T


def test_accelerations_have_the_size_that_the_model_found(known: DesignPrior) -> None:
    found, level = accelerations(known, 1.0, 100_000), known.noise["yaw"]
    assert np.std(found[:, 5]) == pytest.approx(
        np.hypot(level.slow_radps2, level.wave_radps2), rel=0.1
    )
    assert np.std(found[:, 1]) * TICK_S**0.5 == pytest.approx(level.force_mps15, rel=0.02)
    assert np.all(np.abs(found[:, (0, 3)]) < 1e-9)


def test_a_rougher_sea_is_the_same_sea_louder(known: DesignPrior) -> None:
    assert accelerations(known, 2.0, 3000) == pytest.approx(2.0 * accelerations(known, 1.0, 3000))


def test_a_silent_sea_pushes_nobody(known: DesignPrior) -> None:
    still = known._replace(noise={"yaw": silent(), "pitch": silent()})
    assert np.all(accelerations(still, 1.0, 100) == 0.0)
