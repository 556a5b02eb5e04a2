"""Order of times: late, repeated and single wrong times of samples."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from sysid.data.readers.samples import (
    CLOCK_STEP_SAMPLES,
    ahead_of_others,
    clock_steps,
    out_of_order,
    strictly_increasing,
)

TIME_S = 0.02 * np.arange(500.0)


@given(
    st.sets(st.integers(0, TIME_S.size - CLOCK_STEP_SAMPLES - 20), min_size=1, max_size=6),
    st.floats(1.0, 1e300),
)
def test_single_times_far_ahead_do_not_exclude_later_samples(
    places: set[int], ahead_s: float
) -> None:
    time_s, wrong = TIME_S.copy(), sorted({3 * (place // 3) for place in places})
    time_s[wrong] += ahead_s
    assert list(np.flatnonzero(ahead_of_others(time_s))) == wrong
    assert list(np.flatnonzero(~strictly_increasing(time_s))) == wrong
    assert clock_steps("A", time_s) == []


@given(st.lists(st.integers(0, 30), min_size=1, max_size=60))
def test_increasing_samples_increase(times: list[int]) -> None:
    time_s = np.array(times, float)
    assert np.all(np.diff(time_s[strictly_increasing(time_s)]) > 0.0)


@given(st.lists(st.integers(0, TIME_S.size - 2), max_size=40))
def test_late_and_repeated_samples_are_excluded_as_before(places: list[int]) -> None:
    """Datagrams that overtake one other, and copies: samples later than all before stay."""
    time_s = np.repeat(TIME_S, 1 + np.arange(TIME_S.size) % 2)
    for place in places:
        time_s[[place, place + 1]] = time_s[[place + 1, place]]
    before = np.concatenate(([-np.inf], np.maximum.accumulate(time_s)[:-1]))
    if not ahead_of_others(time_s).any():
        np.testing.assert_array_equal(strictly_increasing(time_s), time_s > before)


def test_clock_that_steps_back_stays_a_step() -> None:
    time_s = np.concatenate((TIME_S, TIME_S))
    assert not ahead_of_others(time_s).any()
    assert not out_of_order(time_s).any()
    (step,) = clock_steps("A", time_s)
    assert (step.time_s, step.back_s) == (TIME_S[-1], TIME_S[-1])


def test_clock_step_is_found_behind_a_wrong_time() -> None:
    time_s = np.concatenate((TIME_S, TIME_S))
    time_s[100] = 999.0
    (step,) = clock_steps("A", time_s)
    assert (step.time_s, step.back_s) == (TIME_S[-1], TIME_S[-1])


def test_single_earlier_time_is_out_of_order() -> None:
    time_s = TIME_S.copy()
    time_s[100] = -5.0
    assert list(np.flatnonzero(out_of_order(time_s))) == [100]
