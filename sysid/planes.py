"""The two planes of motion that identification tests excite: one table of their names."""

from dataclasses import dataclass
from enum import StrEnum
from typing import Literal

Surface = Literal["rudder", "elevator"]


class Plane(StrEnum):
    """Plane of motion; the values are keys and values of files."""

    YAW = "yaw"
    PITCH = "pitch"


@dataclass(frozen=True)
class PlaneTraits:
    """Names and sizes that differ between the planes."""

    is_yaw: bool
    """Argument of the compiled kernels."""
    index: int
    """Position in pairs and in rows that hold both planes."""
    other: Plane
    surface: Surface
    """Surface that turns the vehicle in the plane; its loop is opened at the surface."""
    sid_axis: int
    """ArduPilot's SID_AXIS number of the mixer input."""
    angle: str
    """Name of the angle."""
    outer_loop: str
    """Name of the outermost loop."""
    gain_prefix: str
    """Prefix of the parameters of the loop from angle to surface."""
    states: tuple[str, ...]
    """States of the linear model; all but the first are measured."""
    velocities: tuple[int, int, int]
    """Indices of surge, cross speed and rate in (u, v, w, p, q, r), and of their forces."""

    @property
    def n_outputs(self) -> int:
        """Return the number of measured outputs: rate, angle and, in pitch, depth."""
        return len(self.states) - 1

    @property
    def has_depth(self) -> bool:
        """Return whether depth is a state of the plane."""
        return "depth" in self.states


PLANES: dict[Plane, PlaneTraits] = {
    Plane.YAW: PlaneTraits(
        is_yaw=True,
        index=0,
        other=Plane.PITCH,
        surface="rudder",
        sid_axis=12,
        angle="heading",
        outer_loop="heading",
        gain_prefix="HDG",
        states=("v", "r", "psi"),
        velocities=(0, 1, 5),
    ),
    Plane.PITCH: PlaneTraits(
        is_yaw=False,
        index=1,
        other=Plane.YAW,
        surface="elevator",
        sid_axis=11,
        angle="pitch",
        outer_loop="depth",
        gain_prefix="PTCH",
        states=("w", "q", "theta", "depth"),
        velocities=(0, 2, 4),
    ),
}
"""Traits by plane."""
PLANE_OF_SURFACE: dict[str, Plane] = {traits.surface: plane for plane, traits in PLANES.items()}
"""Plane by surface."""
