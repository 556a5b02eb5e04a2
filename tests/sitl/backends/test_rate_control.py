"""Wait times for PX4: the estimate from its answers, and that no history leads to a deadlock."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sitl.backends.rate_control import ANSWER_TIMEOUT_S, CLOCK_RESTART_US, AnswerRate

TICK_US = 4000


def fly(answer_rate: AnswerRate, frames: range, nth: int = 1, behind_us: int = 0) -> list[float]:
    """Answer every nth frame with a clock that is ``behind_us`` behind; return the wait times."""
    timeouts = []
    for number in frames:
        asked_us = number * TICK_US
        timeouts.append(answer_rate.wait_timeout_s(asked_us))
        if number % nth == 0:
            assert answer_rate.record_answer(asked_us - behind_us, asked_us, lockstep=True)
        else:
            answer_rate.record_timeout(asked_us)
    return timeouts


def test_before_first_answer_wait_is_one_step() -> None:
    answer_rate = AnswerRate(TICK_US)
    for number in range(1, 100):
        assert answer_rate.wait_timeout_s(number * TICK_US) == pytest.approx(0.004)
        answer_rate.record_timeout(number * TICK_US)


@pytest.mark.parametrize("behind_us", [0, TICK_US, 123_457])
def test_after_answer_every_frame_is_due(behind_us: int) -> None:
    """PX4's clock counts from its first HIL_SENSOR, or from zero."""
    answer_rate = AnswerRate(TICK_US)
    assert fly(answer_rate, range(40, 100), behind_us=behind_us)[1:] == [ANSWER_TIMEOUT_S] * 59


@pytest.mark.parametrize("nth", [2, 5, 10])
def test_periodic_answers_only_due_frames_are_waited_for(nth: int) -> None:
    answer_rate = AnswerRate(TICK_US)
    fly(answer_rate, range(1, 3 * nth + 1), nth)
    timeouts = fly(answer_rate, range(3 * nth + 1, 8 * nth + 1), nth)
    assert timeouts == ([0.0] * (nth - 1) + [ANSWER_TIMEOUT_S]) * 5
    fly(answer_rate, range(8 * nth + 1, 8 * nth + 3))
    assert set(fly(answer_rate, range(8 * nth + 3, 8 * nth + 20))) == {ANSWER_TIMEOUT_S}, (
        "back to every frame"
    )


def test_after_pause_every_frame_is_due_again() -> None:
    answer_rate = AnswerRate(TICK_US)
    fly(answer_rate, range(1, 50))
    for number in range(50, 550):
        answer_rate.record_timeout(number * TICK_US)
    assert answer_rate.wait_timeout_s(550 * TICK_US) == pytest.approx(0.004)
    assert fly(answer_rate, range(550, 600))[1:] == [ANSWER_TIMEOUT_S] * 49


def test_late_answer_does_not_answer_newer_frame() -> None:
    answer_rate = AnswerRate(TICK_US)
    fly(answer_rate, range(1, 10))
    assert not answer_rate.record_answer(9 * TICK_US, 10 * TICK_US, lockstep=True)
    assert answer_rate.record_answer(10 * TICK_US, 10 * TICK_US, lockstep=True)


def test_prompt_answer_corrects_overestimated_lag() -> None:
    answer_rate = AnswerRate(TICK_US)
    assert answer_rate.record_answer(4 * TICK_US, 6 * TICK_US, lockstep=True)
    assert answer_rate.record_answer(7 * TICK_US, 7 * TICK_US, lockstep=True)
    assert not answer_rate.record_answer(7 * TICK_US, 8 * TICK_US, lockstep=True)


def test_restarted_clock_resets_lag() -> None:
    answer_rate = AnswerRate(TICK_US)
    fly(answer_rate, range(1, 1000))
    start_us = 1000 * TICK_US + CLOCK_RESTART_US
    assert answer_rate.record_answer(0, start_us, lockstep=True)
    assert answer_rate.record_answer(TICK_US, start_us + TICK_US, lockstep=True)


def test_without_lockstep_wait_is_one_step() -> None:
    answer_rate = AnswerRate(TICK_US)
    answer_rate.record_answer(8000, 8000, lockstep=False)
    assert answer_rate.wait_timeout_s(12_000) == pytest.approx(0.004)


@given(
    st.lists(st.tuples(st.booleans(), st.integers(0, 20), st.booleans()), min_size=1, max_size=200)
)
def test_any_history_never_waits_twice_without_answer(
    history: list[tuple[bool, int, bool]],
) -> None:
    """After one wait without an answer there is no further wait until the next answer."""
    answer_rate, in_vain = AnswerRate(TICK_US), False
    for number, (is_answered, late, lockstep) in enumerate(history, 1):
        timeout_s = answer_rate.wait_timeout_s(number * TICK_US)
        assert 0.0 <= timeout_s <= ANSWER_TIMEOUT_S
        assert not (in_vain and timeout_s > 0.004 + 1e-9)
        if is_answered:
            answer_rate.record_answer(max(0, number - late) * TICK_US, number * TICK_US, lockstep)
            in_vain = False
        else:
            answer_rate.record_timeout(number * TICK_US)
            in_vain = timeout_s == ANSWER_TIMEOUT_S or (in_vain and timeout_s < ANSWER_TIMEOUT_S)
