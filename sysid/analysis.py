"""Poles and margins of given gains on given planes; the paper's Table 4 by the same means."""

from typing import NamedTuple

import numpy as np

from sysid import loops
from sysid.loops import Gains, Lag, Margins
from sysid.planes import LinearPlane, pitch_plane, yaw_plane
from sysid.tables import TABLE_1_ADJUSTED, TABLE_1_INITIAL, TABLE_3_IMPROVED, TABLE_3_INITIAL, TABLE_4

BAND_RADPS = 5.0
"""Poles within it are the vehicle's and its loops'; what lies beyond belongs to the Pade approximation of the delay."""
TABLE_4_LAG = Lag(0.3)
"""The delay that the paper prints; which one its Table 4 used is not known."""
TABLE_4_ORDER = 2


class Analysis(NamedTuple):
    poles: dict[str, tuple[complex, ...]]
    """By loop (heading, pitch, depth), within BAND_RADPS, slowest first."""
    margins: dict[str, Margins]
    """By the place where the loop is opened: rudder, heading, elevator, depth, pitch."""


class Planes(NamedTuple):
    yaw: LinearPlane
    pitch: LinearPlane


def analyse(planes: Planes, gains: Gains, delay_s: float, lag: Lag | None = None, order: int = 4) -> Analysis:
    """Poles and margins; ``delay_s`` is everything between a command and the duct's answer.

    ``lag`` gives the tailcone's second-order lag when it is not the paper's (its own delay is ignored).
    """
    tail = (lag or Lag(delay_s))._replace(delay_s=delay_s)
    cuts = loops.heading_loops(loops.responses(planes.yaw, tail), gains)
    cuts |= loops.depth_loops(loops.responses(planes.pitch, tail), gains)
    closed = {
        "heading": loops.close_heading(planes.yaw, tail, gains, order),
        "pitch": loops.close_pitch(planes.pitch, tail, gains, order),
        "depth": loops.close_depth(planes.pitch, tail, gains, order),
    }
    return Analysis(
        poles={name: _in_band(loop) for name, loop in closed.items()},
        margins={name: loops.margins(loop) for name, loop in cuts.items()},
    )


def _in_band(loop: loops.ClosedLoop) -> tuple[complex, ...]:
    return tuple(complex(pole) for pole in loops.poles(loop) if abs(pole) < BAND_RADPS)


def damping(poles: tuple[complex, ...]) -> float:
    """Smallest damping ratio; negative for an unstable pole."""
    return min((-pole.real / abs(pole) for pole in poles), default=1.0)


def dominant(poles: tuple[complex, ...]) -> complex:
    """The pair that Table 4 prints: of the oscillating pairs the one of the highest frequency, upper pole."""
    pairs = [pole for pole in poles if pole.imag > 1e-6]
    return max(pairs, key=abs) if pairs else complex(np.nan, np.nan)


class Table4Row(NamedTuple):
    loop: str
    case: str
    """Model/controller: I initial, A adjusted or improved."""
    paper: complex
    ours: complex


def table_4(lag: Lag = TABLE_4_LAG) -> list[Table4Row]:
    """All nine rows from Tables 1 and 3, beside the printed poles."""
    models = {
        "I": Planes(yaw_plane(TABLE_1_INITIAL), pitch_plane(TABLE_1_INITIAL)),
        "A": Planes(yaw_plane(TABLE_1_ADJUSTED), pitch_plane(TABLE_1_ADJUSTED)),
    }
    controllers = {"I": TABLE_3_INITIAL, "A": TABLE_3_IMPROVED}
    rows = []
    for (loop, case), paper in TABLE_4.items():
        found = analyse(models[case[0]], controllers[case[2]], lag.delay_s, lag, TABLE_4_ORDER)
        rows.append(Table4Row(loop, case, paper, dominant(found.poles[loop])))
    return rows
