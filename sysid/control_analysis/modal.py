"""A closed loop's modes, and which of them show in its motion."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.control_analysis.loop_transfer import ClosedLoop

MIN_VISIBLE_SHARE = 0.1
"""A mode with less than this share of the largest in what a disturbance does is hardly seen in the
motion: so the tailcone's lag beside the zeros that undo it, which never quite meet."""
OBSERVED_STATES = {
    "heading": {"heading": 2},
    "pitch": {"pitch": 2},
    "depth": {"pitch": 2, "depth": 3},
}
"""Of each closed loop the states that it moves, as they are counted there."""
RATE_STATE = 1
"""The state that a blow about the plane's axis changes: r or q."""


class Modes(NamedTuple):
    """A closed loop in its own coordinates: x = right * amounts, each of which goes by its own
    value."""

    values: NDArray[np.complex128]
    right: NDArray[np.complex128]


def modes_of(closed: ClosedLoop) -> Modes:
    values, right = np.linalg.eig(closed.A)
    return Modes(values.astype(np.complex128), right.astype(np.complex128))


def visible_modes(found: Modes, loop: str) -> dict[str, NDArray[np.bool_]]:
    """Which modes of a closed loop (heading, pitch, depth) show in what a blow about the plane's
    axis does to each of its ``OBSERVED_STATES``."""
    blow = np.zeros(found.values.size, dtype=np.complex128)
    blow[RATE_STATE] = 1.0
    amounts = np.linalg.solve(found.right, blow)
    sizes = {
        name: np.abs(found.right[state] * amounts) for name, state in OBSERVED_STATES[loop].items()
    }
    return {name: size > MIN_VISIBLE_SHARE * np.max(size) for name, size in sizes.items()}
