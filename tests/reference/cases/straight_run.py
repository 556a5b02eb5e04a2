"""Ten minutes of straight run.

Verifies: that a symmetric vehicle with zero duct angle in still water runs straight, without
heading, roll or sway; and that rounding errors stay small in an oblique current, where symmetry is
not exact to the bit. Leaves out: the autopilot and the sensors, whose errors steer a real vehicle;
bias of the tailcone. Reference: symmetry, hence zero. Tolerance: 0.1 deg of heading in ten minutes,
the requirement; the value is zero to the bit without current.
"""

from collections.abc import Iterator
from math import degrees

from sitl.vehicle import config
from sitl.vehicle.water import drifting
from tests.reference import fossen
from tests.reference.check import Check, worst
from tests.sitl.vehicle import flight

SECONDS = 600.0
OBLIQUE_MPS = (0.31, -0.17, 0.0)


def checks() -> Iterator[Check]:
    """Yield the checks in still water, then in a current with which the vehicle drifts."""
    for name in config.SHIPPED:
        model, point = flight.model(name), config.load(name).operating_point
        track = flight.fly(
            model, flight.cruising(point.speed_mps), SECONDS, thrust_fraction=point.thrust_fraction
        )
        heading = [degrees(fossen.from_state(state)[5]) for state in track[::200]]
        yield worst(f"{name}, heading", "deg", heading, 0.0, 0.1, "symmetry")
        yield worst(f"{name}, off the line", "m", track[:, 1], 0.0, 0.1, "symmetry")
        start = flight.cruising(point.speed_mps)
        start[7:10] += OBLIQUE_MPS
        track = flight.fly(
            model,
            start,
            SECONDS,
            thrust_fraction=point.thrust_fraction,
            water=drifting(OBLIQUE_MPS),
        )
        heading = [degrees(fossen.from_state(state)[5]) for state in track[::200]]
        yield worst(f"{name}, heading in a current", "deg", heading, 0.0, 0.1, "symmetry")
