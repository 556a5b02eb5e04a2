"""Initial state of the body: floating in trim at the surface, or at a depth and speed."""

from __future__ import annotations

from math import cos, radians, sin

import numpy as np

from mavlink_io.frames import quaternion_from_euler
from sitl.core import environment
from sitl.core.environment import Surroundings
from sitl.scenario import StartTable
from sitl.vehicle import restoring
from sitl.vehicle.dynamics import NU, QUATERNION, rotation, state_at_rest
from sitl.vehicle.model import VehicleModel
from sitl.vehicle.vectors import Vector

_BISECTIONS = 60
_NEWTON_STEPS = 12
_DIFFERENCE = 1e-6
"""Step of the central differences, m and rad."""


def initial_body_state(
    model: VehicleModel, start: StartTable, sea: Surroundings, variation: Vector
) -> Vector:
    """Return the body state at the start of a scenario.

    Parameters
    ----------
    model : VehicleModel
        The vehicle.
    start : StartTable
        Place, heading, depth and speed through the water.
    sea : Surroundings
        Environment of this run.
    variation : Vector
        Variation of the current at time zero, see ``environment.current``.

    Returns
    -------
    Vector
        State of ``vehicle.dynamics``, shape (13,): position (NWU, m), attitude quaternion, velocity
        over ground (FLU). The vehicle moves with the water, plus the speed through the water.
    """
    body = _rest_state(model, start, sea)
    local_water = environment.sample_water(sea, variation, body, 0.0)
    to_body = np.array(rotation(body)).T
    body[NU][:3] = to_body @ local_water.water.velocity_mps + (start.speed_mps, 0.0, 0.0)
    return body


def _rest_state(model: VehicleModel, start: StartTable, sea: Surroundings) -> Vector:
    """Return the state at rest: at the start depth, or in floating trim and below any ice."""
    if start.depth_m is None:
        ratio = float(sea.field.column[0, 1]) / sea.field.ballast_density_kgpm3
        z_up_m, roll_rad, pitch_rad = float_trim(model, ratio)
        z_up_m = min(z_up_m, sea.field.ceiling_m - 2.0 * model.hydrostatics.radius_m)
    else:
        z_up_m, roll_rad, pitch_rad = -start.depth_m, 0.0, 0.0
    state = state_at_rest(z_up_m)
    state[:2] = start.north_m, -start.east_m
    state[QUATERNION] = quaternion_from_euler(roll_rad, pitch_rad, -radians(start.heading_deg))
    return state


def float_trim(model: VehicleModel, density_ratio: float = 1.0) -> tuple[float, float, float]:
    """Return the equilibrium of the floating vehicle at rest.

    A vehicle that is heavier than the displaced water has no equilibrium; the result is then level
    and just submerged.

    Parameters
    ----------
    model : VehicleModel
        The vehicle.
    density_ratio : float
        Water density over the density in which the vehicle was ballasted.

    Returns
    -------
    z_up_m, roll_rad, pitch_rad : float
        Height of the hull axis above the still surface, roll and pitch (FLU).

    Notes
    -----
    Solves f(z, roll, pitch) = (F . up, K, M) = 0 for the force F (N) and the moments K, M (N m) of
    weight and buoyancy: bisection for z in the level attitude, then Newton's method
    x <- x - J^-1 f with J by central differences.
    """
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
    """Return the net upward force (N) and the roll and pitch moments (N m) at rest, shape (3,)."""
    z_up_m, roll, pitch = trim.tolist()
    up = (-sin(pitch), sin(roll) * cos(pitch), cos(roll) * cos(pitch))
    X, Y, Z, K, M, _ = restoring.wrench(
        z_up_m, up[0], up, density_ratio, model.hydrostatics, model.stations
    )
    return np.array([X * up[0] + Y * up[1] + Z * up[2], K, M])


def _static_jacobian(trim: Vector, model: VehicleModel, density_ratio: float) -> Vector:
    """Return the Jacobian of ``_static_residual`` by central differences, shape (3, 3)."""
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
