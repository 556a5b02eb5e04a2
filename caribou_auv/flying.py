"""Dives with the simulator and the autopilot as processes, or with a real vehicle."""

import json
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from importlib import resources
from numbers import Real
from pathlib import Path

from caribou_auv.parameters import checked
from ground.campaign import prototype, refit
from ground.client import flight
from ground.client.flight import Dive
from ground.log_tools.comparison import DiveErrors, compare
from ground.output_files import new_file
from ground.simulation.processes import SimulatedVehicle, Simulation
from ground.simulation.subprocesses import ChildProcess, CommandProcess, SpawnedProcess
from mavlink_io.errors import InputError
from mavlink_io.mission_items import MavCmd
from mavlink_io.text_files import read_text
from sitl import scenario as scenarios
from sysid.data import readers
from sysid.data.dataset import Log

Fault = Mapping[str, float | str]
"""One row ``[[fault]]`` of a scenario file (docs/faults.md), such as
``{"at_s": 60.0, "unit": "rudder", "kind": "stuck"}``."""


@dataclass(frozen=True)
class Flight:
    """A finished dive."""

    log_file: Path
    vehicle_s: float
    """Vehicle time of the dive."""
    failsafes: tuple[str, ...]
    """Failsafes of the dive; empty for a dive that ended as planned."""
    texts: tuple[str, ...]
    """Texts of the vehicle."""
    lost_frames: int

    @cached_property
    def log(self) -> Log:
        """Content of the log."""
        return readers.read(self.log_file)

    @property
    def errors(self) -> DiveErrors:
        """Errors of heading, pitch and depth on constant set-points, after settling."""
        return compare({self.log_file.stem: self.log}).dives[0]

    @property
    def trims(self) -> dict[str, float]:
        """TRIM_RUD_DEG and TRIM_ELE_DEG: mean commands in the last 60 s of a straight mission."""
        return refit.measure_trims(self.log_file)


def fly(
    mission: str | Path,
    log: str | Path,
    *,
    parameters: Mapping[str, float] | None = None,
    connect: str | None = None,
    vehicle: str | Path = "caribou_truth",
    scenario: str | Path = "calm",
    seed: int = 1,
    speed: str | float = "max",
    faults: Sequence[Fault] = (),
    truth: str | Path | None = None,
    autopilot: Sequence[str] = (),
) -> Flight:
    """Fly a mission and record it, as `ground fly` does.

    Parameters
    ----------
    mission : str or Path
        Name of a shipped mission, or a ``.toml``, ``.plan`` or QGC WPL 110 file.
    log : str or Path
        MCAP log to write; an existing file is refused.
    parameters : mapping, optional
        Parameters to set before the dive. Without them a simulated vehicle has first gains for its
        vehicle file, and learns its trims if the mission has no tests.
    connect : str, optional
        Address of a vehicle, such as ``udpin:127.0.0.1:14550``. Without it a simulated vehicle is
        started on free ports and stopped at the end.
    vehicle, scenario : str or Path
        Simulated vehicle and sea: a shipped name or a file.
    seed : int
        Seed of all random streams of the simulation.
    speed : str or float
        Vehicle time per wall time, or ``max``.
    faults : sequence of mapping
        Scheduled faults of the simulation, in addition to those of the scenario.
    truth : str or Path, optional
        MCAP file for the true state of the simulation.
    autopilot : sequence of str
        Command of another autopilot that flies the simulated vehicle. It is started with the
        options ``--hil ADDRESS --gcs ADDRESS`` and must serve parameters and missions
        (docs/mavlink.md).

    Returns
    -------
    Flight
        Log and outcome.

    Raises
    ------
    CaribouError
        An input cannot be used, or the vehicle was not found, refused or was lost.
    """
    log_file = new_file(Path(log))
    dive = Dive.load(str(mission), log_file, parameters=checked(parameters))
    if connect is not None:
        for name, value in (("faults", faults), ("truth", truth), ("autopilot", autopilot)):
            if value:
                raise InputError(f"{name} = {value!r}: is for a simulated vehicle, without connect")
        return _flight(flight.fly(dive, connect))
    if not autopilot:
        prototype.check_flown(str(vehicle))
    if parameters is None:
        dive = _with_first_parameters(dive, str(vehicle))
    with _scenario_with_faults(str(scenario), faults) as scenario_file:
        simulation = Simulation(
            vehicle=str(vehicle),
            scenario=scenario_file,
            seed=seed,
            speed=str(speed),
            truth=Path(truth) if truth else None,
        )
        start = _AutopilotCommand(autopilot) if autopilot else SpawnedProcess
        return _flight(flight.fly_simulated(dive, SimulatedVehicle(simulation, start=start)))


class _AutopilotCommand:
    """Process factory that starts another command as the autopilot."""

    def __init__(self, command: Sequence[str]) -> None:
        self._command = tuple(command)

    def __call__(self, module: str, arguments: Sequence[str], stderr_file: Path) -> ChildProcess:
        """Return the started process."""
        if module != "autopilot":
            return SpawnedProcess(module, arguments, stderr_file)
        links = [
            part
            for name in ("--hil", "--gcs")
            for part in (name, arguments[arguments.index(name) + 1])
        ]
        try:
            return CommandProcess([*self._command, *links], stderr_file)
        except OSError as error:
            raise InputError(
                f"autopilot: {self._command[0]}: {error.strerror}; give a program and its arguments"
            ) from None


def _flight(result: flight.FlightResult) -> Flight:
    """Return the public record of a dive."""
    return Flight(
        log_file=result.log,
        vehicle_s=result.vehicle_s,
        failsafes=result.failsafes,
        texts=result.texts,
        lost_frames=result.lost_frames,
    )


def _with_first_parameters(dive: Dive, vehicle: str) -> Dive:
    """Return the dive with first gains, and learning of trims if it has no tests."""
    parameters = prototype.first_dive_parameters(vehicle)
    if not any(item.command == MavCmd.USER_1 for item in dive.items):
        parameters = {**prototype.trim_learning_for(vehicle), **parameters}
    return replace(dive, parameters=parameters)


@contextmanager
def _scenario_with_faults(name: str, faults: Sequence[Fault]) -> Iterator[str]:
    """Yield a scenario with further faults: its name, or a file that is deleted afterwards.

    The file stands beside the scenario, whose floor file has a relative path.
    """
    if not isinstance(faults, Sequence) or not all(isinstance(row, Mapping) for row in faults):
        raise InputError(
            f"faults = {faults!r}: expected a list of faults, such as"
            ' [{"at_s": 60.0, "unit": "rudder", "kind": "stuck"}]'
        )
    if not faults:
        yield name
        return
    shipped = name in scenarios.names()
    if shipped:
        text = (resources.files("sitl") / "scenarios" / f"{name}.toml").read_text(encoding="utf-8")
    else:
        try:
            text = read_text(Path(name))
        except OSError as error:
            raise InputError(f"scenario {name}: {error.strerror}; give a name or a file") from None
        except UnicodeDecodeError:
            raise InputError(f"scenario {name}: is no text in UTF-8; give a TOML file") from None
    folder = None if shipped else Path(name).parent
    with tempfile.NamedTemporaryFile("w", suffix=".toml", dir=folder, encoding="utf-8") as file:
        file.write(text + "".join(map(_fault_table, faults)))
        file.flush()
        yield file.name


def _fault_table(fault: Fault) -> str:
    """Return a fault as a table of a scenario file. Raises InputError."""
    return "\n[[fault]]\n" + "".join(
        f"{_quoted(str(key))} = {_toml_value(key, value)}\n" for key, value in fault.items()
    )


def _toml_value(key: str, value: float | str) -> str:
    """Return a value of a fault as TOML. Raises InputError."""
    if isinstance(value, str):
        return _quoted(value)
    if not isinstance(value, Real) or isinstance(value, bool):
        raise InputError(f"faults: {key} = {value!r}: expected a number or a text")
    return str(value)  # of numpy's numbers, too, whose repr is no TOML


def _quoted(text: str) -> str:
    """Return a text as a TOML string: as in JSON, but DEL is escaped too."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
