"""A search judges no gains twice, and ends on the limit that holds it back."""

from collections.abc import Mapping

import pytest

from sysid.design.constrained_search import ConstrainedProblem, CostAndConstraints, solve


def test_a_search_ends_on_its_limit_and_judges_no_gains_twice_on_the_way() -> None:
    evaluated: list[tuple[float, ...]] = []

    def judge(gains: Mapping[str, float]) -> CostAndConstraints:
        evaluated.append((gains["P"], gains["D"]))
        return CostAndConstraints(
            1.0 / gains["P"] + 0.1 * gains["D"], {"stiffness": gains["P"] / gains["D"] - 1.0}
        )

    found = solve(ConstrainedProblem({}, ({"P": 0.5, "D": 2.0},), judge))
    assert found["P"] == pytest.approx(found["D"], rel=0.01)
    assert found["P"] == pytest.approx(10.0**0.5, rel=0.05)
    # A search judges its end again, and the next one sets out from there.
    assert len(evaluated) <= len(set(evaluated)) + 8
