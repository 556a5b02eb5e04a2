"""What is believed of a vehicle before the next tests: a file's first principles, or an identified
model."""

import math
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sitl.vehicle import config as vehicle_files
from sitl.vehicle.config import VehicleConfig
from sysid import refit
from sysid.data.segments import Plane
from sysid.estimation.map import fit
from sysid.models import model_file as models
from sysid.models import noise, parameters
from sysid.models.model_file import IdentifiedModel
from sysid.models.noise import Noise
from sysid.models.parameters import NAMES, CandidateVehicle
from sysid.test_design.simulate import LevelFlight

Array = NDArray[np.float64]

UNKNOWN_TRIM_SHARE = 0.4
"""Share of the travel that a trim which nobody has measured may take; the paper's took 6 of 15
deg."""
SPARE_RAD = math.radians(0.5)
"""Travel that stays unused beside a trim that is known."""


class DesignPrior(NamedTuple):
    """z (``sysid.models.parameters``) is normal with ``mean`` and ``covariance``."""

    name: str
    config: VehicleConfig
    biases_rad: dict[Plane, float]
    mean: Array
    covariance: Array
    noise: dict[Plane, Noise]
    trims_known: bool = False

    def vehicle(self, z: Array) -> CandidateVehicle:
        return parameters.candidate_vehicle(self.config, self.biases_rad, z)


def read(prior: str | Path) -> DesignPrior:
    """From ``bench``, a vehicle file or a ``model.json``.

    Raises:
        VehicleError, ModelError, RefitError: bad input, each in one line.
    """
    if not str(prior).endswith(".json"):
        return from_file(
            refit.vehicle_file(prior),
            str(prior) if prior == "caribou_nominal" else Path(prior).name,
        )
    model = models.read(prior)
    if model.method != "map":
        raise refit.RefitError(
            f"{prior}: method = {model.method!r}; tests are designed on a model of method 'map'"
        )
    return from_model(model, vehicle_files.load(model.vehicle.prior), Path(prior).name)


def from_file(config: VehicleConfig, name: str = "caribou_nominal") -> DesignPrior:
    """First principles with the spread that they leave, in the sea that the fit assumes before it
    has seen it."""
    biases: dict[Plane, float] = {"yaw": 0.0, "pitch": 0.0}
    sea: dict[Plane, Noise] = {"yaw": Noise(), "pitch": Noise()}
    return DesignPrior(
        name, config, biases, np.zeros(len(NAMES)), parameters.prior_covariance(), sea
    )


def from_model(
    model: IdentifiedModel, config: VehicleConfig, name: str = "model.json"
) -> DesignPrior:
    """The posterior of an earlier fit, and the sea that it found."""
    biases: dict[Plane, float] = {
        plane: math.radians(b) for plane, b in model.vehicle.prior_biases_deg.items()
    }
    sea: dict[Plane, Noise] = {"yaw": Noise(), "pitch": Noise()}
    sea |= {plane: noise.from_model(found) for plane, found in model.noise.items()}
    return DesignPrior(
        name, config, biases, np.array(model.joint.z), np.array(model.joint.covariance), sea, True
    )


def with_trim(belief: DesignPrior, rudder_rad: float, elevator_rad: float) -> DesignPrior:
    """The same after a trim flight: the biases with which it balances where the surfaces then
    stood."""
    unbiased = belief._replace(biases_rad={"yaw": 0.0, "pitch": 0.0})
    level_rad = level_flight(unbiased.vehicle(belief.mean), "pitch").trim_rad
    biases: dict[Plane, float] = {"yaw": -rudder_rad, "pitch": level_rad - elevator_rad}
    return belief._replace(biases_rad=biases, trims_known=True)


def level_flight(vehicle: CandidateVehicle, plane: Plane) -> LevelFlight:
    """Straight level flight of a candidate at its operating point."""
    thrust = vehicle.config.operating_point.thrust_fraction
    speed_mps = fit.cruise_speed_mps(vehicle, thrust)
    bias_rad = vehicle.actuators[plane].bias_rad
    if plane == "yaw":
        return LevelFlight(-bias_rad, thrust, speed_mps, 0.0)
    level_rad = fit.level_elevator_rad(vehicle.config, vehicle.model)
    return LevelFlight(
        level_rad - bias_rad, thrust, speed_mps, fit.level_pitch_rad(vehicle.config, vehicle.model)
    )


def available_travel_rad(belief: DesignPrior, plane: Plane) -> float:
    """How far the surface may be moved from its trim before it meets its stops."""
    vehicle = belief.vehicle(belief.mean)
    travel = vehicle.actuators[plane].travel_rad
    if not belief.trims_known:
        return (1.0 - UNKNOWN_TRIM_SHARE) * travel
    return travel - abs(level_flight(vehicle, plane).trim_rad) - SPARE_RAD
