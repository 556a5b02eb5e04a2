"""Selection of tests against repeated single tests and against exhaustive search."""

from itertools import combinations_with_replacement

import numpy as np
from hypothesis import example, given, settings
from hypothesis import strategies as st

from sysid.planes import Plane
from sysid.test_design import selection
from sysid.test_design.safety_margins import Excursion
from sysid.test_design.selection import SizedTest
from sysid.test_design.simulate import Manoeuvre

NOWHERE = Excursion(0.0, 0.0, 0.0, 0.0)


def candidates(seed: int, count: int) -> list[SizedTest]:
    """Return tests of a synthetic problem with three parameters; each informs on two directions."""
    rng = np.random.default_rng(seed)
    found = []
    for number in range(count):
        rows = rng.standard_normal((2, 3)) * rng.uniform(0.3, 3.0)
        shape = Manoeuvre(Plane.YAW, "step", 1.0 + number, 10)
        found.append(SizedTest(shape, NOWHERE, rows.T @ rows, float(rng.integers(30, 80))))
    return found


def criterion(information: np.ndarray) -> float:
    """Return the criterion of an information matrix."""
    return -float(np.linalg.slogdet(information)[1])


@settings(max_examples=40)
@given(st.integers(0, 10**6))
def test_select_tests_beats_repeated_single_tests(seed: int) -> None:
    offered, known, test_time_s = candidates(seed, 6), np.eye(3), 400.0
    chosen = selection.select_tests(offered, known, test_time_s, criterion)
    assert selection.total_test_time_s(chosen) <= test_time_s
    assert selection.has_repeats(chosen)
    best = criterion(selection.total(chosen, known))
    for one in offered:
        repeated = [one] * int(test_time_s // one.test_time_s)
        assert best <= criterion(selection.total(repeated, known)) + 0.02


@settings(max_examples=15)
@given(st.integers(0, 10**6))
@example(421)
@example(486)
@example(509)
def test_select_tests_is_near_exhaustive_optimum(seed: int) -> None:
    offered, known, test_time_s = candidates(seed, 4), np.eye(3), 250.0
    best = min(
        criterion(selection.total(some, known))
        for size in range(2, 9)
        for some in combinations_with_replacement(offered, size)
        if selection.total_test_time_s(some) <= test_time_s and selection.has_repeats(some)
    )
    assert (
        criterion(
            selection.total(selection.select_tests(offered, known, test_time_s, criterion), known)
        )
        <= best + 0.1
    )


def test_select_tests_time_below_a_pair_is_empty() -> None:
    offered = candidates(1, 3)
    assert (
        selection.select_tests(
            offered, np.eye(3), 1.5 * min(c.test_time_s for c in offered), criterion
        )[2:]
        == []
    )
