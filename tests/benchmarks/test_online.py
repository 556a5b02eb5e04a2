"""Figures of the live estimate: a number without a bounded interval does not count."""

import math

import numpy as np
import pytest

from benchmarks.identification import online


def test_numbers_without_bounds_are_left_out_of_agreement_and_coverage() -> None:
    differences, errors = np.full((4, online.COUNT), 0.5), np.ones((4, online.COUNT))
    differences[:, 0] = math.nan
    differences[0, 1], errors[:, 0], errors[:2, 1] = 2.5, math.nan, 3.0
    figures = online.judge("remus100", np.column_stack([differences, errors, np.full(4, 0.01)]))
    agreement, worst, coverage, _ = figures
    counted = 4 * (online.COUNT - 1)
    assert agreement.value == pytest.approx(math.sqrt((0.25 * (counted - 1) + 6.25) / counted))
    assert worst.value == pytest.approx(math.sqrt((3 * 0.25 + 6.25) / 4))
    assert worst.name == "largest of them, yaw b1_per_s2"
    assert coverage.value == pytest.approx(100.0 * (counted - 2) / counted)
