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
    assert lost([(0, 50_000), (2, 50_040), (1, 50_020), (2, 50_040)]) == 1 + 254
