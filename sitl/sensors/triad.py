"""What three axes have in common: scale and misalignment in one matrix, a bias, and white noise."""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt

from numpy.random import Generator

from link.frames import Vector

Matrix = tuple[Vector, Vector, Vector]
"""Row by row."""
PERFECT: Matrix = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
NOTHING: Vector = (0.0, 0.0, 0.0)


def white(density: float, rate_hz: float) -> float:
    """Standard deviation of white noise of one-sided ``density``, sampled at a rate that passes all below its half."""
    return density * sqrt(0.5 * rate_hz)


def biases(rms: float, stream: Generator) -> Vector:
    """One draw for each axis."""
    x, y, z = stream.standard_normal(3).tolist()
    return rms * x, rms * y, rms * z


def imperfect_axes(scale_rms: float, skew_rms: float, stream: Generator) -> Matrix:
    """The identity but for the scale of each axis and the angles (rad) by which it leans on the two others."""
    n = stream.standard_normal((3, 3))
    rows = [[(1.0 + scale_rms * n[i, j]) if i == j else skew_rms * n[i, j] for j in range(3)] for i in range(3)]
    return _vector(rows[0]), _vector(rows[1]), _vector(rows[2])


def soft_iron(rms: float, stream: Generator) -> Matrix:
    """The identity plus a symmetric distortion: iron that the field itself magnetises (Gebre-Egziabher 2006, eq. 4)."""
    xx, yy, zz, xy, xz, yz = (rms * stream.standard_normal(6)).tolist()
    return (1.0 + xx, xy, xz), (xy, 1.0 + yy, yz), (xz, yz, 1.0 + zz)


def measured(true: Vector, axes: Matrix, bias: Vector, noise: float, draws: Sequence[float]) -> Vector:
    """What the axes read of ``true`` with three unit ``draws`` of noise."""
    x, y, z = true
    a, b, c = axes
    return (
        a[0] * x + a[1] * y + a[2] * z + bias[0] + noise * draws[0],
        b[0] * x + b[1] * y + b[2] * z + bias[1] + noise * draws[1],
        c[0] * x + c[1] * y + c[2] * z + bias[2] + noise * draws[2],
    )


def _vector(row: Sequence[float]) -> Vector:
    x, y, z = row
    return float(x), float(y), float(z)
