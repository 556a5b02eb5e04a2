"""Score tests: which anomaly a run's whitened residuals look most like, and how often chance alone
would look so.

With residuals e, signature a per unit of size, parameter slopes J and the parameters' posterior
covariance P, the efficient score is a'e, its variance v = a'(1 - J P J')a, the size a'e/v and the
statistic a'e/sqrt(v) (Rao 1948). As the residuals at the joint optimum are (1 - J P J') times those
that the fit of the *other* runs leaves in this one, this is the leave-one-run-out estimate without
a second fit."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from sysid.screening.anomaly_models import Kind, Signature

Array = NDArray[np.float64]

MIN_INFORMATION = 0.01
"""Of the best time's: anomalies at times that tell less are not looked for."""


class Anomaly(NamedTuple):
    """The likeliest of one kind."""

    kind: Kind
    statistic: float
    """Standard normal if there is none, were its time known."""
    size: float
    sd: float
    unit: str
    at_s: float | None
    """Since the test began; None for what lasts throughout."""


class Scores(NamedTuple):
    anomalies: tuple[Anomaly, ...]
    """Each kind's, the likeliest first."""
    p_value: float
    """Chance that a clean run shows any of them so clearly, at whatever time."""


class _StatisticOverTime(NamedTuple):
    """Statistics of one kind over time, and how alike neighbours are."""

    signature: Signature
    variance: Array
    statistic: Array
    alike: Array


def scores(
    signatures: Sequence[Signature],
    residual: Array,
    slopes: Array,
    covariance: Array,
    spread: float = 1.0,
) -> Scores:
    """Test a run's residual (n,) of white variance ``spread`` and slopes (n, p) for every
    signature.

    What lasts throughout and what comes at some time share the chance of a false alarm by halves: a
    search over a minute would else take most of it, and a wrong gain would pay for the many times
    at which a slip may come."""
    courses = [_statistic_over_time(s, residual, slopes, covariance, spread) for s in signatures]
    families = [[c for c in courses if bool(c.alike.size) == timed] for timed in (False, True)]
    chances = [_false_alarm_bound(family) for family in families if family]
    anomalies = sorted((_most_likely(c) for c in courses), key=lambda a: -abs(a.statistic))
    return Scores(tuple(anomalies), min(1.0, len(chances) * min(chances)))


def _false_alarm_bound(family: Sequence[_StatisticOverTime]) -> float:
    """Bound on the chance that a clean run shows any anomaly of a family as clearly as this one
    does."""
    highest = max(float(np.max(np.abs(course.statistic))) for course in family)
    return sum(exceedance(highest, course.alike) for course in family)


def _statistic_over_time(
    signature: Signature, residual: Array, slopes: Array, covariance: Array, spread: float
) -> _StatisticOverTime:
    white = signature.white
    explained = white @ slopes
    through = explained @ covariance
    variance = spread * np.sum(white**2, axis=1) - np.sum(through * explained, axis=1)
    telling = np.flatnonzero(variance > MIN_INFORMATION * np.max(variance))
    white, variance, explained, through = (
        white[telling],
        variance[telling],
        explained[telling],
        through[telling],
    )
    neighbours = spread * np.sum(white[1:] * white[:-1], axis=1) - np.sum(
        through[1:] * explained[:-1], axis=1
    )
    sd = np.sqrt(variance)
    signature = signature._replace(times_s=signature.times_s[telling], white=white)
    return _StatisticOverTime(
        signature, variance, white @ residual / sd, neighbours / (sd[1:] * sd[:-1])
    )


def _most_likely(course: _StatisticOverTime) -> Anomaly:
    k = int(np.argmax(np.abs(course.statistic)))
    sd = 1.0 / math.sqrt(course.variance[k])
    time_s = float(course.signature.times_s[k])
    statistic = float(course.statistic[k])
    kind, unit = course.signature.kind, course.signature.unit
    return Anomaly(
        kind, statistic, statistic * sd, sd, unit, None if math.isnan(time_s) else time_s
    )


def exceedance(level: float, alike: Array) -> float:
    """Bound on the chance that |T| exceeds ``level`` anywhere along a course of standard normal T.

    Along a smooth course it is the chance at one end and that of crossing on the way,
    exp(-c^2/2)/pi times the arc length arccos(correlation) (Davies 1987, equation 3.4; Hotelling
    1939). Between points too far apart to be smooth, each new one adds no more than its own chance.
    """
    single = 2.0 * float(norm.sf(level))
    arcs = np.arccos(np.clip(alike, -1.0, 1.0))
    return single + float(np.sum(np.minimum(arcs / math.pi * math.exp(-0.5 * level**2), single)))
