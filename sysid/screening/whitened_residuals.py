"""Whitened residuals of a joint fit, run by run, with their slopes by parameters and structure."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.estimation.map import problem as problems
from sysid.estimation.map.datasets import Dataset
from sysid.estimation.map.fit import Fit
from sysid.estimation.map.intervals import problem_at_estimate
from sysid.estimation.map.problem import Prior
from sysid.models.parameters import CandidateVehicle
from sysid.planes import PLANES, Plane
from sysid.screening.anomaly_models import Kind, Signature, signatures, size_rad, sizes_of_test

Array = NDArray[np.float64]

GROWTH_PRIOR_SD = 0.3
"""Prior standard deviation of the relative error of the response at the largest test of a plane."""
MIN_SIZE_RATIO = 1.5
"""Minimum ratio of the largest to the smallest test of a plane.

Below it, growth of the response with size cannot be distinguished from gain.
"""


class RunResiduals(NamedTuple):
    """One run, linearised about the fit."""

    dataset: Dataset
    size_rad: float
    """Largest deflection of the tested surface from its mean before the test, rad."""
    residual: Array
    """(n,), whitened residual at the fit; n = samples x outputs."""
    slopes: Array
    """(n, p + 2), derivatives of the residual.

    Columns: z (p), then the growth of the response with size in yaw and in pitch.
    """
    signatures: tuple[Signature, ...]
    sizes_of_test: dict[Kind, float]
    """Size of each kind of anomaly that is as large as the test itself, in its unit."""


class Growth(NamedTuple):
    """Relative error of the response to the largest test of a plane, with standard deviation."""

    value: float
    sd: float


class Residuals(NamedTuple):
    """Residuals and slopes of runs at the parameters that are optimal for these runs."""

    runs: tuple[RunResiduals, ...]
    covariance: Array
    """(p + 2, p + 2), posterior covariance of z and of the two growth values."""
    shift: Array
    """(p + 2,), one Gauss-Newton step from the fit to the optimum of these runs."""

    def residual_at_optimum(self, run: RunResiduals) -> Array:
        """Return the whitened residual of a run at the optimum, to first order: e + J shift.

        Parameters
        ----------
        run : RunResiduals
            Residual e and slopes J of the run.

        Returns
        -------
        ndarray
            Residual in standard deviations, at each sample and output.
        """
        return run.residual + run.slopes @ self.shift

    def growth(self, plane: Plane) -> Growth:
        """Return the growth of the response of a plane with the size of the test.

        Parameters
        ----------
        plane : Plane
            Plane.

        Returns
        -------
        Growth
            Estimate at the optimum; zero for a plane whose tests are of one size.
        """
        column = len(self.shift) - len(Plane) + PLANES[plane].index
        sd = math.sqrt(self.covariance[column, column])
        return Growth(float(self.shift[column]), sd)


def linearise_runs(fit: Fit, prior: Prior) -> tuple[RunResiduals, ...]:
    """Linearise every run of a fit about the fit.

    Parameters
    ----------
    fit : Fit
        Joint fit.
    prior : Prior
        Prior of the fit.

    Returns
    -------
    tuple of RunResiduals
        Residuals, slopes and signatures, in the order of ``fit.datasets``.
    """
    problem = problem_at_estimate(fit, prior)
    linear = problems.linearise(problem, fit.z)
    datasets = [
        (plane, dataset, noise_filter)
        for plane, group in fit.datasets.items()
        for dataset, noise_filter in zip(group, problem.filters[plane], strict=True)
    ]
    sizes_rad = {
        plane: [size_rad(dataset.run) for dataset in group] for plane, group in fit.datasets.items()
    }
    largest = {plane: max(sizes) for plane, sizes in sizes_rad.items()}
    smallest = {plane: min(sizes) for plane, sizes in sizes_rad.items()}
    runs = []
    for (plane, dataset, noise_filter), (whitened, slopes) in zip(datasets, linear, strict=True):
        run_signatures = signatures(fit.vehicle, dataset, noise_filter)
        growth = np.zeros((whitened.size, 2))
        if largest[plane] > MIN_SIZE_RATIO * smallest[plane]:
            growth[:, PLANES[plane].index] = (
                -100.0
                * _single_signature(run_signatures, "gain error")
                * size_rad(dataset.run)
                / largest[plane]
            )
        run = RunResiduals(
            dataset=dataset,
            size_rad=size_rad(dataset.run),
            residual=whitened.ravel(),
            slopes=np.hstack([slopes, growth]),
            signatures=tuple(run_signatures),
            sizes_of_test=sizes_of_test(fit.vehicle, dataset.run),
        )
        offset_sd_deg, gain_sd_percent = _position_errors(fit.vehicle, dataset)
        run = _with_noise(run, "actuator offset", offset_sd_deg)
        runs.append(_with_noise(run, "gain error", gain_sd_percent))
    return tuple(runs)


def _position_errors(vehicle: CandidateVehicle, dataset: Dataset) -> tuple[float, float]:
    """Return standard deviations of the offset (deg) and gain (%) of a duct that is not measured.

    The duct rests anywhere within its backlash b at the start, and at each end of its travel of
    2 a anywhere within the motor step s that is nearest to the command. With e+ and e- the errors
    at both ends, of variance s^2 / 12 each, the offset is (e+ + e-) / 2 and the relative error of
    the gain (e+ - e-) / (2 a).
    """
    backlash_rad = vehicle.actuators[dataset.run.plane].backlash_rad
    step_rad = math.radians(vehicle.config.tailcone.step_deg)
    offset_rad = math.sqrt((backlash_rad**2 + 0.5 * step_rad**2) / 12.0)
    gain = step_rad / math.sqrt(24.0) / size_rad(dataset.run)
    return math.degrees(offset_rad), 100.0 * gain


def update_parameters(runs: Sequence[RunResiduals], fit: Fit, prior: Prior) -> Residuals:
    """Compute the optimum of a subset of the runs, to first order.

    With A = diag(P0^-1, 1/GROWTH_PRIOR_SD^2) the prior information of z and growth, J_k and e_k
    slopes and residual of run k, m the prior mean, and d = (z - m, 0)::

        information = A + sum_k J_k'J_k
        shift = -information^-1 (A d + sum_k J_k'e_k)

    Parameters
    ----------
    runs : sequence of RunResiduals
        Runs of the subset.
    fit : Fit
        Fit about which they are linearised.
    prior : Prior
        Prior of the fit.

    Returns
    -------
    Residuals
        Covariance and shift for these runs.
    """
    p = fit.z.size
    prior_information = np.zeros((p + 2, p + 2))
    prior_information[:p, :p] = np.linalg.inv(prior.covariance)
    prior_information[p:, p:] = np.eye(2) / GROWTH_PRIOR_SD**2
    information = prior_information + sum(run.slopes.T @ run.slopes for run in runs)
    departure = np.concatenate([fit.z - prior.mean, np.zeros(2)])
    gradient = prior_information @ departure + sum(run.slopes.T @ run.residual for run in runs)
    covariance = np.asarray(np.linalg.inv(information), dtype=np.float64)
    return Residuals(tuple(runs), covariance, -covariance @ gradient)


def _single_signature(run_signatures: Sequence[Signature], kind: Kind) -> Array:
    """Return the signature of a kind of anomaly that acts throughout the run."""
    return next(signature.white[0] for signature in run_signatures if signature.kind == kind)


def _with_noise(run: RunResiduals, kind: Kind, sd: float) -> RunResiduals:
    """Whiten residuals again for an unknown error of standard deviation ``sd`` throughout the run.

    With b (n,) the signature of one standard deviation, residuals of covariance 1 + b b' become
    white by subtracting the share 1 - 1/sqrt(1 + b'b) of their projection on b.
    """
    error = sd * _single_signature(run.signatures, kind)
    power = float(error @ error)
    if power == 0.0:
        return run
    share = (1.0 - 1.0 / math.sqrt(1.0 + power)) / power

    def rewhiten(rows: Array) -> Array:
        return rows - np.multiply.outer(rows @ error, share * error)

    run_signatures = tuple(
        signature._replace(white=rewhiten(signature.white)) for signature in run.signatures
    )
    return run._replace(
        residual=rewhiten(run.residual), slopes=rewhiten(run.slopes.T).T, signatures=run_signatures
    )
