"""Score tests for anomalies of a run: the most likely one, and its probability by chance.

Symbols: e whitened residual (n,), a signature of an anomaly per unit of its size (n,), J slopes of
the residual by the parameters (n, p), P posterior covariance of the parameters (p, p). The
efficient score is a'e, its variance v, the estimated size s and the statistic T (Rao 1948)::

    v = a' (1 - J P J') a,    s = a'e / v,    T = a'e / sqrt(v)

T is standard normal in a run without anomaly. The residuals at the joint optimum are (1 - J P J')
times those that the fit of the *other* runs leaves in this one. The test is therefore the
leave-one-run-out estimate without a second fit.

v holds for residuals that are white in every part of a run. Where the noise model is wrong, the
statistics of anomalies at a time scatter more. Their variance is therefore taken from the other
runs of the plane (`inflation`; genomic control, Devlin and Roeder 1999).
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from sysid.screening.anomaly_models import Kind, Signature

Array = NDArray[np.float64]

MEDIAN_OVER_MEAN = 0.85
"""Ratio for chi-square with four to five degrees of freedom.

A mean of T^2 over a run has that many, because statistics of neighbouring times are correlated."""
MIN_INFORMATION = 0.01
"""Variance v, as a share of the largest over time, below which a time is not tested."""


class Anomaly(NamedTuple):
    """Most likely anomaly of one kind."""

    kind: Kind
    statistic: float
    """Size over standard deviation.

    Standard normal in a clean run at a time that is fixed in advance.
    """
    size: float
    """Estimated size in ``unit``."""
    sd: float
    unit: str
    at_s: float | None
    """Time since the start of the test, s; None if the anomaly acts throughout."""


class Scores(NamedTuple):
    """Score tests of one run."""

    anomalies: tuple[Anomaly, ...]
    """Most likely anomaly of each kind, the most likely first."""
    p_value: float
    """Probability that a clean run shows any of them as clearly, over all kinds and times."""


class StatisticOverTime(NamedTuple):
    """Statistics of one kind of anomaly over time, and the correlations of neighbouring times."""

    signature: Signature
    variance: Array
    statistic: Array
    correlation: Array
    """(k - 1,), correlation of the statistics of two neighbouring times."""


def scores(
    signatures: Sequence[Signature],
    residual: Array,
    slopes: Array,
    covariance: Array,
    spread: float = 1.0,
) -> Scores:
    """Test a run for every kind of anomaly.

    Parameters
    ----------
    signatures : sequence of Signature
        Signatures per unit of size.
    residual : ndarray, (n,)
        Whitened residual of the run, of variance ``spread``.
    slopes : ndarray, (n, p)
        Slopes of the residual by the parameters.
    covariance : ndarray, (p, p)
        Posterior covariance of the parameters.
    spread : float
        Variance of one sample of the residual.

    Returns
    -------
    Scores
        Most likely anomaly of each kind and the probability of a false alarm.

    Notes
    -----
    Constant anomalies and anomalies at some time form two families, each with half of the false
    alarm probability. Without this division the search over time would dominate the probability,
    and a wrong gain would be found less often.
    """
    return evaluate(statistics_over_time(signatures, residual, slopes, covariance, spread))


def statistics_over_time(
    signatures: Sequence[Signature],
    residual: Array,
    slopes: Array,
    covariance: Array,
    spread: float = 1.0,
) -> list[StatisticOverTime]:
    """Return the statistics of every kind of anomaly; arguments as for `scores`."""
    return [
        _statistic_over_time(signature, residual, slopes, covariance, spread)
        for signature in signatures
    ]


def inflation(others: Iterable[Sequence[StatisticOverTime]]) -> dict[Kind, float]:
    """Return the variance of the statistics of anomalies at a time, from other runs.

    Parameters
    ----------
    others : iterable of sequence of StatisticOverTime
        Statistics of the other runs of the plane.

    Returns
    -------
    dict
        Mean of T^2 over time; of the runs the median, which one anomalous run hardly changes, over
        MEDIAN_OVER_MEAN. At least 1.
    """
    means = dict[Kind, list[float]]()
    for run in others:
        for course in run:
            if course.correlation.size:
                mean = float(np.mean(course.statistic**2))
                means.setdefault(course.signature.kind, []).append(mean)
    return {
        kind: max(1.0, float(np.median(values)) / MEDIAN_OVER_MEAN)
        for kind, values in means.items()
    }


def evaluate(
    statistics: Sequence[StatisticOverTime], variances: Mapping[Kind, float] | None = None
) -> Scores:
    """Return the most likely anomaly of each kind and the probability of a false alarm.

    Parameters
    ----------
    statistics : sequence of StatisticOverTime
        Statistics of one run.
    variances : mapping of kind to float, optional
        Variance of the statistics of a clean run, from `inflation`; 1 without it.

    Returns
    -------
    Scores
        As for `scores`.
    """
    statistics = [
        _scale(course, (variances or {}).get(course.signature.kind, 1.0)) for course in statistics
    ]
    families = [
        [course for course in statistics if bool(course.correlation.size) == timed]
        for timed in (False, True)
    ]
    bounds = [_false_alarm_bound(family) for family in families if family]
    anomalies = sorted(
        (_most_likely(course) for course in statistics), key=lambda a: -abs(a.statistic)
    )
    return Scores(tuple(anomalies), min(1.0, len(bounds) * min(bounds)))


def _scale(course: StatisticOverTime, variance: float) -> StatisticOverTime:
    """Return the statistics for a clean run in which they have this variance."""
    return course._replace(
        variance=course.variance / variance, statistic=course.statistic / math.sqrt(variance)
    )


def _false_alarm_bound(family: Sequence[StatisticOverTime]) -> float:
    """Return a bound on the probability that a clean run shows such an anomaly as clearly."""
    highest = max(float(np.max(np.abs(statistics.statistic))) for statistics in family)
    return sum(exceedance(highest, statistics.correlation) for statistics in family)


def _statistic_over_time(
    signature: Signature, residual: Array, slopes: Array, covariance: Array, spread: float
) -> StatisticOverTime:
    """Return efficient score, variance and correlation of neighbouring times, for every time.

    v_k = spread a_k'a_k - (a_k'J) P (a_k'J)'; the correlation of times k and k+1 is (spread
    a_k'a_{k+1} - (a_k'J) P (a_{k+1}'J)') / sqrt(v_k v_{k+1}).
    """
    white = signature.white
    projected = white @ slopes
    projected_covariance = projected @ covariance
    variance = spread * np.sum(white**2, axis=1) - np.sum(projected_covariance * projected, axis=1)
    informative = np.flatnonzero(variance > MIN_INFORMATION * np.max(variance))
    white = white[informative]
    variance = variance[informative]
    projected = projected[informative]
    projected_covariance = projected_covariance[informative]
    neighbour_covariance = spread * np.sum(white[1:] * white[:-1], axis=1) - np.sum(
        projected_covariance[1:] * projected[:-1], axis=1
    )
    sd = np.sqrt(variance)
    signature = signature._replace(times_s=signature.times_s[informative], white=white)
    return StatisticOverTime(
        signature=signature,
        variance=variance,
        # A sum, not a product of BLAS, whose rounding depends on its number of threads.
        statistic=np.sum(white * residual, axis=1) / sd,
        correlation=neighbour_covariance / (sd[1:] * sd[:-1]),
    )


def _most_likely(statistics: StatisticOverTime) -> Anomaly:
    """Return the anomaly at the time of the largest statistic."""
    index = int(np.argmax(np.abs(statistics.statistic)))
    sd = 1.0 / math.sqrt(statistics.variance[index])
    time_s = float(statistics.signature.times_s[index])
    statistic = float(statistics.statistic[index])
    kind, unit = statistics.signature.kind, statistics.signature.unit
    return Anomaly(
        kind=kind,
        statistic=statistic,
        size=statistic * sd,
        sd=sd,
        unit=unit,
        at_s=None if math.isnan(time_s) else time_s,
    )


def exceedance(level: float, correlation: Array) -> float:
    """Return a bound on the probability that |T| exceeds ``level`` at any time, T standard normal.

    Davies (1987, equation 3.4; Hotelling 1939): on a smooth path it is the probability at one end
    plus that of a crossing, exp(-c^2/2)/pi times the arc length, sum arccos(correlation). If two
    neighbouring times are nearly independent, the second adds at most its own probability.
    """
    pointwise = 2.0 * float(ndtr(-level))
    arcs = np.arccos(np.clip(correlation, -1.0, 1.0))
    return pointwise + float(
        np.sum(np.minimum(arcs / math.pi * math.exp(-0.5 * level**2), pointwise))
    )
