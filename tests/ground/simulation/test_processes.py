"""A simulated vehicle's processes: what the simulator reports while it runs."""

from collections.abc import Sequence
from pathlib import Path

import pytest

from ground.simulation import affinity, processes
from ground.simulation.processes import SimulatedVehicle, Simulation


class RunningChild:
    """A child process that runs until it is terminated."""

    def poll(self) -> None:
        """Return None: the process runs."""

    def pin(self, core: int) -> None:
        """Ignore the core."""

    def terminate(self) -> None:
        """Do nothing."""

    def end(self, within_s: float) -> None:
        """Do nothing."""


def test_compilation_is_reported_once_and_an_error_is_left_to_the_end() -> None:
    files: dict[str, Path] = {}

    def start(module: str, arguments: Sequence[str], stderr_file: Path) -> RunningChild:
        files[module] = stderr_file
        return RunningChild()

    lines: list[str] = []
    with SimulatedVehicle(Simulation(), start=start, notify=lines.append) as vehicle:
        vehicle.check()
        assert lines == []
        files["autopilot"].write_text("not of the simulator\n")
        files["sitl"].write_text("sitl: scenario storm: No such file or directory\n")
        vehicle.check()
        assert lines == []
        files["sitl"].write_text("sitl: compiling the physics\n")
        vehicle.check()
        vehicle.check()
        assert lines == ["sitl: compiling the physics"]


def start_child(module: str, arguments: Sequence[str], stderr_file: Path) -> RunningChild:
    return RunningChild()


def test_ports_of_an_ended_dive_are_given_back(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without ports left, the next dive waited for ever."""
    monkeypatch.setattr(processes, "_given_ports", set())
    vehicle = SimulatedVehicle(Simulation(), start=start_child)
    assert len(processes._given_ports) == 2
    vehicle.stop()
    assert not processes._given_ports
    vehicle.stop()


def test_program_that_cannot_start_occupies_no_core_and_no_port() -> None:
    def refuse(module: str, arguments: Sequence[str], stderr_file: Path) -> RunningChild:
        raise OSError("no such program")

    dives, ports = affinity._dives_on.total(), set(processes._given_ports)
    with pytest.raises(OSError, match="no such program"):
        SimulatedVehicle(Simulation(), start=refuse)
    assert affinity._dives_on.total() == dives
    assert processes._given_ports == ports
