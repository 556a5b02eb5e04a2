"""The paper's set beside which a design is judged: steps from trim, one size after another, and no
limits."""

from sysid.data.segments import Plane
from sysid.test_design.simulate import Manoeuvre

RUDDER_DEG = (3.0, -3.0, 5.0, -5.0, 7.0, -7.0, 9.0, -9.0)
ELEVATOR_DEG = (2.0, 3.0, 4.0, 5.0, 7.0, 9.0, 12.0, 14.0)
"""Nose up only, away from the bottom."""
RUDDER_S, ELEVATOR_S = 20, 8
RECOVERY_S = 55.0
"""What so large steps need until the vehicle is back on depth and course."""


def steps(scale: dict[Plane, float], water_s: float) -> list[Manoeuvre]:
    """As many as fit into ``water_s``, both planes by turns, over again from the first where all
    have been flown.

    ``scale`` is what a degree of Caribou's comes to on this vehicle.
    """
    flown: list[Manoeuvre] = []
    used_s, number = 0.0, 0
    while True:
        plane: Plane = "pitch" if number % 2 else "yaw"
        sizes, seconds = (RUDDER_DEG, RUDDER_S) if plane == "yaw" else (ELEVATOR_DEG, ELEVATOR_S)
        used_s += seconds + RECOVERY_S
        if used_s > water_s:
            return flown
        size_deg = scale[plane] * sizes[number // 2 % len(sizes)]
        flown.append(Manoeuvre(plane, "step", size_deg, seconds))
        number += 1
