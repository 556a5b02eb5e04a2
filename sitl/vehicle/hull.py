"""Hull geometry: Series 58 profile with a parallel mid-body, and the integrals over it.

x runs forward from mid-length of the whole hull.
"""

from __future__ import annotations

from functools import cache
from math import pi
from typing import NamedTuple

import numpy as np

from sitl.vehicle.config import HullGeometry
from sitl.vehicle.kernel import Vector

NODES_PER_SECTION = 64
"""Gauss-Legendre nodes for nose, mid-body and tail; the profile squared is a polynomial, so volumes come out exact."""


def series_58(nose_radius: float, tail_radius: float, prismatic: float, max_section: float) -> Vector:
    """Coefficients a_1..a_6 of (R/D)^2 = sum a_k X^k, X = 0 at the nose and 1 at the tail; shape (6,).

    Gertler (1950), DTMB report C-297: end radii r = R_end l/D^2, prismatic coefficient, and the place of the maximum
    section fix the six coefficients.
    """
    k = np.arange(1, 7)
    m = max_section
    conditions = np.array([np.eye(6)[0], k, np.ones(6), m**k, k * m ** (k - 1), 1 / (k + 1)], dtype=float)
    values = np.array([2 * nose_radius, -2 * tail_radius, 0.0, 0.25, 0.0, prismatic / 4])
    return np.linalg.solve(conditions, values)


def length_m(hull: HullGeometry) -> float:
    """Length overall, base body and mid-body."""
    return hull.base_length_m + hull.midbody_length_m


def radius_m(hull: HullGeometry, x_m: Vector) -> Vector:
    """Hull radius at ``x_m`` (any shape), zero outside the hull."""
    from_nose = length_m(hull) / 2 - x_m
    nose_end = hull.max_section * hull.base_length_m
    along_base = np.where(
        from_nose < nose_end, from_nose, np.maximum(nose_end, from_nose - hull.midbody_length_m)
    ) / hull.base_length_m  # fmt: skip
    a = series_58(hull.nose_radius, hull.tail_radius, hull.prismatic, hull.max_section)
    squared = sum(a[k] * along_base ** (k + 1) for k in range(6))
    inside = (along_base >= 0.0) & (along_base <= 1.0)
    return np.asarray(hull.diameter_m * np.sqrt(np.where(inside, np.maximum(squared, 0.0), 0.0)))


_gauss_legendre = cache(np.polynomial.legendre.leggauss)
"""Nodes and weights on [-1, 1]: an eigenvalue problem that need not be solved for every vehicle anew."""


def quadrature(hull: HullGeometry, nodes: tuple[int, int, int]) -> tuple[Vector, Vector]:
    """(abscissae x_m, weights in m) for integrals over the hull; ``nodes`` for nose, mid-body and tail, nose first."""
    ends = length_m(hull) / 2 - np.cumsum(
        [0.0, hull.max_section * hull.base_length_m, hull.midbody_length_m, (1 - hull.max_section) * hull.base_length_m]
    )
    x, dx = [], []
    for forward, aft, n in zip(ends[:-1], ends[1:], nodes, strict=True):
        at, weight = _gauss_legendre(n)
        x.append((forward + aft) / 2 - at * (forward - aft) / 2)
        dx.append(weight * (forward - aft) / 2)
    return np.concatenate(x), np.concatenate(dx)


class Integrals(NamedTuple):
    """Integrals over the hull, first and second moments about mid-length."""

    volume_m3: float
    centroid_m: float
    planform_m2: float
    frontal_m2: float
    roll_inertia_m5: float
    """Of unit density, about the axis."""
    pitch_inertia_m5: float
    """Of unit density, about a diameter at mid-length."""
    section_moment_m5: float
    """Integral of pi R^2 x^2: the added inertia of strip theory, of unit density."""


def integrals(hull: HullGeometry) -> Integrals:
    """Volume, planform and inertia integrals of the hull."""
    x, dx = quadrature(hull, (NODES_PER_SECTION,) * 3)
    radius = radius_m(hull, x)
    section = pi * radius**2
    volume = float(section @ dx)
    slice_inertia = section * radius**2 / 4
    return Integrals(
        volume_m3=volume,
        centroid_m=float((section * x) @ dx) / volume,
        planform_m2=float(2 * radius @ dx),
        frontal_m2=pi * hull.diameter_m**2 / 4,
        roll_inertia_m5=float(2 * slice_inertia @ dx),
        pitch_inertia_m5=float((slice_inertia + section * x**2) @ dx),
        section_moment_m5=float((section * x**2) @ dx),
    )
