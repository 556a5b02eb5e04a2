"""Prior of a vehicle for test design: from a vehicle file, or from an identified model."""

import math
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sitl.vehicle.config import VehicleConfig
from sysid import prior_knowledge, refit
from sysid.estimation.map import steady_state
from sysid.models import model_file as models
from sysid.models import noise, parameters, prediction
from sysid.models.model_file import IdentifiedModel
from sysid.models.noise import Noise
from sysid.models.parameters import NAMES, CandidateVehicle
from sysid.planes import PLANES, Plane
from sysid.test_design.simulate import SimulatedLevelFlight

Array = NDArray[np.float64]

UNKNOWN_TRIM_SHARE = 0.4
"""Share of the travel reserved for an unknown trim; the paper's vehicle needed 6 of 15 deg."""
SPARE_RAD = math.radians(0.5)
"""Travel that stays unused beside a known trim (rad)."""


class DesignPrior(NamedTuple):
    """Normal prior of z (``sysid.models.parameters``) with ``mean`` and ``covariance``."""

    name: str
    config: VehicleConfig
    biases_rad: dict[Plane, float]
    """Actuator bias of each plane (rad) at z = 0."""
    mean: Array
    covariance: Array
    noise: dict[Plane, Noise]
    """Disturbance and sensor noise of each plane."""
    trims_known: bool = False
    """Whether the trims were measured."""

    def vehicle(self, z: Array) -> CandidateVehicle:
        """Return the vehicle at a value of z.

        Parameters
        ----------
        z : ndarray
            Normalised parameters, in prior standard deviations.

        Returns
        -------
        CandidateVehicle
            Vehicle configuration and actuators.
        """
        return parameters.candidate_vehicle(self.config, self.biases_rad, z)


def read(prior: str | Path, vehicle: VehicleConfig | None = None) -> DesignPrior:
    """Read a prior from ``caribou_nominal``, a vehicle file or a ``model.json``.

    Parameters
    ----------
    prior : str or Path
        Name or path.
    vehicle : VehicleConfig, optional
        Vehicle file of a model's refit; by default the one in the model.

    Returns
    -------
    DesignPrior
        Prior of the vehicle.

    Raises
    ------
    VehicleError, ModelError, RefitError
        The input is invalid; the message has one line.
    """
    if not str(prior).endswith(".json"):
        return from_file(
            prior_knowledge.vehicle_file(prior),
            str(prior) if prior == "caribou_nominal" else Path(prior).name,
        )
    model = models.read(prior)
    if model.method != "map":
        raise refit.RefitError(
            f"{prior}: method = {model.method!r}; tests are designed on a model of method 'map'"
        )
    return from_model(model, prediction.prior_vehicle(model, vehicle), Path(prior).name)


def from_file(config: VehicleConfig, name: str = "caribou_nominal") -> DesignPrior:
    """Return the first-principles prior of a vehicle file, with the fit's default disturbance.

    Parameters
    ----------
    config : VehicleConfig
        Content of the vehicle file.
    name : str
        Name of the vehicle.

    Returns
    -------
    DesignPrior
        Prior with mean zero.
    """
    biases: dict[Plane, float] = {Plane.YAW: 0.0, Plane.PITCH: 0.0}
    disturbance: dict[Plane, Noise] = {Plane.YAW: Noise(), Plane.PITCH: Noise()}
    return DesignPrior(
        name=name,
        config=config,
        biases_rad=biases,
        mean=np.zeros(len(NAMES)),
        covariance=parameters.prior_covariance(),
        noise=disturbance,
    )


def from_model(
    model: IdentifiedModel, config: VehicleConfig, name: str = "model.json"
) -> DesignPrior:
    """Return the posterior of an earlier fit as prior, with the identified disturbance.

    Parameters
    ----------
    model : IdentifiedModel
        Earlier fit of method ``map``.
    config : VehicleConfig
        Vehicle file from which it was fitted.
    name : str
        Name of the prior in messages.

    Returns
    -------
    DesignPrior
        Mean and covariance of the model.
    """
    disturbance: dict[Plane, Noise] = {Plane.YAW: Noise(), Plane.PITCH: Noise()}
    disturbance |= {
        plane: noise.from_model(model_noise) for plane, model_noise in model.noise.items()
    }
    return DesignPrior(
        name=name,
        config=config,
        biases_rad=model.vehicle.prior_biases_rad,
        mean=np.array(model.joint.z),
        covariance=np.array(model.joint.covariance),
        noise=disturbance,
        trims_known=True,
    )


def with_trim(prior: DesignPrior, rudder_rad: float, elevator_rad: float) -> DesignPrior:
    """Return the prior after a trim flight.

    Parameters
    ----------
    prior : DesignPrior
        Prior before the flight.
    rudder_rad, elevator_rad : float
        Mean surface commands in straight level flight (rad).

    Returns
    -------
    DesignPrior
        Prior with the biases that explain them: command plus bias is the angle of level flight.
    """
    unbiased = prior._replace(biases_rad={Plane.YAW: 0.0, Plane.PITCH: 0.0})
    level_rad = level_flight(unbiased.vehicle(prior.mean), Plane.PITCH).trim_rad
    biases: dict[Plane, float] = {Plane.YAW: -rudder_rad, Plane.PITCH: level_rad - elevator_rad}
    return prior._replace(biases_rad=biases, trims_known=True)


def level_flight(vehicle: CandidateVehicle, plane: Plane) -> SimulatedLevelFlight:
    """Return the straight level flight of a candidate at its operating point.

    Parameters
    ----------
    vehicle : CandidateVehicle
        Vehicle.
    plane : str
        Plane whose surface is trimmed: yaw or pitch.

    Returns
    -------
    SimulatedLevelFlight
        Trim of the surface (rad), thrust, speed (m/s) and pitch (rad).
    """
    thrust = vehicle.config.operating_point.thrust_fraction
    speed_mps = steady_state.cruise_speed_mps(vehicle, thrust)
    bias_rad = vehicle.actuators[plane].bias_rad
    is_yaw = PLANES[plane].is_yaw
    return SimulatedLevelFlight(
        trim_rad=steady_state.level_surface_rad(vehicle, plane) - bias_rad,
        thrust=thrust,
        speed_mps=speed_mps,
        pitch_rad=0.0 if is_yaw else steady_state.level_pitch_rad(vehicle.config, vehicle.model),
    )


def available_travel_rad(prior: DesignPrior, plane: Plane) -> float:
    """Return the distance (rad) of a surface from its trim to the nearer stop."""
    vehicle = prior.vehicle(prior.mean)
    travel = vehicle.actuators[plane].travel_rad
    if not prior.trims_known:
        return (1.0 - UNKNOWN_TRIM_SHARE) * travel
    return travel - abs(level_flight(vehicle, plane).trim_rad) - SPARE_RAD
