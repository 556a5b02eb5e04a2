"""Flying a model without autopilot or sensors: what every test of the vehicle needs."""

from __future__ import annotations

import numpy as np
from numba import njit

from sitl.vehicle import build_model, config, dynamics
from sitl.vehicle.jit import Vector
from sitl.vehicle.model import VehicleModel
from sitl.vehicle.water import STILL, Water

DEEP_M = -200.0
SHIPPED = ("caribou_nominal", "caribou_truth")


def model(name: str) -> VehicleModel:
    """A shipped vehicle."""
    return build_model.build(config.load(name))


def cruising(u_mps: float = 1.3) -> Vector:
    """Deep, level, heading north, under way."""
    state = dynamics.state_at_rest(DEEP_M)
    state[7] = u_mps
    return state


def tumbling(z_up_m: float = -1000.0) -> Vector:
    """Deep and moving in all six degrees of freedom, at an attitude without symmetry."""
    state = dynamics.state_at_rest(z_up_m)
    state[3:7] = np.array([0.7, 0.3, -0.5, 0.4]) / np.linalg.norm([0.7, 0.3, -0.5, 0.4])
    state[7:13] = 1.1, -0.4, 0.3, 0.9, -0.5, 0.6
    return state


def without_fluid_forces(model: VehicleModel) -> VehicleModel:
    """Added mass, weight and buoyancy only: no drag, no lift, no thrust, no pull of walls."""
    return model._replace(
        hull=model.hull._replace(**dict.fromkeys(model.hull._fields, 0.0)),
        stations=model.stations._replace(drag_kgpm=np.zeros_like(model.stations.drag_kgpm)),
        duct=model.duct._replace(half_rho_area_kgpm=0.0),
        walls=model.walls._replace(far_m=0.0),
        fins=model.fins._replace(half_rho_area_kgpm=0.0),
    )


def without_weight(model: VehicleModel) -> VehicleModel:
    """Neither weight nor buoyancy."""
    return model._replace(hydrostatics=model.hydrostatics._replace(weight_n=0.0, buoyancy_n=0.0))


def balanced(model: VehicleModel) -> VehicleModel:
    """Neither weight nor buoyancy, centre of mass on the axis: yaw and pitch do not stir roll."""
    M = np.diag(np.diag(model.inertia.M))
    inertia = model.inertia._replace(M=M, M_inverse=np.linalg.inv(M))
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
    """d(state)/dt."""
    out = np.empty(dynamics.STATE_SIZE)
    push = np.zeros(6) if disturbance is None else disturbance
    dynamics.derivative(state, rudder_rad, elevator_rad, shaft_rps, push, water, model, out)
    return out


@njit(cache=False)
def _record(state, rudder_rad, elevator_rad, shaft_rps, disturbance, water, dt, model, work, track):
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
    """States before each step and after the last, shape (n + 1, 13); inputs held throughout."""
    track = np.empty((round(seconds / dt_s) + 1, dynamics.STATE_SIZE))
    push = np.zeros(6) if disturbance is None else disturbance
    shaft_rps = thrust_fraction * model.propeller.full_rps
    work = dynamics.work_array()
    _record(
        state.copy(), rudder_rad, elevator_rad, shaft_rps, push, water, dt_s, model, work, track
    )
    return track


def rotation(state: Vector) -> Vector:
    """R, body FLU to NWU, shape (3, 3)."""
    return np.array(dynamics.rotation(state))
