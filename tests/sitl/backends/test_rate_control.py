"""How long PX4 is waited for: what is learnt from the answers, and that no history of them leads to
a deadlock."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sitl.backends.rate_control import ANSWER_TIMEOUT_S, CLOCK_RESTART_US, AnswerRate

TICK_US = 4000


def fly(answer_rate: AnswerRate, frames: range, nth: int = 1, behind_us: int = 0) -> list[float]:
    """Every nth frame answered at once by a clock that stands ``behind_us`` behind; the patience
    with each."""
    patience = []
    for number in frames:
        asked_us = number * TICK_US
        patience.append(answer_rate.wait_timeout_s(asked_us))
        if number % nth == 0:
            assert answer_rate.record_answer(asked_us - behind_us, asked_us, lockstep=True)
        else:
            answer_rate.record_timeout(asked_us)
    return patience


def test_nobody_is_waited_for_longer_than_a_step_before_the_first_answer() -> None:
    answer_rate = AnswerRate(TICK_US)
    for number in range(1, 100):
        assert answer_rate.wait_timeout_s(number * TICK_US) == pytest.approx(0.004)
        answer_rate.record_timeout(number * TICK_US)


@pytest.mark.parametrize("behind_us", [0, TICK_US, 123_457])
def test_once_answered_every_frame_is_waited_for(behind_us: int) -> None:
    """PX4's clock counts from its first HIL_SENSOR, or from zero."""
    answer_rate = AnswerRate(TICK_US)
    assert fly(answer_rate, range(40, 100), behind_us=behind_us)[1:] == [ANSWER_TIMEOUT_S] * 59


@pytest.mark.parametrize("nth", [2, 5, 10])
def test_the_frames_between_answers_are_not_waited_for_once_the_rhythm_is_known(nth: int) -> None:
    answer_rate = AnswerRate(TICK_US)
    fly(answer_rate, range(1, 3 * nth + 1), nth)
    patience = fly(answer_rate, range(3 * nth + 1, 8 * nth + 1), nth)
    assert patience == ([0.0] * (nth - 1) + [ANSWER_TIMEOUT_S]) * 5
    fly(answer_rate, range(8 * nth + 1, 8 * nth + 3))
    assert set(fly(answer_rate, range(8 * nth + 3, 8 * nth + 20))) == {ANSWER_TIMEOUT_S}, (
        "back to every frame"
    )


def test_after_a_pause_every_frame_is_waited_for_again() -> None:
    answer_rate = AnswerRate(TICK_US)
    fly(answer_rate, range(1, 50))
    for number in range(50, 550):
        answer_rate.record_timeout(number * TICK_US)
    assert answer_rate.wait_timeout_s(550 * TICK_US) == pytest.approx(0.004)
    assert fly(answer_rate, range(550, 600))[1:] == [ANSWER_TIMEOUT_S] * 49


def test_a_late_answer_is_no_answer_to_the_frame_that_was_sent_since() -> None:
    answer_rate = AnswerRate(TICK_US)
    fly(answer_rate, range(1, 10))
    assert not answer_rate.record_answer(9 * TICK_US, 10 * TICK_US, lockstep=True)
    assert answer_rate.record_answer(10 * TICK_US, 10 * TICK_US, lockstep=True)


def test_a_lag_that_was_taken_for_too_much_is_mended_by_the_first_prompt_answer() -> None:
    answer_rate = AnswerRate(TICK_US)
    assert answer_rate.record_answer(4 * TICK_US, 6 * TICK_US, lockstep=True)
    assert answer_rate.record_answer(7 * TICK_US, 7 * TICK_US, lockstep=True)
    assert not answer_rate.record_answer(7 * TICK_US, 8 * TICK_US, lockstep=True)


def test_a_clock_that_begins_anew_is_believed() -> None:
    answer_rate = AnswerRate(TICK_US)
    fly(answer_rate, range(1, 1000))
    start_us = 1000 * TICK_US + CLOCK_RESTART_US
    assert answer_rate.record_answer(0, start_us, lockstep=True)
    assert answer_rate.record_answer(TICK_US, start_us + TICK_US, lockstep=True)


def test_without_lockstep_nobody_is_waited_for() -> None:
    answer_rate = AnswerRate(TICK_US)
    answer_rate.record_answer(8000, 8000, lockstep=False)
    assert answer_rate.wait_timeout_s(12_000) == pytest.approx(0.004)


@given(
    st.lists(st.tuples(st.booleans(), st.integers(0, 20), st.booleans()), min_size=1, max_size=200)
)
def test_no_history_of_answers_makes_two_frames_in_a_row_wait_in_vain(
    history: list[tuple[bool, int, bool]],
) -> None:
    """A wait that was in vain is the last until somebody answers again."""
    answer_rate, in_vain = AnswerRate(TICK_US), False
    for number, (is_answered, late, lockstep) in enumerate(history, 1):
        patience_s = answer_rate.wait_timeout_s(number * TICK_US)
        assert 0.0 <= patience_s <= ANSWER_TIMEOUT_S
        assert not (in_vain and patience_s > 0.004 + 1e-9)
        if is_answered:
            answer_rate.record_answer(max(0, number - late) * TICK_US, number * TICK_US, lockstep)
            in_vain = False
        else:
            answer_rate.record_timeout(number * TICK_US)
            in_vain = patience_s == ANSWER_TIMEOUT_S or (in_vain and patience_s < ANSWER_TIMEOUT_S)
