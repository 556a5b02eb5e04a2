"""What three axes have in common: scale and misalignment in one matrix, a bias, and white noise."""

from __future__ import annotations

from math import sqrt

from mavlink_io.frames import Vector
from sitl.core.sensors.noise import NoiseStream

Matrix = tuple[Vector, Vector, Vector]
"""Row by row."""
IDENTITY: Matrix = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
ZERO: Vector = (0.0, 0.0, 0.0)


def white_noise_sd(density: float, rate_hz: float) -> float:
    """Standard deviation of white noise of one-sided ``density``, sampled at a rate that passes all
    below its half."""
    return density * sqrt(0.5 * rate_hz)


def biases(rms: float, stream: NoiseStream) -> Vector:
    """One draw for each axis."""
    x, y, z = stream.normals(3)
    return rms * x, rms * y, rms * z


def imperfect_axes(scale_rms: float, skew_rms: float, stream: NoiseStream) -> Matrix:
    """The identity but for the scale of each axis and the angles (rad) by which it leans on the two
    others."""
    xx, xy, xz, yx, yy, yz, zx, zy, zz = stream.normals(9)
    return (
        (1.0 + scale_rms * xx, skew_rms * xy, skew_rms * xz),
        (skew_rms * yx, 1.0 + scale_rms * yy, skew_rms * yz),
        (skew_rms * zx, skew_rms * zy, 1.0 + scale_rms * zz),
    )


def soft_iron(rms: float, stream: NoiseStream) -> Matrix:
    """The identity plus a symmetric distortion: iron that the field itself magnetises."""
    xx, yy, zz, xy, xz, yz = (rms * n for n in stream.normals(6))
    return (1.0 + xx, xy, xz), (xy, 1.0 + yy, yz), (xz, yz, 1.0 + zz)


def apply_errors(
    true: Vector, axes: Matrix, bias: Vector, noise: float, n_x: float, n_y: float, n_z: float
) -> Vector:
    """What the axes read of ``true`` with a unit draw of noise for each."""
    x, y, z = true
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = axes
    b_x, b_y, b_z = bias
    return (
        xx * x + xy * y + xz * z + b_x + noise * n_x,
        yx * x + yy * y + yz * z + b_y + noise * n_y,
        zx * x + zy * y + zz * z + b_z + noise * n_z,
    )
