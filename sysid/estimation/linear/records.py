"""A run as the linear estimators see it, and what they believe before they see any."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.data.segments import Plane, Run
from sysid.estimation.linear import linear_model as plants
from sysid.estimation.linear.linear_model import LinearModel
from sysid.estimation.linear.response import SurfaceCommand
from sysid.estimation.map import fit
from sysid.models import parameters
from sysid.models.parameters import NAMES

Array = NDArray[np.float64]

LEVEL_SD_RAD = float(np.radians(2.0))
"""What is unsure about pitch in level flight."""
COEFFICIENT_BOUND_SD, LAG_BOUND_SD = 12.0, 9.0
"""Bounds of an equation's numbers and of the tailcone's lag, in standard deviations from what is
believed."""
MAX_DELAY_S, MAX_ANGLE_RAD = 1.5, float(np.radians(20.0))
MAX_DAMPING = 0.99


class LinearRun(NamedTuple):
    command: SurfaceCommand
    measured: Array
    """(steps, outputs) at 10 Hz: rate, angle and, in pitch, depth; heading and depth from where
    they begin."""


class LinearPrior(NamedTuple):
    """Where an estimate is looked for: values are about ``plant``'s, within bounds."""

    plant: LinearModel
    covariance: Array
    """Of the values, from the prior of the physical coefficients."""
    lowest: Array
    highest: Array

    @property
    def spread(self) -> Array:
        """One standard deviation of each value, by which steps and starts are scaled."""
        return np.sqrt(np.diag(self.covariance))


def linear_run(run: Run, lead_s: float) -> LinearRun:
    """A run from ``lead_s`` before its test on; the duct starts with the pre-roll."""
    what = fit.dataset(run.since(-lead_s))
    begins = what.measured[0].copy()
    begins[: 2 if run.plane == "pitch" else 1] = 0.0
    return LinearRun(
        SurfaceCommand(run.command_rad, run.time_s.size - what.run.time_s.size),
        what.measured - begins,
    )


def linear_prior(prior: fit.Prior, plane: Plane) -> LinearPrior:
    """What the first-principles vehicle and its uncertainty say of one plane's values.

    The bias is that from level flight, which pitch is linear about.
    """
    at = values_at(prior, prior.mean, plane)
    slopes = np.zeros((at.values.size, len(NAMES)))
    for i in parameters.parameters_of_planes([plane]):
        step = np.zeros(len(NAMES))
        step[i] = 1e-3
        away = (
            values_at(prior, prior.mean + step, plane),
            values_at(prior, prior.mean - step, plane),
        )
        slopes[:, i] = (away[0].values - away[1].values) / 2e-3
    covariance = slopes @ prior.covariance @ slopes.T
    if plane == "pitch":
        covariance[-1, -1] = LEVEL_SD_RAD**2
    return with_bounds(at, covariance)


def with_bounds(at: LinearModel, covariance: Array) -> LinearPrior:
    """A belief with the bounds of what any vehicle could be."""
    names, spread = plants.names(at.frame.plane), np.sqrt(np.diag(covariance))
    lowest, highest = (
        at.values - COEFFICIENT_BOUND_SD * spread,
        at.values + COEFFICIENT_BOUND_SD * spread,
    )
    for i, name in enumerate(names):
        if name == "delay_s":
            lowest[i], highest[i] = 0.0, MAX_DELAY_S
        elif name in ("bias_rad", plants.LEVEL_PITCH):
            lowest[i], highest[i] = -MAX_ANGLE_RAD, MAX_ANGLE_RAD
        elif name in ("natural_frequency_radps", "damping_ratio"):
            lowest[i], highest[i] = (
                at.values[i] - LAG_BOUND_SD * spread[i],
                at.values[i] + LAG_BOUND_SD * spread[i],
            )
    damping = names.index("damping_ratio")
    highest[damping] = min(highest[damping], MAX_DAMPING)
    return LinearPrior(at, covariance, lowest, highest)


def values_at(prior: fit.Prior, z: Array, plane: Plane) -> LinearModel:
    """The plant of the prior vehicle moved by ``z``; bias and level are those of its own level
    flight."""
    vehicle = parameters.candidate_vehicle(prior.config, prior.biases_rad, z)
    at = plants.of_vehicle(vehicle, plane)
    if plane == "yaw":
        return at
    values = at.values.copy()
    names = plants.names(plane)
    values[names.index("bias_rad")] -= fit.level_elevator_rad(vehicle.config, vehicle.model)
    values[names.index(plants.LEVEL_PITCH)] = fit.level_pitch_rad(vehicle.config, vehicle.model)
    return LinearModel(at.frame, values)
