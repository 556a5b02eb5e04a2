"""Late frames of a sender are recognised; senders that start again or do not count are not."""

from mavlink_io.frame_order import MAX_FRAMES_LATE, MAX_LATE_S, FrameCounter, FrameOrder


def late(numbers: list[int], step_s: float = 0.01) -> list[bool]:
    order = FrameOrder()
    return [order.is_late(number, step * step_s) for step, number in enumerate(numbers)]


def test_delayed_frames_are_late_across_the_wrap() -> None:
    assert late([254, 255, 1, 0, 255, 2]) == [False, False, False, True, True, False]


def test_lost_frames_make_no_frame_late() -> None:
    assert late([3, 150, 20]) == [False, False, False]


def test_sender_that_does_not_count_has_no_late_frames() -> None:
    assert late([0, 0, 0]) == [False, False, False]


def test_sender_that_starts_again_is_accepted_after_a_while() -> None:
    assert late([MAX_FRAMES_LATE, 0], step_s=0.5 * MAX_LATE_S) == [False, True]
    assert late([MAX_FRAMES_LATE, 0], step_s=MAX_LATE_S) == [False, False]


def test_sender_that_starts_again_is_recognised_though_it_sent_until_now() -> None:
    """Before, each frame of a long exchange put off the time from which a new start counts."""
    numbers = [*range(MAX_FRAMES_LATE), 0, 1, 2]
    assert late(numbers, step_s=MAX_LATE_S / 16) == [False] * len(numbers)


def test_frame_is_late_until_the_first_that_overtook_it_is_too_old() -> None:
    order = FrameOrder()
    assert [order.is_late(number, now_s) for number, now_s in ((7, 0.0), (9, 1.5), (8, 3.4))] == [
        False,
        False,
        True,  # 9 came 1.9 s before
    ]
    assert not order.is_late(8, 3.5)


def test_positions_follow_the_order_of_sending_across_the_wrap() -> None:
    counter = FrameCounter()
    positions = [counter.position(number) for number in (254, 255, 1, 0, 100, 220, 120)]
    assert positions == [254, 255, 257, 256, 356, 476, 376]
