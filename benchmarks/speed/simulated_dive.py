"""Processor time of a dive of `ground simulate`: vehicle and autopilot in one compiled loop."""

import time

from autopilot.control import params
from benchmarks.speed import physics
from benchmarks.speed.closed_loop import PHYSICS_ALONE
from benchmarks.speed.results import Measurement, Reference
from benchmarks.speed.session import Session
from ground.missions import plans
from mavlink_io.tick import TICK_S
from sitl.core import timestep
from sitl.vehicle import config
from sysid.monte_carlo import samples, simulate
from sysid.monte_carlo.simulate import Sea
from sysid.reproduction.paper_tables import TABLE_3_INITIAL
from sysid.test_design import prior as design_priors

MISSION = "trim"
"""A straight leg of 150 s."""
DEEP_MISSION = "elevator_steps"
"""Legs and tests 10 m deep, clear of the surface."""
DIVE_S = 150.0
"""Vehicle time to which the processor time is scaled."""


def dive_cpu_s(seed: int, mission: str = MISSION, *, fine_steps: bool = False) -> float:
    """Simulate a dive and return its processor time for `DIVE_S` of vehicle time."""
    known = design_priors.from_file(config.load("caribou_nominal"))
    vehicle = known.vehicle(known.mean)
    parameters = params.config({**TABLE_3_INITIAL, **samples.trims_deg(vehicle)})
    items, conditions = plans.load(mission).items, (parameters, Sea(), (1, seed))
    began_s = time.process_time()
    dive = simulate.fly(vehicle, known.noise, items, *conditions, fine_steps=fine_steps)
    return (time.process_time() - began_s) * DIVE_S / dive.seconds


def measure(session: Session) -> list[Measurement]:
    """Measure `simulated-dive`."""
    dive_cpu_s(0)
    costs_s, floors_s = [], []
    for seed in range(1, session.repetitions("simulated-dive") + 1):
        floors_s.append(physics.kernel_cpu_s(DIVE_S, timestep.SUBSTEP_S))
        costs_s.append(dive_cpu_s(seed))
        session.report(f"simulated-dive: {costs_s[-1]:.3f} s; physics alone {floors_s[-1]:.3f} s")
    return [
        Measurement("simulated-dive", tuple(costs_s), Reference(PHYSICS_ALONE, tuple(floors_s)))
    ]


def measure_four_steps(session: Session) -> list[Measurement]:
    """Measure `closed-loop`."""
    return [_speed(session, "closed-loop", timestep.SUBSTEP_S, fine_steps=True)]


def measure_one_step(session: Session) -> list[Measurement]:
    """Measure `closed-loop-20ms`."""
    return [_speed(session, "closed-loop-20ms", TICK_S, fine_steps=False)]


def _speed(session: Session, row: str, step_s: float, *, fine_steps: bool) -> Measurement:
    """Measure the speed of deep dives, and of the physics alone with the same steps."""
    dive_cpu_s(0, DEEP_MISSION)
    speeds, floors = [], []
    for seed in range(1, session.repetitions(row) + 1):
        floors.append(1.0 / physics.kernel_cpu_s(1.0, step_s))
        speeds.append(DIVE_S / dive_cpu_s(seed, DEEP_MISSION, fine_steps=fine_steps))
        session.report(f"{row}: {speeds[-1]:.0f} x real time; physics alone {floors[-1]:.0f} x")
    return Measurement(row, tuple(speeds), Reference(PHYSICS_ALONE, tuple(floors)))
