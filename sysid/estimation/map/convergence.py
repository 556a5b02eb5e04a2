"""When a fit has failed, in words: no figure of it may then be taken at face value."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from sysid.data.segments import Plane

Array = NDArray[np.float64]

START_COST_TOLERANCE = 0.01
"""Relative cost by which other starts may differ from the best."""
MAX_PRIOR_SHARE = 0.95
"""A design number that keeps this share of its prior standard deviation was not measured."""
DESIGN_NUMBERS = ("static_gain_per_s", "b1_per_s2", "p_fast_per_s", "p_slow_per_s", "delay_s")


def failures(
    cost: float,
    start_costs: Sequence[float],
    at_bounds: Sequence[str],
    spreads: Mapping[Plane, tuple[Array, Array]],
) -> tuple[str, ...]:
    """Reasons not to believe a fit; empty for one that may be judged further.

    ``spreads`` are, of each plane that was tested, the covariances of DESIGN_NUMBERS (5, 5) before
    and after the data."""
    found = []
    apart = [abs(other - cost) / cost for other in start_costs]
    if apart and max(apart) > START_COST_TOLERANCE:
        strayed = sum(share > START_COST_TOLERANCE for share in apart)
        found.append(
            f"{strayed} of {len(apart)} other starts end elsewhere, their costs up to"
            f" {max(apart):.1%} away, at most {START_COST_TOLERANCE:.0%}: "
            "the tests admit more than one vehicle"
        )
    if at_bounds:
        found.append(
            f"{', '.join(at_bounds)} at a bound, four prior standard deviations away: the prior is"
            " wrong"
        )
    found += [
        reason
        for plane, (before, after) in spreads.items()
        if (reason := _uninformed_numbers(plane, before, after))
    ]
    return tuple(found)


def _uninformed_numbers(plane: Plane, before: Array, after: Array) -> str:
    """Says which design numbers the data leave as they were."""
    kept = np.sqrt(np.diag(after) / np.diag(before))
    left = [
        f"{name} ({share:.0%})"
        for name, share in zip(DESIGN_NUMBERS, kept, strict=True)
        if share > MAX_PRIOR_SHARE
    ]
    return f"the {plane} tests leave the prior's uncertainty of {', '.join(left)}" if left else ""
