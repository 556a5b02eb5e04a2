"""Ten minutes of straight run.

Verifies: that a symmetric vehicle with her duct amidships, in still water, goes straight: no
heading, roll or sway of her own; and how little rounding makes of it where symmetry is not to the
bit, in a current that meets her obliquely. Leaves out: the autopilot and the sensors, whose errors
steer a real one; bias of the tailcone. Reference: symmetry: nothing. Tolerance: 0.1 deg of heading
in ten minutes, as asked for; the figure is zero to the bit without current."""

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
    """Still water, then a current that she drifts with."""
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
