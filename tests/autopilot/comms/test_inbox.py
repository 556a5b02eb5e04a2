"""Received frames are served in turn by sender, in order within each sender."""

from hypothesis import given
from hypothesis import strategies as st

from autopilot.comms.inbox import MAX_SENDER_FRAMES, MAX_SENDERS, Inbox
from mavlink_io.codec import Frame


def frame(system: int, number: int) -> Frame:
    return Frame(system, 1, 0, number, b"", b"")


def test_flood_of_one_sender_delays_others_by_one_frame() -> None:
    inbox = Inbox()
    for number in range(MAX_SENDER_FRAMES + 100):
        inbox.add("flood", frame(9, number))
    inbox.add("operator", frame(255, 0))
    assert inbox.dropped == 100
    assert 255 in (inbox.pop().system, inbox.pop().system)


def test_many_senders_of_one_peer_share_a_queue() -> None:
    inbox = Inbox()
    for system in range(250):
        inbox.add("flood", frame(system, 0))
    inbox.add("operator", frame(255, 0))
    served = [inbox.pop().system for _ in range(MAX_SENDERS + 2)]
    assert 255 in served
    assert len(inbox) == 251 - len(served)


@given(st.lists(st.tuples(st.integers(1, 5), st.integers(1, 5))))
def test_frames_of_a_sender_stay_in_order_and_none_is_lost(sent: list[tuple[int, int]]) -> None:
    inbox = Inbox()
    frames = [(peer, frame(system, number)) for number, (peer, system) in enumerate(sent)]
    for peer, received in frames:
        inbox.add(peer, received)
    popped = []
    while inbox:
        popped.append(inbox.pop())
    assert sorted(f.sequence for f in popped) == list(range(len(sent)))
    for pair in set(sent):
        numbers = [n for n, each in enumerate(sent) if each == pair]
        assert [f.sequence for f in popped if f.sequence in numbers] == numbers
    assert not inbox._senders
