"""The water about the hull, as the equations of motion need it: one value that the sea fills anew
every tick."""

from __future__ import annotations

from math import inf
from typing import NamedTuple

from sitl.vehicle.jit import Vector3


class Water(NamedTuple):
    """Water and its boundaries at the hull, NWU axes; held through a step of the integrator.

    Along the hull the velocity is taken as linear: ``velocity_mps + x slope_per_s`` at x metres
    forward of the origin."""

    velocity_mps: Vector3 = (0.0, 0.0, 0.0)
    acceleration_mps2: Vector3 = (0.0, 0.0, 0.0)
    """Of the water itself, Dv/Dt: it presses on the hull as gravity does (Froude-Krylov force)."""
    slope_per_s: Vector3 = (0.0, 0.0, 0.0)
    """Change of velocity per metre forward along the hull."""
    slope_rate_per_s2: Vector3 = (0.0, 0.0, 0.0)
    density_ratio: float = 1.0
    """Density over that of the water in which the vehicle was ballasted."""
    surface_m: float = 0.0
    """Height of the surface above its still level, over the origin."""
    surface_slope: float = 0.0
    """Rise of the surface per metre forward along the hull."""
    ceiling_m: float = inf
    """Height of the underside of ice."""
    floor_m: float = -inf
    """Height of the sea floor under the origin, negative."""
    floor_normal: Vector3 = (0.0, 0.0, 1.0)
    """Unit vector out of the floor there."""


STILL = Water()
"""Deep, still and uniform water."""


def drifting(velocity_mps: Vector3) -> Water:
    """A steady, uniform current (NWU, m/s)."""
    return Water(velocity_mps=velocity_mps)
