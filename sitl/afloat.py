"""How the vehicle lies when a run begins: afloat in trim, or at a depth and under way."""

from __future__ import annotations

from math import cos, radians, sin

import numpy as np

from link.frames import quaternion_from_euler
from sitl.scenario import Start
from sitl.vehicle import restoring
from sitl.vehicle.dynamics import NU, QUATERNION, state_at_rest
from sitl.vehicle.kernel import Vector, Vector3
from sitl.vehicle.model import Model

_BISECTIONS = 60
_NEWTON_STEPS = 12
_DIFFERENCE = 1e-6


def start_state(model: Model, start: Start, current_nwu_mps: Vector3) -> Vector:
    """Body state, shape (13,), FLU in NWU, that a scenario starts from; the current carries her along."""
    z_up_m, roll_rad, pitch_rad = float_trim(model) if start.depth_m is None else (-start.depth_m, 0.0, 0.0)
    state = state_at_rest(z_up_m)
    state[QUATERNION] = quaternion_from_euler(roll_rad, pitch_rad, -radians(start.heading_deg))
    w, x, y, z = state[QUATERNION]
    to_body = np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)],
        [2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)],
        [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)],
    ])  # fmt: skip
    state[NU][:3] = to_body @ current_nwu_mps + (start.speed_mps, 0.0, 0.0)
    return state


def float_trim(model: Model) -> tuple[float, float, float]:
    """(height of the origin above the surface in m, roll and pitch in FLU, rad) at which she floats at rest.

    A vehicle heavier than the water she displaces floats nowhere; she starts level and just submerged.
    """
    low, high = -model.hydrostatics.radius_m, model.hydrostatics.radius_m
    if model.hydrostatics.buoyancy_n <= model.hydrostatics.weight_n:
        return low, 0.0, 0.0
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if _unbalance(np.array([middle, 0.0, 0.0]), model)[0] > 0.0 else (low, middle)
    trim = np.array([low, 0.0, 0.0])
    for _ in range(_NEWTON_STEPS):
        trim -= np.linalg.solve(_stiffness(trim, model), _unbalance(trim, model))
    z_up_m, roll_rad, pitch_rad = trim.tolist()
    return z_up_m, roll_rad, pitch_rad


def _unbalance(trim: Vector, model: Model) -> Vector:
    """Net upward force and the moments in roll and pitch of weight and buoyancy, N and N m."""
    z_up_m, roll, pitch = trim.tolist()
    up = (-sin(pitch), sin(roll) * cos(pitch), cos(roll) * cos(pitch))
    X, Y, Z, K, M, _ = restoring.wrench(z_up_m, up[0], up, 1.0, model.hydrostatics, model.stations)
    return np.array([X * up[0] + Y * up[1] + Z * up[2], K, M])


def _stiffness(trim: Vector, model: Model) -> Vector:
    """Jacobian of ``_unbalance`` by central differences, shape (3, 3)."""
    steps = _DIFFERENCE * np.eye(3)
    columns = [(_unbalance(trim + d, model) - _unbalance(trim - d, model)) / (2 * _DIFFERENCE) for d in steps]
    return np.column_stack(columns)
