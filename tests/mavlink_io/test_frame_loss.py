"""Gaps in the sequence numbers are lost frames, except where the sender restarts."""

import pytest

from mavlink_io import dialect
from mavlink_io.frame_loss import FrameLoss

HEARTBEAT, ATTITUDE = dialect.by_name("HEARTBEAT"), dialect.by_name("ATTITUDE")


def attitude(time_ms: int) -> bytes:
    """Return the payload of a message with a time, without the zeros at its end as on the link."""
    return time_ms.to_bytes(4, "little").rstrip(b"\0") or b"\0"


def lost(frames: list[tuple[int, int | None]]) -> int:
    """Return the count for sequence numbers and times (ms) of frames; None is a heartbeat."""
    loss = FrameLoss()
    for sequence, time_ms in frames:
        if time_ms is None:
            loss.count(sequence, HEARTBEAT.message_id, b"")
        else:
            loss.count(sequence, ATTITUDE.message_id, attitude(time_ms))
    return loss.lost


def test_gaps_are_counted_across_the_wrap() -> None:
    assert lost([(254, None), (255, None), (0, None), (3, None)]) == 2


@pytest.mark.parametrize("first_time", [0, 1, 2])
def test_restart_is_no_loss(first_time: int) -> None:
    """`ground live` showed 255 lost frames: the vehicle began again with number 0, after 0."""
    before = [(k & 0xFF, 50_000 + 20 * k) for k in range(257)]
    after: list[tuple[int, int | None]] = [(k, None) for k in range(first_time)]
    after += [(k, 20 * k) for k in range(first_time, first_time + 10)]
    assert lost([*before, *after]) == 0


def test_losses_before_and_after_a_restart_remain() -> None:
    before = [(0, 50_000), (5, 50_020), (6, 50_040)]
    after = [*((k, 20 * k) for k in range(5)), (10, 300), (11, 320)]
    assert lost([*before, *after]) == 4 + 5


def test_impossible_time_of_one_frame_is_no_restart() -> None:
    assert lost([(0, 50_000), (5, 50_020), (7, 3), (8, 50_060)]) == 4 + 1


def test_late_frame_is_no_restart() -> None:
    assert lost([(0, 50_000), (2, 50_040), (1, 50_020), (2, 50_040)]) == 0


@pytest.mark.parametrize(
    ("numbers", "expected"),
    [
        ([0, 2, 1, 3], 0),  # two were swapped
        ([254, 0, 255, 1], 0),  # across the wrap
        ([0, 1, 1, 2], 0),  # one arrived twice
        ([0, 2, 1, 1, 3], 0),
        ([0, 4, 1, 5], 2),  # one of three arrived late
        ([0, 0, 0], 0),  # a sender that does not count
        ([0, 200, 201], 199),
    ],
)
def test_late_or_repeated_frame_is_not_lost(numbers: list[int], expected: int) -> None:
    """Before, two swapped frames counted 1 + 254 + 1 lost ones, and a repeated one 255."""
    assert lost([(number, None) for number in numbers]) == expected
    assert lost([(number, 50_000 + 20 * number) for number in numbers]) == expected


@pytest.mark.parametrize("last", [4, 20, 40, 200])
def test_restart_at_a_lower_number_is_no_loss(last: int) -> None:
    """The frames of the new start are no late ones of the old one, of which 2 were lost."""
    before = [(k, 50_000 + 20 * k) for k in range(last) if k not in (1, 2)]
    after = [(k, 20 * k) for k in range(10)]
    assert lost([*before, *after, (12, 240), (13, 260)]) == 2 + 2
