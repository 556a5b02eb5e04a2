"""Helpers of the vehicle tests: simulate a model without autopilot and sensors."""

from __future__ import annotations

from typing import TypedDict

import numpy as np
from numba import njit

from sitl.vehicle import build_model, config, dynamics
from sitl.vehicle.model import VehicleModel
from sitl.vehicle.vectors import Vector
from sitl.vehicle.water import STILL, Water

DEEP_M = -200.0
SHIPPED = ("caribou_nominal", "caribou_truth")


class Inputs(TypedDict):
    """Constant inputs of ``fly``."""

    rudder_rad: float
    elevator_rad: float
    thrust_fraction: float


def model(name: str) -> VehicleModel:
    """Return the model of a shipped vehicle."""
    return build_model.build(config.load(name))


def cruising(u_mps: float = 1.3) -> Vector:
    """Return the state of a deep, level vehicle that moves north at ``u_mps``."""
    state = dynamics.state_at_rest(DEEP_M)
    state[7] = u_mps
    return state


def tumbling(z_up_m: float = -1000.0) -> Vector:
    """Return a state with motion in six degrees of freedom and an attitude without symmetry."""
    state = dynamics.state_at_rest(z_up_m)
    state[3:7] = np.array([0.7, 0.3, -0.5, 0.4]) / np.linalg.norm([0.7, 0.3, -0.5, 0.4])
    state[7:13] = 1.1, -0.4, 0.3, 0.9, -0.5, 0.6
    return state


def without_fluid_forces(model: VehicleModel) -> VehicleModel:
    """Return the model with inertia, weight and buoyancy only: no drag, lift, thrust or walls."""
    return model._replace(
        hull=model.hull._replace(**dict.fromkeys(model.hull._fields, 0.0)),
        stations=model.stations._replace(drag_kgpm=np.zeros_like(model.stations.drag_kgpm)),
        duct=model.duct._replace(half_rho_area_kgpm=0.0),
        walls=model.walls._replace(far_m=0.0),
        fins=model.fins._replace(half_rho_area_kgpm=0.0),
    )


def without_weight(model: VehicleModel) -> VehicleModel:
    """Return the model without weight and buoyancy."""
    return model._replace(hydrostatics=model.hydrostatics._replace(weight_n=0.0, buoyancy_n=0.0))


def balanced(model: VehicleModel) -> VehicleModel:
    """Return the model without weight and buoyancy and with a diagonal mass matrix.

    Yaw and pitch then do not excite roll.
    """
    M = np.diag(np.diag(model.inertia.M))
    inertia = model.inertia._replace(M=M, M_inverse=np.linalg.inv(M).astype(float))
    return without_weight(model)._replace(inertia=inertia)


def rate(
    model: VehicleModel,
    state: Vector,
    rudder_rad: float = 0.0,
    elevator_rad: float = 0.0,
    shaft_rps: float = 0.0,
    disturbance: Vector | None = None,
    water: Water = STILL,
) -> Vector:
    """Return d(state)/dt, shape (13,)."""
    out = np.empty(dynamics.STATE_SIZE)
    push = np.zeros(6) if disturbance is None else disturbance
    dynamics.derivative(state, rudder_rad, elevator_rad, shaft_rps, push, water, model, out)
    return out


@njit(cache=False)
def _record(
    state: Vector,
    rudder_rad: float,
    elevator_rad: float,
    shaft_rps: float,
    disturbance: Vector,
    water: Water,
    dt: float,
    model: VehicleModel,
    work: Vector,
    track: Vector,
) -> None:
    for i in range(len(track)):
        track[i] = state
        dynamics.rk4_step(
            state, rudder_rad, elevator_rad, shaft_rps, disturbance, water, dt, model, work
        )


def fly(
    model: VehicleModel,
    state: Vector,
    seconds: float,
    rudder_rad: float = 0.0,
    elevator_rad: float = 0.0,
    thrust_fraction: float = 0.0,
    water: Water = STILL,
    disturbance: Vector | None = None,
    dt_s: float = 0.005,
) -> Vector:
    """Return the states before each step and after the last, shape (n + 1, 13), inputs constant."""
    track = np.empty((round(seconds / dt_s) + 1, dynamics.STATE_SIZE))
    push = np.zeros(6) if disturbance is None else disturbance
    shaft_rps = thrust_fraction * model.propeller.full_rps
    work = dynamics.work_array()
    _record(
        state.copy(), rudder_rad, elevator_rad, shaft_rps, push, water, dt_s, model, work, track
    )
    return track


def rotation(state: Vector) -> Vector:
    """Return R, body FLU to NWU, shape (3, 3)."""
    return np.array(dynamics.rotation(state))
