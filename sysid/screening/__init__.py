"""Which runs may be fitted, and why the others may not. Every rejection has a name; none rests on
residual size.

``screen`` judges by what was commanded and how it began, before any fit; ``find_outliers`` asks the
fit of all kept runs for anomalies that one of them has and the others have not; ``rounds.settle``
does so until none is left."""

from collections.abc import Sequence
from typing import NamedTuple

from sysid.data.segments import Run
from sysid.screening import preroll, rules
from sysid.screening.cross_plane import cross_plane
from sysid.screening.limits import ScreeningLimits as ScreeningLimits
from sysid.screening.outlier_tests import RunScreening as RunScreening
from sysid.screening.outlier_tests import find_outliers as find_outliers


class Screening(NamedTuple):
    run: Run
    kept: bool
    reasons: tuple[str, ...]
    """Each "name: figures"; empty for a kept run."""


def screen(runs: Sequence[Run], limits: ScreeningLimits | None = None) -> list[Screening]:
    """Judge every run by itself, by the sea before all of them, and by its other plane."""
    limits = limits or ScreeningLimits()
    rough = {
        p: preroll.typical_roughness_radps([r for r in runs if r.plane == p])
        for p in ("yaw", "pitch")
    }
    screenings = []
    for run in runs:
        found = (
            rules.gap(run, limits),
            rules.clock(run, limits),
            rules.too_short(run, limits),
            rules.saturation(run, limits),
            rules.unsteady_start(run, preroll.usual_preroll(run, runs, limits)),
            rules.disturbance(run, limits, rough[run.plane]),
            rules.thrust_change(run, limits),
            cross_plane(run, limits, runs),
            rules.attitude_rate_mismatch(run, limits),
            rules.depth_pitch_mismatch(run, limits),
        )
        reasons = tuple(reason for reason in found if reason)
        screenings.append(Screening(run, not reasons, reasons))
    return screenings
