"""The rigid body.

Verifies: the six equations of a rigid body with its centre of mass off the origin and a full
inertia tensor; that its momenta are constant without forces. Leaves out: water. Reference: the six
scalar equations that the source paper prints under "Overall Vehicle Modeling"; Newton's first law.
Tolerance: rounding for accelerations; for a minute's tumble what steps of 2 ms leave.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from sitl.vehicle.model import VehicleModel
from tests.reference import bodies
from tests.reference.check import Check, worst
from tests.sitl.vehicle import flight

Array = NDArray[np.float64]

MASS = 640.0
CM = np.array([0.12, -0.07, -0.05])
INERTIA = np.array([[42.0, 3.0, -5.0], [3.0, 480.0, 7.0], [-5.0, 7.0, 510.0]])
"""Inertia tensor about the origin; off-diagonal elements as tensor elements: I_xy = -int x y dm."""
MOTIONS = 200
SECONDS = 60.0


def checks() -> Iterator[Check]:
    """Yield the checks of accelerations under random wrenches, then of momenta."""
    body, rng = bodies.rigid_body(MASS, CM, INERTIA), np.random.default_rng(5)
    misses = []
    for _ in range(MOTIONS):
        state, wrench = flight.cruising(), rng.uniform(-300, 300, 6)
        state[7:13] = rng.uniform(-2, 2, 6)
        rates = flight.rate(body, state, disturbance=wrench)[7:13]
        misses.append(paper_equations(state[7:13], rates) - wrench)
    yield worst(f"wrench of {MOTIONS} motions", "N", misses, 0.0, 1e-9, "paper, six equations")
    start = flight.tumbling()
    momenta = [
        _momenta(body, state, start)
        for state in flight.fly(body, start, SECONDS, dt_s=0.002)[::1000]
    ]
    size = np.linalg.norm(momenta[0])
    yield worst(
        "momenta over 60 s", "part", np.array(momenta) / size, momenta[0] / size, 1e-9, "Newton"
    )


def paper_equations(nu: Array, rates: Array) -> Array:
    """X, Y, Z, K, M, N as the paper prints them."""
    (u, v, w, p, q, r), (du, dv, dw, dp, dq, dr), m = nu, rates, MASS
    x, y, z = CM
    (Ixx, Ixy, Ixz), (Iyx, Iyy, Iyz), (Izx, Izy, Izz) = INERTIA
    return np.array(
        [
            m * (du + q * w - r * v + dq * z - dr * y + (q * y + r * z) * p - (q**2 + r**2) * x),
            m * (dv + r * u - p * w + dr * x - dp * z + (r * z + p * x) * q - (r**2 + p**2) * y),
            m * (dw + p * v - q * u + dp * y - dq * x + (p * x + q * y) * r - (p**2 + q**2) * z),
            Ixx * dp
            + Ixy * dq
            + Ixz * dr
            + (Izz - Iyy) * r * q
            + Iyz * (q**2 - r**2)
            + Ixz * p * q
            - Ixy * p * r
            + m * (y * (dw + p * v - q * u) - z * (dv + r * u - p * w)),
            Iyx * dp
            + Iyy * dq
            + Iyz * dr
            + (Ixx - Izz) * p * r
            + Ixz * (r**2 - p**2)
            + Ixy * q * r
            - Iyz * q * p
            + m * (z * (du + q * w - r * v) - x * (dw + p * v - q * u)),
            Izx * dp
            + Izy * dq
            + Izz * dr
            + (Iyy - Ixx) * p * q
            + Ixy * (p**2 - q**2)
            + Iyz * p * r
            - Ixz * q * r
            + m * (x * (dv + r * u - p * w) - y * (du + q * w - r * v)),
        ]
    )


def _momenta(body: VehicleModel, state: Array, start: Array) -> Array:
    """Linear, and angular about a fixed point, in the inertial frame."""
    R, momentum = flight.rotation(state), body.inertia.M @ state[7:13]
    linear = R @ momentum[:3]
    return np.concatenate([linear, R @ momentum[3:] + np.cross(state[0:3] - start[0:3], linear)])
