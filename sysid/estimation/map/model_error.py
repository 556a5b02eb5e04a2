"""Covariance that covers errors of the model structure: scatter of runs, conflict with the prior.

The likelihood accounts for sensors and sea. Where the structure of the model is wrong, other
parameters explain each run best. With the whitened sensitivities J_k and residuals e_k of run k at
the estimate, H_k = J_k' J_k and s_k = J_k' e_k, and parameters of run k that deviate by N(0, t^2
P0) from the common ones::

    s_k ~ N(0, H_k + t^2 H_k P0 H_k)

(random effects; DerSimonian and Laird 1986; P0 prior covariance). t is its maximum likelihood
estimate, zero unless twice the log-likelihood ratio exceeds the chi-square quantile. The scatter is
the visible part of the error. A part is common to all runs, because all tests are larger than the
motion for which control is designed, and no scatter shows it. But parameters that take up an error
of the structure lie further from the prior than it allows (prior predictive check; Box 1980). With
the estimate z, mean m and covariance P of the prior, and H = sum_k H_k::

    Q = (z - m)' P^-1 (z - m),    z - m ~ N(0, P - (H + P^-1)^-1)    without error of the structure

The share of Q beyond its expectation is the conflict, g^2 = max(0, 1 - E(Q) / Q) (as the I^2 of
Higgins and Thompson 2002). It needs no threshold: true vehicles lie nearer to their files than the
standard deviations of the prior, which are generous, so that g is zero without an error.

The common error has two effects. All parameters are off by a share of their prior deviations, and
those combinations that the data hardly see, such as a pole and a zero beside it, by more: the
information of the data is divided by a dispersion k (quasi-likelihood; McCullagh and Nelder 1989,
ch. 9). The covariance of the estimate is

    (H / k + P^-1)^-1 + (c^2 + t^2) P0,    k = 1 + (DISPERSION - 1) g^2,    c = COMMON g

COMMON and DISPERSION come from campaigns of plants from outside. docs/accuracy.md has the figures
of these campaigns, and of others that had no part in the choice.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.models import parameters
from sysid.planes import Plane

Array = NDArray[np.float64]

COMMON = 0.1
"""Error that all runs share where the prior conflicts, in prior standard deviations."""
DISPERSION = 60.0
"""Factor on the variance of the likelihood where the prior conflicts."""
SIGNIFICANT = 3.84
"""Quantile of chi-square with one degree of freedom, 95 %."""
RANK_TOLERANCE = 1e-6
"""Relative eigenvalue of an information matrix below which a direction is unobserved."""
SCATTER = np.geomspace(1e-3, 2.0, 60)
"""Values of the scatter t that are compared, in prior standard deviations."""


class RunScore(NamedTuple):
    """Information of one run and the gradient of its cost at the estimate."""

    information: Array
    """(p, p), H_k."""
    slope: Array
    """(p,), s_k."""


def score_of(white: Array, jacobian: Array) -> RunScore:
    """Return the score of a run.

    Parameters
    ----------
    white : ndarray, (samples, outputs)
        Whitened residuals.
    jacobian : ndarray, (samples x outputs, p)
        Their derivatives by the parameters.

    Returns
    -------
    RunScore
        Information and gradient.
    """
    return RunScore(jacobian.T @ jacobian, jacobian.T @ white.ravel())


class RunScatter(NamedTuple):
    """Scatter t of the parameters between runs, in prior standard deviations."""

    value: float = 0.0
    """Maximum likelihood estimate; zero if it is not significant."""
    run: int = 0
    """Number of the run without which it is smallest, from 0."""
    without_run: float = 0.0
    """Scatter without that run."""


def scatter(scores: Sequence[RunScore]) -> RunScatter:
    """Return the scatter between runs, and the run that raises it most.

    Parameters
    ----------
    scores : sequence of RunScore
        Scores of the runs at the estimate.

    Returns
    -------
    RunScatter
        Scatter of all runs, and without one of them at the same estimate.
    """
    deviances = np.array([_deviance_change(score) for score in scores])
    total = np.sum(deviances, axis=0)
    value = _most_likely(total)
    if value == 0.0:
        return RunScatter()
    without = [_most_likely(total - own) for own in deviances]
    run = int(np.argmin(without))
    return RunScatter(value, run, without[run])


def _deviance_change(score: RunScore) -> Array:
    """Return minus twice the log-likelihood ratio of each of `SCATTER` to no scatter, of a run."""
    # With H = L L', y = L^+ s ~ N(0, 1 + t^2 L' P0 L): independent in the eigenvectors of L' P0 L.
    eigenvalues, axes = np.linalg.eigh(score.information)
    seen = eigenvalues > RANK_TOLERANCE * eigenvalues[-1]
    root = axes[:, seen] * np.sqrt(eigenvalues[seen])
    gain, turn = np.linalg.eigh(root.T @ parameters.prior_covariance() @ root)
    square = (turn.T @ ((axes[:, seen] / np.sqrt(eigenvalues[seen])).T @ score.slope)) ** 2
    spread = 1.0 + SCATTER[:, None] ** 2 * np.maximum(gain, 0.0)
    return np.asarray(np.sum(square / spread - square + np.log(spread), axis=1))


def _most_likely(deviance_changes: Array) -> float:
    """Return the scatter of least deviance; zero if it is not significant."""
    best = int(np.argmin(deviance_changes))
    return float(SCATTER[best]) if deviance_changes[best] < -SIGNIFICANT else 0.0


def prior_conflict(offset: Array, information: Array, prior_precision: Array) -> float:
    """Return how far the estimate contradicts the prior, from 0 to 1.

    Parameters
    ----------
    offset : ndarray, (p,)
        Estimate minus prior mean.
    information : ndarray, (p, p)
        Information of the data, the sum of H_k.
    prior_precision : ndarray, (p, p)
        Inverse of the prior covariance of the fit.

    Returns
    -------
    float
        Conflict g^2.

    Notes
    -----
    E(Q) = p - tr((H + P^-1)^-1 P^-1), the number of directions that the data inform.
    """
    remaining = np.linalg.solve(information + prior_precision, prior_precision)
    expected = offset.size - float(np.trace(remaining))
    distance = float(offset @ prior_precision @ offset)
    return 1.0 - expected / distance if distance > expected else 0.0


def covariance(
    information: Array, prior_precision: Array, scatter: float, conflict: float
) -> Array:
    """Return the covariance of the estimate, (p, p).

    Parameters
    ----------
    information : ndarray, (p, p)
        Information of the data, the sum of H_k.
    prior_precision : ndarray, (p, p)
        Inverse of the prior covariance of the fit.
    scatter : float
        Scatter between runs, from `scatter`.
    conflict : float
        Conflict with the prior, from `prior_conflict`.

    Returns
    -------
    ndarray, (p, p)
        Covariance by sensors, sea, and errors of the model structure.
    """
    dispersion = 1.0 + (DISPERSION - 1.0) * conflict
    likelihood = np.linalg.inv(information / dispersion + prior_precision)
    return np.asarray(likelihood + structure_covariance(scatter, conflict))


def command_time_covariance(delay_sds_s: Mapping[Plane, float]) -> Array:
    """Return the part of the covariance by the unknown times of the commands, (p, p).

    The fit cannot distinguish it from the delay, and it is the same in both planes.

    Parameters
    ----------
    delay_sds_s : mapping of Plane to float
        Standard deviation of the delay of each plane that was tested, s.

    Returns
    -------
    ndarray, (p, p)
        Covariance of the delays.
    """
    sds = np.zeros(len(parameters.PARAMETERS))
    for i, parameter in enumerate(parameters.PARAMETERS):
        if parameter.name.startswith("delay_"):
            (plane,) = parameter.planes
            sds[i] = delay_sds_s.get(plane, 0.0) / parameter.prior_sd
    return np.outer(sds, sds)


def structure_covariance(scatter: float, conflict: float) -> Array:
    """Return the part of the covariance that more tests do not lower, (p, p).

    Parameters
    ----------
    scatter : float
        Scatter between runs, from `scatter`.
    conflict : float
        Conflict with the prior, from `prior_conflict`.

    Returns
    -------
    ndarray, (p, p)
        (c^2 + t^2) P0.
    """
    return np.asarray((COMMON**2 * conflict + scatter**2) * parameters.prior_covariance())
