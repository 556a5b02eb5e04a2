"""What a joint fit leaves to be explained, run by run: whitened residuals, and what the parameters could still do."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.fit import STRIDE, Experiment, Fit, Prior
from sysid.joint import problem as problems
from sysid.joint.problem import Problem
from sysid.screen.signature import Signature, departure_rad, signatures

Array = NDArray[np.float64]

GROWTH = 0.3
"""Prior standard deviation of structure: by what share the answer at a plane's largest test may be off."""
SIZES = 1.5
"""Largest over smallest test of a plane from which on growth can be told from gain."""


class Exhibit(NamedTuple):
    """One run, linear about the fit."""

    experiment: Experiment
    size_rad: float
    """The farthest that the test moved the surface from its trim."""
    residual: Array
    """(n,), whitened: samples x outputs, at the fit."""
    slopes: Array
    """(n, p): of the residual by z, and by the growth of the answer with size in yaw and in pitch."""
    signatures: tuple[Signature, ...]


class Evidence(NamedTuple):
    """Residuals and slopes where the parameters are best for the runs that are in it."""

    exhibits: tuple[Exhibit, ...]
    covariance: Array
    """(p, p), posterior of the parameters."""
    shift: Array
    """(p,) from the fit to the best parameters, one Gauss-Newton step."""

    def left(self, exhibit: Exhibit) -> Array:
        """The exhibit's whitened residual at the best parameters."""
        return exhibit.residual + exhibit.slopes @ self.shift


def gather(found: Fit, prior: Prior) -> tuple[Exhibit, ...]:
    """Every run of a fit, linear about it."""
    filters = problems.filters(found.vehicle, found.experiments, found.noise, STRIDE)
    problem = Problem(prior, found.experiments, filters, found.noise, STRIDE)
    linear = problems.linearised(problem, found.z)
    experiments = [(plane, e) for plane, group in found.experiments.items() for e in group]
    largest = {plane: max(_size_rad(e) for e in group) for plane, group in found.experiments.items()}
    smallest = {plane: min(_size_rad(e) for e in group) for plane, group in found.experiments.items()}
    exhibits = []
    for (plane, e), (white, slopes) in zip(experiments, linear, strict=True):
        marks = signatures(found.vehicle, e, filters[plane])
        growth = np.zeros((white.size, 2))
        if largest[plane] > SIZES * smallest[plane]:
            (gain,) = next(s.white for s in marks if s.kind == "gain error")
            growth[:, int(plane == "pitch")] = -100.0 * gain * _size_rad(e) / largest[plane]
        exhibits.append(Exhibit(e, _size_rad(e), white.ravel(), np.hstack([slopes, growth]), tuple(marks)))
    return tuple(exhibits)


def weigh(exhibits: Sequence[Exhibit], found: Fit, prior: Prior) -> Evidence:
    """The best parameters for these runs, as far as the fit is linear."""
    p = found.z.size
    belief = np.zeros((p + 2, p + 2))
    belief[:p, :p] = np.linalg.inv(prior.covariance)
    belief[p:, p:] = np.eye(2) / GROWTH**2
    information = belief + sum(e.slopes.T @ e.slopes for e in exhibits)
    away = np.concatenate([found.z - prior.mean, np.zeros(2)])
    gradient = belief @ away + sum(e.slopes.T @ e.residual for e in exhibits)
    covariance = np.asarray(np.linalg.inv(information), dtype=np.float64)
    return Evidence(tuple(exhibits), covariance, -covariance @ gradient)


def _size_rad(e: Experiment) -> float:
    return float(np.max(np.abs(departure_rad(e.run))))
