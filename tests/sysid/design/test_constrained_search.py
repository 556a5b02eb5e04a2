"""The search caches evaluations and ends on the active constraint."""

import math
from collections.abc import Mapping

import pytest

from autopilot.control import params
from sysid.design.constrained_search import ConstrainedProblem, CostAndConstraints, solve


def test_solve_active_constraint_is_met_with_few_evaluations() -> None:
    evaluated: list[tuple[float, ...]] = []

    def evaluate(gains: Mapping[str, float]) -> CostAndConstraints:
        evaluated.append((gains["P"], gains["D"]))
        return CostAndConstraints(
            1.0 / gains["P"] + 0.1 * gains["D"], {"stiffness": gains["P"] / gains["D"] - 1.0}
        )

    gains_found = solve(ConstrainedProblem({}, ({"P": 0.5, "D": 2.0},), evaluate))
    assert gains_found["P"] == pytest.approx(gains_found["D"], rel=0.01)
    assert gains_found["P"] == pytest.approx(10.0**0.5, rel=0.05)
    # Each restart evaluates the end of the previous search again.
    assert len(evaluated) <= len(set(evaluated)) + 8


def test_solve_start_with_a_poor_optimum_is_followed_by_the_next() -> None:
    """Objective with minima 2 at P = 0.1 and 0.5 at P = 10; the reference's objective is 1."""

    def evaluate(gains: Mapping[str, float]) -> CostAndConstraints:
        logarithm = math.log10(gains["P"])
        poor, good = 2.0 + (logarithm + 1.0) ** 2, 0.5 + (logarithm - 1.0) ** 2
        return CostAndConstraints(min(poor, good), {"none": -1.0})

    search = ConstrainedProblem({}, ({"P": 0.05}, {"P": 20.0}), evaluate)
    assert solve(search)["P"] == pytest.approx(10.0, rel=0.05)
    search = ConstrainedProblem({}, ({"P": 0.05},), evaluate)
    assert solve(search)["P"] == pytest.approx(0.1, rel=0.05)


def test_solve_keeps_to_the_range_that_the_autopilot_accepts() -> None:
    def evaluate(gains: Mapping[str, float]) -> CostAndConstraints:
        return CostAndConstraints(1.0 / gains["HDG_P"], {"none": -1.0})

    found = solve(ConstrainedProblem({}, ({"HDG_P": 1.0},), evaluate))
    assert found["HDG_P"] == pytest.approx(5.0)
    assert params.config(found).heading_p == pytest.approx(5.0)


def test_solve_rounding_does_not_leave_the_range() -> None:
    """exp(log(100)) is more than 100, the largest bandwidth of the lead."""

    def evaluate(gains: Mapping[str, float]) -> CostAndConstraints:
        return CostAndConstraints(1.0 / gains["ACT_LEAD_W"], {"none": -1.0})

    found = solve(ConstrainedProblem({}, ({"ACT_LEAD_W": 90.0},), evaluate))
    assert found["ACT_LEAD_W"] == 100.0
