"""Speed of simulator and autopilot as functions in one process, without sockets.

    python -m benchmarks.speed.closed_loop

prints the processor time of the autopilot's tick (us): with NUMBA_DISABLE_JIT=1 that of plain
Python.
"""

import sys
import time
from typing import NamedTuple

from autopilot.control import core, modes, request_handler, requests
from autopilot.control.params import Config
from autopilot.control.types import AutopilotState, Inputs
from benchmarks.speed import machine, physics
from benchmarks.speed.results import Measurement, Reference
from benchmarks.speed.session import Session
from ground.missions import plans
from mavlink_io.errors import OperationError
from mavlink_io.records import ActuatorFrame
from mavlink_io.tick import TICK_S, TICK_US
from sitl import scenario
from sitl.core import plant, timestep
from sitl.core.plant import Plant, PlantState, RandomStreams
from sitl.core.sensors import Sensors
from sitl.vehicle import config

MISSION, SCENARIO, VEHICLE = "combined", "disturbed", "caribou_truth"
TICKS = 5000
TICKS_PLAIN = 1000
"""Ticks of plain Python, where a step of the simulator takes milliseconds."""
PHYSICS_ALONE = "physics alone"


class Flight(NamedTuple):
    """A vehicle that has just been armed in its mission."""

    sea: Plant
    streams: RandomStreams
    body: PlantState
    parameters: Config
    pilot: AutopilotState
    frame: ActuatorFrame


def armed() -> Flight:
    """Return the vehicle at the start of the mission. Raises OperationError."""
    sea = plant.build(config.load(VEHICLE), scenario.load(SCENARIO))
    streams, parameters = plant.random_streams(1), Config()
    body, reading = plant.initial_state(sea, streams)
    pilot, frame, _, _ = core.tick(core.initial_state(), _inputs(reading), parameters)
    for request in (
        requests.LoadMission(plans.load(MISSION).items),
        requests.SetMode(modes.MISSION.number),
        requests.Arm(),
    ):
        pilot, answer, _ = request_handler.handle_request(pilot, request, parameters)
        if answer.result:
            raise OperationError(f"{MISSION}: the autopilot refused: {answer.text}")
    return Flight(sea, streams, body, parameters, pilot, frame)


def _inputs(reading: Sensors) -> Inputs:
    """Return the inputs of the autopilot's tick."""
    return Inputs(reading.frame, reading.gps, reading.altimeter, None)


def tick_by_tick(ticks: int) -> float:
    """Fly by calling both functions in turn; return the processor time (s)."""
    sea, streams, body, parameters, pilot, frame = armed()
    began_s = time.process_time()
    for _ in range(ticks):
        body, reading = plant.step(sea, body, frame, streams)
        pilot, frame, _, _ = core.tick(pilot, _inputs(reading), parameters)
    return time.process_time() - began_s


def speed() -> float:
    """Return the speed tick by tick, as a multiple of real time; the first ticks warm up."""
    tick_by_tick(50)
    return TICKS * TICK_S / tick_by_tick(TICKS)


def measure(session: Session) -> list[Measurement]:
    """Measure `tick-by-tick`."""
    speeds, floors = [], []
    for _ in range(session.repetitions("tick-by-tick")):
        floors.append(1.0 / physics.kernel_cpu_s(1.0, timestep.SUBSTEP_S))
        speeds.append(speed())
        session.report(f"tick-by-tick: {speeds[-1]:.0f} x; physics alone {floors[-1]:.0f} x")
    return [Measurement("tick-by-tick", tuple(speeds), Reference(PHYSICS_ALONE, tuple(floors)))]


def measure_plain_tick(session: Session) -> list[Measurement]:
    """Measure `plain-tick`: share of a core (%) with ticks at 50 Hz."""
    shares, compiled = [], []
    arguments = ["-m", "benchmarks.speed.closed_loop"]
    for _ in range(session.repetitions("plain-tick")):
        shares.append(_share(machine.output_of(arguments, NUMBA_DISABLE_JIT="1")))
        compiled.append(_share(machine.output_of(arguments, NUMBA_DISABLE_JIT="0")))
        session.report(f"plain-tick: {shares[-1]:.2f} % of a core; with numba {compiled[-1]:.2f} %")
    return [
        Measurement("plain-tick", tuple(shares), Reference("the same with numba", tuple(compiled)))
    ]


def _share(printed: str) -> float:
    """Return the share of a core (%) at 50 Hz from the time of a tick (us)."""
    return 100.0 * float(printed) / TICK_US


def tick_us(ticks: int) -> float:
    """Return the processor time (us) of the autopilot's tick alone; the simulator's is left out."""
    sea, streams, body, parameters, pilot, frame = armed()
    spent_s = 0.0
    for _ in range(ticks):
        body, reading = plant.step(sea, body, frame, streams)
        inputs = _inputs(reading)
        began_s = time.process_time()
        pilot, frame, _, _ = core.tick(pilot, inputs, parameters)
        spent_s += time.process_time() - began_s
    return 1e6 * spent_s / ticks


def main() -> None:
    """Print the processor time of the autopilot's tick (us)."""
    tick_us(50)
    sys.stdout.write(f"{tick_us(TICKS_PLAIN):.3f}\n")


if __name__ == "__main__":
    main()
