"""How many times faster than life a recorded dive flies: vehicle seconds over wall seconds, arming
to disarming.

Real processes, UDP lockstep at 50 Hz, every message recorded over TCP. Beside it, in the same run,
the same tick without any process or socket, so that the figure can be judged on whatever machine it
was taken.

    python benchmarks/lockstep.py [MISSION] [--dives N]
"""

import argparse
import statistics
import sys
import tempfile
import time
from pathlib import Path

from autopilot.control import core
from autopilot.control.params import Config
from autopilot.control.types import Inputs
from ground.client import flight
from ground.simulation.processes import SimulatedVehicle, Simulation
from sitl import scenario
from sitl.core import plant, timestep
from sitl.vehicle import config

TICKS = 5000


def recorded_dive(mission: str, folder: Path, number: int) -> float:
    """Times real time that one dive flew at."""
    dive = flight.Dive.load(mission, folder / f"{number}.mcap")
    outcome = flight.fly_simulated(
        dive, SimulatedVehicle(Simulation(scenario="disturbed", seed=number))
    )
    assert outcome.lost_frames == 0
    return outcome.vehicle_s / outcome.wall_s


def bare_ticks() -> float:
    """Times real time that the two pure functions reach alone."""
    sea, rng = (
        plant.build(config.load("caribou_truth"), scenario.load("disturbed")),
        plant.random_streams(1),
    )
    body, reading = plant.initial_state(sea, rng)
    state, parameters = core.initial_state(), Config()
    began_s = time.perf_counter()
    for _ in range(TICKS):
        state, frame, _, _ = core.tick(
            state, Inputs(reading.frame, reading.gps, reading.altimeter, None), parameters
        )
        body, reading = plant.step(sea, body, frame, rng)
    return TICKS * timestep.TICK_S / (time.perf_counter() - began_s)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("mission", nargs="?", default="combined")
    parser.add_argument("--dives", type=int, default=5)
    asked = parser.parse_args()
    bare_ticks()  # compiles, and warms the caches
    with tempfile.TemporaryDirectory() as folder:
        speeds = []
        for number in range(asked.dives):
            speeds.append(recorded_dive(asked.mission, Path(folder), number))
            sys.stderr.write(f"dive {number + 1}: {speeds[-1]:.0f} x real time\n")
    alone = bare_ticks()
    median = statistics.median(speeds)
    sys.stdout.write(
        f"recorded dive over UDP: median {median:.0f} x real time (best {max(speeds):.0f}, worst"
        f" {min(speeds):.0f})\nthe same ticks without processes: {alone:.0f} x; ratio"
        f" {median / alone:.2f}\n"
    )


if __name__ == "__main__":
    main()
