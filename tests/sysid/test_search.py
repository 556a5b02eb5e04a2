"""Constrained search: it ends at its constraint and evaluates no gains twice."""

from collections.abc import Mapping

import pytest

from sysid.design.constrained_search import ConstrainedProblem, CostAndConstraints, solve


def test_solve_ends_at_constraint_without_repeats() -> None:
    evaluated: list[tuple[float, ...]] = []

    def evaluate(gains: Mapping[str, float]) -> CostAndConstraints:
        evaluated.append((gains["P"], gains["D"]))
        return CostAndConstraints(
            1.0 / gains["P"] + 0.1 * gains["D"], {"stiffness": gains["P"] / gains["D"] - 1.0}
        )

    gains = solve(ConstrainedProblem({}, ({"P": 0.5, "D": 2.0},), evaluate))
    assert gains["P"] == pytest.approx(gains["D"], rel=0.01)
    assert gains["P"] == pytest.approx(10.0**0.5, rel=0.05)
    # A search evaluates its end again, and the next one starts from there.
    assert len(evaluated) <= len(set(evaluated)) + 8
