"""Tests flown again must agree: differences of matched runs, in which every error of the model's
structure cancels."""

from collections.abc import Sequence

import numpy as np

from sysid.estimation.map.fit import STRIDE
from sysid.screening.anomaly_models import departure_rad
from sysid.screening.score_test import Scores, scores
from sysid.screening.whitened_residuals import Residuals, RunResiduals

SAME_SIZE, SAME_TIME_S = 0.05, 0.2


def repeated_runs(exhibit: RunResiduals, exhibits: Sequence[RunResiduals]) -> list[RunResiduals]:
    """The other runs of the same plane, wave, size and duration, of either sign."""
    return [e for e in exhibits if e is not exhibit and _match(e, exhibit)]


def _match(a: RunResiduals, b: RunResiduals) -> bool:
    one, two = a.experiment.run, b.experiment.run
    return (
        (one.plane, one.wave) == (two.plane, two.wave)
        and abs(abs(one.magnitude_deg) - abs(two.magnitude_deg))
        <= SAME_SIZE * abs(two.magnitude_deg)
        and abs(one.time_s[-1] - two.time_s[-1]) <= SAME_TIME_S
    )


def repeatability(exhibit: RunResiduals, evidence: Residuals) -> Scores | None:
    """Anomalies of a run's difference from the mean of its partners; None without any."""
    others = repeated_runs(exhibit, evidence.exhibits)
    if not others:
        return None
    before = min(_before(e) for e in (exhibit, *others))
    after = min(_samples(e) - _before(e) for e in (exhibit, *others))
    rows = _rows(exhibit, before, after)
    residual, slopes = evidence.left(exhibit)[rows], exhibit.slopes[rows]
    for other in others:
        share = _direction(exhibit) * _direction(other) / len(others)
        there = _rows(other, before, after)
        residual, slopes = (
            residual - share * evidence.left(other)[there],
            slopes - share * other.slopes[there],
        )
    marks = [s._replace(white=s.white[:, rows]) for s in exhibit.signatures]
    return scores(marks, residual, slopes, evidence.covariance, spread=1.0 + 1.0 / len(others))


def _before(exhibit: RunResiduals) -> int:
    """Samples before the test."""
    return -(-int(np.count_nonzero(exhibit.experiment.run.preroll)) // STRIDE)


def _samples(exhibit: RunResiduals) -> int:
    return len(exhibit.experiment.measured)


def _rows(exhibit: RunResiduals, before: int, after: int) -> slice:
    """Of the flat residual: ``before`` and ``after`` samples about the start of the test."""
    outputs, start = exhibit.experiment.measured.shape[1], _before(exhibit)
    return slice((start - before) * outputs, (start + after) * outputs)


def _direction(exhibit: RunResiduals) -> float:
    """The sign of a test's first clear move."""
    away = departure_rad(exhibit.experiment.run)
    first = int(np.argmax(np.abs(away) > 0.5 * np.max(np.abs(away))))
    return float(np.sign(away[first]))
