"""The simulator as a process, with a small autopilot's end of the HIL link in the test."""

import json
import os
import signal
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import closing, suppress
from pathlib import Path

import pytest
from mcap.exceptions import EndOfFile
from mcap.records import Message
from mcap.stream_reader import StreamReader

from mavlink_io import dialect
from mavlink_io.codec import Framer, encode
from tests.helpers.subprocesses import TIMEOUT_S

pytestmark = pytest.mark.process

CONTROLS = dialect.by_name("HIL_ACTUATOR_CONTROLS")
ARMED, DISARMED = 129, 1
TICK_US = 20_000


class Peer:
    """Bind as the autopilot does; receive datagrams and answer them on request of the test."""

    def __init__(self) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", 0))
        self._socket.settimeout(30.0)
        self._from: tuple[str, int] | None = None
        self.address = f"udpout:127.0.0.1:{self._socket.getsockname()[1]}"

    def receive(self) -> tuple[int, bytes]:
        """Return vehicle time and datagram of the next datagram; it must contain one HIL_SENSOR."""
        datagram, self._from = self._socket.recvfrom(65_535)
        times = [
            frame.decode().time_usec
            for frame in Framer().feed(datagram)
            if frame.name == "HIL_SENSOR"
        ]
        assert len(times) == 1
        return times[0], datagram

    def receive_tick(self, time_us: int) -> bytes:
        """Return the next datagram of a vehicle time; ignore repeated earlier ones."""
        while (received := self.receive())[0] != time_us:
            assert received[0] < time_us
        return received[1]

    def answer(self, time_us: int, mode: int = ARMED) -> None:
        assert self._from is not None
        frame = (time_us, 1, (0.4, 0.1, 0.58, *(0.0,) * 13), mode)
        self._socket.sendto(encode(CONTROLS, frame, 0, 1, 1), self._from)

    def fly(self, ticks: int, start_us: int = 0) -> list[bytes]:
        """Answer a number of ticks; return their datagrams."""
        datagrams = []
        for time_us in range(start_us, start_us + ticks * TICK_US, TICK_US):
            datagrams.append(self.receive_tick(time_us))
            self.answer(time_us)
        return datagrams

    def close(self) -> None:
        self._socket.close()


@pytest.fixture
def peer() -> Iterator[Peer]:
    with closing(Peer()) as peer:
        yield peer


Start = Callable[..., subprocess.Popen[str]]


@pytest.fixture
def sitl() -> Iterator[Start]:
    started: list[subprocess.Popen[str]] = []

    def start(*arguments: str) -> subprocess.Popen[str]:
        process = subprocess.Popen(
            [sys.executable, "-m", "sitl", *arguments],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        started.append(process)
        return process

    yield start
    for process in started:
        process.kill()
        process.communicate()


def flown(sitl: Start, fly: Callable[[Peer], list[bytes]], *arguments: str) -> list[bytes]:
    """The datagrams that a new simulator sent during a flight."""
    with closing(Peer()) as peer:
        sitl("--hil", peer.address, "--speed", "max", *arguments)
        return fly(peer)


def test_lockstep_same_seed_gives_same_bytes(
    sitl: Start,
) -> None:
    rough = ("--scenario", "disturbed", "--seed", "7")
    first = flown(sitl, lambda peer: peer.fly(200), *rough)
    assert first == flown(sitl, lambda peer: peer.fly(200), *rough)
    assert first != flown(
        sitl, lambda peer: peer.fly(200), "--scenario", "disturbed", "--seed", "8"
    )


def test_lost_and_repeated_datagrams_change_nothing(sitl: Start) -> None:
    def fly_badly(peer: Peer) -> list[bytes]:
        datagrams = []
        for time_us in range(0, 40 * TICK_US, TICK_US):
            datagram = peer.receive_tick(time_us)
            if time_us % (10 * TICK_US) == TICK_US:
                assert peer.receive_tick(time_us) == datagram
                peer.answer(time_us + TICK_US)
                peer.answer(max(0, time_us - TICK_US))
            peer.answer(time_us)
            peer.answer(time_us)
            datagrams.append(datagram)
        return datagrams

    assert flown(sitl, fly_badly) == flown(sitl, lambda peer: peer.fly(40))


def test_before_first_answer_time_zero_is_repeated(sitl: Start, peer: Peer) -> None:
    sitl("--hil", peer.address)
    assert [peer.receive()[0] for _ in range(20)] == [0] * 20


def test_wait_for_arm_time_stands_while_disarmed(sitl: Start, peer: Peer) -> None:
    sitl("--hil", peer.address, "--speed", "max", "--wait-for-arm")
    standing = []
    for _ in range(10):
        time_us, datagram = peer.receive()
        standing.append((time_us, datagram))
        peer.answer(time_us, DISARMED)
    armed = peer.fly(30)
    assert set(standing) == {(0, armed[0])}
    moored_us = 30 * TICK_US
    for _ in range(10):
        peer.receive_tick(moored_us)
        peer.answer(moored_us, DISARMED)
    again = peer.fly(10, moored_us)
    assert armed + again == flown(sitl, lambda other: other.fly(40), "--wait-for-arm")


def test_without_wait_for_arm_time_runs_disarmed(sitl: Start, peer: Peer) -> None:
    sitl("--hil", peer.address, "--speed", "max")
    for time_us in (0, TICK_US, 2 * TICK_US):
        peer.receive_tick(time_us)
        peer.answer(time_us, DISARMED)


def test_silent_autopilot_ends_run_with_reason(sitl: Start, peer: Peer) -> None:
    process = sitl("--hil", peer.address, "--speed", "max")
    peer.fly(50)
    _, message = process.communicate(timeout=TIMEOUT_S)
    assert process.returncode == 1
    assert message == "sitl: the autopilot stopped answering at vehicle time 1.00 s\n"


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_stop_signal_ends_run_cleanly(
    sitl: Start, peer: Peer, tmp_path: Path, number: signal.Signals
) -> None:
    log = tmp_path / "truth.mcap"
    process = sitl("--hil", peer.address, "--speed", "max", "--truth", str(log))
    peer.fly(100)
    process.send_signal(number)
    assert process.communicate(timeout=TIMEOUT_S) == ("", "")
    assert process.returncode == 0
    assert truth_times(log) == [tick * TICK_US for tick in range(101)]


@pytest.mark.parametrize("attempt", range(3))
def test_burst_of_end_signals_ends_run(sitl: Start, peer: Peer, attempt: int) -> None:
    """A second signal may interrupt the handler of the first one, as Ctrl-C in a process group."""
    process = sitl("--hil", peer.address, "--speed", "max")
    peer.fly(10 + attempt)
    for count in range(4000):
        process.send_signal(signal.SIGINT if count % 2 else signal.SIGTERM)
    _, message = process.communicate(timeout=TIMEOUT_S)
    assert "Traceback" not in message


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="no such signal here")
def test_killed_run_keeps_truth_to_last_flush(sitl: Start, peer: Peer, tmp_path: Path) -> None:
    log = tmp_path / "truth.mcap"
    process = sitl("--hil", peer.address, "--speed", "1", "--truth", str(log))
    peer.fly(150)
    os.kill(process.pid, signal.SIGKILL)
    process.wait(TIMEOUT_S)
    times = truth_times(log)
    assert times == [tick * TICK_US for tick in range(len(times))]
    assert len(times) > 100


def truth_times(log: Path) -> list[int]:
    """Return the vehicle times of the messages of a log that may be unfinished."""
    times: list[int] = []
    with log.open("rb") as file, suppress(EndOfFile):
        records = StreamReader(file).records
        times.extend(
            json.loads(record.data)["time_us"] for record in records if isinstance(record, Message)
        )
    return times


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (("--vehicle", "submarine"), "submarine"),
        (("--scenario", "stormy"), "scenario stormy"),
        (("--hil", "udpout:nowhere"), "address 'udpout:nowhere'"),
        (("--speed", "fast"), "--speed fast: expected a number from 0.01 to 10000, or max"),
        (
            ("--truth", "/no/such/folder/truth.mcap"),
            "--truth /no/such/folder/truth.mcap: No such file or directory",
        ),
    ],
)
def test_bad_input_gets_one_line_and_status_2(
    sitl: Start, arguments: tuple[str, str], named: str
) -> None:
    process = sitl(*arguments)
    output, message = process.communicate(timeout=TIMEOUT_S)
    assert (process.returncode, output) == (2, "")
    assert named in message
    assert message.count("\n") == 1
