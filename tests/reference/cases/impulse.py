"""Added-mass impulse.

Verifies: that a short push accelerates body and added mass together, in all six directions and
their couplings; the apparent mass of a sphere. Leaves out: every force that depends on speed,
because the body is pushed for one step from rest. Reference: M^-1 J with M = M_RB + M_A assembled
here from mass, centre of mass and inertia; 3/2 of the displaced mass for a sphere (Lamb 1932, sec.
92). Tolerance: 1e-6 of the change of speed: what one step of Coriolis force adds.
"""

from collections.abc import Iterator

import numpy as np

from sitl.vehicle import config
from tests.reference import bodies, fossen
from tests.reference.check import Check, relative, worst
from tests.sitl.vehicle import flight

STEP_S = 0.005
PUSH = 0.01 * np.array([100.0, -70.0, 40.0, 8.0, -20.0, 30.0])
"""N and N m."""


def checks() -> Iterator[Check]:
    """Yield the checks of shipped vehicles, then of the sphere."""
    for name in config.SHIPPED:
        model = flight.without_weight(flight.without_fluid_forces(flight.model(name)))
        ship = fossen.craft(model)
        lever = ship.m * fossen.S(ship.r_g)
        M = np.block([[ship.m * np.eye(3), -lever], [lever, ship.I_b]]) + ship.M_A
        for i, direction in enumerate(("surge", "sway", "heave", "roll", "pitch", "yaw")):
            push = np.where(np.arange(6) == i, PUSH, 0.0)
            gained = flight.fly(model, flight.cruising(0.0), STEP_S, disturbance=push)[-1, 7:13]
            expected = fossen.FLIP @ np.linalg.solve(M, fossen.FLIP @ push * STEP_S)
            size = np.linalg.norm(expected)
            yield worst(
                f"{name}, {direction}", "part", gained / size, expected / size, 1e-6, "M^-1 J"
            )
    yield relative(
        "sphere, apparent mass / displaced mass", "-", _sphere(), 1.5, 1e-9, "Lamb 1932, sec. 92"
    )


def _sphere() -> float:
    """Force over acceleration, over displaced mass."""
    ball = bodies.spheroid(1.0, 1.0)
    push = np.array([3.0, 4.0, 0.0, 0.0, 0.0, 0.0])
    rate = flight.rate(ball, flight.cruising(0.0), disturbance=push)
    return float(5.0 / np.linalg.norm(rate[7:10]) / ball.inertia.mass_kg)
