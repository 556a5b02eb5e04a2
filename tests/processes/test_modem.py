"""A vehicle behind a modem: real programs on a channel of seconds, with losses, half duplex."""

import contextlib
import json
import threading
import time
from collections.abc import Iterator
from typing import Any

import pytest
from pymavlink import mavutil
from pymavlink.dialects.v20 import all as mavlink

from autopilot.control import modes
from tests.helpers.modem import ModemChannel, between_processes, tcp_server
from tests.helpers.subprocesses import Finished, free_port, process, vehicle

pytestmark = [pytest.mark.process, pytest.mark.timeout(1200)]

DELAY_S, LOSS = 3.0, 0.2
RETRY_S = 12
"""More than the way there and back and the packets in between."""
BUDGET_S = 10.0 * RETRY_S
"""Time for the attempts of one request: a loss of 0.2 each way makes all ten fail once in 3e4."""
OTHER_S = 60.0
"""Time to find the vehicle by a HIGH_LATENCY2, one in 10 s, and to start a program."""


class Modem:
    """A vehicle with a modem, and with a plain link on which a test sees what it does."""

    def __init__(self, channel: ModemChannel, ground_port: int, plain_port: int) -> None:
        self.channel, self.ground_port = channel, ground_port
        self.modes: list[int] = []
        """Modes that the vehicle has had, by its heartbeats."""
        self._stop = threading.Event()
        self._listener = threading.Thread(target=self._listen, args=(plain_port,))
        self._listener.start()

    def _listen(self, port: int) -> None:
        """Note each change of the mode."""
        link: Any = mavutil.mavlink_connection(f"udpin:127.0.0.1:{port}")
        while not self._stop.is_set():
            beat = link.recv_match(type="HEARTBEAT", blocking=True, timeout=0.5)
            if beat is None or beat.get_srcSystem() != 1:
                continue  # those of the ground station are forwarded
            if [beat.custom_mode] != self.modes[-1:]:
                self.modes.append(beat.custom_mode)
        link.close()

    def close(self) -> None:
        self._stop.set()
        self._listener.join()

    def ground(self, *arguments: str) -> Finished:
        """Run a command of ``ground`` over the modem."""
        start_s = time.monotonic()
        link = ("--connect", f"udpin:127.0.0.1:{self.ground_port}", "--modem", str(RETRY_S))
        with process("-m", "ground", *arguments, *link) as child:
            finished = child.finish(timeout_s=2.0 * BUDGET_S + OTHER_S)
        took_s = time.monotonic() - start_s
        print(f"ground {' '.join(arguments)}: {took_s:.0f} s; {finished.stdout.strip()}")
        assert took_s > 2.0 * DELAY_S, "there and back"
        return finished


@pytest.fixture
def modem() -> Iterator[Modem]:
    channel, ground_port, plain_port = ModemChannel(5, loss=LOSS), free_port(), free_port()
    with contextlib.ExitStack() as stack:
        link = stack.enter_context(between_processes(channel, ground_port))
        plain = f"udpout:127.0.0.1:{plain_port}"
        stack.enter_context(vehicle(link, plain, options=("--modem", link)))
        yield stack.enter_context(contextlib.closing(Modem(channel, ground_port, plain_port)))


def acknowledged(port: int, command: int, *parameters: float) -> int:
    """Send a command with pymavlink until it is acknowledged; return the result."""
    link: Any = mavutil.mavlink_connection(f"udpin:127.0.0.1:{port}", source_system=255)
    try:
        while link.recv_match(type="HIGH_LATENCY2", blocking=True, timeout=1.0) is None:
            pass  # pymavlink learns the vehicle's address
        values = (*parameters, *(0.0,) * (7 - len(parameters)))
        deadline_s = time.monotonic() + BUDGET_S
        while time.monotonic() < deadline_s:
            link.mav.command_long_send(1, 1, command, 0, *values)
            ack = link.recv_match(type="COMMAND_ACK", blocking=True, timeout=RETRY_S)
            if ack is not None:
                return int(ack.result)
    finally:
        link.close()
    raise AssertionError(f"no answer to {command}")


def test_vehicle_is_commanded_over_a_lossy_half_duplex_modem(
    modem: Modem, capsys: pytest.CaptureFixture[str]
) -> None:
    with capsys.disabled():
        print()
        done = modem.ground("params", "set", "FS_GCS_TIMEOUT", "0")
        assert done.status == 0, done.stderr
        done = modem.ground("arm")
        assert done.status == 0, done.stderr
        assert "under way in mode HOLD" in done.stdout
        start_s = time.monotonic()
        mode = modes.DEPTH.number
        set_mode = mavlink.MAV_CMD_DO_SET_MODE
        assert acknowledged(modem.ground_port, set_mode, 1.0, float(mode)) == 0
        print(f"pymavlink DO_SET_MODE: {time.monotonic() - start_s:.0f} s")
        done = modem.ground("surface")
        assert done.status == 0, done.stderr
        ended = "the vehicle is disarmed"  # before its next HIGH_LATENCY2
        assert "mode SURFACE" in done.stdout or ended in done.stdout
        commanded = [modes.HOLD.number, mode, modes.SURFACE.number]
        assert modem.modes[:3] == commanded, "then it has surfaced, and is in HOLD"
        ends = modem.channel.vehicle, modem.channel.ground
        print(f"packets of vehicle and ground: {[len(end.sent) for end in ends]},", end=" ")
        print(f"collisions: {[end.collisions for end in ends]}")


def test_mavsdk_commands_a_vehicle_over_a_modem(
    modem: Modem, capsys: pytest.CaptureFixture[str]
) -> None:
    """MAVSDK finds the vehicle by HIGH_LATENCY2; its timeout is set to that of the modem.

    By TCP: on a serial line it sends a heartbeat a second (mavsdk_impl.cpp), which fills the modem;
    over UDP it forgets an address that has been silent for 10 s (udp_connection.cpp).
    """
    client = ("-m", "tests.processes.mavsdk_modem_client")
    with (
        tcp_server(modem.ground_port) as port,
        process(*client, f"tcpout://127.0.0.1:{port}", str(RETRY_S)) as program,
    ):
        finished = program.finish(timeout_s=5.0 * BUDGET_S)
    assert finished.status == 0, finished.stderr[-3000:]
    calls = json.loads(finished.stdout.splitlines()[-1])
    with capsys.disabled():
        print()
        for method, call in calls.items():
            print(f"MAVSDK {method}: {call['s']} s, {', '.join(call['results']) or 'found'}")
    done = [call["results"][-1] for call in calls.values() if call["results"]]
    assert done == ["SUCCESS"] * 4
    commanded = [modes.HOLD.number, modes.STATION.number, modes.SURFACE.number]
    assert modem.modes[:3] == commanded
