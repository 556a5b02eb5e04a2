"""Points of a sweep: quasi-random samples of the inputs and of the vehicle.

A point has one coordinate in (0, 1) for each sampled input and one for each parameter of the
vehicle. The same points are used for every vehicle, gains, mission and sea, so that differences
between these are not due to different samples.
"""

from collections.abc import Sequence
from enum import StrEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri
from scipy.stats import qmc

Array = NDArray[np.float64]

EDGE = 1e-12
"""Smallest distance of a coordinate from 0 and 1, where the normal distribution has no quantile."""


class Sampler(StrEnum):
    """Method of sampling; the names are those of ``scipy.stats.qmc``, in lower case."""

    SOBOL = "sobol"
    HALTON = "halton"
    LATIN_HYPERCUBE = "latin-hypercube"
    RANDOM = "random"


class ParameterRange(NamedTuple):
    """Uniform distribution of a sampled input."""

    min: float
    max: float


def draw(sampler: Sampler, count: int, dimension: int, seed: int) -> Array:
    """Return points in the unit cube.

    Parameters
    ----------
    sampler : Sampler
        Method. The first points of `sobol`, `halton` and `random` do not depend on `count`.
    count : int
        Number of points.
    dimension : int
        Number of coordinates.
    seed : int
        Seed of the scrambling or of the random numbers.

    Returns
    -------
    ndarray, shape (count, dimension)
        Coordinates between 0 and 1.

    Notes
    -----
    Scrambled Sobol' points (Owen 1998, J. Complexity 14, 466-489) are drawn as a power of two and
    cut, which keeps their balance where `count` is a power of two.
    """
    rng = np.random.default_rng(seed)
    if sampler is Sampler.RANDOM:
        return rng.random((count, dimension))
    if sampler is Sampler.SOBOL:
        power = max(0, count - 1).bit_length()
        points = qmc.Sobol(dimension, scramble=True, seed=rng).random_base2(power)[:count]
    elif sampler is Sampler.HALTON:
        points = qmc.Halton(dimension, scramble=True, seed=rng).random(count)
    else:
        points = qmc.LatinHypercube(dimension, seed=rng).random(count)
    return np.asarray(points, dtype=np.float64)


def to_normal(coordinates: Array) -> Array:
    """Return standard normal values with these cumulative probabilities.

    Parameters
    ----------
    coordinates : ndarray
        Probabilities between 0 and 1.

    Returns
    -------
    ndarray
        Quantiles, of the same shape.
    """
    return np.asarray(ndtri(np.clip(coordinates, EDGE, 1.0 - EDGE)))


def to_ranges(coordinates: Sequence[float], ranges: Sequence[ParameterRange]) -> list[float]:
    """Return the values of the sampled inputs.

    Parameters
    ----------
    coordinates : sequence of float
        One coordinate for each range.
    ranges : sequence of ParameterRange
        Uniform distributions.

    Returns
    -------
    list of float
        Values, in the unit of the ranges.
    """
    return [float(r.min + (r.max - r.min) * u) for u, r in zip(coordinates, ranges, strict=True)]
