"""Mirror symmetry.

Verifies: that mirrored inputs, disturbance and current give the mirrored track to the last bit, so
that a sign error or a spurious turn would be seen. Leaves out: a centre of mass off the plane of
symmetry. Reference: the same run, reflected in the vertical plane through north. Tolerance: none
with a duct; rounding with fins, whose forces are summed one after the other.
"""

from collections.abc import Iterator

import numpy as np

from sitl.vehicle import config
from sitl.vehicle.water import drifting
from tests.reference.check import Check, worst
from tests.sitl.vehicle import flight

MIRROR = np.array([1, -1, 1, 1, -1, 1, -1, 1, -1, 1, -1, 1, -1])
"""Port becomes starboard, component by component of the state."""
MIRROR_WRENCH = np.array([1, -1, 1, -1, 1, -1])
SECONDS = 60.0


def checks() -> Iterator[Check]:
    """Yield the checks of each shipped vehicle in a manoeuvre in six degrees of freedom."""
    push = np.array([3.0, -5.0, 2.0, 0.4, -6.0, 7.0])
    inputs = {"elevator_rad": 0.1, "thrust_fraction": 0.8}
    for name in config.SHIPPED:
        model, start = flight.model(name), flight.tumbling(-50.0)
        track = flight.fly(
            model,
            start,
            SECONDS,
            rudder_rad=0.2,
            disturbance=push,
            water=drifting((0.3, -0.2, 0.05)),
            **inputs,
        )
        mirrored = flight.fly(
            model,
            start * MIRROR,
            SECONDS,
            rudder_rad=-0.2,
            disturbance=push * MIRROR_WRENCH,
            water=drifting((0.3, 0.2, 0.05)),
            **inputs,
        )
        rounding = 1e-10 if model.fins.span_y.size else 0.0
        yield worst(
            f"{name}, state over 60 s", "SI", mirrored, track * MIRROR, rounding, "reflected run"
        )
