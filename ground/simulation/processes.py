"""A simulator and an autopilot as child processes, for one dive."""

import contextlib
import secrets
import signal
import socket
import tempfile
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import NamedTuple, Self

from ground.client.vehicle import VehicleClientError
from ground.errors import BAD_INPUT, InputError
from ground.simulation import affinity
from ground.simulation.subprocesses import ProcessFactory, SpawnedProcess
from mavlink_io.clock import wall_s
from mavlink_io.transport import AddressError, Transport, open_transport, wait

START_TIMEOUT_S = 60.0
STOP_TIMEOUT_S = 5.0
PORTS = range(20_000, 32_000)
"""Below those that the system deals out by itself: what was free stays free until a child takes
it."""
_given_ports: set[int] = set()


class Simulation(NamedTuple):
    """What to simulate, as the simulator's command line names it."""

    vehicle: str = "caribou_truth"
    scenario: str = "calm"
    seed: int = 1
    speed: str = "max"
    truth: Path | None = None
    """Where the simulator writes what really happened; nobody else reads it."""
    logs: Path | None = None
    """The folder in which the vehicle keeps her own log; None where ground's is enough."""


class SimulatedVehicle:
    """sitl and autopilot, started and stopped together. The vehicle's time begins when it is armed.

    Both run on one core (`ground.simulation.affinity`) from `connect` on. While they load their
    libraries they use whatever cores are free."""

    def __init__(
        self,
        simulation: Simulation,
        parameters: Path | None = None,
        start: ProcessFactory = SpawnedProcess,
    ) -> None:
        hil, ground = free_port(), free_port(socket.SOCK_STREAM)
        self.address = f"tcp:127.0.0.1:{ground}"
        sitl = ["--vehicle", simulation.vehicle, "--scenario", simulation.scenario]
        sitl += [
            "--seed",
            str(simulation.seed),
            "--speed",
            simulation.speed,
            "--wait-for-arm",
            "--lifeline",
        ]
        if simulation.truth is not None:
            sitl += ["--truth", str(simulation.truth)]
        autopilot = ["--hil", f"udpin:127.0.0.1:{hil}", "--gcs", f"tcpin:127.0.0.1:{ground}"]
        autopilot += ["--lifeline", "--state", "off", "--logs", str(simulation.logs or "off")]
        if parameters is not None:
            autopilot += ["--params", str(parameters)]
        self._core = affinity.take_core()
        self._autopilot = _Program("autopilot", autopilot, start)
        self._sitl = _Program("sitl", [*sitl, "--hil", f"udpout:127.0.0.1:{hil}"], start)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        tb: TracebackType | None,
    ) -> None:
        self.stop()

    def connect(self) -> Transport:
        """Open the link to the autopilot as soon as it listens.

        Raises:
            BadInputError: a process refused the vehicle, scenario or parameters.
            VehicleError: a process died, or did not come up in time.
        """
        deadline_s = wall_s() + START_TIMEOUT_S
        while True:
            self.check()
            try:
                transport = open_transport(self.address)
            except AddressError:
                if wall_s() > deadline_s:
                    raise VehicleClientError(
                        f"the autopilot did not listen within {START_TIMEOUT_S:g} s"
                    ) from None
                wait([], 0.02)
            else:
                self._pin()
                return transport

    def check(self) -> None:
        """Raise when one of the two has died, with what it said."""
        for child in (self._sitl, self._autopilot):
            child.check()

    def stop(self) -> None:
        """End both, and wait until they are gone."""
        for child in (self._sitl, self._autopilot):
            child.terminate()
        for child in (self._sitl, self._autopilot):
            child.wait()
        core, self._core = self._core, None
        if core is not None:
            affinity.release_core(core)

    def _pin(self) -> None:
        """Restrict both processes to one core, where the system can."""
        if self._core is not None:
            for child in (self._sitl, self._autopilot):
                child.pin(self._core)


class _Program:
    """One of the two, and what it says."""

    def __init__(self, name: str, arguments: Sequence[str], start: ProcessFactory) -> None:
        self._name = name
        self._said = tempfile.NamedTemporaryFile(prefix=f"{name}-")  # noqa: SIM115 - lives as long as the process
        self._child = start(name, arguments, Path(self._said.name))

    def check(self) -> None:
        status = self._child.poll()
        if status is None:
            return
        said = self._last_words()
        if status == BAD_INPUT:
            raise InputError(said or f"{self._name} refused its input")
        how = (
            f"was killed by {signal.Signals(-status).name}"
            if status < 0
            else f"ended with status {status}"
        )
        raise VehicleClientError(f"{self._name} {how}" + (f": {said}" if said else ""))

    def pin(self, core: int) -> None:
        self._child.pin(core)

    def terminate(self) -> None:
        self._child.terminate()

    def wait(self) -> None:
        self._child.end(STOP_TIMEOUT_S)
        self._said.close()

    def _last_words(self) -> str:
        self._said.seek(0)
        lines = self._said.read().decode("utf-8", "replace").strip().splitlines()
        return lines[-1].strip() if lines else ""


def free_port(kind: socket.SocketKind = socket.SOCK_DGRAM) -> int:
    """A UDP or TCP port of the loopback that nobody uses, and that this process gives once."""
    while True:
        port = secrets.choice(PORTS)
        with socket.socket(socket.AF_INET, kind) as probe, contextlib.suppress(OSError):
            probe.bind(("127.0.0.1", port))
            if port not in _given_ports:
                _given_ports.add(port)
                return port
