"""Both linear estimators: recovery of a known plane, stated errors, ambiguous data."""

import math
import re

import numpy as np
import pytest

from sysid.estimation.linear import estimate, linear_model, multistart, records
from sysid.estimation.linear.estimate import Method, PassResult
from sysid.estimation.linear.linear_model import NUMBERS
from sysid.estimation.linear.multistart import NotUniqueError
from sysid.estimation.linear.response import SurfaceCommand
from sysid.planes import Plane
from tests.sysid import sea
from tests.sysid.estimation.linear.conftest import commands, simulate_runs, true_model, wide_prior

SDS = np.array([math.radians(0.2), math.radians(0.2), 0.02])


@pytest.mark.parametrize("method", ["output-error", "filter-error"])
def test_estimate_known_plane_is_recovered(plane: Plane, method: Method) -> None:
    truth = true_model(plane)
    runs = simulate_runs(truth, commands(), SDS, np.random.default_rng(3))
    estimated = estimate.estimate(runs, wide_prior(plane), method, others=2)
    true_derived, derived = linear_model.derived(*truth), linear_model.derived(*estimated.model)
    sds = np.sqrt(np.diag(linear_model.propagate(*estimated.model, estimated.covariance)))
    assert np.max(np.abs(derived - true_derived) / sds) < 3.5
    assert np.all(sds[:2] < 0.15 * np.abs(true_derived[:2]))
    np.testing.assert_allclose(estimated.sensors[:2], SDS[:2], rtol=0.2)
    assert len(estimated.start_costs) == 2


def test_descend_stated_errors_match_actual_errors() -> None:
    """Over sixteen campaigns, the mean squared error in stated standard deviations is about one."""
    truth, prior = true_model(Plane.YAW), wide_prior(Plane.YAW)
    squared = []
    for seed in range(16):
        runs = simulate_runs(truth, commands(), SDS, np.random.default_rng(100 + seed))
        estimated = estimate.descend(runs, prior, "output-error", prior.model.values)
        error = (estimated.model.values - truth.values)[: len(NUMBERS[Plane.YAW]) + 2]
        covariance = estimated.covariance[: error.size, : error.size]
        squared.append(error @ np.linalg.solve(covariance, error) / error.size)
    assert 0.6 < np.mean(squared) < 1.5


def test_descend_unknown_command_times_widen_the_delay() -> None:
    """Their variance adds to that of the delay; the values stay."""
    truth, prior = true_model(Plane.YAW), wide_prior(Plane.YAW)
    runs = simulate_runs(truth, commands(), SDS, np.random.default_rng(9))
    sharp = estimate.descend(runs, prior, "output-error", prior.model.values)
    late = [runs[0]._replace(delay_sd_s=0.03), *runs[1:]]
    wide = estimate.descend(late, prior, "output-error", prior.model.values)
    added = np.zeros_like(sharp.covariance)
    i = linear_model.names(Plane.YAW).index("delay_s")
    added[i, i] = 0.03**2
    np.testing.assert_allclose(wide.covariance, sharp.covariance + added, atol=1e-15)
    np.testing.assert_array_equal(wide.model.values, sharp.model.values)


def test_estimate_constant_commands_are_rejected(plane: Plane) -> None:
    """Constant commands without noise determine nothing: the error names a value."""
    surface_commands = [SurfaceCommand(sea.step(0.0, 20.0))] * 2
    runs = simulate_runs(true_model(plane), surface_commands, SDS, np.random.default_rng(4))
    with pytest.raises(NotUniqueError, match=rf"{plane}: the tests do not distinguish"):
        estimate.estimate(runs, wide_prior(plane), "output-error", others=2)


def test_estimate_value_at_bound_is_a_failure() -> None:
    """The prior is far from the vehicle and much too narrow."""
    prior = wide_prior(Plane.YAW)
    narrow = records.with_bounds(prior.model, prior.covariance * 1e-4)
    runs = simulate_runs(true_model(Plane.YAW), commands(), SDS, np.random.default_rng(5))
    failures = estimate.estimate(runs, narrow, "output-error", others=0).failures
    assert failures
    assert all(re.match(r"yaw: \w+ = .* is at its bound", failure) for failure in failures)


def test_estimate_disagreeing_starts_are_a_failure(monkeypatch: pytest.MonkeyPatch) -> None:
    """Searches from other starts end after one evaluation, far above the lowest cost."""
    runs = simulate_runs(true_model(Plane.YAW), commands(), SDS, np.random.default_rng(6))
    passes = estimate._passes("output-error")
    monkeypatch.setattr(
        estimate, "_passes", lambda method: lambda *arguments: stop_early(passes(*arguments))
    )

    def stop_early(result: PassResult) -> PassResult:
        monkeypatch.setattr(multistart, "MAX_EVALUATIONS", 1)
        return result

    (failure,) = estimate.estimate(runs, wide_prior(Plane.YAW), "output-error", others=3).failures
    assert re.match(r"yaw: 3 of 3 other starts end elsewhere, their costs up to .* away", failure)


def test_estimate_without_runs_is_rejected() -> None:
    with pytest.raises(ValueError, match="at least one run"):
        estimate.estimate([], wide_prior(Plane.YAW))
