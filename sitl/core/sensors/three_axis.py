"""Errors of three-axis sensors: measured = A true + b + n.

A: matrix of scale and misalignment. b: bias. n: white noise.
"""

from __future__ import annotations

from math import sqrt

from mavlink_io.frames import Vector
from mavlink_io.jit import numeric
from sitl.core.draws import Draws

Matrix = tuple[Vector, Vector, Vector]
"""3 x 3 matrix, row by row."""
IDENTITY: Matrix = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
ZERO: Vector = (0.0, 0.0, 0.0)


def white_noise_sd(density: float, rate_hz: float) -> float:
    """Return the standard deviation of sampled white noise.

    sd = density sqrt(rate / 2): ``density`` is one-sided, per sqrt(Hz), and the bandwidth is half
    the sample rate.
    """
    return density * sqrt(0.5 * rate_hz)


def biases(rms: float, draws: Draws, stream: int) -> Vector:
    """Draw the bias of each axis from a normal distribution."""
    x, y, z = draws.normals(stream, 3)
    return rms * x, rms * y, rms * z


def imperfect_axes(scale_rms: float, skew_rms: float, draws: Draws, stream: int) -> Matrix:
    """Draw a matrix of random scale errors (diagonal) and misalignments (off-diagonal, rad)."""
    xx, xy, xz, yx, yy, yz, zx, zy, zz = draws.normals(stream, 9)
    return (
        (1.0 + scale_rms * xx, skew_rms * xy, skew_rms * xz),
        (skew_rms * yx, 1.0 + scale_rms * yy, skew_rms * yz),
        (skew_rms * zx, skew_rms * zy, 1.0 + scale_rms * zz),
    )


def soft_iron(rms: float, draws: Draws, stream: int) -> Matrix:
    """Draw a symmetric distortion matrix: identity plus induced magnetism."""
    xx, yy, zz, xy, xz, yz = (rms * n for n in draws.normals(stream, 6))
    return (1.0 + xx, xy, xz), (xy, 1.0 + yy, yz), (xz, yz, 1.0 + zz)


@numeric
def apply_errors(
    true: Vector, axes: Matrix, bias: Vector, noise: float, n_x: float, n_y: float, n_z: float
) -> Vector:
    """Return the measured vector; ``n_x`` to ``n_z`` are standard normal draws."""
    # measured = A true + b + noise n (module docstring), all in the unit and the axes of ``true``.
    x, y, z = true
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = axes
    b_x, b_y, b_z = bias
    return (
        xx * x + xy * y + xz * z + b_x + noise * n_x,
        yx * x + yy * y + yz * z + b_y + noise * n_y,
        zx * x + zy * y + zz * z + b_z + noise * n_z,
    )
