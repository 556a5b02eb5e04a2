"""Attacks and accidents from network, files and terminals do not end a flight."""

import resource
import selectors
import signal
import socket
import time
from collections.abc import Iterator
from contextlib import ExitStack, closing
from pathlib import Path

import pytest
from mcap.reader import make_reader

from autopilot.app import BURST_S
from autopilot.param_store import FILE
from mavlink_io.logging.mcap import MAGIC
from mavlink_io.services.params import REAL32, ParamClient
from mavlink_io.transport.tcp import MAX_CLIENTS
from tests.helpers.exchange import run
from tests.helpers.fake_hil import TICK_US
from tests.helpers.subprocesses import (
    TIMEOUT_S,
    Process,
    autopilot,
    free_port,
    process,
)
from tests.processes.test_autopilot import ARMED, GROUND, VEHICLE, Harness

pytestmark = pytest.mark.process

FLOOD = 1100
"""Number of connections, above the usual limits of `select` and of open files (1,024)."""
BATCH = 50
"""Number of connections that are begun at once.

It is below the 128 that the system queues, so that the system drops none of them. The server takes
them at least every `BURST_S`.
"""
USUAL_OPEN_FILES = 1024
SPARE_FILES = 200


@pytest.fixture
def many_files() -> Iterator[None]:
    """Let this process open the sockets of a flood."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    file_limit = FLOOD + SPARE_FILES
    if hard != resource.RLIM_INFINITY and hard < file_limit:
        pytest.skip(f"only {hard} files may be open here, {file_limit} are needed")
    resource.setrlimit(resource.RLIMIT_NOFILE, (max(soft, file_limit), hard))
    yield
    resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))


def connect_many(port: int, count: int, stack: ExitStack) -> list[socket.socket]:
    """Begin connections without waiting for any."""
    sockets = []
    for _ in range(count):
        connection = stack.enter_context(closing(socket.socket()))
        connection.setblocking(False)
        connection.connect_ex(("127.0.0.1", port))
        sockets.append(connection)
    return sockets


def closed_by_peer(sockets: list[socket.socket], timeout_s: float) -> int:
    """Return how many connections the other end closes within a time."""
    closed, deadline_s = 0, time.monotonic() + timeout_s
    with selectors.DefaultSelector() as selector:
        for connection in sockets:
            selector.register(connection, selectors.EVENT_READ)
        while closed < FLOOD - MAX_CLIENTS and time.monotonic() < deadline_s:
            for key, _ in selector.select(0.2):
                peer = key.fileobj
                assert isinstance(peer, socket.socket)
                try:
                    ended = not peer.recv(4096)
                except OSError:
                    ended = True
                if ended:
                    selector.unregister(peer)
                    closed += 1
    return closed


class FloodHarness(Harness):
    """Start an autopilot with the usual limit of open files, a simulator and a ground station."""

    def __init__(self, child: Process, hil_port: int, ground_port: int) -> None:
        super().__init__(child, hil_port, ground_port)
        self.port = ground_port


@pytest.fixture
def flood_harness(many_files: None) -> Iterator[FloodHarness]:
    hil, ground = free_port(), free_port(socket.SOCK_STREAM)
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    with ExitStack() as stack:
        resource.setrlimit(resource.RLIMIT_NOFILE, (USUAL_OPEN_FILES, hard))
        child = stack.enter_context(
            autopilot(f"udpin:127.0.0.1:{hil}", f"tcpin:127.0.0.1:{ground}")
        )
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
        harness = FloodHarness(child, hil, ground)
        with closing(harness.simulator), closing(harness.ground):
            yield harness


def test_connection_flood_leaves_the_first_client_served(flood_harness: FloodHarness) -> None:
    harness = flood_harness
    harness.simulator.ask(0)
    assert harness.ground.command(400, 1) == 0
    with ExitStack() as stack:
        sockets: list[socket.socket] = []
        for tick in range(1, FLOOD // BATCH + 1):
            sockets += connect_many(harness.port, BATCH, stack)
            time.sleep(2.0 * BURST_S)
            assert harness.simulator.ask(tick * TICK_US).time_usec == tick * TICK_US
        assert harness.ground.command(512, 148) == 0
        assert closed_by_peer(sockets, TIMEOUT_S) >= FLOOD - MAX_CLIENTS
        assert harness.ground.command(512, 148) == 0
    harness.process.signal(signal.SIGTERM)
    assert harness.process.finish() == (0, "", "")


def set_parameter(harness: Harness, name: str, value: float) -> None:
    """Send PARAM_SET without the check of the project's own client."""
    harness.ground.endpoint.send(
        "PARAM_SET",
        target_system=1,
        target_component=1,
        param_id=name,
        param_value=value,
        param_type=REAL32,
    )


def test_denormal_parameter_is_refused_and_not_stored(tmp_path: Path) -> None:
    hil, port = free_port(), free_port(socket.SOCK_STREAM)
    options = ("--state", str(tmp_path))
    with autopilot(f"udpin:127.0.0.1:{hil}", f"tcpin:127.0.0.1:{port}", options=options) as child:
        harness = Harness(child, hil, port)
        with closing(harness.simulator), closing(harness.ground):
            harness.simulator.ask(0)
            set_parameter(harness, "THR_CRUISE_PCT", 1e-40)
            assert harness.ground.wait_for("PARAM_ERROR").param_id == "THR_CRUISE_PCT"
            assert harness.ground.command(400, 1) == 0
            assert harness.ground.command(178, 1, -1, 100) == 0  # full thrust
            for tick in range(1, 51):
                harness.simulator.ask(tick * TICK_US)
            child.signal(signal.SIGTERM)
            assert child.finish() == (0, "", "")
    assert not (tmp_path / FILE).exists()


def test_stored_denormal_parameter_becomes_default(tmp_path: Path) -> None:
    (tmp_path / FILE).write_text("HDG_P,0.7\nTHR_CRUISE_PCT,1e-40\n")
    hil, port = free_port(), free_port(socket.SOCK_STREAM)
    options = ("--state", str(tmp_path))
    with autopilot(f"udpin:127.0.0.1:{hil}", f"tcpin:127.0.0.1:{port}", options=options) as child:
        complaint = child.wait_for_line()
        assert "parameters.param:2: THR_CRUISE_PCT = 1e-40" in complaint
        assert "default" in complaint
        harness = Harness(child, hil, port)
        with closing(harness.simulator), closing(harness.ground):
            client = ParamClient(harness.ground.endpoint.send, GROUND, VEHICLE)
            assert run(client.get("THR_CRUISE_PCT"), harness.ground.endpoint) == 58.0
            assert run(client.get("HDG_P"), harness.ground.endpoint) == pytest.approx(0.7)


@pytest.mark.parametrize("time_us", [1 << 63, (1 << 64) - 1])
def test_sample_with_impossible_time_is_rejected(tmp_path: Path, time_us: int) -> None:
    hil, port = free_port(), free_port(socket.SOCK_STREAM)
    options = ("--logs", str(tmp_path))
    with autopilot(f"udpin:127.0.0.1:{hil}", f"tcpin:127.0.0.1:{port}", options=options) as child:
        harness = Harness(child, hil, port)
        with closing(harness.simulator), closing(harness.ground):
            harness.simulator.ask(0)
            assert harness.ground.command(400, 1) == 0
            for _ in range(3):
                harness.simulator.send(time_us)
            for tick in range(1, 51):
                answer = harness.simulator.ask(tick * TICK_US)
                assert (answer.time_usec, answer.mode & ARMED) == (tick * TICK_US, ARMED)
            while f"sample time {time_us} us" not in harness.ground.wait_for("STATUSTEXT").text:
                pass
            child.signal(signal.SIGTERM)
            assert child.finish() == (0, "", "")
    assert (
        attitudes(tmp_path) == 50
    )  # the log begins when the vehicle is armed, after the first tick


def attitudes(folder: Path) -> int:
    """Return the number of attitudes in the one log of a folder; fail if it was not finished."""
    (path,) = folder.glob("*.mcap")
    assert path.read_bytes()[-len(MAGIC) :] == MAGIC
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    assert summary.statistics is not None
    counts = summary.statistics.channel_message_counts
    return sum(
        counts[n]
        for n, channel in summary.channels.items()
        if channel.topic == "/mavlink/1/1/ATTITUDE"
    )


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_autopilot_on_signal_finishes_its_log(tmp_path: Path, number: signal.Signals) -> None:
    hil, port = free_port(), free_port(socket.SOCK_STREAM)
    options = ("--logs", str(tmp_path))
    with autopilot(f"udpin:127.0.0.1:{hil}", f"tcpin:127.0.0.1:{port}", options=options) as child:
        harness = Harness(child, hil, port)
        with closing(harness.simulator), closing(harness.ground):
            harness.simulator.ask(0)
            assert harness.ground.command(400, 1) == 0
            for tick in range(1, 51):
                harness.simulator.ask(tick * TICK_US)
            child.signal(number)
            assert child.finish() == (0, "", "")
    assert (
        attitudes(tmp_path) == 50
    )  # the log begins when the vehicle is armed, after the first tick


def test_closed_terminal_does_not_end_nohup_program() -> None:
    """`nohup` starts a program with SIGHUP ignored; it must stay ignored."""
    hil, port = free_port(), free_port(socket.SOCK_STREAM)
    code = (
        "import signal, sys; signal.signal(signal.SIGHUP, signal.SIG_IGN); "
        "from autopilot.__main__ import main; sys.argv[0] = 'autopilot'; main()"
    )
    words = (
        "--hil",
        f"udpin:127.0.0.1:{hil}",
        "--gcs",
        f"tcpin:127.0.0.1:{port}",
        "--state",
        "off",
        "--logs",
        "off",
    )
    with process("-c", code, *words) as child:
        assert child.wait_for_line().startswith("autopilot: system")
        child.signal(signal.SIGHUP)
        harness = Harness(child, hil, port)
        with closing(harness.simulator), closing(harness.ground):
            assert harness.simulator.ask(0).time_usec == 0
        child.signal(signal.SIGTERM)
        assert child.finish() == (0, "", "")
