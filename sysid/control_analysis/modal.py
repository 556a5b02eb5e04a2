"""A closed loop's modes, and which of them show in its motion."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.control_analysis.loop_transfer import ClosedLoop

SHOWS = 0.1
"""A mode with less than this share of the largest in what a disturbance does is hardly seen in the
motion: so the tailcone's lag beside the zeros that undo it, which never quite meet."""
STATES = {"heading": {"heading": 2}, "pitch": {"pitch": 2}, "depth": {"pitch": 2, "depth": 3}}
"""Of each closed loop the states that it moves, as they are counted there."""
TURNING = 1
"""The state that a blow about the plane's axis changes: r or q."""


class Modes(NamedTuple):
    """A closed loop in its own coordinates: x = right * amounts, each of which goes by its own
    value."""

    values: NDArray[np.complex128]
    right: NDArray[np.complex128]


def of(closed: ClosedLoop) -> Modes:
    values, right = np.linalg.eig(closed.A)
    return Modes(values.astype(np.complex128), right.astype(np.complex128))


def showing(found: Modes, loop: str) -> dict[str, NDArray[np.bool_]]:
    """Which modes of a closed loop (heading, pitch, depth) show in what a blow about the plane's
    axis does to each of its ``STATES``."""
    blow = np.zeros(found.values.size, dtype=np.complex128)
    blow[TURNING] = 1.0
    amounts = np.linalg.solve(found.right, blow)
    sizes = {name: np.abs(found.right[state] * amounts) for name, state in STATES[loop].items()}
    return {name: size > SHOWS * np.max(size) for name, size in sizes.items()}
