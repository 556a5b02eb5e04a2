"""Turning circle and zig-zag.

Verifies: all forces on a moving vehicle together and in large motion: the kernels against a second
implementation that shares the vehicle's numbers but no code; also the accelerations at random
states. Leaves out: the tailcone (the duct moves without delay), the surface; the values of the
coefficients, which other cases verify. Reference: Fossen's equations in matrix
form with Euler angles (``tests/reference/fossen.py``), integrated by scipy's DOP853 at a tolerance
of 1e-7. Tolerance: rounding for accelerations; for manoeuvres 1e-5 of the figure, what two
integrators leave.
"""

from collections.abc import Iterator
from math import degrees, radians

import numpy as np

from sitl.vehicle import config
from sitl.vehicle.model import VehicleModel
from sitl.vehicle.water import drifting
from tests.reference import fossen, trials, vehicles
from tests.reference.check import Check, relative, worst
from tests.sitl.vehicle import flight

CIRCLE_RAD, CIRCLE_S = radians(10), 60.0
ZIGZAGS = (radians(10), radians(15))
STATES = 60
SOURCE = "Fossen, matrix form"


def checks() -> Iterator[Check]:
    """Any vehicle's accelerations, then every shipped vehicle, one manoeuvre after the other."""
    yield _accelerations(f"{vehicles.FLEET} random vehicles", vehicles.fleet())
    for name in config.SHIPPED:
        model, point = flight.model(name), config.load(name).operating_point
        yield _accelerations(name, [model])
        under_way = model, point.speed_mps, point.thrust_fraction * model.propeller.full_rps
        ours, theirs = trials.kernels(*under_way), trials.matrices(*under_way)
        circles = (trials.circle(ship, CIRCLE_RAD, CIRCLE_S) for ship in (ours, theirs))
        yield from _compared(f"{name}, circle at {degrees(CIRCLE_RAD):.0f} deg", *circles)
        for angle in ZIGZAGS:
            label = f"{name}, zig-zag {degrees(angle):.0f}/{degrees(angle):.0f}"
            yield from _compared(label, *(trials.zigzag(ship, angle) for ship in (ours, theirs)))


def _compared(
    label: str, ours: trials.Circle | trials.Zigzag, theirs: trials.Circle | trials.Zigzag
) -> Iterator[Check]:
    """Field by field."""
    for field, value, reference in zip(ours._fields, ours, theirs, strict=True):
        words, _, unit = field.replace("mps", "m/s").replace("degps", "deg/s").rpartition("_")
        yield relative(f"{label}: {words.replace('_', ' ')}", unit, value, reference, 1e-5, SOURCE)


def _accelerations(name: str, models: list[VehicleModel]) -> Check:
    """Random attitude, speeds, inputs and current."""
    rng, found, expected = np.random.default_rng(7), [], []
    for model in models * (STATES // len(models)):
        state = flight.tumbling()
        state[3:7] = (turn := rng.normal(size=4)) / np.linalg.norm(turn)
        state[7:13] = rng.uniform(-1.5, 1.5, 6)
        rudder_rad, elevator_rad = rng.uniform(-0.25, 0.25, 2).tolist()
        inputs = fossen.Inputs(rudder_rad, elevator_rad, float(rng.uniform(-4, 6)))
        current = rng.uniform(-1, 1, 3)
        found.append(
            fossen.FLIP
            @ flight.rate(model, state, *inputs, water=drifting(tuple(current.tolist())))[7:]
        )
        expected.append(
            fossen.rates(
                fossen.from_state(state), inputs, fossen.craft(model), fossen.TURN @ current
            )[6:]
        )
    return worst(
        f"{name}, accelerations at {STATES} states", "m/s2", found, expected, 1e-10, SOURCE
    )
