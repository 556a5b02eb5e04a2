"""Several clients on one ``tcpin`` or ``udpin`` link: each has its own stream of bytes."""

import socket
from collections.abc import Hashable, Iterator
from contextlib import closing

import pytest

from mavlink_io import dialect
from mavlink_io.codec import MAX_PARTIAL_STREAMS, Framer, encode
from mavlink_io.endpoint import Endpoint
from mavlink_io.transport import TcpServer, Transport, open_transport, wait

HEARTBEAT = dialect.by_name("HEARTBEAT")
VALUES = (0, 12, 0, 1, 3, 3)


def frame(sequence: int, system: int) -> bytes:
    return encode(HEARTBEAT, VALUES, sequence, system, 1)


def systems(endpoint: Endpoint) -> list[int]:
    """Return the systems received within the time; [] if none."""
    received_systems: list[int] = []
    while wait([endpoint.transport], 0.05 if received_systems else 0.3):
        received_systems += [received.system for received in endpoint.receive()]
    return received_systems


@pytest.fixture(params=["tcpin", "udpin"])
def shared(request: pytest.FixtureRequest) -> Iterator[tuple[Endpoint, list[Transport]]]:
    """A vehicle's endpoint, and two clients of its one link."""
    kind = socket.SOCK_STREAM if request.param == "tcpin" else socket.SOCK_DGRAM
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind(("127.0.0.1", 0))
        where = f"127.0.0.1:{probe.getsockname()[1]}"
    out = "tcp" if request.param == "tcpin" else "udpout"
    with (
        closing(open_transport(f"{request.param}:{where}")) as server,
        closing(open_transport(f"{out}:{where}")) as one,
        closing(open_transport(f"{out}:{where}")) as two,
    ):
        endpoint = Endpoint(server, 1, 1)
        for system, client in ((11, one), (12, two)):
            client.send(frame(0, system))
        assert sorted(systems(endpoint)) == [11, 12]
        yield endpoint, [one, two]


def test_shared_link_half_frame_of_one_client_leaves_the_other(
    shared: tuple[Endpoint, list[Transport]],
) -> None:
    endpoint, (one, two) = shared
    half = frame(1, 11)[:10]
    one.send(half)
    assert systems(endpoint) == []
    for sequence in range(1, 4):
        two.send(frame(sequence, 12))
        assert systems(endpoint) == [12]
    one.send(frame(1, 11)[10:])
    assert systems(endpoint) == [11]
    assert endpoint.rejected_frames == endpoint.skipped_bytes == 0


def test_shared_link_frames_split_by_turns_all_arrive(
    shared: tuple[Endpoint, list[Transport]],
) -> None:
    """The datagrams are cut anywhere, as by two serial-to-UDP bridges."""
    endpoint, (one, two) = shared
    first, second = frame(1, 11) + frame(2, 11), frame(1, 12) + frame(2, 12)
    received_systems = []
    for start in range(0, len(first), 7):
        one.send(first[start : start + 7])
        two.send(second[start : start + 7])
        received_systems += systems(endpoint)
    assert sorted(received_systems) == [11, 11, 12, 12]


def test_tcp_disconnected_client_leaves_no_partial_frame() -> None:
    with closing(TcpServer("tcpin:127.0.0.1:0", "127.0.0.1", 0)) as server:
        endpoint = Endpoint(server, 1, 1)
        with closing(open_transport(f"tcp:127.0.0.1:{server.port}")) as client:
            client.send(frame(0, 11)[:10])
            assert systems(endpoint) == []
            assert endpoint.partial_streams == 1
        assert systems(endpoint) == []
        assert endpoint.partial_streams == 0


class Crowd:
    """A transport on which every piece comes from its own peer."""

    address = "crowd"

    def __init__(self) -> None:
        self.pieces: list[tuple[Hashable, bytes]] = []

    def handles(self) -> tuple[()]:
        return ()

    def send(self, data: bytes) -> None:
        pass

    def receive(self) -> bytes:
        raise AssertionError("bytes of several peers must not be mixed")

    def receive_from(self) -> list[tuple[Hashable, bytes]]:
        pieces, self.pieces = self.pieces, []
        return pieces

    def close(self) -> None:
        pass


def test_framer_partial_frame_flood_keeps_busy_stream() -> None:
    crowd = Crowd()
    endpoint = Endpoint(crowd, 1, 1)
    whole = frame(0, 11)
    for start in range(len(whole)):
        crowd.pieces.append(("bridge", whole[start : start + 1]))
        crowd.pieces += [((start, port), whole[:10]) for port in range(MAX_PARTIAL_STREAMS - 1)]
    assert [received.system for received in endpoint.receive()] == [11]
    assert endpoint.partial_streams <= MAX_PARTIAL_STREAMS


def test_framer_streams_do_not_mix() -> None:
    framer, first, second = Framer(), frame(0, 11), frame(0, 12)
    assert framer.feed(first[:9], "a") == framer.feed(second[:12], "b") == []
    assert [f.system for f in framer.feed(second[12:], "b")] == [12]
    assert [f.system for f in framer.feed(first[9:], "a")] == [11]
    framer.feed(first[:9], "a")
    framer.forget("a")
    assert [f.system for f in framer.feed(first, "a")] == [11]
    assert framer.skipped_bytes == 0
