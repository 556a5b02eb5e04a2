"""Sizes of tests of both surfaces at once.

Even tones belong to the rudder and odd tones to the elevator, so the responses can be separated and
each second of test time gives information about both planes. One autopilot parameter sets the
elevator's size as a share of the rudder's.
"""

import math
from collections.abc import Sequence

from sysid.test_design.safety_margins import round_down
from sysid.test_design.simulate import Manoeuvre


def elevator_share(largest: Sequence[tuple[Manoeuvre, Manoeuvre]]) -> float:
    """Return the elevator's size over the rudder's, in whole percent, that suits all tests.

    Parameters
    ----------
    largest : Sequence
        Rudder and elevator half of each test at their largest safe size; at least one test.

    Returns
    -------
    float
        Median ratio, between 0.01 and 1.
    """
    ratios = sorted(elevator.size_deg / rudder.size_deg for rudder, elevator in largest)
    return min(100, max(1, math.floor(100.0 * ratios[len(ratios) // 2]))) / 100.0


def scale_to_limits(
    shape: Manoeuvre, rudder: Manoeuvre, elevator: Manoeuvre, share: float
) -> Manoeuvre:
    """Return `shape` at the largest size that both halves allow at this share."""
    size_deg = round_down(min(rudder.size_deg, elevator.size_deg / share))
    return shape._replace(size_deg=size_deg, elevator_deg=round(share * size_deg, 4))
