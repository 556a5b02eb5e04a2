"""How the vehicle lies when a run begins: afloat in trim, or at a depth and under way."""

from __future__ import annotations

from math import cos, radians, sin

import numpy as np

from mavlink_io.frames import quaternion_from_euler
from sitl.core import environment
from sitl.core.environment import Environment, Weather
from sitl.core.environment.field import LocalWater
from sitl.scenario import StartTable
from sitl.vehicle import restoring
from sitl.vehicle.dynamics import NU, QUATERNION, rotation, state_at_rest
from sitl.vehicle.jit import Vector
from sitl.vehicle.model import VehicleModel

_BISECTIONS = 60
_NEWTON_STEPS = 12
_DIFFERENCE = 1e-6


def initial_body_state(
    model: VehicleModel, start: StartTable, sea: Environment, weather: Weather
) -> tuple[Vector, LocalWater]:
    """Body state, shape (13,), FLU in NWU, that a scenario starts from, and the water there, which
    carries her."""
    lying = _rest_state(model, start, sea)
    here = environment.sample_water(sea, weather, lying, 0.0)
    to_body = np.array(rotation(lying)).T
    lying[NU][:3] = to_body @ here.water.velocity_mps + (start.speed_mps, 0.0, 0.0)
    return lying, here


def _rest_state(model: VehicleModel, start: StartTable, sea: Environment) -> Vector:
    """Where and how she lies, at rest: afloat in the still water's trim, under the ice if there is
    any, or at depth."""
    if start.depth_m is None:
        ratio = float(sea.field.column[0, 1]) / sea.field.ballast_density_kgpm3
        z_up_m, roll_rad, pitch_rad = float_trim(model, ratio)
        z_up_m = min(z_up_m, sea.field.ceiling_m - 2.0 * model.hydrostatics.radius_m)
    else:
        z_up_m, roll_rad, pitch_rad = -start.depth_m, 0.0, 0.0
    state = state_at_rest(z_up_m)
    state[QUATERNION] = quaternion_from_euler(roll_rad, pitch_rad, -radians(start.heading_deg))
    return state


def float_trim(model: VehicleModel, density_ratio: float = 1.0) -> tuple[float, float, float]:
    """(height of the origin above the surface in m, roll and pitch in FLU, rad) at which she floats
    at rest.

    A vehicle heavier than the water she displaces floats nowhere; she starts level and just
    submerged."""
    low, high = -model.hydrostatics.radius_m, model.hydrostatics.radius_m
    if density_ratio * model.hydrostatics.buoyancy_n <= model.hydrostatics.weight_n:
        return low, 0.0, 0.0
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        low, high = (
            (middle, high)
            if _static_residual(np.array([middle, 0.0, 0.0]), model, density_ratio)[0] > 0.0
            else (low, middle)
        )
    trim = np.array([low, 0.0, 0.0])
    for _ in range(_NEWTON_STEPS):
        trim -= np.linalg.solve(
            _static_jacobian(trim, model, density_ratio),
            _static_residual(trim, model, density_ratio),
        )
    z_up_m, roll_rad, pitch_rad = trim.tolist()
    return z_up_m, roll_rad, pitch_rad


def _static_residual(trim: Vector, model: VehicleModel, density_ratio: float) -> Vector:
    """Net upward force and the moments in roll and pitch of weight and buoyancy, N and N m."""
    z_up_m, roll, pitch = trim.tolist()
    up = (-sin(pitch), sin(roll) * cos(pitch), cos(roll) * cos(pitch))
    X, Y, Z, K, M, _ = restoring.wrench(
        z_up_m, up[0], up, density_ratio, model.hydrostatics, model.stations
    )
    return np.array([X * up[0] + Y * up[1] + Z * up[2], K, M])


def _static_jacobian(trim: Vector, model: VehicleModel, density_ratio: float) -> Vector:
    """Jacobian of ``_static_residual`` by central differences, shape (3, 3)."""
    steps = _DIFFERENCE * np.eye(3)
    columns = [
        (
            _static_residual(trim + d, model, density_ratio)
            - _static_residual(trim - d, model, density_ratio)
        )
        / (2 * _DIFFERENCE)
        for d in steps
    ]
    return np.column_stack(columns)
