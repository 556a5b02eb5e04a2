"""Root loci by python-control: where a closed loop's poles go as its gain grows from nothing.

A loop is opened where one of its states acts on the others, x' = (A + k into row) x, and closed
again at k = 1. Nothing else of it changes, so the poles at k = 1 are its own."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.control_analysis.loop_transfer import ClosedLoop, ComplexArray

Array = NDArray[np.float64]


class OpenLoop(NamedTuple):
    """A loop opened at one place."""

    A: Array
    into: Array
    """What was acted on, (states,)."""
    row: Array
    """The state that acted, (states,)."""


def open_at_duct(closed: ClosedLoop, states: int) -> OpenLoop:
    """Opened between the duct's angle and the vehicle, whose ``states`` come first in the loop and
    the angle next."""
    return _open(closed, states, slice(0, states))


def open_at_depth(closed: ClosedLoop) -> OpenLoop:
    """Opened where depth is fed back, the pitch loop within left closed."""
    return _open(closed, 3, slice(None))


def poles(opened: OpenLoop, factors: Array) -> ComplexArray:
    """Closed-loop poles by loop gain, (factors, states), each column one branch."""
    import control

    return np.asarray(control.root_locus_map(_system(opened), gains=factors).loci)


def zeros(opened: OpenLoop) -> ComplexArray:
    """Where branches end that do not leave."""
    import control

    return np.asarray(control.zeros(_system(opened)))


def damping(found: ComplexArray) -> Array:
    """Least damping ratio of the oscillating poles by loop gain, (factors,); 1 where none
    oscillates, -1 where a real one grows."""
    swings = np.abs(found.imag) > 1e-6
    ratios = np.where(swings, -found.real / np.maximum(np.abs(found), 1e-12), 1.0)
    return np.asarray(np.min(np.where(~swings & (found.real > 0.0), -1.0, ratios), axis=1))


def _system(opened: OpenLoop) -> Any:
    import control

    return control.ss(opened.A, opened.into[:, None], -opened.row[None, :], 0.0)


def _open(closed: ClosedLoop, state: int, rows: slice) -> OpenLoop:
    A, into, row = closed.A.copy(), np.zeros(len(closed.A)), np.zeros(len(closed.A))
    into[rows], row[state] = closed.A[rows, state], 1.0
    A[rows, state] = 0.0
    return OpenLoop(A, into, row)
