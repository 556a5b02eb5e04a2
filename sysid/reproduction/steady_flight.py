"""Steady flight of the paper's vehicle with its own gains, from Tables 1 and 3 alone.

Table 5 prints errors "during steady state flight" and neither the sea nor the time from which
flight counts as steady. Both are replaced by what the paper's own model and gains imply.
"""

from functools import cache

import numpy as np
from numpy.typing import NDArray

from sysid.control_analysis import loop_state_space
from sysid.control_analysis.loop_transfer import GRID_RADPS
from sysid.design import design_model, disturbance_response
from sysid.planes import Plane
from sysid.reproduction import paper_poles
from sysid.reproduction.paper_tables import (
    TABLE_3_IMPROVED,
    TABLE_3_INITIAL,
    TABLE_5_IMPROVED,
    TABLE_5_INITIAL,
    SteadyError,
)

SETTLED_TIME_CONSTANTS = 3.0
"""Time constants of the slowest pole after which a loop has settled: 5 % of a transient is left."""
ADJUSTED = "A"
"""Key of the adjusted model in `paper_poles.models`."""
MAX_PERIOD_S = 300.0
"""Longest period of a disturbance (s): the length of our straight run. Slower ones are loads."""
MIN_PERIOD_S = 0.6
"""Shortest period (s): above 10 rad/s no gains move the vehicle."""


@cache
def settling_s(loop: str) -> float:
    """Return the time after which a loop of the adjusted model with the improved gains is steady.

    Parameters
    ----------
    loop : str
        Heading, pitch or depth.

    Returns
    -------
    float
        Three time constants of the slowest closed-loop pole (s).
    """
    closed = loop_state_space.close_loop(
        loop,
        tuple(paper_poles.models()[ADJUSTED]),
        (paper_poles.LAG, paper_poles.LAG),
        TABLE_3_IMPROVED,
    )
    return SETTLED_TIME_CONSTANTS / -float(np.max(loop_state_space.poles(closed).real))


@cache
def smallest_ratios() -> SteadyError:
    """Return the least ratio of errors, improved over initial gains, in any disturbance.

    Returns
    -------
    SteadyError
        Without unit. No stationary disturbing moment with periods of up to `MAX_PERIOD_S`
        gives a smaller ratio of standard deviations on the adjusted model, because the ratio of
        two integrals is at least the least ratio of the integrands.
    """
    planes = paper_poles.models()[ADJUSTED]
    vehicle = design_model.build(
        planes,
        paper_poles.LAG,
        paper_poles.LAG,
        dict.fromkeys(Plane, design_model.DEFAULT_DISTURBANCE),
    )
    initial, improved = (
        (
            disturbance_response.heading_responses(vehicle, gains)[0],
            *disturbance_response.depth_responses(vehicle, gains, vehicle.pitch.moment)[:2],
        )
        for gains in (TABLE_3_INITIAL, TABLE_3_IMPROVED)
    )
    period_s = 2.0 * np.pi / GRID_RADPS
    band = (period_s <= MAX_PERIOD_S) & (period_s >= MIN_PERIOD_S)
    return SteadyError(
        *(_least(new, old, band) for new, old in zip(improved, initial, strict=True))
    )


def _least(
    new: NDArray[np.complex128], old: NDArray[np.complex128], band: NDArray[np.bool_]
) -> float:
    """Return the least ratio of two responses in a band of frequencies."""
    return float(np.min(np.abs(new[band]) / np.abs(old[band])))


def contradiction(name: str) -> str:
    """Return why a printed improvement of Table 5 does not follow from Tables 1 and 3.

    Parameters
    ----------
    name : str
        Field of `SteadyError`.

    Returns
    -------
    str
        Evidence with its numbers; empty if some disturbance gives the printed ratio.
    """
    printed = getattr(TABLE_5_IMPROVED, name) / getattr(TABLE_5_INITIAL, name)
    least = getattr(smallest_ratios(), name)
    if printed >= least:
        return ""
    return (
        f"the printed errors fall to {printed:.2f} of the initial ones; on the adjusted model of"
        f" Table 1 the gains of Table 3 leave at least {least:.2f} of them in any disturbance with"
        f" periods up to {MAX_PERIOD_S:g} s, and the paper gives neither sea nor constant load"
    )
