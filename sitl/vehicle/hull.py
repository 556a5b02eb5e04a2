"""Hull geometry: bodies of revolution with a parallel mid-body, and integrals over them.

x is positive forward from mid-length of the whole hull, m.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, lru_cache
from math import pi, radians, tan
from typing import NamedTuple

import numpy as np

from sitl.vehicle.file_schema import Cylinder, HullGeometry, Myring, ProfileHull, Series58
from sitl.vehicle.vectors import Vector

NODES_PER_SECTION = 64
"""Gauss-Legendre nodes on each of nose, mid-body and tail.

The squared radius of Series 58 is a polynomial, so volumes are exact."""
NODES_PER_FRUSTUM = 4
"""Gauss-Legendre nodes on a straight-sided piece; the integrals of its polynomials are exact."""


class Outline(NamedTuple):
    """Hull as nose, parallel middle and tail."""

    nose_m: tuple[float, ...]
    """Lengths of the smooth pieces forward of the widest section, nose first."""
    middle_m: float
    """Length of the parallel mid-body."""
    tail_m: tuple[float, ...]
    """Lengths of the smooth pieces aft of the widest section."""
    ends_m: float
    """Length of nose and tail together."""
    radius: Callable[[Vector], Vector]
    """Radius (m) as a function of the distance from the nose (m), without the parallel middle."""
    nodes: int
    """Number of quadrature nodes for each piece."""


@cache
def outline(hull: HullGeometry) -> Outline:
    """Return the pieces of a hull of any shape."""
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
    """Return the coefficients a_1..a_6 of (R/D)^2 = sum a_k X^k, shape (6,).

    X is 0 at the nose and 1 at the tail, R the local radius and D the largest diameter. Arguments
    are dimensionless: end radii r = R_end l/D^2, prismatic coefficient, and X of the maximum
    section.
    """
    # Gertler (1950), DTMB report C-297. Six conditions on (R/D)^2 = f(X):
    #     f'(0) = 2 r_0,  f'(1) = -2 r_1,  f(1) = 0,  f(m) = 1/4,  f'(m) = 0,
    #     integral of f over 0..1 = C_p / 4.
    k = np.arange(1, 7)
    m = max_section
    conditions = np.array(
        [np.eye(6)[0], k, np.ones(6), m**k, k * m ** (k - 1), 1 / (k + 1)], dtype=float
    )
    values = np.array([2 * nose_radius, -2 * tail_radius, 0.0, 0.25, 0.0, prismatic / 4])
    return np.linalg.solve(conditions, values)


def _series_58_outline(hull: Series58) -> Outline:
    """Return the outline of a Series 58 body (Gertler 1950)."""
    # R = D sqrt(sum a_k X^k), X = distance from the nose over base length (``series_58``).
    a = series_58(hull.nose_radius, hull.tail_radius, hull.prismatic, hull.max_section)

    def radius(along_m: Vector) -> Vector:
        along = along_m / hull.base_length_m
        squared = sum(a[k] * along ** (k + 1) for k in range(6))
        return np.asarray(hull.diameter_m * np.sqrt(np.maximum(squared, 0.0)))

    nose, tail = hull.max_section * hull.base_length_m, (1 - hull.max_section) * hull.base_length_m
    return Outline(
        nose_m=(nose,),
        middle_m=hull.midbody_length_m,
        tail_m=(tail,),
        ends_m=hull.base_length_m,
        radius=radius,
        nodes=NODES_PER_SECTION,
    )


def _myring_outline(hull: Myring) -> Outline:
    """Return the outline of a Myring body."""
    # Myring (1976), "A theoretical study of body drag in subcritical axisymmetric flow". With nose
    # length a, tail length c, diameter d, exponent n, tail angle b, s from the start of the tail:
    #     nose: r = d/2 (1 - ((a - x)/a)^2)^(1/n), x from the nose tip,
    #     tail: r = d/2 - (3 d/(2 c^2) - tan b/c) s^2 + (d/c^3 - tan b/c^2) s^3.
    # The offsets cut off the tips of nose and tail.
    a, c, d = hull.nose_length_m, hull.tail_length_m, hull.diameter_m
    nose, tail, slope = (
        a - hull.nose_offset_m,
        c - hull.tail_offset_m,
        tan(radians(hull.tail_angle_deg)),
    )

    def radius(along_m: Vector) -> Vector:
        """Return the hull radius (m) at distances from the bow (m), from Myring's nose and tail."""
        to_shoulder, behind_m = (
            np.clip((nose - along_m) / a, 0.0, 1.0),
            np.maximum(along_m - nose, 0.0),
        )
        nose_radius_m = d / 2 * (1 - to_shoulder**2) ** (1 / hull.nose_exponent)
        tail_radius_m = (
            d / 2
            - (1.5 * d / c**2 - slope / c) * behind_m**2
            + (d / c**3 - slope / c**2) * behind_m**3
        )
        return np.where(along_m < nose, nose_radius_m, np.maximum(tail_radius_m, 0.0))

    middle = hull.mid_length_m + hull.midbody_length_m
    return Outline(
        nose_m=(nose,),
        middle_m=middle,
        tail_m=(tail,),
        ends_m=nose + tail,
        radius=radius,
        nodes=NODES_PER_SECTION,
    )


def _cylinder_outline(hull: Cylinder) -> Outline:
    """Return the outline of a cylinder with half-ellipsoid caps."""
    # Radius of a cap with length c (m), at the distance s from the cylinder, 0 <= s <= c:
    #     R = d/2 sqrt(1 - (s/c)^2);   c = d/2 is a hemisphere, c = 0 a flat end.
    half = hull.diameter_m / 2
    nose = half if hull.nose_cap_m is None else hull.nose_cap_m
    tail = half if hull.tail_cap_m is None else hull.tail_cap_m

    def radius(along_m: Vector) -> Vector:
        """Return the hull radius (m) at distances from the bow (m), with elliptic nose and tail."""
        before_m, behind_m = nose - along_m, along_m - nose
        reach = np.where(
            before_m > 0.0, before_m / (nose or 1.0), np.maximum(behind_m, 0.0) / (tail or 1.0)
        )
        return np.asarray(half * np.sqrt(np.maximum(1 - reach**2, 0.0)))

    middle = hull.length_m - nose - tail + hull.midbody_length_m
    return Outline(
        nose_m=(nose,),
        middle_m=middle,
        tail_m=(tail,),
        ends_m=nose + tail,
        radius=radius,
        nodes=NODES_PER_SECTION,
    )


def _profile_outline(hull: ProfileHull) -> Outline:
    """Return the outline of a hull with straight lines between given points."""
    along, radii = np.array(hull.points_m).T
    pieces, widest = np.diff(along).tolist(), int(radii.argmax())

    def radius(along_m: Vector) -> Vector:
        return np.asarray(np.interp(along_m + along[0], along, radii))

    ends = float(along[-1] - along[0])
    nose, tail = tuple(pieces[:widest]), tuple(pieces[widest:])
    return Outline(
        nose_m=nose,
        middle_m=hull.midbody_length_m,
        tail_m=tail,
        ends_m=ends,
        radius=radius,
        nodes=NODES_PER_FRUSTUM,
    )


def length_m(hull: HullGeometry) -> float:
    """Return the overall length of a hull.

    Parameters
    ----------
    hull : HullGeometry
        Shape of the hull.

    Returns
    -------
    float
        Length overall, m.
    """
    hull_outline = outline(hull)
    return hull_outline.ends_m + hull_outline.middle_m


def radius_m(hull: HullGeometry, x_m: Vector) -> Vector:
    """Return the radius of a hull at given stations.

    Parameters
    ----------
    hull : HullGeometry
        Shape of the hull.
    x_m : ndarray
        Distances forward of mid-length, m; any shape.

    Returns
    -------
    ndarray
        Radius, m, in the shape of ``x_m``; zero outside the hull.
    """
    hull_outline = outline(hull)
    from_nose, nose = length_m(hull) / 2 - x_m, sum(hull_outline.nose_m)
    along = np.where(
        from_nose < nose, from_nose, np.maximum(nose, from_nose - hull_outline.middle_m)
    )
    inside = (along >= 0.0) & (along <= hull_outline.ends_m)
    return np.asarray(
        np.where(inside, hull_outline.radius(np.clip(along, 0.0, hull_outline.ends_m)), 0.0)
    )


_gauss_legendre = cache(np.polynomial.legendre.leggauss)
"""Gauss-Legendre nodes and weights on [-1, 1], cached because they need an eigenvalue problem."""


def quadrature(hull: HullGeometry, nodes: tuple[int, int, int]) -> tuple[Vector, Vector]:
    """Return (abscissae x_m, weights in m) of a Gauss-Legendre quadrature over the hull.

    ``nodes`` is the number of nodes on nose, mid-body and tail; abscissae run from nose to tail.
    """
    hull_outline = outline(hull)
    return _quadrature(
        length_m(hull),
        (sum(hull_outline.nose_m), hull_outline.middle_m, sum(hull_outline.tail_m)),
        nodes,
    )


def _quadrature(
    length: float, pieces_m: tuple[float, ...], nodes: tuple[int, ...]
) -> tuple[Vector, Vector]:
    """Return abscissae and weights of Gauss-Legendre on each piece, nose first."""
    ends = length / 2 - np.cumsum([0.0, *pieces_m])
    x, dx = [], []
    for forward, aft, n in zip(ends[:-1], ends[1:], nodes, strict=True):
        node, weight = _gauss_legendre(n)
        x.append((forward + aft) / 2 - node * (forward - aft) / 2)
        dx.append(weight * (forward - aft) / 2)
    return np.concatenate(x), np.concatenate(dx)


class Integrals(NamedTuple):
    """Integrals over the hull; first and second moments are about mid-length."""

    volume_m3: float
    """Integral of pi R^2 dx."""
    centroid_m: float
    """Position of the centroid of the volume, forward of mid-length."""
    planform_m2: float
    """Integral of 2 R dx."""
    frontal_m2: float
    """Largest sectional area, pi d^2 / 4."""
    roll_inertia_m5: float
    """Moment of inertia about the axis at unit density: integral of pi R^4 / 2 dx."""
    pitch_inertia_m5: float
    """Moment of inertia about a transverse axis at mid-length at unit density.

    Integral of (pi R^2 x^2 + pi R^4 / 4) dx."""
    section_moment_m5: float
    """Integral of pi R^2 x^2 dx: added moment of inertia of strip theory at unit density."""


@lru_cache(maxsize=16)
def integrals(hull: HullGeometry) -> Integrals:
    """Return the volume, planform and inertia integrals of a hull.

    Parameters
    ----------
    hull : HullGeometry
        Shape of the hull.

    Returns
    -------
    Integrals
        Moments about mid-length, at unit density.

    Notes
    -----
    Gauss-Legendre quadrature on every smooth piece; exact where R^2 is a polynomial. The result is
    cached, because a fit builds thousands of models of one hull.
    """
    # Section A = pi R^2 (m2); a slice has the moments of inertia A R^2/2 dx about the axis and
    # (A R^2/4 + A x^2) dx about a transverse axis at mid-length (m5, unit density).
    hull_outline = outline(hull)
    pieces = (*hull_outline.nose_m, hull_outline.middle_m, *hull_outline.tail_m)
    x, dx = _quadrature(length_m(hull), pieces, (hull_outline.nodes,) * len(pieces))
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
