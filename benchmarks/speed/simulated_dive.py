"""Processor time of a dive of `ground simulate`."""

import time

from autopilot.control import params
from benchmarks.speed import physics
from benchmarks.speed.closed_loop import PHYSICS_ALONE
from benchmarks.speed.results import Measurement, Reference
from benchmarks.speed.session import Session
from ground.missions import plans
from sitl.core import timestep
from sitl.vehicle import config
from sysid.monte_carlo import samples, simulate
from sysid.monte_carlo.simulate import Sea
from sysid.reproduction.paper_tables import TABLE_3_INITIAL
from sysid.test_design import prior as design_priors

MISSION = "trim"
"""A straight leg of 150 s."""
DIVE_S = 150.0
"""Vehicle time to which the processor time is scaled."""


def dive_cpu_s(seed: int) -> float:
    """Simulate a dive and return its processor time for `DIVE_S` of vehicle time."""
    known = design_priors.from_file(config.load("caribou_nominal"))
    vehicle = known.vehicle(known.mean)
    parameters = params.config({**TABLE_3_INITIAL, **samples.trims_deg(vehicle)})
    items = plans.load(MISSION).items
    began_s = time.process_time()
    dive = simulate.fly(vehicle, known.noise, items, parameters, Sea(), (1, seed))
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
