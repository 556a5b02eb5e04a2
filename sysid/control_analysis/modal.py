"""Modes of a closed loop, and the modes that are visible in its motion."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.control_analysis.loop_state_space import ClosedLoop

MIN_VISIBLE_SHARE = 0.1
"""Smallest contribution of a visible mode, as a share of the largest mode in the same state.

Example of an invisible mode: the lag of the tailcone next to the zeros of the actuator lead, which
cancel it almost exactly.
"""
OBSERVED_STATES = {
    "heading": {"heading": 2},
    "pitch": {"pitch": 2},
    "depth": {"pitch": 2, "depth": 3},
}
"""Observed states of each closed loop: name and state index."""
RATE_STATE = 1
"""Index of the angular rate (r or q), which an impulsive moment about the plane's axis changes."""


class Modes(NamedTuple):
    """Eigenvalues and right eigenvectors: x(t) = right exp(values t) amplitudes."""

    values: NDArray[np.complex128]
    right: NDArray[np.complex128]


def modes_of(closed: ClosedLoop) -> Modes:
    """Return the modes of a closed loop."""
    values, right = np.linalg.eig(closed.A)
    return Modes(values.astype(np.complex128), right.astype(np.complex128))


def visible_modes(modes: Modes, loop: str) -> dict[str, NDArray[np.bool_]]:
    """Return which modes are visible in the response to an impulsive moment.

    Parameters
    ----------
    modes : Modes
        Modes of the closed loop.
    loop : str
        heading, pitch or depth.

    Returns
    -------
    dict
        A boolean mask over the modes for each of the loop's `OBSERVED_STATES`.

    Notes
    -----
    An impulse changes the rate state e_r. With V the right eigenvectors, mode i contributes
    |V_ki (V^-1 e_r)_i| to state k. It is visible if this exceeds `MIN_VISIBLE_SHARE` of the
    largest contribution.
    """
    impulse = np.zeros(modes.values.size, dtype=np.complex128)
    impulse[RATE_STATE] = 1.0
    amplitudes = np.linalg.solve(modes.right, impulse)
    sizes = {
        name: np.abs(modes.right[state] * amplitudes)
        for name, state in OBSERVED_STATES[loop].items()
    }
    return {name: size > MIN_VISIBLE_SHARE * np.max(size) for name, size in sizes.items()}
