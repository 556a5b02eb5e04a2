"""Suction of a wall on a body of revolution that moves along it: slender-body theory, tabulated.

Symbols: U speed along the wall (m/s), A(x) sectional area (m2), x forward from mid-length (m), h
distance from the hull axis to the wall (m), rho density (kg/m3).

The hull is a line of sources of strength -U A'(x). The wall is modelled by the mirror image of that
line at distance 2h. A source of strength m in a stream w receives the force -rho m w (Lagally 1922;
Milne-Thomson 1968, sec. 8.63), so the force towards the wall is

    F = rho U^2 / (4 pi) double integral A'(x) A'(xi) 2h / ((x - xi)^2 + 4 h^2)^(3/2) dx dxi,

and the pitch moment about mid-length has the same integrand times x (Newman 1965, DTMB report
2127, has both). The contribution of the mirrored crossflow to the moment integrates to zero.

Assumptions: the hull is parallel to the wall and moves along it. The change of transverse added
mass near a wall is neglected; it is significant within one hull radius of the wall.
"""

from __future__ import annotations

from functools import lru_cache
from math import pi

import numpy as np

from sitl.vehicle import hull as geometry
from sitl.vehicle.file_schema import HullGeometry
from sitl.vehicle.model import Walls
from sitl.vehicle.vectors import Vector

STEPS = 64
"""Number of points of the table over nearness."""
NODES = (48, 2, 48)
"""Quadrature nodes on nose, mid-body (where A' is zero) and tail."""
_DIFFERENCE = 1e-5
"""Step of the central difference for A'(x), as a fraction of the hull length."""


@lru_cache(maxsize=16)
def build(hull: HullGeometry, density_kgpm3: float) -> Walls:
    """Return the table of force and moment for a hull, from contact to one hull length away.

    At one hull length a few thousandths of the force at contact remain; they are subtracted, so
    that the table ends at zero. The result is cached, because a fit builds models of one hull with
    hundreds of coefficient sets.

    Parameters
    ----------
    hull : HullGeometry
        Shape of the hull.
    density_kgpm3 : float
        Density of the water, kg/m3.

    Returns
    -------
    Walls
        Force (kg/m) and moment (kg) per u^2 over nearness, which is hull radius over distance.
    """
    length, radius = geometry.length_m(hull), hull.diameter_m / 2
    nearness = np.linspace(radius / length, 1.0, STEPS)
    force_and_moment = np.array([pull(hull, density_kgpm3, radius / s) for s in nearness])
    force_and_moment -= force_and_moment[0]
    return Walls(
        far_m=length,
        far_nearness=float(nearness[0]),
        steps_per_nearness=(STEPS - 1) / (1.0 - float(nearness[0])),
        pull_kgpm=force_and_moment[:, 0],
        moment_kg=force_and_moment[:, 1],
    )


def pull(hull: HullGeometry, density_kgpm3: float, distance_m: float) -> tuple[float, float]:
    """Return (force towards a wall, its moment about the origin) per U^2, kg/m and kg.

    ``distance_m`` is the distance h from the hull axis to the wall; the moment is positive where
    the force acts forward of mid-length.
    """
    # Quadrature of the double integral in the module docstring: growth_i = A'(x_i) dx_i.
    x, dx = geometry.quadrature(hull, NODES)
    growth = _section_growth(hull, x) * dx
    separation_m = 2.0 * distance_m
    kernel_per_m2 = separation_m / ((x[:, None] - x) ** 2 + separation_m**2) ** 1.5
    force_per_station = density_kgpm3 / (4.0 * pi) * growth * (kernel_per_m2 @ growth)
    return float(force_per_station.sum()), float(force_per_station @ x)


def _section_growth(hull: HullGeometry, x_m: Vector) -> Vector:
    """Return A'(x), the change of sectional area per metre forward, m."""
    step = _DIFFERENCE * geometry.length_m(hull)
    fore, aft = geometry.radius_m(hull, x_m + step), geometry.radius_m(hull, x_m - step)
    return np.asarray(pi * (fore**2 - aft**2) / (2.0 * step))
