"""Speed of simulator and autopilot as functions in one process, without sockets.

    python -m benchmarks.speed.closed_loop

prints the processor time of the autopilot's tick (us): with NUMBA_DISABLE_JIT=1 that of plain
Python.
"""

import sys
import time
from collections.abc import Callable
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
Loop = Callable[[int], float]
"""Fly a number of ticks from arming on; return their processor time (s)."""


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


def four_steps(ticks: int) -> float:
    """Fly with four Runge-Kutta steps of 5 ms in each tick; return the processor time (s)."""
    sea, streams, body, parameters, pilot, frame = armed()
    began_s = time.process_time()
    for _ in range(ticks):
        body, reading = plant.step(sea, body, frame, streams)
        pilot, frame, _, _ = core.tick(pilot, _inputs(reading), parameters)
    return time.process_time() - began_s


ONE_STEP: Loop | None = None
"""As `four_steps` with one step of 20 ms in each tick; None: the simulator has no such function."""


def speed(loop: Loop) -> float:
    """Return the speed of a loop, as a multiple of real time; the first ticks warm up."""
    loop(50)
    return TICKS * timestep.TICK_S / loop(TICKS)


def measure_four_steps(session: Session) -> list[Measurement]:
    """Measure `closed-loop`."""
    return [_measurement(session, "closed-loop", four_steps, timestep.SUBSTEP_S)]


def measure_one_step(session: Session) -> list[Measurement]:
    """Measure `closed-loop-20ms`."""
    if ONE_STEP is None:
        return [Measurement("closed-loop-20ms", (), note="not built")]
    return [_measurement(session, "closed-loop-20ms", ONE_STEP, timestep.TICK_S)]


def _measurement(session: Session, row: str, loop: Loop, step_s: float) -> Measurement:
    """Measure the speed of a loop, and of the physics alone with the same steps."""
    speeds, floors = [], []
    for _ in range(session.repetitions(row)):
        floors.append(1.0 / physics.kernel_cpu_s(1.0, step_s))
        speeds.append(speed(loop))
        session.report(f"{row}: {speeds[-1]:.0f} x real time; physics alone {floors[-1]:.0f} x")
    return Measurement(row, tuple(speeds), Reference(PHYSICS_ALONE, tuple(floors)))


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
    return 100.0 * float(printed) / timestep.TICK_US


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
