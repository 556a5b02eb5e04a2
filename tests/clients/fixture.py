"""Test set-ups for stock clients: a simulated vehicle, a link to it, and a client program."""

import contextlib
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Hashable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager
from functools import partial
from pathlib import Path
from socket import SOCK_STREAM
from typing import Any, NamedTuple, TypeVar

from mavlink_io.endpoint import Endpoint
from mavlink_io.transport import open_transport, wait
from tests.helpers import node
from tests.helpers.pty_pair import Line, Noise, line
from tests.helpers.subprocesses import (
    BACKGROUND_NICENESS,
    REAL_TIME_NICENESS,
    TIMEOUT_S,
    Process,
    autopilot,
    free_port,
    on_one_core,
    process,
)

BAUD, NOISE = 57_600, Noise(drop=3e-4, flip=3e-4)
"""Noise of a radio: 3 of 10,000 bytes are lost and 3 arrive wrong."""
FRAME_LOSS = Noise(frame=0.1)
"""Noise of a radio that loses one frame in ten, in each direction."""
STANDBY = 3
STARTS_WITHIN_S = 180.0
"""Wall time for a start, in s: on a new machine several simulators may compile their kernels."""
UDP, TCP, SERIAL = "udp", "tcp", "serial"


class Program(NamedTuple):
    """A client program with its checks."""

    arguments: tuple[str, ...]
    """Arguments of Python, or of node, before the address."""
    addresses: Mapping[str, str]
    """Address of the vehicle by kind of link, with {} for its port or device."""
    vehicle_options: tuple[str, ...] = ()
    """Options of the autopilot."""
    slow_option: tuple[str, ...] = ("--slow",)
    """Options on a noisy line."""
    baud_option: tuple[str, ...] = ()
    needs_modes: bool = False
    """Whether it reads the names of modes in its home, which is its first argument."""
    in_javascript: bool = False


_PYMAVLINK = {UDP: "udpin:127.0.0.1:{}", TCP: "tcp:127.0.0.1:{}", SERIAL: "{}"}
PROGRAMS = {
    "mavsdk": Program(
        ("-m", "tests.clients.mavsdk_checks"),
        {
            UDP: "udpin://127.0.0.1:{}",
            TCP: "tcpout://127.0.0.1:{}",
            SERIAL: f"serial://{{}}:{BAUD}",
        },
    ),
    "mavproxy": Program(
        ("-m", "tests.clients.mavproxy_checks"),
        _PYMAVLINK,
        baud_option=("--baud", str(BAUD)),
        needs_modes=True,
    ),
    "dronekit": Program(
        ("-m", "tests.clients.dronekit_checks"),
        _PYMAVLINK,
        vehicle_options=("--autopilot-id", "ardupilot"),
    ),
    "pymavlink": Program(("-m", "tests.clients.pymavlink_checks"), _PYMAVLINK, needs_modes=True),
    "node": Program(
        ("checks.js",),
        {UDP: "udp:{}", TCP: "tcp:{}", SERIAL: "{}"},
        slow_option=(),
        in_javascript=True,
    ),
}
Verdicts = dict[str, dict[str, Any]]
Key = TypeVar("Key", bound=Hashable)
T = TypeVar("T")


class Afloat:
    """A simulated vehicle; the test may listen to it on ``spare``, a UDP port."""

    def __init__(self, links: tuple[str, ...], speed: str, options: tuple[str, ...] = ()) -> None:
        self._options = options
        hil, spare = free_port(), free_port()
        self.spare = f"udpin:127.0.0.1:{spare}"
        self._hil, self._speed = hil, speed
        self._links = (*links, f"udpout:127.0.0.1:{spare}")
        self._processes = contextlib.ExitStack()

    def start(self) -> None:
        """Start the vehicle; return when it is in standby with working sensors.

        A vehicle faster than real time gets less processor time than its clients. On a busy
        machine it then becomes slower, where a client would lose datagrams.
        """
        sea = (
            "-m",
            "sitl",
            "--hil",
            f"udpout:127.0.0.1:{self._hil}",
            "--speed",
            self._speed,
            "--seed",
            "1",
        )
        logs = self._processes.enter_context(tempfile.TemporaryDirectory())
        options = ("--logs", logs, *self._options)
        own = autopilot(f"udpin:127.0.0.1:{self._hil}", *self._links, options=options)
        programs = self._processes.enter_context(own), self._processes.enter_context(process(*sea))
        self._processes.enter_context(on_one_core(*programs))
        fast = float(self._speed) > 1.0
        for program in programs:
            program.set_niceness(BACKGROUND_NICENESS if fast else REAL_TIME_NICENESS)
        wait_for_heartbeat(self.spare, STANDBY)

    def kill(self) -> None:
        """Kill the vehicle's programs, as a power failure does."""
        self._processes.close()


@contextlib.contextmanager
def afloat(*links: str, speed: str = "1", options: tuple[str, ...] = ()) -> Iterator[Afloat]:
    """Yield a vehicle in standby in the simulator; ``options`` are those of the autopilot."""
    vehicle = Afloat(links, speed, options)
    try:
        vehicle.start()
        yield vehicle
    finally:
        vehicle.kill()


def wait_for_heartbeat(address: str, status: int = 0, within_s: float = STARTS_WITHIN_S) -> Any:
    """Return the first heartbeat of a vehicle with at least a MAV_STATE."""
    transport = open_transport(address)
    with contextlib.closing(transport):
        endpoint, deadline_s = Endpoint(transport, 250, 191), time.monotonic() + within_s
        while time.monotonic() < deadline_s:
            wait([transport], 0.2)
            for frame in endpoint.receive():
                if frame.name == "HEARTBEAT" and frame.decode().system_status >= status:
                    return frame.decode()
    raise AssertionError(f"no vehicle is in standby on {address}")


def mavsdk_action_results() -> Verdicts:
    """Return result and difference from the expected one of each method of plugin `action`."""
    port = free_port()
    with (
        afloat(f"udpout:127.0.0.1:{port}"),
        process("-m", "tests.clients.mavsdk_actions", f"udpin://127.0.0.1:{port}") as program,
    ):
        return _outcomes(program)


def mavproxy_command_results(folder: Path) -> Verdicts:
    """Return result and difference from the expected one of each command of MAVProxy."""
    port = free_port()
    with afloat(f"udpout:127.0.0.1:{port}") as vehicle:
        install_modes(folder, vehicle)
        arguments = ("-m", "tests.clients.mavproxy_commands", str(folder))
        with process(*arguments, f"udpin:127.0.0.1:{port}") as program:
            return _outcomes(program)


def _outcomes(program: Process) -> Verdicts:
    """Return what a program prints in its last line."""
    finished = program.finish(timeout_s=400.0)
    assert finished.status == 0, finished.stderr[-3000:]
    results: Verdicts = json.loads(finished.stdout.splitlines()[-1])
    return results


class Act(NamedTuple):
    """A running client program, and its serial line if it uses one."""

    program: Process
    line: Line | None
    vehicle: Afloat

    def verdicts(self) -> Verdicts:
        """Return the results of the finished program."""
        return _outcomes(self.program)


@contextlib.contextmanager
def over_udp(client: str, folder: Path, *options: str, speed: str = "1") -> Iterator[Act]:
    """Start a client with its checks on a UDP link; node-mavlink sends to a port that listens."""
    port, program = free_port(), PROGRAMS[client]
    link = f"{'udpin' if program.in_javascript else 'udpout'}:127.0.0.1:{port}"
    if speed != "1":
        options = ("--speed", speed, *options)
    with (
        afloat(link, speed=speed, options=program.vehicle_options) as vehicle,
        run(client, folder, vehicle, program.addresses[UDP].format(port), *options) as running,
    ):
        yield Act(running, None, vehicle)


@contextlib.contextmanager
def over_tcp(client: str, folder: Path, *options: str) -> Iterator[Act]:
    """Start a client with its checks; it connects to the vehicle's TCP server."""
    port, program = free_port(SOCK_STREAM), PROGRAMS[client]
    with (
        afloat(f"tcpin:127.0.0.1:{port}", options=program.vehicle_options) as vehicle,
        run(client, folder, vehicle, program.addresses[TCP].format(port), *options) as running,
    ):
        yield Act(running, None, vehicle)


@contextlib.contextmanager
def over_serial(client: str, folder: Path, *options: str, noise: Noise = NOISE) -> Iterator[Act]:
    """Start a client with its checks on a noisy serial line."""
    program = PROGRAMS[client]
    options = (*program.baud_option, *program.slow_option, *options)
    with line(folder, BAUD, noise) as cable:
        device, address = cable.device["vehicle"], program.addresses[SERIAL]
        with (
            afloat(f"serial:{device}:{BAUD}", options=program.vehicle_options) as vehicle,
            run(
                client, folder, vehicle, address.format(cable.device["ground"]), *options
            ) as running,
        ):
            yield Act(running, cable, vehicle)


ACTS: dict[str, Callable[..., AbstractContextManager[Act]]] = {
    "udp": over_udp,
    "tcp": over_tcp,
    "lossy": partial(over_serial, noise=FRAME_LOSS),
    "serial": over_serial,
    "udp 0.2x": partial(over_udp, speed="0.2"),
    "udp 10x": partial(over_udp, speed="10"),
    "udp 50x": partial(over_udp, speed="50"),
}
"""Every link and speed on which a client runs its checks."""
EVERY_CLIENT = ("udp", "tcp", "lossy")
"""Links on which all programs run; on the others MAVSDK and MAVProxy."""


def clients_on(where: str) -> list[str]:
    """Return the programs that run their checks on a link."""
    return list(PROGRAMS)[: None if where in EVERY_CLIENT else 2]


@contextlib.contextmanager
def all_at_once(acts: Mapping[Key, AbstractContextManager[T]]) -> Iterator[dict[Key, T]]:
    """Start several set-ups at once, because most of the time is spent waiting for programs."""
    with contextlib.ExitStack() as stack:
        with ThreadPoolExecutor(len(acts)) as pool:
            entered = {key: pool.submit(act.__enter__) for key, act in acts.items()}
        for key, act in acts.items():
            if entered[key].exception() is None:
                stack.push(act)
        yield {key: future.result() for key, future in entered.items()}


@contextlib.contextmanager
def run(
    client: str, folder: Path, vehicle: Afloat, address: str, *options: str
) -> Iterator[Process]:
    """Start a client's checks as a program. Raises LookupError if it cannot be installed."""
    program = PROGRAMS[client]
    if program.in_javascript:
        if reason := node.mavlink_failure():
            raise LookupError(reason)
        script = (str(node.MAVLINK_FOLDER / program.arguments[0]), address, *options)
        with process(*script, executable="node") as running:
            yield running
        return
    home: tuple[str, ...] = ()
    if program.needs_modes:
        install_modes(folder, vehicle)
        home = (str(folder),)
    environment = {"HOME": str(folder), "MAVLINK20": "1"} if program.needs_modes else None
    with process(*program.arguments, *home, address, *options, environment=environment) as running:
        yield running


def install_modes(home: Path, vehicle: Afloat) -> None:
    """Run ``ground modes export-mavproxy`` with this home directory."""
    path = home / ".pymavlink" / "custom_mode_map.json"
    command = [
        sys.executable,
        "-m",
        "ground",
        "modes",
        "export-mavproxy",
        "--path",
        str(path),
        "--connect",
        vehicle.spare,
    ]
    subprocess.run(command, check=True, capture_output=True, timeout=TIMEOUT_S)
