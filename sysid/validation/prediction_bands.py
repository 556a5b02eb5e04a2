"""Prediction bands of a run: uncertainty of the estimate, and disturbance with sensor noise."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sitl.vehicle.config import VehicleConfig
from sysid.data.runs import Run
from sysid.estimation.map import steady_state
from sysid.estimation.map.datasets import STEP_S, STRIDE
from sysid.models import delta_method, noise, prediction
from sysid.models.model_file import IdentifiedModel
from sysid.validation import noise_floor
from sysid.validation.validate import rate_innovations, uncertain_vehicle

Array = NDArray[np.float64]


class Band(NamedTuple):
    """Standard deviations of the rate on a run's grid from LEAD_S before its test, rad/s."""

    time_s: Array
    estimate_radps: Array
    """Standard deviation of the prediction, from the covariance of the estimate.

    Zero if it is unknown.
    """
    noise_radps: Array
    """Standard deviation of the measured rate about a perfect prediction."""


def rate_band(model: IdentifiedModel, run: Run, prior: VehicleConfig | None = None) -> Band:
    """Return the standard deviations of a run's predicted rate.

    Parameters
    ----------
    model : IdentifiedModel
        Model.
    run : Run
        Run.
    prior : VehicleConfig, optional
        Prior vehicle; by default the vehicle file in the model.

    Returns
    -------
    Band
        Standard deviations from the estimate and from noise, rad/s.
    """
    uncertain = uncertain_vehicle(model, prior)
    predicted_run = run.since(-prediction.LEAD_S)
    estimate_sd = np.zeros(predicted_run.time_s.size)
    if uncertain.covariance is not None:
        slopes = delta_method.slopes(
            lambda z: prediction.simulate(uncertain.vehicle(z), predicted_run).rate_radps,
            uncertain.z,
        )
        estimate_sd = delta_method.propagate_sd(slopes, uncertain.covariance)
    return Band(predicted_run.time_s, estimate_sd, _noise_sd_radps(model, predicted_run, prior))


def _noise_sd_radps(model: IdentifiedModel, run: Run, prior: VehicleConfig | None) -> Array:
    """Return the standard deviation of the rate from disturbance and sensor noise, rad/s."""
    if run.plane not in model.noise:
        return np.zeros(run.time_s.size)
    uncertain = uncertain_vehicle(model, prior)
    linear = steady_state.linear_plane(uncertain.vehicle(uncertain.z), run.plane)
    level = noise.from_model(model.noise[run.plane])
    steps = run.time_s.size // STRIDE + 1
    sd = np.sqrt(np.diag(noise_floor.rate_covariance(linear, level, STEP_S, 0, steps)))
    return np.interp(np.arange(run.time_s.size), STRIDE * np.arange(steps), sd)


def innovations(model: IdentifiedModel, run: Run, prior: VehicleConfig | None = None) -> Array:
    """Return the normalised innovations of the rate during a test, every ``STEP_S``.

    Parameters
    ----------
    model : IdentifiedModel
        Model with a noise model of the run's plane.
    run : Run
        Run.
    prior : VehicleConfig, optional
        Prior vehicle; by default the vehicle file in the model.

    Returns
    -------
    ndarray, (steps,)
        White with unit variance if model and noise model are right.
    """
    uncertain = uncertain_vehicle(model, prior)
    vehicle = uncertain.vehicle(uncertain.z)
    level, samples = noise.from_model(model.noise[run.plane]), run.time_s.size // STRIDE + 1
    whitener = noise.build(steady_state.linear_plane(vehicle, run.plane), level, STEP_S, samples)
    return rate_innovations(vehicle, run, whitener)
