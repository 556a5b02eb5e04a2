"""Speed of recorded dives: vehicle seconds per wall second, from arming to disarming.

Each dive is flown by real processes in UDP lockstep at 50 Hz, and every message is recorded over
TCP. The same ticks without processes and sockets are measured in the same run: compare the figures
of different machines by their ratio.

    python benchmarks/lockstep.py [MISSION] [--dives N] [--busy]

With --busy, one more process per core computes all the time, as other programs may.
"""

import argparse
import contextlib
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from autopilot.control import core
from autopilot.control.params import Config
from autopilot.control.types import Inputs
from ground.client import flight
from ground.simulation import affinity
from ground.simulation.processes import SimulatedVehicle, Simulation
from sitl import scenario
from sitl.core import plant, timestep
from sitl.vehicle import config

TICKS = 5000


def recorded_dive(mission: str, folder: Path, number: int) -> float:
    """Return the speed of one dive, as a multiple of real time."""
    dive = flight.Dive.load(mission, folder / f"{number}.mcap")
    simulated = SimulatedVehicle(Simulation(scenario="disturbed", seed=number))
    outcome = flight.fly_simulated(dive, simulated)
    assert outcome.lost_frames == 0
    return outcome.vehicle_s / outcome.wall_s


def bare_ticks() -> float:
    """Return the speed of simulator step and autopilot tick alone, as a multiple of real time."""
    sea = plant.build(config.load("caribou_truth"), scenario.load("disturbed"))
    rng = plant.random_streams(1)
    body, reading = plant.initial_state(sea, rng)
    state, parameters = core.initial_state(), Config()
    began_s = time.perf_counter()
    for _ in range(TICKS):
        inputs = Inputs(reading.frame, reading.gps, reading.altimeter, None)
        state, frame, _, _ = core.tick(state, inputs, parameters)
        body, reading = plant.step(sea, body, frame, rng)
    return TICKS * timestep.TICK_S / (time.perf_counter() - began_s)


@contextlib.contextmanager
def busy_loops(count: int) -> Iterator[list[subprocess.Popen[bytes]]]:
    """Run processes that compute all the time, on whatever cores the system gives them."""
    command = [sys.executable, "-c", "while True: pass"]
    with contextlib.ExitStack() as stack:
        loops = []
        for _ in range(count):
            loops.append(stack.enter_context(subprocess.Popen(command)))
            stack.callback(loops[-1].kill)
        yield loops


def measure(mission: str, dives: int) -> tuple[list[float], float]:
    """Return the speed of each dive and that of the bare ticks, as multiples of real time."""
    bare_ticks()  # compiles the code and fills the caches
    speeds = []
    with tempfile.TemporaryDirectory() as folder:
        for number in range(dives):
            speeds.append(recorded_dive(mission, Path(folder), number))
            sys.stderr.write(f"dive {number + 1}: {speeds[-1]:.0f} x real time\n")
    return speeds, bare_ticks()


def in_words(speeds: list[float], alone: float) -> str:
    """Return the median of the dives, their range, and the ratio to the bare ticks."""
    median = statistics.median(speeds)
    return (
        f"recorded dive over UDP, {len(speeds)} dives: median {median:.0f} x real time "
        f"({min(speeds):.0f} to {max(speeds):.0f})\n"
        f"the same ticks without processes: {alone:.0f} x; ratio {median / alone:.2f}\n"
    )


def machine_in_words(busy_loops: int, before: float, after: float) -> str:
    """Return the number of cores and the load: mean count of runnable processes (getloadavg(3))."""
    return (
        f"{len(affinity.cores()) or os.cpu_count()} cores, {busy_loops} busy loops started here; "
        f"load average of the last minute {before:.1f} before, {after:.1f} after\n"
    )


def main() -> None:
    """Print the speed of dives in lockstep."""
    raw = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=raw)
    parser.add_argument("mission", nargs="?", default="combined")
    parser.add_argument("--dives", type=int, default=5, help="number of dives; 5")
    parser.add_argument("--busy", action="store_true", help="load every core with another process")
    asked = parser.parse_args()
    if asked.dives < 1:
        parser.error(f"--dives {asked.dives}: must be at least 1")
    loops = (len(affinity.cores()) or os.cpu_count() or 1) if asked.busy else 0
    before = os.getloadavg()[0]
    with busy_loops(loops):
        speeds, alone = measure(asked.mission, asked.dives)
    sys.stdout.write(machine_in_words(loops, before, os.getloadavg()[0]) + in_words(speeds, alone))


if __name__ == "__main__":
    main()
