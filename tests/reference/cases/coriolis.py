"""Coriolis power.

Verifies: that the Coriolis and centripetal terms of body and added mass, including the Munk moment,
do no work and are equal to those of Fossen's matrices. Leaves out: all other forces.
Reference: nu^T C(nu) nu = 0 for any skew-symmetric C (Fossen 2021, ch. 3 and 6); C_RB and C_A as
written there. Tolerance: rounding.
"""

from collections.abc import Iterator

import numpy as np

from sitl.vehicle import config, forces
from tests.reference import fossen
from tests.reference.check import Check, worst
from tests.sitl.vehicle import flight

MOTIONS = 1000


def checks() -> Iterator[Check]:
    """Yield power and force at a thousand motions."""
    motions = np.random.default_rng(11).uniform(-3, 3, (MOTIONS, 6))
    for name in config.SHIPPED:
        inertia = flight.model(name).inertia
        wrenches = np.array([forces.coriolis(tuple(nu), inertia) for nu in motions.tolist()])
        terms = wrenches * motions
        power = terms.sum(axis=1) / np.abs(terms).sum(axis=1)
        yield worst(
            f"{name}, power of {MOTIONS} motions", "part", power, 0.0, 1e-14, "skew symmetry"
        )
        ship = fossen.craft(flight.model(name))
        flipped = motions @ fossen.FLIP
        expected = [-(fossen.C_RB(nu, ship) + fossen.C_A(nu, ship)) @ nu for nu in flipped]
        yield worst(f"{name}, wrench", "N", wrenches @ fossen.FLIP, expected, 1e-9, "C_RB + C_A")
