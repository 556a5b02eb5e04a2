"""What the checks of several clients expect of the vehicle, and the mission that they fly."""

from typing import NamedTuple

from autopilot.control.params import PARAMETERS
from mavlink_io.real32 import as_real32

DEFAULTS = {p.name: as_real32(p.default) for p in PARAMETERS}
"""Default of each parameter as clients receive it."""
FRAME_MISSION = 2
"""MAV_FRAME of an item without a place."""


class Item(NamedTuple):
    """MAV_CMD and the first four parameters of a mission item without a place."""

    command: int
    p1: float = 0.0
    p2: float = 0.0
    p3: float = 0.0
    p4: float = 0.0


def leg_items(depth_m: float = 4.0, seconds: float = 10_000.0) -> tuple[Item, ...]:
    """Return thrust, depth, heading and a delay that is longer than all checks at any speed."""
    return (
        Item(178, 1.0, -1.0, 58.0),
        Item(186, -depth_m, 3.0),
        Item(115, 40.0),
        Item(93, seconds, -1.0, -1.0, -1.0),
    )
