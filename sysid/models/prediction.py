"""Simulation of runs with an identified model and with its prior, and the rate errors of both."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sitl.vehicle.config import VehicleConfig
from sysid.data.runs import Run
from sysid.estimation.map.steady_state import cruise_speed_mps
from sysid.models import greybox, parameters
from sysid.models.model_file import IdentifiedModel, RunQuality
from sysid.models.parameters import NAMES, CandidateVehicle
from sysid.planes import Plane
from sysid.reproduction import paper_method

Array = NDArray[np.float64]


LEAD_S = 1.0
"""Time before the test at which a simulation starts; short, because disturbances accumulate."""

OPENING_S = 10.0
"""Duration of the first window of a test.

It is the longest window in which the paper's two models differ by no more than its Table 2 states.
"""


class Prediction(NamedTuple):
    """Simulation from the motion measured LEAD_S before the test, under the commands of the run.

    Arrays are on the run's grid, in MAVLink's axes; before the simulation starts they repeat the
    measurement.
    """

    rate_radps: Array
    """Rate of the identified model."""
    prior_rate_radps: Array
    """Rate of the prior vehicle, with the prior bias of the actuators."""
    angle_rad: Array
    """Heading (unwrapped) or pitch of the identified model."""
    prior_angle_rad: Array
    """Heading (unwrapped) or pitch of the prior vehicle."""
    depth_m: Array
    """Depth of the identified model."""


def predict(model: IdentifiedModel, run: Run, prior: VehicleConfig | None = None) -> Prediction:
    """Simulate a run with an identified model and with its prior vehicle.

    Parameters
    ----------
    model : IdentifiedModel
        The identified model.
    run : Run
        The run with its commands and measurements.
    prior : VehicleConfig, optional
        The prior vehicle; by default the file named in the model.

    Returns
    -------
    Prediction
        Rate and angle of both and the model's depth, on the run's grid.

    Raises
    ------
    VehicleFileError
        The prior vehicle cannot be read.
    """
    vehicle, first = vehicles(model, prior)
    return predict_with(vehicle, first, run, model)


def predict_with(
    vehicle: CandidateVehicle, first: CandidateVehicle, run: Run, model: IdentifiedModel
) -> Prediction:
    """Simulate a run as ``predict`` does, with given identified and prior vehicles."""
    run_from_lead = run.since(-LEAD_S)
    prior_motion = simulate(first, run_from_lead)
    after = simulate_model(model, vehicle, run_from_lead)

    def whole(measured: Array, simulated: Array) -> Array:
        return np.concatenate([measured[: measured.size - simulated.size], simulated])

    return Prediction(
        rate_radps=whole(run.rate_radps, after.rate_radps),
        prior_rate_radps=whole(run.rate_radps, prior_motion.rate_radps),
        angle_rad=whole(run.angle_rad, after.angle_rad),
        prior_angle_rad=whole(run.angle_rad, prior_motion.angle_rad),
        depth_m=whole(run.depth_m, after.depth_m),
    )


def vehicles(
    model: IdentifiedModel, prior: VehicleConfig | None = None
) -> tuple[CandidateVehicle, CandidateVehicle]:
    """Return the identified vehicle and its prior vehicle.

    Parameters
    ----------
    model : IdentifiedModel
        The identified model.
    prior : VehicleConfig, optional
        The prior vehicle; by default the file named in the model.

    Returns
    -------
    tuple of two CandidateVehicle
        Identified and prior vehicle.

    Raises
    ------
    VehicleFileError
        The prior vehicle cannot be read.
    """
    return perturb(model, np.array(model.joint.z), prior), perturb(
        model, np.zeros(len(model.joint.z)), prior
    )


def perturb(
    model: IdentifiedModel, z: Array, prior: VehicleConfig | None = None
) -> CandidateVehicle:
    """Return a vehicle of a model's distribution.

    Parameters
    ----------
    model : IdentifiedModel
        The identified model.
    z : ndarray, shape (n,)
        Parameters in prior standard deviations, in the order of ``model.joint.names``.
    prior : VehicleConfig, optional
        The prior vehicle; by default the file named in the model.

    Returns
    -------
    CandidateVehicle
        Vehicle at ``z``.
    """
    config = prior_vehicle(model, prior)
    z_by_name = dict(zip(model.joint.names, z.tolist(), strict=True))
    return parameters.candidate_vehicle(
        config,
        model.vehicle.prior_biases_rad,
        np.array([z_by_name.get(name, 0.0) for name in NAMES]),
    )


def prior_vehicle(model: IdentifiedModel, prior: VehicleConfig | None = None) -> VehicleConfig:
    """Return the prior vehicle of a model.

    Parameters
    ----------
    model : IdentifiedModel
        The identified model.
    prior : VehicleConfig, optional
        The prior vehicle; by default the vehicle file in the model.

    Returns
    -------
    VehicleConfig
        The prior vehicle.
    """
    return prior or model.vehicle.file


def simulate_model(
    model: IdentifiedModel, vehicle: CandidateVehicle, run: Run
) -> greybox.PlaneTrajectory:
    """Simulate a run with a model and its identified vehicle.

    Models of other methods than "map" have linear planes only.
    """
    return (
        simulate(vehicle, run)
        if model.method == "map"
        else paper_method.motion(model, vehicle.actuators[run.plane], run)
    )


def simulate(vehicle: CandidateVehicle, run: Run) -> greybox.PlaneTrajectory:
    """Simulate a run with a vehicle from the first sample.

    Parameters
    ----------
    vehicle : CandidateVehicle
        The vehicle.
    run : Run
        The run with its commands and measurements.

    Returns
    -------
    PlaneTrajectory
        Rate, angle, depth and speed on the run's grid, MAVLink's axes.
    """
    speed = cruise_speed_mps(vehicle, float(run.thrust[0]))
    return greybox.simulate(
        vehicle.model, vehicle.actuators[run.plane], run, greybox.initial_motion(run), 1, speed
    )


def quality(
    model: IdentifiedModel, runs: Sequence[Run], prior: VehicleConfig | None = None
) -> tuple[RunQuality, ...]:
    """Return the rate errors of each run from the start of its test."""
    vehicle, first = vehicles(model, prior)
    return tuple(_quality(run, predict_with(vehicle, first, run, model)) for run in runs)


def mean_rate_errors(qualities: Sequence[RunQuality], plane: Plane) -> tuple[float, float] | None:
    """Return the mean squared rate errors over the runs of a plane.

    Parameters
    ----------
    qualities : sequence of RunQuality
        Errors per run.
    plane : {"yaw", "pitch"}
        The plane.

    Returns
    -------
    tuple of two floats, or None
        Errors of prior and model, (deg/s)^2; None without runs in the plane.
    """
    return _means(
        [(q.prior_mse_deg2ps2, q.model_mse_deg2ps2) for q in qualities if q.plane == plane]
    )


def opening_rate_errors(
    qualities: Sequence[RunQuality], plane: Plane
) -> tuple[float, float] | None:
    """Return the mean squared rate errors over the first OPENING_S of the runs of a plane.

    Parameters
    ----------
    qualities : sequence of RunQuality
        Errors per run.
    plane : {"yaw", "pitch"}
        The plane.

    Returns
    -------
    tuple of two floats, or None
        Errors of prior and model, (deg/s)^2; None without runs in the plane.
    """
    return _means(
        [
            (q.opening_prior_mse_deg2ps2, q.opening_model_mse_deg2ps2)
            for q in qualities
            if q.plane == plane
        ]
    )


def _means(pairs: Sequence[tuple[float, float]]) -> tuple[float, float] | None:
    """Return the means of both entries; None without pairs."""
    if not pairs:
        return None
    prior, model = np.mean(pairs, axis=0)
    return float(prior), float(model)


def _quality(run: Run, prediction: Prediction) -> RunQuality:
    """Return the mean squared rate errors (deg/s)^2 and variance accounted for of one run."""
    # e = measured - simulated rate r or q (deg/s, FRD), after the pre-roll:
    #     mean squared error = mean(e^2),   variance accounted for = 1 - var(e) / var(measured).
    after = ~run.preroll
    measured = np.degrees(run.rate_radps[after])
    model_error = measured - np.degrees(prediction.rate_radps[after])
    prior_error = measured - np.degrees(prediction.prior_rate_radps[after])
    opening = run.time_s[after] < OPENING_S
    return RunQuality(
        run=run.name,
        plane=run.plane,
        prior_mse_deg2ps2=float(np.mean(prior_error**2)),
        model_mse_deg2ps2=float(np.mean(model_error**2)),
        opening_prior_mse_deg2ps2=float(np.mean(prior_error[opening] ** 2)),
        opening_model_mse_deg2ps2=float(np.mean(model_error[opening] ** 2)),
        variance_accounted_for=1.0 - float(np.var(model_error) / max(np.var(measured), 1e-12)),
    )
