"""What a joint fit leaves to be explained, run by run: whitened residuals, and what the parameters could still do."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid import fit, noise, parameters
from sysid.fit import DIFFERENCE, STRIDE, Experiment, Fit, Prior
from sysid.noise import Filter
from sysid.runs import RATE_HZ, Plane
from sysid.screen.signature import Signature, departure, signatures

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
    """Every run of a fit, its slopes by forward differences."""
    filters = {plane: _filter(found, plane, group) for plane, group in found.experiments.items()}
    before = _whitened(found, prior, found.z, filters)
    columns = []
    for axis in np.eye(found.z.size):
        after = _whitened(found, prior, found.z + DIFFERENCE * axis, filters)
        columns.append([(b - a) / DIFFERENCE for b, a in zip(after, before, strict=True)])
    experiments = [(plane, e) for plane, group in found.experiments.items() for e in group]
    largest = {plane: max(_size_rad(e) for e in group) for plane, group in found.experiments.items()}
    smallest = {plane: min(_size_rad(e) for e in group) for plane, group in found.experiments.items()}
    exhibits = []
    for k, (plane, e) in enumerate(experiments):
        marks = signatures(found.vehicle, e, filters[plane])
        growth = np.zeros((before[k].size, 2))
        if largest[plane] > SIZES * smallest[plane]:
            (gain,) = next(s.white for s in marks if s.kind == "gain error")
            growth[:, int(plane == "pitch")] = -100.0 * gain * _size_rad(e) / largest[plane]
        slopes = np.column_stack([*(column[k] for column in columns), growth])
        exhibits.append(Exhibit(e, _size_rad(e), before[k], slopes, tuple(marks)))
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


def _filter(found: Fit, plane: Plane, group: Sequence[Experiment]) -> Filter:
    longest = max(len(e.measured) for e in group)
    return noise.build(fit.linear_plane(found.vehicle, plane), found.noise[plane], STRIDE / RATE_HZ, longest)


def _whitened(found: Fit, prior: Prior, z: Array, filters: dict[Plane, Filter]) -> list[Array]:
    vehicle = parameters.vehicle(prior.config, prior.biases_rad, z)
    return [
        noise.whitened(residual, filters[plane]).ravel()
        for plane, group in found.experiments.items()
        for residual in fit.residuals(vehicle, group)
    ]


def _size_rad(e: Experiment) -> float:
    return float(np.max(np.abs(departure(e.run))))
