"""Server of the live page: names, headers, and browsers that do not read."""

import contextlib
import http.client
import json
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import closing

import pytest

from ground.live.page import connections, server
from ground.live.page.page_state import PageState
from ground.live.page.server import PageServer
from mavlink_io.errors import InputError
from tests.ground.live.page.telemetry import frame, heartbeat, motion
from tests.helpers.subprocesses import wait_for

START_S, LAST_S = 400.0, 430.0
WHOLE_REQUEST = b"GET /icon.svg HTTP/1.1\r\nHost: localhost\r\n\r\n"
BUFFER_BYTES = 8192
"""Size of the buffers in the kernel: the history of `START_S` does not fit into them."""


@pytest.fixture(scope="module")
def state() -> PageState:
    return PageState()


@pytest.fixture(scope="module")
def port(state: PageState) -> Iterator[int]:
    listener = server.listen(port=None)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, BUFFER_BYTES)
    with PageServer(state, listener):
        yield listener.getsockname()[1]


@pytest.fixture
def unused_port() -> Iterator[int]:
    """Port of a server that no other test has connected to."""
    with PageServer(PageState(), listener := server.listen(port=None)):
        yield listener.getsockname()[1]


def get(port: int, path: str, host: str | None = None) -> http.client.HTTPResponse:
    with closing(http.client.HTTPConnection("127.0.0.1", port)) as connection:
        connection.request("GET", path, headers={"Host": host} if host else {})
        response = connection.getresponse()
        response.read()
        return response


@pytest.mark.parametrize(
    ("host", "status"),
    [
        ("127.0.0.1:8750", 200),
        ("localhost", 200),
        ("LOCALHOST:1", 200),
        ("[::1]:8750", 200),
        ("192.168.1.20", 200),
        ("rebound.example:8750", 400),
        ("127.0.0.1.rebound.example", 400),
        ("localhost.rebound.example", 400),
        ("", 400),
    ],
)
def test_request_under_a_foreign_name_is_refused(port: int, host: str, status: int) -> None:
    assert get(port, "/", host or " ").status == status
    if status == 400:
        assert get(port, "/events", host or " ").status == status


def test_page_allows_its_own_server_only(port: int) -> None:
    policy = get(port, "/").headers["Content-Security-Policy"]
    assert "default-src 'none'" in policy
    assert "http" not in policy


def test_unknown_path_and_other_method_are_refused(port: int) -> None:
    assert get(port, "/../server.py").status == 404
    with closing(http.client.HTTPConnection("127.0.0.1", port)) as connection:
        connection.request("POST", "/events", b"{}")
        assert connection.getresponse().status == 405


def test_stopped_browser_does_not_delay_another(port: int, state: PageState) -> None:
    """A browser that reads nothing is sent more than its buffers take; another gets every row."""
    with state.dive("dive") as dive:
        for tick in range(int(10 * START_S)):
            dive.on_frame(frame("ATTITUDE", time_boot_ms=100 * tick))
    stopped = socket.socket()
    stopped.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, BUFFER_BYTES)
    stopped.connect(("127.0.0.1", port))
    stopped.sendall(b"GET /events HTTP/1.1\r\nHost: localhost\r\n\r\n")
    stop = threading.Event()

    def fly() -> None:
        time_s = START_S
        while not stop.wait(0.01):
            with state.dive("dive") as dive:
                dive.on_frame(heartbeat())
                for received in motion(time_s):
                    dive.on_frame(received)
            time_s += 0.1

    flight = threading.Thread(target=fly)
    flight.start()
    try:
        with closing(http.client.HTTPConnection("127.0.0.1", port)) as connection:
            connection.request("GET", "/events")
            response, times_s = connection.getresponse(), list[float]()
            while not times_s or times_s[-1] < LAST_S:
                line = response.readline()
                if line.startswith(b"data: "):
                    times_s += [row[0] for row in json.loads(line[6:]).get("rows", [])]
            response.close()
    finally:
        stop.set()
        flight.join()
        stopped.close()
    assert times_s == sorted(set(times_s))


def is_closed(connection: socket.socket) -> bool:
    """Return whether the server has closed a connection within two seconds."""
    connection.settimeout(2.0)
    try:
        return connection.recv(1) == b""
    except ConnectionError:
        return True
    except TimeoutError:
        return False


@pytest.mark.parametrize("request_part", [b"", b"GET / HTTP/1.1\r\nHost: ", WHOLE_REQUEST])
def test_connection_without_a_request_is_closed(
    port: int, monkeypatch: pytest.MonkeyPatch, request_part: bytes
) -> None:
    """Before, it stayed open for ever, and so did one whose next request came in small parts."""
    monkeypatch.setattr(connections, "REQUEST_TIMEOUT_S", 0.3)
    with socket.create_connection(("127.0.0.1", port)) as idle:
        idle.sendall(request_part)
        with contextlib.suppress(ConnectionError):
            for _ in range(6):
                idle.sendall(b"x")
                time.sleep(0.1)
        idle.settimeout(2.0)
        with contextlib.suppress(ConnectionError):
            while idle.recv(65536):
                pass


def test_stream_of_events_outlives_the_time_limit(
    port: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(connections, "REQUEST_TIMEOUT_S", 0.1)
    with socket.create_connection(("127.0.0.1", port)) as stream:
        stream.sendall(b"GET /events HTTP/1.1\r\nHost: localhost\r\n\r\n")
        time.sleep(0.5)
        stream.settimeout(0.0)
        with contextlib.suppress(BlockingIOError):
            while stream.recv(65536):
                pass
        assert stream.send(b"x") == 1
        assert not is_closed(stream)


def open_stream(port: int) -> socket.socket:
    """Return a connection that is sent events."""
    stream = socket.create_connection(("127.0.0.1", port))
    stream.sendall(b"GET /events HTTP/1.1\r\nHost: localhost\r\n\r\n")
    assert stream.recv(12) == b"HTTP/1.1 200"
    return stream


def test_many_idle_connections_give_way_to_a_browser(
    unused_port: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(connections, "MAX_CONNECTIONS", 4)
    with contextlib.ExitStack() as opened:
        for _ in range(3):
            opened.enter_context(open_stream(unused_port))
        idle = [
            opened.enter_context(socket.create_connection(("127.0.0.1", unused_port)))
            for _ in range(3)
        ]
        assert [is_closed(one) for one in idle[:2]] == [True, True]
        assert get(unused_port, "/").status == 200
        assert is_closed(idle[2])
        opened.enter_context(open_stream(unused_port))
        refused = opened.enter_context(socket.create_connection(("127.0.0.1", unused_port)))
        assert is_closed(refused)


def test_streams_whose_browsers_have_left_make_room(
    unused_port: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Before, those that had sent a part of a next request stayed until there was news."""
    monkeypatch.setattr(connections, "MAX_CONNECTIONS", 4)
    monkeypatch.setattr(server, "SILENCE_S", 0.2)

    def is_answered() -> bool:
        with contextlib.suppress(ConnectionError):
            return get(unused_port, "/").status == 200
        return False

    with contextlib.ExitStack() as opened:
        for _ in range(4):
            opened.enter_context(open_stream(unused_port)).sendall(b"G")
        time.sleep(0.3)
        with pytest.raises(ConnectionError):
            get(unused_port, "/")
    wait_for(is_answered)


def test_port_in_use_is_an_input_error(port: int) -> None:
    with pytest.raises(InputError, match=f"--port {port}"):
        server.listen(port=port)


@pytest.mark.parametrize("host", ["", "ü..x", "256.0.0.1"])
def test_host_that_is_none_is_an_input_error(host: str) -> None:
    """An empty one, as of a variable that is not set, would show the page to the network."""
    with pytest.raises(InputError, match=f"--host '?{host}.*give an address of this machine"):
        server.listen(host, 0)


def test_default_port_in_use_gives_another() -> None:
    with server.listen() as first, server.listen() as second:
        assert first.getsockname()[1] != second.getsockname()[1]
        assert first.getsockname()[0] == "127.0.0.1"
