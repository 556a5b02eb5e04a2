"""Rigid-body equations of the paper, against Newton's law for points.

Axes and symbols are the paper's (x forward, y port, z up).
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.reproduction.discrepancies.record import Discrepancy

Array = NDArray[np.float64]

RIGID_BODY_POINTS = 40
"""Number of point masses of the body with which the rigid-body equations are checked."""
EXACT = 1e-9
"""Largest relative difference of equations that agree."""


def places() -> list[Discrepancy]:
    """Return the places with their evidence.

    Returns
    -------
    list of Discrepancy
        In the order of the paper.
    """
    return [_euler_angles(), _forces(), _moments()]


def _euler_angles() -> Discrepancy:
    """Check the order of the Euler angles: which angle's rate is the yaw rate."""
    # E' = J(E) omega with E = (phi, theta, psi) about x, y, z (Fossen 2021, eq. 2.28).
    pitch = 0.2
    psi_rate = math.cos(0.0) / math.cos(pitch)
    phi_rate = math.cos(0.0) * math.tan(pitch)
    return Discrepancy(
        place="Overall Vehicle Modeling: Euler angles; Linearized Model: phi / delta_r",
        printed="(psi, theta, phi) describe roll, pitch and yaw; transfer function phi/delta",
        reading="psi is yaw, theta pitch, phi roll; the transfer function is psi/delta",
        evidence=(
            f"at a pitch of {pitch:g} rad a yaw rate of 1 rad/s turns psi by {psi_rate:.3f} and phi"
            f" by {phi_rate:.3f} rad/s; the numerator holds N_dr, so the angle is yaw"
        ),
        values={"psi_rate_radps": psi_rate, "phi_rate_radps": phi_rate},
        confirmed=abs(psi_rate) > abs(phi_rate),
    )


class _RigidBody(NamedTuple):
    """Point masses, and the motion of the frame in which they are at rest."""

    mass: Array
    position: Array
    """(points, 3), m."""
    velocity: Array
    rate: Array
    acceleration: Array
    """Derivative of the velocity in the body frame, (3,)."""
    rate_change: Array


def _rigid_body() -> _RigidBody:
    """Return a body without symmetry in arbitrary motion."""
    rng = np.random.default_rng(14)
    return _RigidBody(
        mass=rng.uniform(0.5, 2.0, RIGID_BODY_POINTS),
        position=rng.normal(0.3, 1.0, (RIGID_BODY_POINTS, 3)),
        velocity=rng.normal(size=3),
        rate=rng.normal(size=3),
        acceleration=rng.normal(size=3),
        rate_change=rng.normal(size=3),
    )


def _point_forces(body: _RigidBody) -> Array:
    """Return the force on each point, m (v' + w x v + w' x r + w x (w x r)), (points, 3)."""
    turning = np.cross(body.rate_change, body.position) + np.cross(
        body.rate, np.cross(body.rate, body.position)
    )
    common = body.acceleration + np.cross(body.rate, body.velocity)
    return np.asarray(body.mass[:, None] * (common + turning))


def _forces() -> Discrepancy:
    """Check the rigid-body X, Y, Z as printed, against Newton's law for points."""
    body = _rigid_body()
    m = float(body.mass.sum())
    x, y, z = (body.mass @ body.position) / m
    (u, v, w), (p, q, r) = body.velocity, body.rate
    (du, dv, dw), (dp, dq, dr) = body.acceleration, body.rate_change
    printed = m * np.array(
        [
            du + q * w - r * v + dq * z - dr * y + (q * y + r * z) * p - (q * q + r * r) * x,
            dv + r * u - p * w + dr * x - dp * z + (r * z + p * x) * q - (r * r + p * p) * y,
            dw + p * v - q * u + dp * y - dq * x + (p * x + q * y) * r - (p * p + q * q) * z,
        ]
    )
    error = _relative_error(printed, _point_forces(body).sum(axis=0))
    return Discrepancy(
        place="Overall Vehicle Modeling: X, Y, Z",
        printed="three equations with cross terms in x_CM, y_CM, z_CM",
        reading="correct as printed",
        evidence=f"relative difference to Newton's law for {RIGID_BODY_POINTS} points: {error:.0e}",
        values={"relative_error": error},
        confirmed=error < EXACT,
    )


def _moments() -> Discrepancy:
    """Check the rigid-body K, M, N as printed, with both conventions of the products of inertia."""
    body = _rigid_body()
    exact = np.cross(body.position, _point_forces(body)).sum(axis=0)
    tensor, positive = (_relative_error(_printed_moments(body, sign), exact) for sign in (-1, 1))
    return Discrepancy(
        place="Overall Vehicle Modeling: K, M, N",
        printed="products of inertia without their sign convention",
        reading="correct if I_xy = -int x y dm (element of the tensor), wrong if positive",
        evidence=(
            f"relative difference to the moment of {RIGID_BODY_POINTS} points: {tensor:.0e} with"
            f" the tensor's sign, {positive:.1f} with the positive one"
        ),
        values={"tensor_relative_error": tensor, "positive_relative_error": positive},
        confirmed=tensor < EXACT < positive,
    )


def _printed_moments(body: _RigidBody, sign: int) -> Array:
    """Return K, M, N as printed; `sign` of the products of inertia: I_xy = sign int x y dm."""
    m = float(body.mass.sum())
    x, y, z = (body.mass @ body.position) / m
    products = np.einsum("k,ki,kj->ij", body.mass, body.position, body.position)
    Ixx, Iyy, Izz = np.trace(products) - np.diag(products)
    Ixy, Ixz, Iyz = sign * products[0, 1], sign * products[0, 2], sign * products[1, 2]
    (u, v, w), (p, q, r) = body.velocity, body.rate
    (du, dv, dw), (dp, dq, dr) = body.acceleration, body.rate_change
    ax, ay, az = du + q * w - r * v, dv + r * u - p * w, dw + p * v - q * u
    inertial = np.array(
        [
            Ixx * dp + Ixy * dq + Ixz * dr + (Izz - Iyy) * r * q,
            Ixy * dp + Iyy * dq + Iyz * dr + (Ixx - Izz) * p * r,
            Ixz * dp + Iyz * dq + Izz * dr + (Iyy - Ixx) * p * q,
        ]
    )
    product_terms = np.array(
        [
            Iyz * (q * q - r * r) + Ixz * p * q - Ixy * p * r,
            Ixz * (r * r - p * p) + Ixy * q * r - Iyz * q * p,
            Ixy * (p * p - q * q) + Iyz * p * r - Ixz * q * r,
        ]
    )
    offset = m * np.array([y * az - z * ay, z * ax - x * az, x * ay - y * ax])
    return np.asarray(inertial + product_terms + offset)


def _relative_error(values: Array, exact: Array) -> float:
    """Return the largest difference over the largest exact value."""
    return float(np.max(np.abs(values - exact)) / np.max(np.abs(exact)))
