"""Current and accelerating water.

Verifies: that a uniform current only adds its drift to the motion of a vehicle; that accelerating
water accelerates a neutral body equally, and a light or heavy body according to added mass and
pressure. Leaves out: shear along the hull; how a current varies with depth, which
belongs to the environment. Reference: Galilean invariance; (rho V + m_a) / (m + m_a) of the water's
acceleration for a free body (Batchelor 1967, sec. 6.8), 3/2 and 9/13 for spheres of half and 5/3
the water's density. Tolerance: rounding, as it grows in 60 s.
"""

from collections.abc import Iterator

import numpy as np

from sitl.vehicle import config
from sitl.vehicle.water import Water, drifting
from tests.reference import bodies
from tests.reference.check import Check, relative, worst
from tests.sitl.vehicle import flight

SECONDS = 60.0
CURRENT_MPS = (0.7, -0.4, 0.1)
SURGING = Water(acceleration_mps2=(0.3, -0.2, 0.1))


def checks() -> Iterator[Check]:
    """Yield the checks in a steady current, then in accelerating water."""
    for name in config.SHIPPED:
        yield from _drifting(name)
    neutral, state = bodies.spheroid(3.0, 0.5), flight.tumbling()
    state[7:13] = 0.0
    gained = flight.rotation(state) @ flight.rate(neutral, state, water=SURGING)[7:10]
    yield worst(
        "neutral spheroid against the water",
        "m/s2",
        gained,
        SURGING.acceleration_mps2,
        1e-14,
        "rides along",
    )
    for ratio, reference in ((0.5, 3 / 2), (5 / 3, 9 / 13)):
        sphere = bodies.spheroid(1.0, 1.0, mass_ratio=ratio)
        still_water_rate = flight.rate(sphere, state)[7:10]
        gained = flight.rotation(state) @ (
            flight.rate(sphere, state, water=SURGING)[7:10] - still_water_rate
        )
        quotient = gained[0] / SURGING.acceleration_mps2[0]
        yield relative(
            f"sphere of {ratio:.3g} the density",
            "-",
            quotient,
            reference,
            1e-12,
            "Batchelor 1967, 6.8",
        )


def _drifting(name: str) -> Iterator[Check]:
    model, start, current = flight.model(name), flight.tumbling(), np.array(CURRENT_MPS)
    inputs = flight.Inputs(rudder_rad=0.1, elevator_rad=-0.05, thrust_fraction=0.6)
    still = flight.fly(model, start, SECONDS, **inputs)
    start[7:10] += flight.rotation(start).T @ current
    carried = flight.fly(model, start, SECONDS, water=drifting(CURRENT_MPS), **inputs)
    offset = np.linspace(0, SECONDS, len(still))[:, None] * current
    yield worst(
        f"{name}, attitude", "-", carried[:, 3:7], still[:, 3:7], 1e-7, "Galilean invariance"
    )
    yield worst(
        f"{name}, place less drift",
        "m",
        carried[:, :3] - offset,
        still[:, :3],
        1e-6,
        "Galilean invariance",
    )
