"""UDP peers over real sockets: accepted senders, and missing or restarted peers."""

import socket
import time
from collections.abc import Iterator
from contextlib import ExitStack, closing

import pytest

from mavlink_io.transport import Transport, UdpTransport, open_transport, wait
from mavlink_io.transport.udp import MAX_PEERS

TIMEOUT_S = 10.0
SILENCE_S = 0.1
"""Loopback delivers within microseconds; a datagram that is missing after it was dropped."""


def udp_socket(port: int = 0) -> socket.socket:
    bound = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    bound.bind(("127.0.0.1", port))
    bound.settimeout(TIMEOUT_S)
    return bound


def port_of(bound: socket.socket) -> int:
    return int(bound.getsockname()[1])


def receive(transport: Transport, within_s: float = TIMEOUT_S) -> bytes:
    """Return the data received within the time; a socket may be ready for an error alone."""
    deadline_s = time.monotonic() + within_s
    while (left_s := deadline_s - time.monotonic()) > 0.0:
        if wait([transport], left_s) and (data := transport.receive()):
            return data
    return b""


@pytest.fixture
def ground() -> Iterator[socket.socket]:
    with udp_socket() as bound:
        yield bound


@pytest.fixture
def vehicle(ground: socket.socket) -> Iterator[Transport]:
    with closing(open_transport(f"udpout:127.0.0.1:{port_of(ground)}")) as transport:
        yield transport


def learn_port(vehicle: Transport, ground: socket.socket) -> tuple[str, int]:
    """Return the address that the vehicle sends from."""
    vehicle.send(b"telemetry")
    data, address = ground.recvfrom(100)
    assert data == b"telemetry"
    return str(address[0]), int(address[1])


def test_udpout_stranger_to_its_port_is_never_received(
    vehicle: Transport, ground: socket.socket
) -> None:
    address = learn_port(vehicle, ground)
    with udp_socket() as stranger:
        stranger.sendto(b"arm", address)
        assert receive(vehicle, SILENCE_S) == b""
        vehicle.send(b"more")
        assert ground.recv(100) == b"more"
        stranger.settimeout(SILENCE_S)
        with pytest.raises(TimeoutError):
            stranger.recv(100)


def test_udpout_listens_on_the_interface_of_its_peer_only(
    vehicle: Transport, ground: socket.socket
) -> None:
    learn_port(vehicle, ground)
    (handle,) = vehicle.handles()
    assert handle.getsockname()[0] == "127.0.0.1"


def test_udpout_peer_that_answers_from_its_port_is_received(
    vehicle: Transport, ground: socket.socket
) -> None:
    ground.sendto(b"heartbeat", learn_port(vehicle, ground))
    assert receive(vehicle) == b"heartbeat"


def test_udpout_peer_that_starts_late_and_restarts_is_reached() -> None:
    """The kernel reports ECONNREFUSED without a listener; later datagrams must not be lost."""
    with udp_socket() as reserved:
        port = port_of(reserved)
    with closing(open_transport(f"udpout:127.0.0.1:{port}")) as vehicle:
        for _ in range(2):
            for _ in range(3):
                vehicle.send(b"to nobody")
                assert receive(vehicle, 0.01) == b""
            vehicle.send(b"refused when the next is sent")
            with udp_socket(port) as ground:
                address = learn_port(vehicle, ground)
                ground.sendto(b"heartbeat", address)
                assert receive(vehicle) == b"heartbeat"


def test_udpout_host_name_is_resolved_to_its_ipv4_address(ground: socket.socket) -> None:
    with closing(open_transport(f"udpout:localhost:{port_of(ground)}")) as vehicle:
        ground.sendto(b"heartbeat", learn_port(vehicle, ground))
        assert receive(vehicle) == b"heartbeat"


def test_udpout_without_a_network_waits_for_one(
    ground: socket.socket, monkeypatch: pytest.MonkeyPatch
) -> None:
    """connect() fails without a route (ENETUNREACH), as before the network is up."""
    up = [False]
    connect = socket.socket.connect

    def connect_when_up(self: socket.socket, address: tuple[str, int]) -> None:
        if not up[0]:
            raise OSError(101, "Network is unreachable")
        connect(self, address)

    monkeypatch.setattr(socket.socket, "connect", connect_when_up)
    monkeypatch.setattr("mavlink_io.transport.udp.RECONNECT_S", 0.0)
    with closing(open_transport(f"udpout:127.0.0.1:{port_of(ground)}")) as vehicle:
        vehicle.send(b"lost")
        assert vehicle.handles() == ()
        up[0] = True
        ground.sendto(b"heartbeat", learn_port(vehicle, ground))
        assert receive(vehicle) == b"heartbeat"


def test_udpin_datagrams_have_their_peer() -> None:
    with udp_socket() as reserved:
        port = port_of(reserved)
    with (
        closing(open_transport(f"udpin:127.0.0.1:{port}")) as vehicle,
        udp_socket() as one,
        udp_socket() as two,
    ):
        assert isinstance(vehicle, UdpTransport)
        for sender, data in ((one, b"1"), (two, b"2"), (one, b"3")):
            sender.sendto(data, ("127.0.0.1", port))
        pieces = [piece for _ in range(3) for piece in vehicle.receive_from()]
        assert [data for _, data in pieces] == [b"1", b"2", b"3"]
        first, second, third = (peer for peer, _ in pieces)
        assert first == third != second
        assert list(vehicle.receive_from()) == []


def test_udpin_flood_of_peers_is_bounded_and_keeps_those_it_has() -> None:
    with udp_socket() as reserved:
        port = port_of(reserved)
    with (
        closing(open_transport(f"udpin:127.0.0.1:{port}")) as vehicle,
        udp_socket() as ground,
        ExitStack() as flood,
    ):
        ground.sendto(b"first", ("127.0.0.1", port))
        assert receive(vehicle) == b"first"
        accepted = 0
        for _ in range(2 * MAX_PEERS):
            # All stay open: the system may give the port of a closed one to the next.
            stranger = flood.enter_context(udp_socket())
            stranger.sendto(b"x", ("127.0.0.1", port))
            accepted += bool(receive(vehicle, SILENCE_S / 10))
        assert accepted == MAX_PEERS - 1
        vehicle.send(b"telemetry")
        assert ground.recv(100) == b"telemetry"
        ground.sendto(b"again", ("127.0.0.1", port))
        assert receive(vehicle) == b"again"
