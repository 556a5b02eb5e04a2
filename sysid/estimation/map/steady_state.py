"""Steady flight of a candidate: level, straight, and at which speed for which thrust."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq, fsolve

from sitl.vehicle.config import VehicleConfig
from sitl.vehicle.model import VehicleModel
from sysid.data.segments import Plane, Run
from sysid.models import greybox
from sysid.models.parameters import CandidateVehicle

Array = NDArray[np.float64]

MIN_SPEED_MPS, MAX_SPEED_MPS = 0.1, 10.0


def cruise_speed_mps(vehicle: CandidateVehicle, thrust: float) -> float:
    """Steady straight speed at a thrust (fraction of full), at least a crawl."""
    model, rps = vehicle.model, thrust * vehicle.model.propeller.full_rps

    def surge(u: float) -> float:
        return float(
            greybox.accelerations(model, "yaw", np.array([u, 0.0, 0.0, 0.0, 0.0]), 0.0, rps)[0]
        )

    if surge(MIN_SPEED_MPS) <= 0.0:
        return MIN_SPEED_MPS
    return float(brentq(surge, MIN_SPEED_MPS, MAX_SPEED_MPS, xtol=1e-9))


def trim_biases(
    config: VehicleConfig, model: VehicleModel, runs: Sequence[Run]
) -> dict[Plane, float]:
    """Actuator biases that make the prior vehicle balance where the measured one did: what a trim
    flight tells.

    Before each test the loops hold the vehicle straight and level; their mean command plus the bias
    is the angle at which the prior vehicle balances (zero for the rudder)."""
    held: dict[Plane, list[float]] = {"yaw": [], "pitch": []}
    for run in runs:
        if run.preroll.any():
            held["yaw"].append(float(np.mean(run.rudder_rad[run.preroll])))
            held["pitch"].append(float(np.mean(run.elevator_rad[run.preroll])))
    level = level_elevator_rad(config, model)
    commands = {
        plane: float(np.median(values)) if values else 0.0 for plane, values in held.items()
    }
    return {"yaw": -commands["yaw"], "pitch": level - commands["pitch"]}


def level_elevator_rad(config: VehicleConfig, model: VehicleModel) -> float:
    """Elevator at which the vehicle flies straight at constant depth, from its own nonlinear
    equations."""
    return float(_level_flight(config, model)[1])


def level_pitch_rad(config: VehicleConfig, model: VehicleModel) -> float:
    """Pitch (positive nose up) at which the vehicle flies straight at constant depth."""
    return float(_level_flight(config, model)[0])


def _level_flight(config: VehicleConfig, model: VehicleModel) -> Array:
    """(pitch nose up, elevator) of level flight at the operating point, from heave and pitch
    moment."""
    speed = config.operating_point.speed_mps
    rps = config.operating_point.thrust_fraction * model.propeller.full_rps

    def unbalanced(x: Array) -> Array:
        theta, elevator = -float(x[0]), float(x[1])
        u, w = speed * math.cos(theta), speed * math.sin(theta)
        state = np.array([u, w, 0.0, theta, greybox.SUBMERGED_Z_M])
        return greybox.accelerations(model, "pitch", state, elevator, rps)[1:]

    return np.asarray(fsolve(unbalanced, np.zeros(2), xtol=1e-12))
