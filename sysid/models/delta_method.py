"""Standard deviations of numbers of a vehicle, to first order in its parameters.

Symbols: z parameters in prior standard deviations (p,), P their covariance, f(z) numbers (m,). With
the derivatives J = df/dz, cov(f) = J P J' (the delta method).
"""

from collections.abc import Callable
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from sitl.vehicle.config import VehicleFileError

Array = NDArray[np.float64]
Numbers = TypeVar("Numbers", float, Array)

STEP = 1e-4
"""Step of the differences, in prior standard deviations."""


def slopes(function: Callable[[Array], Numbers], z: Array) -> Array:
    """Return the derivatives of numbers of the vehicle by its parameters.

    Parameters
    ----------
    function : callable
        Function of z that raises VehicleFileError where no such vehicle is possible.
    z : ndarray, shape (p,)
        Point, which must be possible.

    Returns
    -------
    ndarray, shape (p,) or (p, m)
        Central differences of a number or of several numbers.

    Raises
    ------
    VehicleFileError
        A parameter is possible at z only.
    """
    steps = STEP * np.eye(z.size)
    return np.array([change_per_step(function, z, step) for step in steps]) / STEP


def change_per_step(function: Callable[[Array], Numbers], z: Array, step: Array) -> Numbers:
    """Return half the difference of a function of the vehicle one step to both sides of z.

    At the edge of the possible vehicles it is the difference to the side that is possible.

    Parameters
    ----------
    function : callable
        Function of z that raises VehicleFileError where no such vehicle is possible.
    z : ndarray, shape (p,)
        Point, which must be possible.
    step : ndarray, shape (p,)
        Step.

    Returns
    -------
    float or ndarray
        Change of the function for one step.

    Raises
    ------
    VehicleFileError
        Neither side is possible.
    """
    try:
        ahead = function(z + step)
    except VehicleFileError:
        return function(z) - function(z - step)
    try:
        return 0.5 * (ahead - function(z - step))
    except VehicleFileError:
        return ahead - function(z)


def propagate_sd(slopes_by_z: Array, covariance: Array) -> Array:
    """Return the standard deviations of numbers of the vehicle.

    Parameters
    ----------
    slopes_by_z : ndarray, shape (p, m)
        Derivatives of the numbers, see `slopes`.
    covariance : ndarray, shape (p, p)
        Covariance of z.

    Returns
    -------
    ndarray, shape (m,)
        Standard deviations.
    """
    variances = np.sum(slopes_by_z * (covariance @ slopes_by_z), axis=0)
    return np.asarray(np.sqrt(np.maximum(variances, 0.0)))
