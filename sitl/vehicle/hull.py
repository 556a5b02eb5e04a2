"""Hull geometry: bodies of revolution with a parallel mid-body, and the integrals over them.

x runs forward from mid-length of the whole hull.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from math import pi, radians, tan
from typing import NamedTuple

import numpy as np

from sitl.vehicle.file_schema import Cylinder, HullGeometry, Myring, ProfileHull, Series58
from sitl.vehicle.jit import Vector

NODES_PER_SECTION = 64
"""Gauss-Legendre nodes for nose, mid-body and tail; the profile squared is a polynomial, so volumes
come out exact."""
NODES_PER_FRUSTUM = 4
"""Exact for the polynomials of a straight-sided piece."""


class Outline(NamedTuple):
    """A hull as nose, parallel middle and tail."""

    nose_m: tuple[float, ...]
    """Lengths of the smooth pieces forward of the widest section, nose first."""
    middle_m: float
    tail_m: tuple[float, ...]
    """Lengths of the smooth pieces aft of it."""
    ends_m: float
    """Length of nose and tail together."""
    radius: Callable[[Vector], Vector]
    """Radius over the distance from the tip along nose and tail, the middle left out."""
    nodes: int
    """Quadrature nodes that a piece needs."""


@cache
def outline(hull: HullGeometry) -> Outline:
    """The pieces of a hull of any shape."""
    match hull:
        case Series58():
            return _series_58_outline(hull)
        case Myring():
            return _myring_outline(hull)
        case Cylinder():
            return _cylinder_outline(hull)
        case ProfileHull():
            return _profile_outline(hull)


def series_58(
    nose_radius: float, tail_radius: float, prismatic: float, max_section: float
) -> Vector:
    """Coefficients a_1..a_6 of (R/D)^2 = sum a_k X^k, X = 0 at the nose and 1 at the tail; shape
    (6,).

    Gertler (1950), DTMB report C-297: end radii r = R_end l/D^2, prismatic coefficient, and the
    place of the maximum section fix the six coefficients."""
    k = np.arange(1, 7)
    m = max_section
    conditions = np.array(
        [np.eye(6)[0], k, np.ones(6), m**k, k * m ** (k - 1), 1 / (k + 1)], dtype=float
    )
    values = np.array([2 * nose_radius, -2 * tail_radius, 0.0, 0.25, 0.0, prismatic / 4])
    return np.linalg.solve(conditions, values)


def _series_58_outline(hull: Series58) -> Outline:
    a = series_58(hull.nose_radius, hull.tail_radius, hull.prismatic, hull.max_section)

    def radius(along_m: Vector) -> Vector:
        along = along_m / hull.base_length_m
        squared = sum(a[k] * along ** (k + 1) for k in range(6))
        return np.asarray(hull.diameter_m * np.sqrt(np.maximum(squared, 0.0)))

    nose, tail = hull.max_section * hull.base_length_m, (1 - hull.max_section) * hull.base_length_m
    return Outline(
        (nose,), hull.midbody_length_m, (tail,), hull.base_length_m, radius, NODES_PER_SECTION
    )


def _myring_outline(hull: Myring) -> Outline:
    """Myring (1976), "A theoretical study of body drag in subcritical axisymmetric flow"; nose and
    tail curves."""
    a, c, d = hull.nose_length_m, hull.tail_length_m, hull.diameter_m
    nose, tail, slope = (
        a - hull.nose_offset_m,
        c - hull.tail_offset_m,
        tan(radians(hull.tail_angle_deg)),
    )

    def radius(along_m: Vector) -> Vector:
        to_shoulder, behind = (
            np.clip((nose - along_m) / a, 0.0, 1.0),
            np.maximum(along_m - nose, 0.0),
        )
        rounded = d / 2 * (1 - to_shoulder**2) ** (1 / hull.nose_exponent)
        pointed = (
            d / 2 - (1.5 * d / c**2 - slope / c) * behind**2 + (d / c**3 - slope / c**2) * behind**3
        )
        return np.where(along_m < nose, rounded, np.maximum(pointed, 0.0))

    middle = hull.mid_length_m + hull.midbody_length_m
    return Outline((nose,), middle, (tail,), nose + tail, radius, NODES_PER_SECTION)


def _cylinder_outline(hull: Cylinder) -> Outline:
    half = hull.diameter_m / 2
    nose = half if hull.nose_cap_m is None else hull.nose_cap_m
    tail = half if hull.tail_cap_m is None else hull.tail_cap_m

    def radius(along_m: Vector) -> Vector:
        before, behind = nose - along_m, along_m - nose
        reach = np.where(
            before > 0.0, before / (nose or 1.0), np.maximum(behind, 0.0) / (tail or 1.0)
        )
        return np.asarray(half * np.sqrt(np.maximum(1 - reach**2, 0.0)))

    middle = hull.length_m - nose - tail + hull.midbody_length_m
    return Outline((nose,), middle, (tail,), nose + tail, radius, NODES_PER_SECTION)


def _profile_outline(hull: ProfileHull) -> Outline:
    along, radii = np.array(hull.points_m).T
    pieces, widest = np.diff(along).tolist(), int(radii.argmax())

    def radius(along_m: Vector) -> Vector:
        return np.asarray(np.interp(along_m + along[0], along, radii))

    ends = float(along[-1] - along[0])
    nose, tail = tuple(pieces[:widest]), tuple(pieces[widest:])
    return Outline(nose, hull.midbody_length_m, tail, ends, radius, NODES_PER_FRUSTUM)


def length_m(hull: HullGeometry) -> float:
    """Length overall."""
    whole = outline(hull)
    return whole.ends_m + whole.middle_m


def radius_m(hull: HullGeometry, x_m: Vector) -> Vector:
    """Hull radius at ``x_m`` (any shape), zero outside the hull."""
    whole = outline(hull)
    from_nose, nose = length_m(hull) / 2 - x_m, sum(whole.nose_m)
    along = np.where(from_nose < nose, from_nose, np.maximum(nose, from_nose - whole.middle_m))
    inside = (along >= 0.0) & (along <= whole.ends_m)
    return np.asarray(np.where(inside, whole.radius(np.clip(along, 0.0, whole.ends_m)), 0.0))


_gauss_legendre = cache(np.polynomial.legendre.leggauss)
"""Nodes and weights on [-1, 1]: an eigenvalue problem that need not be solved for every vehicle
anew."""


def quadrature(hull: HullGeometry, nodes: tuple[int, int, int]) -> tuple[Vector, Vector]:
    """(abscissae x_m, weights in m) for integrals over the hull; ``nodes`` for nose, mid-body and
    tail, nose first."""
    whole = outline(hull)
    return _quadrature(
        length_m(hull), (sum(whole.nose_m), whole.middle_m, sum(whole.tail_m)), nodes
    )


def _quadrature(
    length: float, pieces_m: tuple[float, ...], nodes: tuple[int, ...]
) -> tuple[Vector, Vector]:
    """Gauss-Legendre on each piece, nose first."""
    ends = length / 2 - np.cumsum([0.0, *pieces_m])
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
    whole = outline(hull)
    pieces = (*whole.nose_m, whole.middle_m, *whole.tail_m)
    x, dx = _quadrature(length_m(hull), pieces, (whole.nodes,) * len(pieces))
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
