"""Poles and margins of given gains on given planes."""

from typing import NamedTuple

import numpy as np

from sysid import loops, modes
from sysid.loops import Gains, Lag, Margins
from sysid.planes import LinearPlane

BAND_RADPS = 5.0
"""Poles within it are the vehicle's and its loops'; what lies beyond belongs to the Pade approximation of the delay."""

STATES = {"heading": {"heading": 2}, "pitch": {"pitch": 2}, "depth": {"pitch": 2, "depth": 3}}
"""Of each closed loop the states that it moves, as they are counted there."""


class Analysis(NamedTuple):
    poles: dict[str, tuple[complex, ...]]
    """By loop (heading, pitch, depth), within BAND_RADPS, slowest first."""
    shown: dict[str, tuple[complex, ...]]
    """Those that show in the loop's motion, slowest first."""
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
        shown={name: _shown(name, loop) for name, loop in closed.items()},
        margins={name: loops.margins(loop) for name, loop in cuts.items()},
    )


def _in_band(loop: loops.ClosedLoop) -> tuple[complex, ...]:
    return tuple(complex(pole) for pole in loops.poles(loop) if abs(pole) < BAND_RADPS)


def _shown(name: str, loop: loops.ClosedLoop) -> tuple[complex, ...]:
    found = modes.of(loop)
    shown = found.values[np.any(list(modes.showing(found, STATES[name]).values()), axis=0)]
    return tuple(complex(pole) for pole in shown[np.argsort(np.abs(shown), kind="stable")])


def damping(poles: tuple[complex, ...]) -> float:
    """Smallest damping ratio; negative for an unstable pole."""
    return min((-pole.real / abs(pole) for pole in poles), default=1.0)
