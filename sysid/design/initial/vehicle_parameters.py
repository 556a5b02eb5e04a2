"""Parameters that describe a vehicle to her autopilot, each with its reason."""

import math

import numpy as np

from sitl.vehicle.config import VehicleConfig
from sitl.vehicle.model import VehicleModel
from sysid.estimation.map import fit
from sysid.models import greybox

STEP_MPS = 1e-4


def autopilot_parameters(
    config: VehicleConfig, model: VehicleModel
) -> dict[str, tuple[float, str]]:
    point = config.operating_point
    length_m = -2.0 * point.speed_mps / _surge_slope_per_s(config, model)
    return {
        "ACT_TRAVEL_DEG": (config.tailcone.travel_deg, "travel of the tailcone"),
        "THR_CRUISE_PCT": (100.0 * point.thrust_fraction, "operating point"),
        "SPD_CRUISE_MPS": (point.speed_mps, "operating point"),
        "SPD_LENGTH_M": (
            min(500.0, max(1.0, length_m)),
            "twice speed times the surge time constant",
        ),
        "TRIM_ELE_DEG": (
            math.degrees(fit.level_elevator_rad(config, model)),
            "elevator of level flight",
        ),
        "EST_DENSITY": (config.water.density_kgpm3, "water of the vehicle file"),
    }


def _surge_slope_per_s(config: VehicleConfig, model: VehicleModel) -> float:
    """d(u')/du in straight flight at the operating point: drag, and the thrust lost to inflow."""
    point = config.operating_point
    rps = point.thrust_fraction * model.propeller.full_rps

    def surge(u_mps: float) -> float:
        return float(
            greybox.accelerations(model, "yaw", np.array([u_mps, 0.0, 0.0, 0.0, 0.0]), 0.0, rps)[0]
        )

    return (surge(point.speed_mps + STEP_MPS) - surge(point.speed_mps - STEP_MPS)) / (
        2.0 * STEP_MPS
    )
