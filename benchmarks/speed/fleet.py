"""Cost of several simulated vehicles at once, flown and recorded by one ground station.

    python -m benchmarks.speed.fleet COUNT SPEED

prints vehicle time and processor time of a common window of wall time, as JSON. It is a process of
its own, so that its processor time holds nothing else.
"""

import json
import os
import statistics
import sys
import tempfile
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path
from typing import NamedTuple

from benchmarks.speed import machine
from benchmarks.speed.results import Measurement
from benchmarks.speed.session import Session
from ground.client import flight
from ground.client.flight import FlightProgress
from ground.simulation.processes import SimulatedVehicle, Simulation
from ground.simulation.subprocesses import ForkedProcess
from mavlink_io.errors import OperationError, exit_with_error
from sysid.trials import usable_cores

COUNTS = (1, 2, 4, 8)
"""Numbers of vehicles."""
WINDOW_S = 5.0
"""Wall time of the measurement."""
BEGIN_S = 120.0
"""Wall time in which all vehicles must be under way."""
MISSION = """
name = "fleet"

[[step]]
depth_m = 4.0
heading_deg = 20.0
thrust_pct = 58.0
duration_s = 20000.0

[[step]]
surface = true
"""
"""A leg that outlasts the window at any speed."""


class Window(NamedTuple):
    """Sums over all vehicles, per second of wall time."""

    speed: float
    """Vehicle seconds."""
    cpu_s: float
    """Processor seconds of simulators, autopilots and ground."""


class _WindowEndError(Exception):
    """The window is over."""


class _Fleet:
    """Vehicle time of each vehicle at its last report."""

    def __init__(self, count: int) -> None:
        self.latest: list[tuple[float, float] | None] = [None] * count
        self.over = False

    def fly(self, number: int, speed: str, folder: Path) -> None:
        """Fly one vehicle until the window is over."""
        mission = folder / "fleet.toml"
        dive = flight.Dive.load(str(mission), folder / f"{number}.mcap")
        simulation = Simulation(scenario="disturbed", seed=number + 1, speed=speed)

        def watch(progress: FlightProgress) -> None:
            self.latest[number] = time.monotonic(), progress.vehicle_s
            if self.over:
                raise _WindowEndError

        try:
            flight.fly_simulated(dive, SimulatedVehicle(simulation, start=ForkedProcess), watch)
        except _WindowEndError:
            return
        raise OperationError(f"vehicle {number + 1} ended its dive before the window was over")

    def snapshot(self) -> list[tuple[float, float]]:
        """Return wall time and vehicle time of each vehicle that is under way."""
        return [sample for sample in self.latest if sample is not None]


def fly_window(count: int, speed: str) -> Window:
    """Fly vehicles at once and return the sums of a common window. Raises OperationError."""
    fleet = _Fleet(count)
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(count) as threads:
        (Path(folder) / "fleet.toml").write_text(MISSION, encoding="utf-8")
        dives = [threads.submit(fleet.fly, n, speed, Path(folder)) for n in range(count)]
        try:
            deadline_s = time.monotonic() + BEGIN_S
            while len(fleet.snapshot()) < count:
                if time.monotonic() > deadline_s or any(dive.done() for dive in dives):
                    break
                time.sleep(0.05)
            time.sleep(1.0)
            began, began_s, cpu_s = fleet.snapshot(), time.monotonic(), _cpu_s()
            time.sleep(WINDOW_S)
            ended, cpu_s, wall_s = (
                fleet.snapshot(),
                _cpu_s() - cpu_s,
                time.monotonic() - began_s,
            )
        finally:
            fleet.over = True
        for dive in as_completed(dives):
            dive.result()
    if len(began) < count:
        raise OperationError(f"{count} vehicles were not under way within {BEGIN_S:g} s")
    # A vehicle that reports nothing in the window makes no progress there.
    total = sum(
        (v - u) / (t - s) if t > s else 0.0 for (s, u), (t, v) in zip(began, ended, strict=True)
    )
    if not total:
        raise OperationError(f"none of {count} vehicles reported within {WINDOW_S:g} s")
    return Window(total, cpu_s / wall_s)


def _cpu_s() -> float:
    """Return the processor time of this process and all below it (s)."""
    table = machine.process_table()
    return sum(entry.cpu_s for entry in machine.descendants(table, os.getpid()).values())


def possible_speed(count: int, alone: Window, cores: int, wanted: float | None = None) -> float:
    """Return the speed that several vehicles can reach together.

    Parameters
    ----------
    count : int
        Number of vehicles.
    alone : Window
        One vehicle alone.
    cores : int
        Number of cores.
    wanted : float, optional
        Requested speed of each vehicle; without it, as fast as one alone.

    Returns
    -------
    float
        Vehicle seconds per second, in proportion to the number of vehicles until the cores are
        full.
    """
    cpu_s_per_vehicle_s = alone.cpu_s / alone.speed
    return min(count * (wanted or alone.speed), cores / cpu_s_per_vehicle_s)


def is_within_cores(count: int, alone: Window, cores: int, wanted: float | None = None) -> bool:
    """Return whether several vehicles do not outnumber the cores, or at least do not fill them."""
    wish = count * (wanted or alone.speed)
    return count <= cores or possible_speed(count, alone, cores, wanted) == wish


def measure_real_time(session: Session) -> list[Measurement]:
    """Measure `vehicles-real-time`."""
    return _measurements(session, "vehicles-real-time", "1")


def measure_max(session: Session) -> list[Measurement]:
    """Measure `vehicles-max`."""
    return _measurements(session, "vehicles-max", "max")


def _measurements(session: Session, row: str, speed: str) -> list[Measurement]:
    """Measure all numbers of vehicles; the repetitions alternate between them.

    A number of vehicles that fails, such as too many for the machine, is noted in its figure.
    """
    windows: dict[int, list[Window]] = {count: [] for count in COUNTS}
    failures: dict[int, str] = {}
    for count in COUNTS * session.repetitions(row):
        arguments = ["-m", "benchmarks.speed.fleet", str(count), speed]
        try:
            window = Window(*json.loads(machine.output_of(arguments)))
        except OperationError as error:
            failures[count] = str(error)
            session.report(f"{row}: {count}: {error}")
        else:
            windows[count].append(window)
            session.report(f"{row}: {count}: {window.speed:.1f} x real time")
    wanted = None if speed == "max" else float(speed)
    return [_measurement(row, count, windows, failures.get(count, ""), wanted) for count in COUNTS]


def _measurement(
    row: str, count: int, windows: dict[int, list[Window]], failure: str, wanted: float | None
) -> Measurement:
    """Return the measurement of one number of vehicles."""
    case = f"{count} vehicle{'s' if count > 1 else ''}"
    if failure or not windows[1]:
        return Measurement(
            row, (), case=case, note=f"not measured: {failure or 'one alone failed'}"
        )
    alone = Window(*(statistics.median(column) for column in zip(*windows[1], strict=True)))
    possible = possible_speed(count, alone, usable_cores(), wanted)
    return Measurement(
        row,
        tuple(100.0 * window.speed / possible for window in windows[count]),
        case=case,
        details=_details(windows[count]),
        is_judged=is_within_cores(count, alone, usable_cores(), wanted),
    )


def _details(windows: Sequence[Window]) -> dict[str, float]:
    """Return the medians of speed, cores in use and cost of a vehicle second."""
    return {
        "speed of all, x real time": statistics.median(w.speed for w in windows),
        "cores in use": statistics.median(w.cpu_s for w in windows),
        "processor time per vehicle second, ms": statistics.median(
            1e3 * w.cpu_s / w.speed for w in windows
        ),
    }


def main() -> None:
    """Print speed and processor time of a window."""
    try:
        window = fly_window(int(sys.argv[1]), sys.argv[2])
    except OperationError as error:
        exit_with_error("fleet", error)
    sys.stdout.write(json.dumps(window))


if __name__ == "__main__":
    main()
