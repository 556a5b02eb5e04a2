"""A simulator and an autopilot as child processes, for one dive."""

import contextlib
import secrets
import signal
import socket
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from types import TracebackType
from typing import NamedTuple, Self

from ground.client.vehicle import VehicleClientError
from ground.simulation import affinity
from ground.simulation.subprocesses import ProcessFactory, SpawnedProcess
from mavlink_io.clock import wall_s
from mavlink_io.errors import BAD_INPUT, InputError
from mavlink_io.transport import AddressError, Transport, open_transport, wait

START_TIMEOUT_S = 300.0
"""Wall time in which the autopilot must open its port. A process that fails ends, which is reported
at once; on two cores with 14 running programs a sound autopilot needed more than 60 s."""
_COMPILES = "sitl: compiling"
"""Begin of the line by which a simulator reports that it compiles its physics."""
STOP_TIMEOUT_S = 5.0
"""Wall time after which a process that does not end is killed."""
PORTS = range(20_000, 32_000)
"""Ports for the processes: below the range of automatically assigned ports, so that a free port
stays free until the process binds it."""
_given_ports: set[int] = set()
"""Ports that `free_port` has returned, without those of dives that have ended."""


class Simulation(NamedTuple):
    """Options of a simulation, as for the command line of the simulator."""

    vehicle: str = "caribou_truth"
    scenario: str = "calm"
    seed: int = 1
    speed: str = "max"
    no_compile: bool = False
    """Begin at once, in Python, where the simulator's machine code is not stored yet."""
    truth: Path | None = None
    """Log of the true state that the simulator writes."""
    logs: Path | None = None
    """Folder of the vehicle's own logs; None for no log on the vehicle."""


class SimulatedVehicle:
    """A simulator and an autopilot that are started and stopped together.

    Vehicle time begins when the vehicle is armed. From `connect` on both processes run on one core
    (`ground.simulation.affinity`); before that, while they load libraries, on any core.

    Parameters
    ----------
    simulation : Simulation
        Vehicle, scenario, seed, speed-up and log files.
    parameters : Path, optional
        Parameter file of the autopilot; without it the autopilot starts with its defaults.
    start : ProcessFactory
        Starts one process.
    notify : callable, optional
        Receives the simulator's line that its physics are being compiled. Its other lines are the
        reasons why it ends.
    """

    def __init__(
        self,
        simulation: Simulation,
        parameters: Path | None = None,
        start: ProcessFactory = SpawnedProcess,
        notify: Callable[[str], None] | None = None,
    ) -> None:
        self._notify, self._truth = notify, simulation.truth
        hil, ground = free_port(), free_port(socket.SOCK_STREAM)
        self._ports: tuple[int, ...] = (hil, ground)
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
        if simulation.no_compile:
            sitl += ["--no-compile"]
        if simulation.truth is not None:
            sitl += ["--truth", str(simulation.truth)]
        autopilot = ["--hil", f"udpin:127.0.0.1:{hil}", "--gcs", f"tcpin:127.0.0.1:{ground}"]
        autopilot += ["--lifeline", "--state", "off", "--logs", str(simulation.logs or "off")]
        if parameters is not None:
            autopilot += ["--params", str(parameters)]
        self._core = affinity.take_core()
        try:
            self._autopilot = _Program("autopilot", autopilot, start)
            self._sitl = _Program("sitl", [*sitl, "--hil", f"udpout:127.0.0.1:{hil}"], start)
        except BaseException:
            self._release()
            raise

    def __enter__(self) -> Self:
        """Return the vehicle."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        tb: TracebackType | None,
    ) -> None:
        """Stop both processes."""
        self.stop()

    def connect(self) -> Transport:
        """Open the link to the autopilot as soon as it listens.

        Raises
        ------
        InputError
            A process refused the vehicle, scenario or parameters.
        VehicleClientError
            A process ended, or did not listen within `START_TIMEOUT_S`.
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
        """Raise InputError or VehicleClientError with its message if a process has ended."""
        for child in (self._sitl, self._autopilot):
            child.check()
        if self._notify is not None and (line := self._sitl.last_line()).startswith(_COMPILES):
            self._notify(line)
            self._notify = None

    def remove_truth(self) -> None:
        """Remove the log of the true state; what is recorded later is lost."""
        if self._truth is not None:
            self._truth.unlink(missing_ok=True)

    def stop(self) -> None:
        """Stop both processes and wait for their end."""
        for child in (self._sitl, self._autopilot):
            child.terminate()
        for child in (self._sitl, self._autopilot):
            child.wait()
        self._release()

    def _release(self) -> None:
        """Give back the core and the ports, once."""
        core, self._core = self._core, None
        if core is not None:
            affinity.release_core(core)
        ports, self._ports = self._ports, ()
        _given_ports.difference_update(ports)

    def _pin(self) -> None:
        """Restrict both processes to one core, if the system can."""
        if self._core is not None:
            for child in (self._sitl, self._autopilot):
                child.pin(self._core)


class _Program:
    """One process, with a temporary file for its standard error."""

    def __init__(self, name: str, arguments: Sequence[str], start: ProcessFactory) -> None:
        self._name = name
        self._stderr = tempfile.NamedTemporaryFile(prefix=f"{name}-")  # noqa: SIM115 - lives as long as the process
        self._child = start(name, arguments, Path(self._stderr.name))

    def check(self) -> None:
        """Raise if the process has ended."""
        status = self._child.poll()
        if status is None:
            return
        message = self.last_line()
        if status == BAD_INPUT:
            raise InputError(message or f"{self._name} refused its input")
        end = (
            f"was killed by {signal.Signals(-status).name}"
            if status < 0
            else f"ended with status {status}"
        )
        raise VehicleClientError(f"{self._name} {end}" + (f": {message}" if message else ""))

    def pin(self, core: int) -> None:
        """Restrict the process to a core."""
        self._child.pin(core)

    def terminate(self) -> None:
        """Send SIGTERM."""
        self._child.terminate()

    def wait(self) -> None:
        """Wait for the end of the process; kill it after a timeout."""
        self._child.end(STOP_TIMEOUT_S)
        self._stderr.close()

    def last_line(self) -> str:
        """Return the last line on standard error."""
        self._stderr.seek(0)
        lines = self._stderr.read().decode("utf-8", "replace").strip().splitlines()
        return lines[-1].strip() if lines else ""


def free_port(kind: socket.SocketKind = socket.SOCK_DGRAM) -> int:
    """Return an unused UDP or TCP port of the loopback.

    A port is not returned again until the dive that uses it has ended.
    """
    while True:
        port = secrets.choice(PORTS)
        with socket.socket(socket.AF_INET, kind) as probe, contextlib.suppress(OSError):
            probe.bind(("127.0.0.1", port))
            if port not in _given_ports:
                _given_ports.add(port)
                return port
