"""The paper's test set for comparison: steps from trim with increasing size and without limits."""

from sysid.data.segments import Plane
from sysid.test_design.simulate import Manoeuvre

RUDDER_DEG = (3.0, -3.0, 5.0, -5.0, 7.0, -7.0, 9.0, -9.0)
"""Sizes of the rudder steps (deg)."""
ELEVATOR_DEG = (2.0, 3.0, 4.0, 5.0, 7.0, 9.0, 12.0, 14.0)
"""Sizes of the elevator steps (deg), all nose up to stay clear of the bottom."""
RUDDER_S, ELEVATOR_S = 20, 8
"""Lengths of the steps (s)."""
RECOVERY_S = 55.0
"""Time (s) until the vehicle is back on depth and course after these large steps."""


def steps(scale: dict[Plane, float], water_s: float) -> list[Manoeuvre]:
    """Return the steps that fit into `water_s` (s), alternating between the planes.

    `scale` is the ratio of this vehicle's surface angle to Caribou's for the same effect. The
    sequence starts again after its last step.
    """
    manoeuvres: list[Manoeuvre] = []
    used_s, number = 0.0, 0
    while True:
        plane: Plane = "pitch" if number % 2 else "yaw"
        sizes, seconds = (RUDDER_DEG, RUDDER_S) if plane == "yaw" else (ELEVATOR_DEG, ELEVATOR_S)
        used_s += seconds + RECOVERY_S
        if used_s > water_s:
            return manoeuvres
        size_deg = scale[plane] * sizes[number // 2 % len(sizes)]
        manoeuvres.append(
            Manoeuvre(plane=plane, wave="step", size_deg=size_deg, duration_s=seconds)
        )
        number += 1
