"""The pull of a wall on a body of revolution that moves along it: slender-body theory, tabulated.

A hull at speed U is a line of sources of strength -U A'(x), A its section. A wall at distance h is
a mirror: a second line 2h away. Each source is drawn to the mirrored ones with -rho m w (Lagally
1922; Milne-Thomson 1968, sec. 8.63), so

    F = rho U^2 / (4 pi) double integral A'(x) A'(xi) 2h / ((x - xi)^2 + 4 h^2)^(3/2) dx dxi,
    towards the wall,

with a pitch moment from the same integrand times x (Newman 1965, DTMB report 2127, has both; what
the mirrored flow across the hull adds to the moment integrates to nothing). The hull is taken as
parallel to the wall and moving along it. Left out: how a wall changes added mass across, which
matters within a radius of it."""

from __future__ import annotations

from functools import lru_cache
from math import pi

import numpy as np

from sitl.vehicle import hull as geometry
from sitl.vehicle.file_schema import HullGeometry
from sitl.vehicle.jit import Vector
from sitl.vehicle.model import Walls

STEPS = 64
NODES = (48, 2, 48)
"""On nose, mid-body, where nothing changes, and tail."""
_DIFFERENCE = 1e-5


@lru_cache(maxsize=16)
def build(hull: HullGeometry, density_kgpm3: float) -> Walls:
    """Table for a hull, from touching to a hull's length off, where some thousandths are left and
    dropped.

    Kept, as a fit builds one hull under hundreds of coefficients.
    """
    length, radius = geometry.length_m(hull), hull.diameter_m / 2
    nearness = np.linspace(radius / length, 1.0, STEPS)
    both = np.array([pull(hull, density_kgpm3, radius / s) for s in nearness])
    both -= both[0]
    return Walls(
        length, float(nearness[0]), (STEPS - 1) / (1.0 - float(nearness[0])), both[:, 0], both[:, 1]
    )


def pull(hull: HullGeometry, density_kgpm3: float, distance_m: float) -> tuple[float, float]:
    """(force towards a wall, its moment about the origin) per U^2, kg/m and kg; ``distance_m`` from
    axis to wall."""
    x, dx = geometry.quadrature(hull, NODES)
    growth = _section_growth(hull, x) * dx
    across = 2.0 * distance_m
    mirrored = across / ((x[:, None] - x) ** 2 + across**2) ** 1.5
    drawn = density_kgpm3 / (4.0 * pi) * growth * (mirrored @ growth)
    return float(drawn.sum()), float(drawn @ x)


def _section_growth(hull: HullGeometry, x_m: Vector) -> Vector:
    """A'(x), m."""
    step = _DIFFERENCE * geometry.length_m(hull)
    fore, aft = geometry.radius_m(hull, x_m + step), geometry.radius_m(hull, x_m - step)
    return np.asarray(pi * (fore**2 - aft**2) / (2.0 * step))
