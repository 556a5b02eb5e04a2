"""Data and prior of the linear estimators."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.data.runs import Run
from sysid.estimation.linear import linear_model
from sysid.estimation.linear.linear_model import LinearModel
from sysid.estimation.linear.response import SurfaceCommand
from sysid.estimation.map import datasets, steady_state
from sysid.estimation.map.problem import Prior
from sysid.models import parameters
from sysid.models.parameters import NAMES
from sysid.planes import Plane

Array = NDArray[np.float64]

LEVEL_SD_RAD = float(np.radians(2.0))
"""Prior standard deviation of the pitch of level flight, rad."""
COEFFICIENT_SD_FACTOR = 2.0
"""Standard deviations of the coefficients in the cost, over those of the vehicle file.

Tests alone allow a pole and a zero that cancel, at any frequency. With a slow pair the static gain
is that of a mode which the vehicle does not have.
"""
COEFFICIENT_BOUND_SD, LAG_BOUND_SD = 12.0, 9.0
"""Bounds of the coefficients and of the actuator lag, in prior sd from the mean."""
MAX_DELAY_S, MAX_ANGLE_RAD = 1.5, float(np.radians(20.0))
"""Bounds of the delay (s), and of bias and level pitch (rad, either sign)."""


class LinearRun(NamedTuple):
    """One run as the linear estimators use it."""

    command: SurfaceCommand
    measured: Array
    """(steps, outputs) at 10 Hz: rate (rad/s), angle (rad) and, in pitch, depth (m).

    Heading and depth are relative to their first value.
    """
    delay_sd_s: float = 0.0
    """Standard deviation of the delay by the unknown times of the commands, s."""


class LinearPrior(NamedTuple):
    """Prior of the values of one plane, with bounds."""

    model: LinearModel
    """Prior mean."""
    covariance: Array
    """(p, p), covariance of the values, from the prior of the physical coefficients."""
    lowest: Array
    """(p,), lower bounds."""
    highest: Array
    """(p,), upper bounds."""

    @property
    def spread(self) -> Array:
        """Standard deviation of each value, which scales steps and starts."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def measured_sds(self) -> Array:
        """Standard deviations of the mean as a measurement; infinite for values without one.

        The lag has its bench test. Delay, bias and level pitch are known from the tests alone.
        """
        plane, sds = self.model.frame.plane, np.full(self.model.values.size, np.inf)
        lag, count = linear_model.lag(plane), len(linear_model.NUMBERS[plane])
        sds[:count] = COEFFICIENT_SD_FACTOR * self.spread[:count]
        sds[lag] = self.model.frame.lag_relative_sd * self.model.values[lag]
        return sds


def linear_run(run: Run, lead_s: float) -> LinearRun:
    """Cut a run from some time before its test on.

    Parameters
    ----------
    run : Run
        Test with its pre-roll.
    lead_s : float
        Time before the test at which the outputs begin, s.

    Returns
    -------
    LinearRun
        Command from the pre-roll on, so that the duct is simulated from there, and outputs.
    """
    data = datasets.dataset(run.since(-lead_s))
    origin = data.measured[0].copy()
    origin[:-1] = 0.0
    return LinearRun(
        SurfaceCommand(run.command_rad, run.time_s.size - data.run.time_s.size),
        data.measured - origin,
        run.delay_sd_s,
    )


def linear_prior(prior: Prior, plane: Plane) -> LinearPrior:
    """Return the prior of one plane's values: first-principles vehicle and its uncertainty.

    Parameters
    ----------
    prior : Prior
        Vehicle and covariance P of its normalised parameters z.
    plane : Plane
        Plane.

    Returns
    -------
    LinearPrior
        Values, covariance and bounds.

    Notes
    -----
    With theta(z) the values of the vehicle at z and S = d(theta)/dz, the covariance is S P S'. The
    bias is relative to level flight, about which pitch is linear.
    """
    model = values_at(prior, prior.mean, plane)
    slopes = np.zeros((model.values.size, len(NAMES)))
    for i in parameters.parameters_of_planes([plane]):
        step = np.zeros(len(NAMES))
        step[i] = 1e-3
        perturbed = (
            values_at(prior, prior.mean + step, plane),
            values_at(prior, prior.mean - step, plane),
        )
        slopes[:, i] = (perturbed[0].values - perturbed[1].values) / 2e-3
    covariance = slopes @ prior.covariance @ slopes.T
    if linear_model.OFFSETS[plane]:
        covariance[-1, -1] = LEVEL_SD_RAD**2
    return with_bounds(model, covariance)


def with_bounds(model: LinearModel, covariance: Array) -> LinearPrior:
    """Add bounds that hold for any vehicle.

    Parameters
    ----------
    model : LinearModel
        Structure and mean values.
    covariance : ndarray, shape (p, p)
        Covariance of the values.

    Returns
    -------
    LinearPrior
        Values, covariance and bounds.
    """
    plane, spread = model.frame.plane, np.sqrt(np.diag(covariance))
    names = linear_model.names(plane)
    lowest = model.values - COEFFICIENT_BOUND_SD * spread
    highest = model.values + COEFFICIENT_BOUND_SD * spread
    for i, name in enumerate(names):
        if name == "delay_s":
            lowest[i], highest[i] = 0.0, MAX_DELAY_S
        elif name in ("bias_rad", *linear_model.OFFSETS[plane]):
            lowest[i], highest[i] = -MAX_ANGLE_RAD, MAX_ANGLE_RAD
        elif name in ("natural_frequency_radps", "damping_ratio"):
            lowest[i] = model.values[i] - LAG_BOUND_SD * spread[i]
            highest[i] = model.values[i] + LAG_BOUND_SD * spread[i]
    damping = names.index("damping_ratio")
    highest[damping] = min(highest[damping], parameters.MAX_DAMPING)
    return LinearPrior(model=model, covariance=covariance, lowest=lowest, highest=highest)


def values_at(prior: Prior, z: Array, plane: Plane) -> LinearModel:
    """Return the plane of the vehicle at z, with bias and pitch of its own level flight."""
    vehicle = parameters.candidate_vehicle(prior.config, prior.biases_rad, z)
    model = linear_model.of_vehicle(vehicle, plane)
    values = model.values.copy()
    bias = linear_model.names(plane).index("bias_rad")
    values[bias] -= steady_state.level_surface_rad(vehicle, plane)
    if linear_model.OFFSETS[plane]:
        values[-1] = steady_state.level_pitch_rad(vehicle.config, vehicle.model)
    frame = model.frame._replace(lag_relative_sd=prior.config.tailcone.lag_relative_sd)
    return LinearModel(frame, values)
