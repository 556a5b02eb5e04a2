"""The sizes of tests of both surfaces at once.

Every second tone is the rudder's and those between are the elevator's, so neither plane's answer
hides in the other's, and each second of water tells of both. One parameter aboard says what share
of the rudder's size the elevator gets."""

import math
from collections.abc import Sequence

from sysid.test_design.safety_margins import round_down
from sysid.test_design.simulate import Manoeuvre


def elevator_share(largest: Sequence[tuple[Manoeuvre, Manoeuvre]]) -> float:
    """The elevator's size over the rudder's, in whole percent, with which all of them lose little.

    Args:
        largest: rudder's and elevator's halves at the largest size that limits allow, of at least
        one test.
    """
    ratios = sorted(elevator.size_deg / rudder.size_deg for rudder, elevator in largest)
    return min(100, max(1, math.floor(100.0 * ratios[len(ratios) // 2]))) / 100.0


def scale_to_limits(
    shape: Manoeuvre, rudder: Manoeuvre, elevator: Manoeuvre, share: float
) -> Manoeuvre:
    """``shape`` as large as both halves may be at this share."""
    size_deg = round_down(min(rudder.size_deg, elevator.size_deg / share))
    return shape._replace(size_deg=size_deg, elevator_deg=round(share * size_deg, 4))
