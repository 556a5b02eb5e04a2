"""Memory of the programs in a dive, and the time of their help."""

import os

from benchmarks.speed import machine
from benchmarks.speed.dives import MISSION
from benchmarks.speed.results import Measurement, Reference
from benchmarks.speed.session import Session
from ground.client import flight
from ground.client.flight import FlightProgress
from ground.simulation.processes import SimulatedVehicle, Simulation
from mavlink_io.errors import OperationError

PROGRAMS = ("ground", "sitl", "autopilot")
BARE = "bare interpreter"


def _peaks_mb(session: Session, number: int) -> dict[str, float]:
    """Fly a dive and return the peak memory of each program. Raises OperationError."""
    peaks: dict[str, float] = {}

    def watch(progress: FlightProgress) -> None:
        del progress
        for pid, entry in machine.descendants(machine.process_table(), os.getpid()).items():
            for name in ("sitl", "autopilot"):
                if f"-m {name} " in entry.command and (peak := machine.peak_memory_mb(pid)):
                    peaks[name] = max(peak, peaks.get(name, 0.0))

    dive = flight.Dive.load(MISSION, session.folder / f"memory-{number}.mcap")
    flight.fly_simulated(dive, SimulatedVehicle(Simulation(seed=number)), watch)
    if len(peaks) < 2:
        raise OperationError("memory: this system does not report the memory of processes (/proc)")
    return peaks


def _floor_mb(statement: str) -> float:
    """Return the peak memory of an interpreter that runs a statement."""
    program = f"{statement}\nprint(open('/proc/self/status').read())"
    return machine.peak_mb(machine.output_of(["-c", program])) or 0.0


def measure_memory(session: Session) -> list[Measurement]:
    """Measure `memory-sitl` and `memory-autopilot`."""
    numbers = range(session.repetitions("memory-sitl"))
    peaks = [_peaks_mb(session, number) for number in numbers]
    session.report(
        f"memory: sitl {peaks[-1]['sitl']:.0f} MB, autopilot {peaks[-1]['autopilot']:.0f} MB"
    )
    numpy_mb = tuple(_floor_mb("import numpy") for _ in numbers)
    bare_mb = tuple(_floor_mb("pass") for _ in numbers)
    return [
        Measurement(
            "memory-sitl",
            tuple(peak["sitl"] for peak in peaks),
            Reference("interpreter with numpy", numpy_mb),
        ),
        Measurement(
            "memory-autopilot",
            tuple(peak["autopilot"] for peak in peaks),
            Reference(BARE, bare_mb),
        ),
    ]


def measure_help(session: Session) -> list[Measurement]:
    """Measure `help` of each program."""
    measured = []
    for program in PROGRAMS:
        machine.run(["-m", program, "--help"])
        pairs = [
            (machine.run(["-c", "pass"]).wall_s, machine.run(["-m", program, "--help"]).wall_s)
            for _ in range(session.repetitions("help"))
        ]
        floors_s, walls_s = zip(*pairs, strict=True)
        session.report(f"help: {program} {walls_s[-1]:.2f} s")
        measured.append(Measurement("help", walls_s, Reference(BARE, floors_s), case=program))
    return measured
