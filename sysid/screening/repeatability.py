"""Repeatability of runs of the same test: score tests on the difference of their residuals.

The difference cancels every error of the model structure, which is the same in all of them.
"""

from collections.abc import Sequence

import numpy as np

from sysid.estimation.map.datasets import STRIDE
from sysid.screening.anomaly_models import departure_rad
from sysid.screening.score_test import Scores, scores
from sysid.screening.whitened_residuals import Residuals, RunResiduals

SAME_SIZE = 0.05
"""Largest relative difference of the magnitudes of two runs of the same test."""
SAME_TIME_S = 0.2
"""Largest difference of the durations of two runs of the same test, s."""


def repeated_runs(subject: RunResiduals, candidates: Sequence[RunResiduals]) -> list[RunResiduals]:
    """Return the other runs of the same plane, wave form, duration and magnitude of either sign."""
    return [
        candidate
        for candidate in candidates
        if candidate is not subject and _match(candidate, subject)
    ]


def _match(a: RunResiduals, b: RunResiduals) -> bool:
    """Return whether two runs are runs of the same test."""
    first, second = a.dataset.run, b.dataset.run
    return (
        (first.plane, first.wave) == (second.plane, second.wave)
        and abs(abs(first.magnitude_deg) - abs(second.magnitude_deg))
        <= SAME_SIZE * abs(second.magnitude_deg)
        and abs(first.time_s[-1] - second.time_s[-1]) <= SAME_TIME_S
    )


def repeatability(subject: RunResiduals, residuals: Residuals) -> Scores | None:
    """Test the difference between a run and the mean of the other runs of the same test.

    With e the whitened residual, J its slopes by the parameters, s = +1 or -1 the direction of a
    test and n the number of partners::

        d = e_run - (1/n) sum_i s_run s_i e_i,    D = J_run - (1/n) sum_i s_run s_i J_i

    Each sample of d has the variance 1 + 1/n. Return None if there is no partner.
    """
    partners = repeated_runs(subject, residuals.runs)
    if not partners:
        return None
    rows_before = min(_before(run) for run in (subject, *partners))
    rows_after = min(_samples(run) - _before(run) for run in (subject, *partners))
    rows = _rows(subject, rows_before, rows_after)
    difference = residuals.residual_at_optimum(subject)[rows]
    slope_difference = subject.slopes[rows]
    for partner in partners:
        weight = _direction(subject) * _direction(partner) / len(partners)
        partner_rows = _rows(partner, rows_before, rows_after)
        difference = difference - weight * residuals.residual_at_optimum(partner)[partner_rows]
        slope_difference = slope_difference - weight * partner.slopes[partner_rows]
    signature_rows = [
        signature._replace(white=signature.white[:, rows]) for signature in subject.signatures
    ]
    return scores(
        signature_rows,
        difference,
        slope_difference,
        residuals.covariance,
        spread=1.0 + 1.0 / len(partners),
    )


def _before(run: RunResiduals) -> int:
    """Return the number of fit samples before the test."""
    return -(-int(np.count_nonzero(run.dataset.run.preroll)) // STRIDE)


def _samples(run: RunResiduals) -> int:
    """Return the number of fit samples of a run."""
    return len(run.dataset.measured)


def _rows(run: RunResiduals, before: int, after: int) -> slice:
    """Return the rows of ``before`` and ``after`` samples about the start of the test."""
    outputs, start = run.dataset.measured.shape[1], _before(run)
    return slice((start - before) * outputs, (start + after) * outputs)


def _direction(run: RunResiduals) -> float:
    """Return the sign of the first deflection of a test that exceeds half of its largest."""
    deflection_rad = departure_rad(run.dataset.run)
    first = int(np.argmax(np.abs(deflection_rad) > 0.5 * np.max(np.abs(deflection_rad))))
    return float(np.sign(deflection_rad[first]))
