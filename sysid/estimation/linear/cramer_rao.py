"""Cramer-Rao bound: smallest covariance of any unbiased estimator from a set of tests.

Symbols: theta values (p,), J = d(residual)/d(theta) whitened (n, p) of one test, N nuisances of one
test (gyro bias and initial state). The bound is the inverse of the information (Ljung 1999, section
7.4)::

    I = I_bench + sum over tests of J' J,    cov(theta) >= I^-1

The nuisances are removed by the noise filter with a wide prior (coloured noise) or by projection
(white noise). The bench test of the actuator lag counts as data, I_bench.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.estimation.linear import linear_model, response
from sysid.estimation.linear.linear_model import LinearModel
from sysid.estimation.linear.response import SurfaceCommand
from sysid.estimation.map.datasets import STEP_S
from sysid.models import noise
from sysid.models.noise import Noise
from sysid.planes import PLANES

Array = NDArray[np.float64]


class Bound(NamedTuple):
    """Smallest covariances of an unbiased estimator."""

    information: Array
    """(p, p), information about the values, bench test of the lag included."""
    covariance: Array
    """(p, p), covariance of the values, in the order of ``linear_model.names``."""
    derived: Array
    """Covariance of gain, poles, delay and bias, in the order of ``linear_model.derived_names``."""


def bound_coloured(model: LinearModel, commands: Sequence[SurfaceCommand], level: Noise) -> Bound:
    """Return the bound for disturbance and sensor noise, with uncertain initial states.

    Parameters
    ----------
    model : LinearModel
        True plane, or a sample from its prior.
    commands : sequence of SurfaceCommand
        Command of each test, the time before the test included.
    level : Noise
        Standard deviations of disturbance and sensor noise.

    Returns
    -------
    Bound
        Information and covariances.

    Raises
    ------
    ValueError
        There is no test.
    """
    discrete, output_count = response.discretise(model), PLANES[model.frame.plane].n_outputs
    noise_filter = noise.build(
        linear_model.linear_plane(model), level, STEP_S, _max_steps(commands)
    )
    information = bench_information(model)
    for command in commands:
        slopes = response.slopes(
            model,
            discrete,
            response.duct_motion(model, command),
            np.zeros(len(discrete.transition)),
            output_count,
        )
        J = np.stack([noise.whiten_residual(slope, noise_filter).ravel() for slope in slopes])
        information += J @ J.T
    return of_information(model, information)


def bound_white(model: LinearModel, commands: Sequence[SurfaceCommand], level: Noise) -> Bound:
    """Return the bound for sensor noise alone, with unknown initial states and gyro biases.

    Parameters
    ----------
    model : LinearModel
        True plane, or a sample from its prior.
    commands : sequence of SurfaceCommand
        Command of each test, the time before the test included.
    level : Noise
        Standard deviations of the sensor noise; its disturbance is ignored.

    Returns
    -------
    Bound
        Information and covariances.

    Raises
    ------
    ValueError
        There is no test.

    Notes
    -----
    With N = Q R the nuisance columns of a test, the projected sensitivities are J - Q Q'J.
    """
    discrete, output_count = response.discretise(model), PLANES[model.frame.plane].n_outputs
    sds, max_steps = sensor_sds(level)[:output_count], _max_steps(commands)
    nuisance_columns = response.nuisances(discrete, max_steps, output_count) / sds[:, None]
    information = bench_information(model)
    for command in commands:
        steps = response.steps(command)
        Q = np.linalg.qr(nuisance_columns[:steps].reshape(steps * output_count, -1))[0]
        slopes = (
            response.slopes(
                model,
                discrete,
                response.duct_motion(model, command),
                np.zeros(len(discrete.transition)),
                output_count,
            )
            / sds
        )
        J = slopes.reshape(len(slopes), -1)
        J -= (J @ Q) @ Q.T
        information += J @ J.T
    return of_information(model, information)


def sensor_sds(level: Noise) -> Array:
    """Return the standard deviations of rate (rad/s), angle (rad) and depth (m)."""
    return np.array([level.rate_radps, level.angle_rad, level.depth_m])


def bench_information(model: LinearModel) -> Array:
    """Return the information of the tailcone's bench test about its lag, (p, p)."""
    lag = linear_model.lag(model.frame.plane)
    information = np.zeros((model.values.size, model.values.size))
    information[lag, lag] = np.diag(1.0 / (model.frame.lag_relative_sd * model.values[lag]) ** 2)
    return information


def of_information(model: LinearModel, information: Array) -> Bound:
    """Invert the information, scaled to a unit diagonal: the values differ by powers of ten.

    Parameters
    ----------
    model : LinearModel
        Plane at whose values the information holds.
    information : ndarray, shape (p, p)
        Information about the values.

    Returns
    -------
    Bound
        Information and covariances.
    """
    scale = 1.0 / np.sqrt(np.diag(information))
    covariance = np.linalg.inv(information * np.outer(scale, scale)) * np.outer(scale, scale)
    return Bound(
        information, covariance, linear_model.propagate(model.frame, model.values, covariance)
    )


def _max_steps(commands: Sequence[SurfaceCommand]) -> int:
    """Return the number of output steps of the longest test."""
    if not commands:
        raise ValueError("a bound needs at least one test")
    return max(response.steps(command) for command in commands)
