"""The socket as compiled code uses it: who has sent, what is lost, how long a read waits."""

import socket
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import pytest

from mavlink_io import jit, lockstep_socket
from mavlink_io.clock import wall_s
from mavlink_io.endpoint import Endpoint
from mavlink_io.lockstep_socket import compiled_socket
from mavlink_io.transport import SPIN_S, UdpClient, UdpTransport

pytestmark = pytest.mark.skipif(not jit.COMPILED, reason="only compiled code calls it")


class Calls(NamedTuple):
    """The functions, compiled."""

    receive: Callable[[Any, Any, float], int]
    send: Callable[[Any, Any, int], None]


@pytest.fixture(scope="module")
def calls() -> Calls:
    @jit.entry_point
    def receive(link: jit.Native, memory: Any, spin_s: float) -> int:
        return lockstep_socket.receive(link.value, memory, spin_s)

    @jit.entry_point
    def send(link: jit.Native, memory: Any, length: int) -> None:
        lockstep_socket.send(link.value, memory, length)

    return Calls(receive, send)


@pytest.fixture
def server() -> Iterator[UdpTransport]:
    transport = UdpTransport("udpin", "127.0.0.1", 0)
    yield transport
    transport.close()


@pytest.fixture
def client(server: UdpTransport) -> Iterator[UdpClient]:
    transport = UdpClient("udpout", *server.handles()[0].getsockname())
    yield transport
    transport.close()


@pytest.mark.parametrize("spin_s", [0.0, SPIN_S])
def test_datagrams_pass_both_ways(
    calls: Calls, server: UdpTransport, client: UdpClient, spin_s: float
) -> None:
    client.send(b"first")
    assert server.receive() == b"first"
    near, far = (
        compiled_socket(peer).native for peer in (server.peer(), client.peer()) if peer is not None
    )
    memory, answer = jit.octets(100), jit.octets(100)
    client.send(b"sample")
    length = calls.receive(near, memory, spin_s)
    assert bytes(memory[:length]) == b"sample"
    calls.send(near, memory, 4)
    length = calls.receive(far, answer, spin_s)
    assert bytes(answer[:length]) == b"samp"
    calls.send(far, answer, 2)
    assert server.receive() == b"sa"


@pytest.mark.parametrize("spin_s", [0.0, SPIN_S])
def test_read_without_a_datagram_ends(calls: Calls, client: UdpClient, spin_s: float) -> None:
    peer = client.peer()
    assert peer is not None
    started_s = wall_s()
    assert calls.receive(compiled_socket(peer).native, jit.octets(10), spin_s) == 0
    assert wall_s() - started_s >= 0.5 * SPIN_S


def test_datagram_of_a_stranger_is_left_to_python(
    calls: Calls, server: UdpTransport, client: UdpClient
) -> None:
    endpoint = Endpoint(server, 1, 1)
    client.send(b"first")
    server.receive()
    peer = endpoint.peer()
    assert peer is not None
    own, memory = compiled_socket(peer), jit.octets(100)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        stranger.sendto(b"hello", server.handles()[0].getsockname())
        received = calls.receive(own.native, memory, 0.0)
        assert received == -5
        own.return_rest(endpoint, memoryview(memory), received)
        assert endpoint.has_unread
        assert endpoint.peer() is None, "with two peers there is no compiled exchange"
        server.send(b"to all")
        assert stranger.recv(100) == b"to all"


def test_refused_datagram_does_not_lose_the_next_one(calls: Calls) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as late:
        late.bind(("127.0.0.1", 0))
        address = late.getsockname()
    client = UdpClient("udpout", *address)
    peer = client.peer()
    assert peer is not None
    native, memory = compiled_socket(peer).native, jit.octets(10)
    calls.send(native, memory, 3)  # nobody listens: the system reports it at the next call
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as listener:
        listener.bind(address)
        listener.settimeout(5.0)
        calls.send(native, memory, 7)
        assert len(listener.recv(100)) == 7
    client.close()
