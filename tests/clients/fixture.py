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
from typing import Any, NamedTuple, TypeVar

from mavlink_io.endpoint import Endpoint
from mavlink_io.transport import open_transport, wait
from tests.helpers.pty_pair import Line, Noise, line
from tests.helpers.subprocesses import (
    BACKGROUND_NICENESS,
    PATIENCE_S,
    REAL_TIME_NICENESS,
    Process,
    autopilot,
    free_port,
    on_one_core,
    process,
)

BAUD, NOISE = 57_600, Noise(drop=3e-4, flip=3e-4)
"""Noise of a radio: 3 of 10,000 bytes are lost and 3 arrive wrong."""
STANDBY = 3
STARTS_WITHIN_S = 180.0
"""Wall time for a start, in s: on a new machine several simulators may compile their kernels."""
PROGRAMS = {"mavsdk": "tests.clients.mavsdk_checks", "mavproxy": "tests.clients.mavproxy_checks"}
Verdicts = dict[str, dict[str, Any]]
Key, T = TypeVar("Key", bound=Hashable), TypeVar("T")


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
        finished = program.finish(patience_s=300.0)
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
        finished = self.program.finish(patience_s=400.0)
        assert finished.status == 0, finished.stderr[-3000:]
        found: Verdicts = json.loads(finished.stdout.splitlines()[-1])
        return found


@contextlib.contextmanager
def over_udp(client: str, folder: Path, *options: str, speed: str = "1") -> Iterator[Act]:
    """Start a client with its checks on a UDP link."""
    port = free_port()
    with (
        afloat(f"udpout:127.0.0.1:{port}", speed=speed) as vehicle,
        run(client, folder, vehicle, f"127.0.0.1:{port}", "--speed", speed, *options) as program,
    ):
        yield Act(program, None, vehicle)


@contextlib.contextmanager
def over_serial(client: str, folder: Path, *options: str) -> Iterator[Act]:
    """Start a client with its checks on a noisy serial line."""
    with (
        line(folder, BAUD, NOISE) as cable,
        afloat(f"serial:{cable.device['vehicle']}:{BAUD}") as vehicle,
        run(client, folder, vehicle, cable.device["ground"], "--slow", *options) as program,
    ):
        yield Act(program, cable, vehicle)


ACTS: dict[str, Callable[..., AbstractContextManager[Act]]] = {
    "udp": over_udp,
    "serial": over_serial,
    "udp 0.2x": partial(over_udp, speed="0.2"),
    "udp 10x": partial(over_udp, speed="10"),
    "udp 50x": partial(over_udp, speed="50"),
}
"""Every link and speed on which a client runs its checks."""


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
def run(client: str, folder: Path, vehicle: Afloat, where: str, *options: str) -> Iterator[Process]:
    """Return a client's checks as a program; ``where`` is HOST:PORT to listen on, or a device."""
    serial = where.startswith("/")
    if client == "mavsdk":
        arguments = [f"serial://{where}:{BAUD}" if serial else f"udpin://{where}"]
    else:
        install_modes(folder, vehicle)
        arguments = [str(folder), *([where, "--baud", str(BAUD)] if serial else [f"udpin:{where}"])]
    with process("-m", PROGRAMS[client], *arguments, *options) as program:
        yield program


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
    subprocess.run(command, check=True, capture_output=True, timeout=PATIENCE_S)
