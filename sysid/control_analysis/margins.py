"""Poles and margins of given gains on given planes."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.control_analysis import loop_transfer, modal
from sysid.control_analysis.loop_transfer import Gains, Lag, Margins
from sysid.control_analysis.modal import Modes
from sysid.models.linear_planes import LinearPlane

MAX_POLE_RADPS = 5.0
"""Poles within it are the vehicle's and its loops'; what lies beyond belongs to the Pade
approximation of the delay."""


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


def analyse(planes: Planes, gains: Gains, yaw: Lag, pitch: Lag, order: int = 4) -> Analysis:
    """Poles and margins behind each plane's tailcone; a lag's delay is everything between a command
    and the duct."""
    cuts = loop_transfer.heading_loops(loop_transfer.responses(planes.yaw, yaw), gains)
    cuts |= loop_transfer.depth_loops(loop_transfer.responses(planes.pitch, pitch), gains)
    closed = {
        "heading": modal.modes_of(loop_transfer.close_heading(planes.yaw, yaw, gains, order)),
        "pitch": modal.modes_of(loop_transfer.close_pitch(planes.pitch, pitch, gains, order)),
        "depth": modal.modes_of(loop_transfer.close_depth(planes.pitch, pitch, gains, order)),
    }
    return Analysis(
        poles={
            name: _sort_by_speed(own, np.abs(own.values) < MAX_POLE_RADPS)
            for name, own in closed.items()
        },
        shown={
            name: _sort_by_speed(own, _visible_in_any(own, name)) for name, own in closed.items()
        },
        margins={name: loop_transfer.margins(loop) for name, loop in cuts.items()},
    )


def _visible_in_any(found: Modes, loop: str) -> NDArray[np.bool_]:
    return np.asarray(np.any(list(modal.visible_modes(found, loop).values()), axis=0))


def _sort_by_speed(found: Modes, chosen: NDArray[np.bool_]) -> tuple[complex, ...]:
    values = found.values[chosen]
    return tuple(complex(pole) for pole in values[np.argsort(np.abs(values), kind="stable")])


def damping(poles: tuple[complex, ...]) -> float:
    """Smallest damping ratio; negative for an unstable pole."""
    return min((-pole.real / abs(pole) for pole in poles), default=1.0)
