"""Root loci by python-control: closed-loop poles as the loop gain grows from zero.

A loop is opened where one of its states acts on the others: x' = (A + k b c) x with the input
vector b and the output vector c. At k = 1 the loop is closed again, so the poles at k = 1 are those
of the original loop (Evans 1948).
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.control_analysis.loop_state_space import ClosedLoop
from sysid.control_analysis.loop_transfer import ComplexArray

Array = NDArray[np.float64]


class OpenLoop(NamedTuple):
    """A loop opened at one place."""

    A: Array
    input_vector: Array
    """Direction b in which the feedback acts, (states,)."""
    output_vector: Array
    """Row c that selects the state which is fed back, (states,)."""


def open_at_duct(closed: ClosedLoop, states: int) -> OpenLoop:
    """Open a loop between duct angle and vehicle.

    Parameters
    ----------
    closed : ClosedLoop
        Closed loop.
    states : int
        Number of states of the vehicle, which come first; the duct angle is the next state.

    Returns
    -------
    OpenLoop
        Opened loop.
    """
    return _open(closed, states, slice(0, states))


def open_at_depth(closed: ClosedLoop) -> OpenLoop:
    """Open a loop at the depth feedback; the inner pitch loop stays closed."""
    return _open(closed, 3, slice(None))


def poles(opened: OpenLoop, factors: Array) -> ComplexArray:
    """Return the closed-loop poles for each loop gain.

    Parameters
    ----------
    opened : OpenLoop
        Opened loop.
    factors : ndarray
        Loop gains, (factors,); 1 is the original loop.

    Returns
    -------
    ndarray
        Poles (rad/s), (factors, states); each column is one branch.
    """
    import control

    return np.asarray(control.root_locus_map(_system(opened), gains=factors).loci)


def zeros(opened: OpenLoop) -> ComplexArray:
    """Return the open-loop zeros, where the finite branches end.

    Parameters
    ----------
    opened : OpenLoop
        Opened loop.

    Returns
    -------
    ndarray
        Zeros (rad/s).
    """
    import control

    return np.asarray(control.zeros(_system(opened)))


def damping(loci: ComplexArray) -> Array:
    """Return the smallest damping ratio of the oscillatory poles for each loop gain, (factors,).

    The value is 1 where no pole oscillates and -1 where a real pole is unstable.
    """
    oscillatory = np.abs(loci.imag) > 1e-6
    ratios = np.where(oscillatory, -loci.real / np.maximum(np.abs(loci), 1e-12), 1.0)
    return np.asarray(np.min(np.where(~oscillatory & (loci.real > 0.0), -1.0, ratios), axis=1))


def _system(opened: OpenLoop) -> Any:
    """Return the opened loop as a python-control state space."""
    import control

    return control.ss(opened.A, opened.input_vector[:, None], -opened.output_vector[None, :], 0.0)


def _open(closed: ClosedLoop, state: int, rows: slice) -> OpenLoop:
    """Remove the action of `state` on the states in `rows`."""
    A = closed.A.copy()
    input_vector = np.zeros(len(closed.A))
    output_vector = np.zeros(len(closed.A))
    input_vector[rows], output_vector[state] = closed.A[rows, state], 1.0
    A[rows, state] = 0.0
    return OpenLoop(A, input_vector, output_vector)
