"""Mechanical energy of a vehicle and of the water that it accelerates (added mass)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sitl.vehicle.model import VehicleModel
from tests.sitl.vehicle import flight

Array = NDArray[np.float64]


def kinetic_j(model: VehicleModel, state: Array) -> float:
    """Return the kinetic energy of body and added mass, 1/2 nu^T M nu, J."""
    return float(state[7:13] @ model.inertia.M @ state[7:13] / 2)


def potential_j(model: VehicleModel, state: Array) -> float:
    """Return the potential energy of weight and buoyancy, deep under water, J."""
    h = model.hydrostatics
    up = flight.rotation(state)[2]
    cm = state[2] + up @ [h.x_cm_m, h.y_cm_m, h.z_cm_m]
    cb = state[2] + up @ [h.x_cb_m, 0.0, h.z_cb_m]
    return float(h.weight_n * cm - h.buoyancy_n * cb)


def mechanical_j(model: VehicleModel, track: Array) -> Array:
    """Return the mechanical energy of each state, J; zero for a body at rest at the first state."""
    ground = potential_j(model, track[0])
    return np.array(
        [kinetic_j(model, state) + potential_j(model, state) - ground for state in track]
    )


def power_w(model: VehicleModel, nu: Array) -> float:
    """Return the rate of change of kinetic energy without weight, buoyancy and thrust, W."""
    return float(nu @ model.inertia.M @ _rate(model, nu))


def power_scale_w(model: VehicleModel, nu: Array) -> float:
    """Return the sum of the magnitudes of the terms in ``power_w``, as a scale of its rounding."""
    return float(np.abs(nu) @ np.abs(model.inertia.M) @ np.abs(_rate(model, nu)))


def _rate(model: VehicleModel, nu: Array) -> Array:
    state = flight.cruising()
    state[7:13] = nu
    return flight.rate(flight.without_weight(model), state)[7:13]
