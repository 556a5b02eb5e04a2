"""The nine rows of Table 4 for a given tailcone, with the printed poles."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from sysid.control_analysis import loop_state_space, loop_transfer, root_locus
from sysid.control_analysis.loop_state_space import Approximation, ClosedLoop
from sysid.control_analysis.loop_transfer import Gains, Lag
from sysid.control_analysis.margins import MAX_POLE_RADPS, Planes
from sysid.control_analysis.root_locus import OpenLoop
from sysid.models.linear_planes import pitch_plane, yaw_plane
from sysid.reproduction.paper_tables import (
    TABLE_1_ADJUSTED,
    TABLE_1_INITIAL,
    TABLE_3_IMPROVED,
    TABLE_3_INITIAL,
    TABLE_4,
)

LOOPS = tuple(loop_state_space.LOOPS)
"""Loops of the table."""
CASES = ("I/I", "A/I", "A/A")
"""Model/controller: I for initial, A for adjusted or improved."""
LAG = Lag(0.3)
"""Tailcone with the printed delay and the cut-off frequency of the paper's figure 4."""
PADE = 2
"""Order of the Pade delay: the printed transfer function has a delay of second order."""
CONTROLLERS: Mapping[str, Gains] = {"I": TABLE_3_INITIAL, "A": TABLE_3_IMPROVED}
"""Gains by the letter of a case."""


class PoleRow(NamedTuple):
    """One row of the table."""

    loop: str
    case: str
    paper: complex
    """Upper pole of the printed pair (rad/s)."""
    ours: complex
    """Upper pole of the computed dominant pair (rad/s)."""


def models() -> dict[str, Planes]:
    """Return Table 1's two columns as linear planes."""
    columns = {"I": TABLE_1_INITIAL, "A": TABLE_1_ADJUSTED}
    return {
        name: Planes(yaw_plane(column), pitch_plane(column)) for name, column in columns.items()
    }


class Case(NamedTuple):
    """A model with its controller."""

    name: str
    planes: Planes
    gains: Gains
    yaw_lag: Lag
    pitch_lag: Lag


def printed_cases(lag: Lag = LAG) -> list[Case]:
    """Return the paper's three cases behind one tailcone.

    Parameters
    ----------
    lag : Lag
        Lag and delay of the tailcone.

    Returns
    -------
    list of Case
        Cases in the order of `CASES`.
    """
    planes = models()
    return [
        Case(
            name=case,
            planes=planes[case[0]],
            gains=CONTROLLERS[case[2]],
            yaw_lag=lag,
            pitch_lag=lag,
        )
        for case in CASES
    ]


def rows(lag: Lag = LAG, form: Approximation = PADE) -> list[PoleRow]:
    """Return all nine rows, computed from Tables 1 and 3.

    Parameters
    ----------
    lag : Lag
        Lag and delay of the tailcone.
    form : int or tuple
        Approximation of the delay.

    Returns
    -------
    list of PoleRow
        Printed and computed poles, in the order of Table 4.
    """
    cases = {case.name: case for case in printed_cases(lag)}
    return [
        PoleRow(loop=loop, case=name, paper=paper, ours=pole(loop, cases[name], form))
        for (loop, name), paper in TABLE_4.items()
    ]


def pole(loop: str, case: Case, form: Approximation = PADE) -> complex:
    """Return the dominant pole of a loop.

    Parameters
    ----------
    loop : str
        One of `LOOPS`.
    case : Case
        Model and controller.
    form : int or tuple
        Approximation of the delay.

    Returns
    -------
    complex
        Upper pole of the dominant pair (rad/s).
    """
    return dominant(loop_state_space.poles(close_case(loop, case, form)))


def close_case(loop: str, case: Case, form: Approximation = PADE) -> ClosedLoop:
    """Return the closed loop of a case.

    Parameters
    ----------
    loop : str
        One of `LOOPS`.
    case : Case
        Model and controller.
    form : int or tuple
        Approximation of the delay.

    Returns
    -------
    ClosedLoop
        Closed loop.
    """
    lags = case.yaw_lag, case.pitch_lag
    return loop_state_space.close_loop(loop, case.planes, lags, case.gains, form)


def close_loop(
    loop: str, planes: Planes, lag: Lag, gains: Gains, form: Approximation = PADE
) -> ClosedLoop:
    """Return one of the closed `LOOPS`."""
    return loop_state_space.close_loop(loop, planes, (lag, lag), gains, form)


def open_loop(loop: str, closed: ClosedLoop) -> OpenLoop:
    """Return a loop opened at the duct.

    Parameters
    ----------
    loop : str
        One of `LOOPS`.
    closed : ClosedLoop
        Closed loop.

    Returns
    -------
    OpenLoop
        Opened loop.
    """
    return root_locus.open_at_duct(closed, 4 if loop == "depth" else 3)


def dominant(poles: Sequence[complex] | loop_transfer.ComplexArray) -> complex:
    """Return the upper pole of the oscillatory pair with the smallest damping ratio.

    Parameters
    ----------
    poles : Sequence of complex
        Poles (rad/s); those beyond `MAX_POLE_RADPS` are ignored.

    Returns
    -------
    complex
        Pole (rad/s); NaN without an oscillatory pair.
    """
    pairs = [complex(pole) for pole in poles if pole.imag > 1e-6 and abs(pole) < MAX_POLE_RADPS]
    return max(pairs, key=lambda pole: pole.real / abs(pole), default=complex(np.nan, np.nan))
