"""State of the water at the hull, as the equations of motion need it.

The simulated environment makes a new value every tick. Axes are NWU: x north, y west, z up.
"""

from __future__ import annotations

from math import inf
from typing import NamedTuple

from sitl.vehicle.vectors import Vector3


class Water(NamedTuple):
    """Water and its boundaries at the hull, NWU axes; constant during one integration step.

    The velocity is linear along the hull: ``velocity_mps + x slope_per_s`` at x metres forward of
    the origin.
    """

    velocity_mps: Vector3 = (0.0, 0.0, 0.0)
    """Velocity of the water over ground at the origin, m/s."""
    acceleration_mps2: Vector3 = (0.0, 0.0, 0.0)
    """Acceleration Dv/Dt of the water itself; it causes the Froude-Krylov force on the hull."""
    slope_per_s: Vector3 = (0.0, 0.0, 0.0)
    """Change of velocity per metre forward along the hull."""
    slope_rate_per_s2: Vector3 = (0.0, 0.0, 0.0)
    """Rate of change of ``slope_per_s``."""
    density_ratio: float = 1.0
    """Density over the density of the water in which the vehicle was ballasted."""
    surface_m: float = 0.0
    """Height of the surface over the origin, above the still water level."""
    surface_slope: float = 0.0
    """Rise of the surface per metre forward along the hull."""
    ceiling_m: float = inf
    """Height of the underside of ice above the still water level, negative; infinite without ice.
    """
    floor_m: float = -inf
    """Height of the sea floor under the origin above the still water level, negative."""
    floor_normal: Vector3 = (0.0, 0.0, 1.0)
    """Unit vector normal to the sea floor under the origin, pointing into the water."""


STILL = Water()
"""Deep, still and uniform water."""


def drifting(velocity_mps: Vector3) -> Water:
    """Return deep water with a steady, uniform current.

    Parameters
    ----------
    velocity_mps : tuple of 3 floats
        Velocity of the current over ground, NWU, m/s.

    Returns
    -------
    Water
        Water without acceleration, waves, ice or sea floor.
    """
    return Water(velocity_mps=velocity_mps)
