"""What a joint fit leaves to be explained, run by run: whitened residuals, and what the parameters
could still do."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.estimation.map import problem as problems
from sysid.estimation.map.fit import STRIDE, Dataset, Fit, Prior
from sysid.estimation.map.problem import MapProblem
from sysid.screening.anomaly_models import Kind, Signature, departure_rad, signatures

Array = NDArray[np.float64]

GROWTH = 0.3
"""Prior standard deviation of structure: by what share the answer at a plane's largest test may be
off."""
SIZES = 1.5
"""Largest over smallest test of a plane from which on growth can be told from gain."""


class RunResiduals(NamedTuple):
    """One run, linear about the fit."""

    experiment: Dataset
    size_rad: float
    """The farthest that the test moved the surface from its trim."""
    residual: Array
    """(n,), whitened: samples x outputs, at the fit."""
    slopes: Array
    """(n, p): of the residual by z, and by the growth of the answer with size in yaw and in
    pitch."""
    signatures: tuple[Signature, ...]


class Residuals(NamedTuple):
    """Residuals and slopes where the parameters are best for the runs that are in it."""

    exhibits: tuple[RunResiduals, ...]
    covariance: Array
    """(p, p), posterior of the parameters."""
    shift: Array
    """(p,) from the fit to the best parameters, one Gauss-Newton step."""

    def left(self, exhibit: RunResiduals) -> Array:
        """The exhibit's whitened residual at the best parameters."""
        return exhibit.residual + exhibit.slopes @ self.shift


def linearise_runs(found: Fit, prior: Prior) -> tuple[RunResiduals, ...]:
    """Every run of a fit, linear about it."""
    filters = problems.filters(found.vehicle, found.experiments, found.noise, STRIDE)
    problem = MapProblem(prior, found.experiments, filters, found.noise, STRIDE)
    linear = problems.linearise(problem, found.z)
    experiments = [(plane, e) for plane, group in found.experiments.items() for e in group]
    largest = {
        plane: max(_size_rad(e) for e in group) for plane, group in found.experiments.items()
    }
    smallest = {
        plane: min(_size_rad(e) for e in group) for plane, group in found.experiments.items()
    }
    exhibits = []
    for (plane, e), (white, slopes) in zip(experiments, linear, strict=True):
        marks = signatures(found.vehicle, e, filters[plane])
        growth = np.zeros((white.size, 2))
        if largest[plane] > SIZES * smallest[plane]:
            growth[:, int(plane == "pitch")] = (
                -100.0 * _single_signature(marks, "gain error") * _size_rad(e) / largest[plane]
            )
        vague = math.degrees(found.vehicle.actuators[plane].backlash_rad) / math.sqrt(12.0)
        bare = RunResiduals(
            e, _size_rad(e), white.ravel(), np.hstack([slopes, growth]), tuple(marks)
        )
        exhibits.append(
            _with_backlash_noise(bare, vague * _single_signature(marks, "actuator offset"))
        )
    return tuple(exhibits)


def update_parameters(exhibits: Sequence[RunResiduals], found: Fit, prior: Prior) -> Residuals:
    """The best parameters for these runs, as far as the fit is linear."""
    p = found.z.size
    belief = np.zeros((p + 2, p + 2))
    belief[:p, :p] = np.linalg.inv(prior.covariance)
    belief[p:, p:] = np.eye(2) / GROWTH**2
    information = belief + sum(e.slopes.T @ e.slopes for e in exhibits)
    away = np.concatenate([found.z - prior.mean, np.zeros(2)])
    gradient = belief @ away + sum(e.slopes.T @ e.residual for e in exhibits)
    covariance = np.asarray(np.linalg.inv(information), dtype=np.float64)
    return Residuals(tuple(exhibits), covariance, -covariance @ gradient)


def _single_signature(marks: Sequence[Signature], kind: Kind) -> Array:
    """The signature of a kind that has but one."""
    return next(mark.white[0] for mark in marks if mark.kind == kind)


def _with_backlash_noise(exhibit: RunResiduals, play: Array) -> RunResiduals:
    """The same, white although the duct stands anywhere within its play: ``play`` (n,) is one
    standard deviation of it.

    Residuals of covariance 1 + b b' are white again less their part along b, all but 1/sqrt(1 +
    b'b) of it."""
    power = float(play @ play)
    if power == 0.0:
        return exhibit
    share = (1.0 - 1.0 / math.sqrt(1.0 + power)) / power

    def loose(rows: Array) -> Array:
        return rows - np.multiply.outer(rows @ play, share * play)

    marks = tuple(mark._replace(white=loose(mark.white)) for mark in exhibit.signatures)
    return exhibit._replace(
        residual=loose(exhibit.residual), slopes=loose(exhibit.slopes.T).T, signatures=marks
    )


def _size_rad(e: Dataset) -> float:
    return float(np.max(np.abs(departure_rad(e.run))))
