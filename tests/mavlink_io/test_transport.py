"""Transports over real sockets and a real pseudo-terminal."""

import errno
import fcntl
import os
import resource
import socket
import threading
import time
import tty
from collections.abc import Iterator, Sequence
from contextlib import closing
from types import SimpleNamespace
from typing import Any

import pytest

from mavlink_io import dialect
from mavlink_io.codec import Framer, encode
from mavlink_io.transport import (
    SPIN_S,
    AddressError,
    LinkLostError,
    LockstepTransport,
    MemoryTransport,
    Piece,
    SerialTransport,
    TcpServer,
    Transport,
    base,
    open_transport,
    tcp,
    wait,
)
from mavlink_io.transport.tcp import ACCEPT_PAUSE_S, CLIENT_IDLE_S, MAX_CLIENTS, READ_BYTES

TIMEOUT_S = 10.0
SELECT_LIMIT = 1024
"""FD_SETSIZE of Linux: `select` accepts file descriptors below it."""


def free_port(kind: int = socket.SOCK_STREAM) -> int:
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def receive(transport: Transport) -> bytes:
    assert wait([transport], TIMEOUT_S) == [transport]
    return transport.receive()


def receive_from(server: TcpServer) -> Sequence[Piece]:
    assert wait([server], TIMEOUT_S) == [server]
    return server.receive_from()


@pytest.fixture
def server() -> Iterator[TcpServer]:
    with closing(TcpServer("tcpin:127.0.0.1:0", "127.0.0.1", 0)) as tcp:
        yield tcp


def client(server: TcpServer) -> Any:
    connection = closing(open_transport(f"tcp:127.0.0.1:{server.port}"))
    receive(server)
    return connection


def test_udp_server_sends_to_every_peer() -> None:
    port = free_port(socket.SOCK_DGRAM)
    with (
        closing(open_transport(f"udpin:127.0.0.1:{port}")) as vehicle,
        closing(open_transport(f"udpout:127.0.0.1:{port}")) as one,
        closing(open_transport(f"udpout:127.0.0.1:{port}")) as two,
    ):
        vehicle.send(b"to nobody yet")
        one.send(b"first")
        assert receive(vehicle) == b"first"
        two.send(b"second")
        assert receive(vehicle) == b"second"
        vehicle.send(b"to both")
        assert (receive(one), receive(two)) == (b"to both", b"to both")


def test_receive_without_data_is_empty() -> None:
    port = free_port(socket.SOCK_DGRAM)
    with closing(open_transport(f"udpin:127.0.0.1:{port}")) as transport:
        assert wait([transport], 0.0) == []
        assert transport.receive() == b""


def test_wait_returns_ready_transports() -> None:
    with (
        closing(open_transport("memory:a")) as a,
        closing(open_transport("memory:a")) as far_a,
        closing(open_transport("memory:b")) as b,
        closing(open_transport("memory:b")) as far_b,
    ):
        far_b.send(b"x")
        assert wait([a, b], TIMEOUT_S) == [b]
        far_a.send(b"y")
        assert wait([a, b], TIMEOUT_S) == [a, b]


@pytest.fixture
def one_core(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Restrict this thread to one core, from its first wait on."""
    usable = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {min(usable)})
    monkeypatch.setattr(base, "_mode", base._WaitMode())
    yield
    os.sched_setaffinity(0, usable)


def processor_time_of_eager_waits_s() -> float:
    """Return the CPU time of ten waits of 10 ms; polling for `SPIN_S` each takes up to 50 ms."""
    port = free_port(socket.SOCK_DGRAM)
    with closing(open_transport(f"udpin:127.0.0.1:{port}")) as transport:
        began_s = time.thread_time()
        for _ in range(10):
            assert wait([transport], 0.01, eager=True) == []
        return time.thread_time() - began_s


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="the system cannot restrict cores")
@pytest.mark.usefixtures("one_core")
def test_eager_wait_on_one_core_blocks() -> None:
    # Blocking takes about 20 us a wait, 0.2 ms in all; a fifth of what polling takes is far above.
    assert processor_time_of_eager_waits_s() < 0.2 * 10 * SPIN_S


@pytest.mark.usefixtures("one_core")
@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="the system cannot restrict cores")
def test_eager_wait_on_one_core_receives() -> None:
    with (
        closing(open_transport("memory:one")) as near,
        closing(open_transport("memory:one")) as far,
    ):
        timer = threading.Timer(0.02, far.send, [b"x"])
        timer.start()
        assert wait([near], TIMEOUT_S, eager=True) == [near]
        timer.join()


@pytest.mark.parametrize("cores", [1, 2])
def test_eager_read_of_a_datagram_waits_for_it(cores: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(base, "_has_several_cores", lambda: cores > 1)
    monkeypatch.setattr(base, "_mode", base._WaitMode())
    port = free_port(socket.SOCK_DGRAM)
    with (
        closing(open_transport(f"udpin:127.0.0.1:{port}")) as near,
        closing(open_transport(f"udpout:127.0.0.1:{port}")) as far,
    ):
        assert isinstance(near, LockstepTransport)
        near.eager = True
        began_s = time.monotonic()
        assert near.receive() == b""
        assert time.monotonic() - began_s >= 0.9 * SPIN_S
        timer = threading.Timer(0.2 * SPIN_S, far.send, [b"x"])
        timer.start()
        received = [near.receive() for _ in range(20)]
        timer.join()
    assert b"x" in received


def test_wait_does_not_poll_where_other_programs_want_the_core(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    now_s, preemptions = time.monotonic(), iter([0, 0, 1000, 1000])
    monkeypatch.setattr(base, "_has_several_cores", lambda: True)
    monkeypatch.setattr(base, "_preemptions", lambda: next(preemptions))
    monkeypatch.setattr(base, "_mode", base._WaitMode())
    decisions = []
    for passed_s in (0.5, 1.0, 1.5):
        monkeypatch.setattr(base, "wall_s", lambda passed_s=passed_s: now_s + passed_s)
        decisions.append(base._may_poll())
    assert decisions == [True, False, True]


@pytest.mark.skipif(not base._has_several_cores(), reason="needs two cores")
def test_eager_wait_on_two_cores_polls(monkeypatch: pytest.MonkeyPatch) -> None:
    polls: list[None] = []
    monkeypatch.setattr(base, "_yield_cpu", lambda: polls.append(None))
    monkeypatch.setattr(base, "_mode", base._WaitMode())
    processor_time_of_eager_waits_s()
    assert len(polls) > 10, "one poll would be no polling"


def test_tcp_server_sends_to_every_client(server: TcpServer) -> None:
    with client(server) as one, client(server) as two:
        server.send(b"to all")
        assert (receive(one), receive(two)) == (b"to all", b"to all")
        one.send(b"from one")
        assert receive(server) == b"from one"


def test_tcp_server_continues_after_client_leaves(server: TcpServer) -> None:
    with client(server):
        pass
    with client(server) as other:
        server.send(b"still here")
        assert receive(other) == b"still here"


def test_tcp_slow_reader_loses_nothing(server: TcpServer) -> None:
    blocks = [bytes([n % 256]) * 50_000 for n in range(400)]
    received = bytearray()
    with client(server) as ground:

        def read_slowly() -> None:
            while len(received) < 400 * 50_000:
                received.extend(receive(ground))

        reader = threading.Thread(target=read_slowly)
        reader.start()
        for block in blocks:
            server.send(block)
        reader.join(TIMEOUT_S)
    assert bytes(received) == b"".join(blocks)


def test_tcp_client_that_never_reads_is_disconnected() -> None:
    server = open_transport("tcpin:127.0.0.1:0", send_timeout_s=0.05)
    assert isinstance(server, TcpServer)
    with closing(server), client(server):
        for _ in range(200):
            server.send(bytes(100_000))
        assert len(server.handles()) == 1


def test_tcp_client_that_reads_late_is_at_most_two_megabytes_behind() -> None:
    # the limit: half a minute of telemetry; without a limit of its own the system takes 4 to 8 MB
    with (
        closing(TcpServer("tcpin:127.0.0.1:0", "127.0.0.1", 0, send_timeout_s=0.1)) as server,
        socket.create_connection(("127.0.0.1", server.port)),
    ):
        wait([server], TIMEOUT_S)
        server.receive()
        accepted = 0
        while server.newest is not None and accepted < 20_000_000:
            server.send(bytes(10_000))
            accepted += 10_000
        assert accepted < 2_000_000


def test_tcp_closed_server_raises_link_lost(server: TcpServer) -> None:
    with client(server) as ground:
        server.close()
        assert wait([ground], TIMEOUT_S) == [ground]
        with pytest.raises(LinkLostError, match=r"^tcp:127.0.0.1:\d+: closed by the other end$"):
            ground.receive()


@pytest.fixture
def serial_line() -> Iterator[tuple[int, SerialTransport]]:
    far, near = os.openpty()
    tty.setraw(near)
    device = os.ttyname(near)
    transport = open_transport(f"serial:{device}:57600")
    assert isinstance(transport, SerialTransport)
    with closing(transport):
        os.close(near)
        yield far, transport
    os.close(far)


def test_serial_line_transfers_every_byte(serial_line: tuple[int, SerialTransport]) -> None:
    far, transport = serial_line
    every = bytes(range(256))
    os.write(far, every)
    received = b""
    while len(received) < len(every):
        received += receive(transport)
    assert received == every
    transport.send(every)
    assert os.read(far, 4096) == every


def test_memory_pair_keeps_datagrams() -> None:
    with (
        closing(open_transport("memory:pair")) as one,
        closing(open_transport("memory:pair")) as two,
    ):
        assert isinstance(one, MemoryTransport)
        one.send(b"a")
        one.send(b"b")
        assert (two.receive(), two.receive(), two.receive()) == (b"a", b"b", b"")


@pytest.mark.parametrize(
    ("address", "complaint"),
    [
        ("", "expected udpin:HOST:PORT"),
        ("14550", "expected udpin:HOST:PORT"),
        ("udp:127.0.0.1:14550", "expected udpin:HOST:PORT"),
        ("udpin:14550", "expected udpin:HOST:PORT"),
        ("udpin:127.0.0.1:http", "'http' is no port number"),
        ("udpin:127.0.0.1:70000", "'70000' is no port number"),
        ("udpout:vehicle..example:14550", "'vehicle..example' is no host name"),
        ("tcpin:é..:5760", "'é..' is no host name"),
        ("serial:/dev/nothing:fast", "'fast' is no baud rate"),
        ("serial:/dev/nothing:0", "'0' is no baud rate"),
        ("serial:/dev/nothing:99999999999", "'99999999999' is no baud rate"),
        ("serial:/dev/nothing:57600", "/dev/nothing"),
        ("memory:", "expected udpin:HOST:PORT"),
    ],
)
def test_bad_address_raises_error_with_syntax(address: str, complaint: str) -> None:
    with pytest.raises(AddressError) as error:
        open_transport(address)
    assert repr(address) in str(error.value)
    assert complaint in str(error.value)


@pytest.fixture
def many_files() -> Iterator[None]:
    """Let this process have file descriptors that `select` refuses: 1,024 and above."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if hard != resource.RLIM_INFINITY and hard < SELECT_LIMIT + 100:
        pytest.skip(f"only {hard} files may be open here")
    resource.setrlimit(resource.RLIMIT_NOFILE, (max(soft, SELECT_LIMIT + 100), hard))
    yield
    resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))


class HighHandle:
    """A transport whose file descriptor is beyond those that `select` accepts."""

    def __init__(self, number: int) -> None:
        self.address, self._socket = "high", socket.socket(fileno=number)

    def handles(self) -> list[socket.socket]:
        return [self._socket]

    def send(self, data: bytes) -> None:
        self._socket.send(data)

    def receive(self) -> bytes:
        return self._socket.recv(100)

    def close(self) -> None:
        self._socket.close()


@pytest.mark.usefixtures("many_files")
def test_wait_handle_number_above_1023_is_ready_with_data() -> None:
    near, far = socket.socketpair()
    with closing(near), closing(far):
        number = fcntl.fcntl(far, fcntl.F_DUPFD_CLOEXEC, SELECT_LIMIT)
        with closing(HighHandle(number)) as high:
            assert wait([high], 0.0) == []
            near.send(b"data")
            assert wait([high], TIMEOUT_S, eager=True) == [high]


def connected(server: TcpServer, count: int) -> list[socket.socket]:
    sockets = [socket.create_connection(("127.0.0.1", server.port)) for _ in range(count)]
    for connection in sockets:
        connection.settimeout(TIMEOUT_S)
    return sockets


def test_tcp_server_keeps_the_first_clients_and_closes_the_rest(server: TcpServer) -> None:
    sockets = connected(server, MAX_CLIENTS + 20)
    receive(server)  # one call takes in all that wait
    server.send(b"to all")
    assert [s.recv(100) for s in sockets[:MAX_CLIENTS]] == [b"to all"] * MAX_CLIENTS
    assert [s.recv(100) for s in sockets[MAX_CLIENTS:]] == [b""] * 20
    sockets[0].close()
    receive(server)
    (late,) = connected(server, 1)  # room again
    receive(server)
    server.send(b"again")
    assert late.recv(100) == b"again"
    for each in (*sockets, late):
        each.close()


def test_idle_tcp_clients_give_way_to_new_ones(
    server: TcpServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    now_s = [100.0]
    monkeypatch.setattr(tcp, "wall_s", lambda: now_s[0])
    idle = connected(server, MAX_CLIENTS)
    receive(server)
    now_s[0] += CLIENT_IDLE_S + 1.0
    idle[0].send(b"here")
    receive(server)
    late = connected(server, 2)
    receive(server)
    server.send(b"to all")
    assert [s.recv(100) for s in (idle[0], *late)] == [b"to all"] * 3
    assert [s.recv(100) for s in idle[1:3]] == [b""] * 2
    for each in (*idle, *late):
        each.close()


def test_tcp_server_without_files_pauses_and_serves_its_clients(
    server: TcpServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    def accept() -> None:
        raise OSError(errno.EMFILE, "Too many open files")

    now_s = [0.0]
    monkeypatch.setattr("mavlink_io.transport.tcp.wall_s", lambda: now_s[0])
    (first,) = connected(server, 1)
    receive(server)
    real = server._listener
    monkeypatch.setattr(server, "_listener", SimpleNamespace(accept=accept))
    second = socket.create_connection(real.getsockname())
    server.receive()
    assert len(server.handles()) == 1  # the listener is not watched: it would be ready for ever
    first.send(b"still here")
    assert wait([server], TIMEOUT_S) == [server]
    assert server.receive() == b"still here"
    monkeypatch.setattr(server, "_listener", real)
    now_s[0] = ACCEPT_PAUSE_S
    receive(server)
    assert len(server.handles()) == 3
    first.close()
    second.close()


def test_tcp_server_partial_frame_keeps_other_client(server: TcpServer) -> None:
    heartbeat = encode(dialect.by_name("HEARTBEAT"), (0, 6, 8, 0, 0, 3), 0, 255, 190)
    slow, quick = connected(server, 2)
    receive(server)
    framer, counts = Framer(), []
    for sender, data in ((slow, heartbeat[:7]), (quick, heartbeat), (slow, heartbeat[7:])):
        sender.send(data)
        assert wait([server], TIMEOUT_S) == [server]
        counts.append(sum(len(framer.feed(part, peer)) for peer, part in server.receive_from()))
    assert (counts, framer.rejected_frames) == ([0, 1, 1], 0)
    slow.close()
    quick.close()


def test_tcp_server_reads_a_bounded_amount_and_loses_nothing(server: TcpServer) -> None:
    heartbeat = encode(dialect.by_name("HEARTBEAT"), (0, 6, 8, 0, 0, 3), 0, 255, 190)
    count = 3 * READ_BYTES // len(heartbeat)
    senders = connected(server, 2)
    receive(server)
    for sender in senders:
        sender.sendall(count * heartbeat)
    framer, frames = Framer(), 0
    while frames < 2 * count:
        assert wait([server], TIMEOUT_S) == [server]
        pieces = server.receive_from()
        assert sum(len(data) for _, data in pieces) <= READ_BYTES
        frames += sum(len(framer.feed(data, peer)) for peer, data in pieces)
    assert (frames, framer.rejected_frames) == (2 * count, 0)
    for sender in senders:
        sender.close()


def test_tcp_port_in_use_raises_address_error(server: TcpServer) -> None:
    with pytest.raises(AddressError, match="in use"):
        open_transport(f"tcpin:127.0.0.1:{server.port}")
