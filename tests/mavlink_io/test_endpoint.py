"""Ids, sequence numbers and loss counts of an endpoint."""

from itertools import pairwise

from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import all as mavlink

from mavlink_io import dialect
from mavlink_io.codec import encode
from mavlink_io.endpoint import Endpoint

HEARTBEAT = dialect.by_name("HEARTBEAT")
VALUES = (0, 12, 0, 1, 3, 3)


class Inbox:
    """A transport that has received the given datagrams."""

    address = "test"

    def __init__(self, *datagrams: bytes) -> None:
        self._datagrams = list(datagrams)
        self.sent: list[bytes] = []

    def handles(self) -> tuple[()]:
        return ()

    def send(self, data: bytes) -> None:
        self.sent.append(data)

    def receive(self) -> bytes:
        return self._datagrams.pop(0) if self._datagrams else b""

    def close(self) -> None:
        pass


def test_endpoint_send_has_own_ids_and_sequence() -> None:
    inbox = Inbox()
    endpoint = Endpoint(inbox, 42, 190)
    for _ in range(300):
        endpoint.send(
            "HEARTBEAT",
            type=12,
            autopilot=0,
            base_mode=1,
            custom_mode=0,
            system_status=3,
            mavlink_version=3,
        )
    received = mavlink.MAVLink(None).parse_buffer(b"".join(inbox.sent))
    assert {(m.get_srcSystem(), m.get_srcComponent(), m.type) for m in received} == {(42, 190, 12)}
    sequences = [m.get_seq() for m in received]
    assert all((b - a) % 256 == 1 for a, b in pairwise(sequences))


@given(st.lists(st.booleans(), min_size=2, max_size=600))
def test_endpoint_counts_lost_frames_by_gaps(arrives: list[bool]) -> None:
    arrives[0] = arrives[-1] = True
    frames = [encode(HEARTBEAT, VALUES, n % 256, 1, 1) for n in range(len(arrives))]
    endpoint = Endpoint(Inbox(*(f for f, a in zip(frames, arrives, strict=True) if a)), 255, 190)
    received = sum(len(endpoint.receive()) for _ in frames)
    assert received == sum(arrives)
    longest_gap = max(len(gap) for gap in "".join("1" if a else "0" for a in arrives).split("1"))
    if longest_gap < 256:
        assert endpoint.lost_frames == len(arrives) - sum(arrives)


def test_endpoint_counts_lost_frames_per_sender() -> None:
    senders = [(1, 1, 7), (2, 1, 90), (1, 1, 8), (2, 1, 91), (1, 1, 11)]
    data = b"".join(
        encode(HEARTBEAT, VALUES, n, system, component) for system, component, n in senders
    )
    endpoint = Endpoint(Inbox(data), 255, 190)
    assert len(endpoint.receive()) == 5
    assert endpoint.lost_frames == 2


def test_endpoint_counts_rejected_frames() -> None:
    broken = bytearray(encode(HEARTBEAT, VALUES, 0, 1, 1))
    broken[-1] ^= 1
    endpoint = Endpoint(Inbox(bytes(broken) + bytes(300)), 255, 190)
    assert endpoint.receive() == []
    assert endpoint.rejected_frames == 1
