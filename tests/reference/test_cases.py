"""All values of all check-cases are within tolerance, and the cases have the required headings."""

from types import ModuleType

import pytest

from tests.reference.cases import CASES
from tests.reference.check import HEADINGS, Check, relative, run, title, worst


@pytest.mark.parametrize("case", CASES, ids=title)
def test_check_case_values_within_tolerance(case: ModuleType) -> None:
    checks = list(run(case))
    assert checks, "a case without figures verifies nothing"
    assert [check for check in checks if not check.passed] == []


@pytest.mark.parametrize("case", CASES, ids=title)
def test_check_case_docstring_has_headings_in_order(case: ModuleType) -> None:
    places = [(case.__doc__ or "").find(heading) for heading in HEADINGS]
    assert -1 not in places
    assert places == sorted(places)


@pytest.mark.parametrize(
    ("value", "passed"), [(1.0, True), (1.1, True), (1.11, False), (float("nan"), False)]
)
def test_check_difference_beyond_tolerance_or_nan_fails(value: float, passed: bool) -> None:
    assert Check("", "", value, 1.0, 0.1000001, "").passed is passed
    assert relative("", "", value, 1.0, 0.1000001, "").passed is passed
    assert worst("", "", [1.0, value], 1.0, 0.1000001, "").passed is passed
