"""Screening of runs: which runs may be fitted, and the reason for each rejection.

No rule rejects a run because its residual is large. `screen` applies rules to the command and to
the motion before and during a test, before any fit. `find_outliers` tests the fit of all accepted
runs for anomalies of single runs. `refit_loop.refit_until_clean` repeats fit and test.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

from sysid.data.runs import Run
from sysid.planes import Plane
from sysid.screening import excitation, preroll, rules
from sysid.screening.cross_plane import COUPLING, cross_plane, preroll_motions
from sysid.screening.outlier_tests import RunScreening as RunScreening
from sysid.screening.outlier_tests import find_outliers as find_outliers


class Screening(NamedTuple):
    """Result of the screening rules for one run."""

    run: Run
    accepted: bool
    reasons: tuple[str, ...]
    """Reasons of a rejection, each "rule: values"; empty for an accepted run."""


def screen(runs: Sequence[Run], full_speed_mps: float = math.nan) -> list[Screening]:
    """Apply the screening rules to every run.

    Parameters
    ----------
    runs : sequence of Run
        All runs of a campaign: the motion before all tests gives the limits for each.
    full_speed_mps : float
        Speed of the vehicle with full thrust; NaN if it is not known.

    Returns
    -------
    list of Screening
        One result for each run, in the order of ``runs``.
    """
    roughness_radps = {
        plane: preroll.typical_roughness_radps([r for r in runs if r.plane == plane])
        for plane in Plane
    }
    before = preroll_motions(runs)
    screenings, usual_prerolls = [], preroll.usual_prerolls(runs)
    for run, usual in zip(runs, usual_prerolls, strict=True):
        findings = (
            rules.gap(run),
            rules.clock(run),
            rules.no_depth(run),
            rules.too_short(run),
            rules.attitude_rate_mismatch(run),
            rules.depth_pitch_mismatch(run),
            rules.depth_without_pitch(run, full_speed_mps),
            excitation.no_deflection(run),
            excitation.feedback_only(run),
            rules.saturation(run),
            rules.unsteady_start(run, usual),
            rules.disturbance(run, roughness_radps[run.plane]),
            rules.thrust_change(run),
            cross_plane(run, before),
        )
        reasons = tuple(reason for reason in findings if reason)
        screenings.append(Screening(run, not reasons, reasons))
    return _without_unexcited_planes(screenings)


def _without_unexcited_planes(screenings: Sequence[Screening]) -> list[Screening]:
    """Reject the runs of a plane that all its tests together do not move.

    Coupling is judged relative to the tested plane's motion, so that it is no cause of its own.
    """
    reasons = {
        plane: excitation.no_response(
            plane, [s.run for s in screenings if s.run.plane == plane and _may_be_coupled_only(s)]
        )
        for plane in Plane
    }
    return [
        Screening(s.run, False, (reason, *s.reasons))
        if _may_be_coupled_only(s) and (reason := reasons[s.run.plane])
        else s
        for s in screenings
    ]


def _may_be_coupled_only(screening: Screening) -> bool:
    """Return whether a run is accepted, or rejected for motion of the other plane alone."""
    return all(reason.startswith(COUPLING) for reason in screening.reasons)
