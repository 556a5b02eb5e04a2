"""Poles and margins of the heading, pitch and depth loops for given gains."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.control_analysis import loop_state_space, loop_transfer, modal
from sysid.control_analysis.loop_transfer import Gains, Lag, Margins
from sysid.control_analysis.modal import Modes
from sysid.models.linear_planes import LinearPlane

MAX_POLE_RADPS = 5.0
"""Largest magnitude (rad/s) of poles of the vehicle and its loops.

Faster poles belong to the Pade approximation of the delay.
"""


class Analysis(NamedTuple):
    """Poles and margins of all loops."""

    poles: dict[str, tuple[complex, ...]]
    """Poles (rad/s) by loop (heading, pitch, depth), up to `MAX_POLE_RADPS`, slowest first."""
    visible: dict[str, tuple[complex, ...]]
    """Poles that are visible in the loop's motion (see `modal`), slowest first."""
    margins: dict[str, Margins]
    """Margins by the place where the loop is opened: rudder, heading, elevator, depth, pitch."""


class Planes(NamedTuple):
    """Linear yaw and pitch plane of one vehicle, in FRD axes."""

    yaw: LinearPlane
    pitch: LinearPlane


def analyse(planes: Planes, gains: Gains, yaw: Lag, pitch: Lag, order: int = 4) -> Analysis:
    """Return the poles and margins of all loops.

    Parameters
    ----------
    planes : Planes
        Linear planes of the vehicle.
    gains : Gains
        Parameters of the loops by name.
    yaw, pitch : Lag
        Tailcone of each plane; the delay is everything between a command and the duct.
    order : int
        Order of the Pade approximation in the poles.

    Returns
    -------
    Analysis
        Margins use the true delay.
    """
    loops = loop_transfer.heading_loops(loop_transfer.responses(planes.yaw, yaw), gains)
    loops |= loop_transfer.depth_loops(loop_transfer.responses(planes.pitch, pitch), gains)
    modes = {
        loop: modal.modes_of(loop_state_space.close_loop(loop, planes, (yaw, pitch), gains, order))
        for loop in loop_state_space.LOOPS
    }
    return Analysis(
        poles={
            name: _sort_by_speed(loop_modes, np.abs(loop_modes.values) < MAX_POLE_RADPS)
            for name, loop_modes in modes.items()
        },
        visible={
            name: _sort_by_speed(loop_modes, _visible_in_any(loop_modes, name))
            for name, loop_modes in modes.items()
        },
        margins={name: loop_transfer.margins(loop) for name, loop in loops.items()},
    )


def _visible_in_any(modes: Modes, loop: str) -> NDArray[np.bool_]:
    """Return a mask of the modes that are visible in any observed state of a loop."""
    return np.asarray(np.any(list(modal.visible_modes(modes, loop).values()), axis=0))


def _sort_by_speed(modes: Modes, selected: NDArray[np.bool_]) -> tuple[complex, ...]:
    """Return the selected poles, slowest first."""
    values = modes.values[selected]
    return tuple(complex(pole) for pole in values[np.argsort(np.abs(values), kind="stable")])


def damping(poles: tuple[complex, ...]) -> float:
    """Return the smallest damping ratio.

    Parameters
    ----------
    poles : tuple of complex
        Poles (rad/s).

    Returns
    -------
    float
        Smallest -Re(s) / |s|; negative for an unstable pole, 1 without poles.
    """
    return min((-pole.real / abs(pole) for pole in poles), default=1.0)
