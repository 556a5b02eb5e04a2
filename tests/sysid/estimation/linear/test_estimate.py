"""Both estimators find a known plane again, within what they claim, and refuse what is not one
plane."""

import math

import numpy as np
import pytest

from sysid.data.segments import Plane
from sysid.estimation.linear import estimate, records
from sysid.estimation.linear import linear_model as plants
from sysid.estimation.linear.estimate import Method
from sysid.estimation.linear.linear_model import NUMBERS
from sysid.estimation.linear.multistart import NotUniqueError
from sysid.estimation.linear.response import SurfaceCommand
from tests.sysid import sea
from tests.sysid.estimation.linear.conftest import believed, commands, flown, plant

SDS = np.array([math.radians(0.2), math.radians(0.2), 0.02])


@pytest.mark.parametrize("method", ["output-error", "filter-error"])
def test_a_known_plane_is_found_again(plane: Plane, method: Method) -> None:
    truth = plant(plane)
    runs = flown(truth, commands(), SDS, np.random.default_rng(3))
    found = estimate.estimate(runs, believed(plane), method, others=2)
    true, told = plants.derived(*truth), plants.derived(*found.model)
    sds = np.sqrt(np.diag(plants.propagate(*found.model, found.covariance)))
    assert np.max(np.abs(told - true) / sds) < 3.5
    assert np.all(sds[:2] < 0.15 * np.abs(true[:2]))
    np.testing.assert_allclose(found.sensors[:2], SDS[:2], rtol=0.2)
    assert len(found.start_costs) == 2


def test_claimed_errors_are_real_ones() -> None:
    """Over sixteen campaigns the squared error in claimed standard deviations averages one."""
    truth, belief = plant("yaw"), believed("yaw")
    squared = []
    for seed in range(16):
        runs = flown(truth, commands(), SDS, np.random.default_rng(100 + seed))
        found = estimate.descend(runs, belief, "output-error", belief.model.values)
        error = (found.model.values - truth.values)[: len(NUMBERS["yaw"]) + 2]
        covariance = found.covariance[: error.size, : error.size]
        squared.append(error @ np.linalg.solve(covariance, error) / error.size)
    assert 0.6 < np.mean(squared) < 1.5


def test_still_water_tells_nothing(plane: Plane) -> None:
    """Commands that never move, without noise: the first thing that cannot be told is named."""
    told = [SurfaceCommand(sea.step(0.0, 20.0))] * 2
    runs = flown(plant(plane), told, SDS, np.random.default_rng(4))
    with pytest.raises(NotUniqueError, match=rf"{plane}: .*(do not distinguish|bound|starts)"):
        estimate.estimate(runs, believed(plane), "output-error", others=2)


def test_a_value_at_its_bound_is_refused() -> None:
    """A belief that is far from the vehicle and too sure of itself."""
    belief = believed("yaw")
    narrow = records.with_bounds(belief.model, belief.covariance * 1e-4)
    runs = flown(plant("yaw"), commands(), SDS, np.random.default_rng(5))
    with pytest.raises(NotUniqueError, match=r"yaw: \w+ = .* is at its bound"):
        estimate.estimate(runs, narrow, "output-error", others=0)


def test_starts_that_disagree_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """Other starts that are not followed end where they began, far above the least cost."""
    runs = flown(plant("yaw"), commands(), SDS, np.random.default_rng(6))
    from sysid.estimation.linear import multistart

    follow = multistart.search

    def impatient(objective, belief, start, ftol=1e-8, most=60):  # type: ignore[no-untyped-def]
        return follow(objective, belief, start, ftol, 1)

    found = estimate._passes("output-error")
    monkeypatch.setattr(estimate, "_passes", lambda method: lambda *given: _then(found(*given)))

    def _then(passed):  # type: ignore[no-untyped-def]
        monkeypatch.setattr(multistart, "search", impatient)
        return passed

    with pytest.raises(
        NotUniqueError, match=r"yaw: 3 of 3 starts ended up to .* above the least cost"
    ):
        estimate.estimate(runs, believed("yaw"), "output-error", others=3)


def test_no_run_is_refused() -> None:
    with pytest.raises(ValueError, match="at least one run"):
        estimate.estimate([], believed("yaw"))
