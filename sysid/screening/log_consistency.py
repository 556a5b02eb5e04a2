"""Comparison of the logs of a fit: find a log of another vehicle, or with a wrong thrust.

The outlier tests estimate an error of the surface's gain for each run against the fit of all. In
clean campaigns of the four vehicles of the study, the median of their sizes over the runs of a log
is at most 7 %. If logs of two vehicles are fitted together, one log has large errors of either
sign, because the common model has the wrong shape for it.
"""

import math
from collections.abc import Mapping, Sequence
from statistics import median
from typing import NamedTuple

from sysid.data.dataset import VelocitySource
from sysid.data.runs import Run
from sysid.estimation.map.steady_state import cruise_speed_mps
from sysid.models.parameters import CandidateVehicle
from sysid.planes import PLANES, Plane
from sysid.screening.outlier_tests import RunScreening

MIN_RUNS = 2
"""Minimum number of runs of a plane in a log."""
MIN_GAIN_ERROR_PERCENT = 20.0
"""Smallest median size of the gain errors of a log that is reported."""
MIN_RATIO = 2.0
"""Smallest ratio of that median to the median of the other logs."""
MIN_SIGNIFICANCE = 3.0
"""Smallest median significance of the gain errors, in standard deviations."""


MAX_SPEED_RATIO = 1.35
"""Largest ratio of measured speed and the model's speed with the thrust of a run, or its inverse.

Three prior standard deviations of the axial drag, whose square root is the ratio of speeds."""
THROUGH_WATER = (VelocitySource.WATER_TRACK, VelocitySource.COLUMN)
"""Sources of a speed that a current does not change."""


class _GainErrors(NamedTuple):
    """Gain errors of the runs of one plane in one log."""

    sizes_percent: list[float]
    significances: list[float]


def wrong_thrust(vehicle: CandidateVehicle, runs: Sequence[Run]) -> str:
    """Return the reason if the thrust of a run contradicts its measured speed.

    Lift is proportional to the square of the speed, which the fit takes from the thrust.

    Parameters
    ----------
    vehicle : CandidateVehicle
        Fitted vehicle.
    runs : sequence of Run
        The runs.

    Returns
    -------
    str
        One line; empty if thrust and speed agree, or if no speed was measured.
    """
    for run in runs:
        if run.velocity_source not in THROUGH_WATER or math.isnan(run.straight_speed_mps):
            continue
        speed_mps = cruise_speed_mps(vehicle, float(run.thrust[0]))
        if abs(math.log(run.straight_speed_mps / speed_mps)) > math.log(MAX_SPEED_RATIO):
            return (
                f"{run.name}: with a thrust of {run.thrust[0]:.0%} the model reaches"
                f" {speed_mps:.2f} m/s, and the log has {run.straight_speed_mps:.2f} m/s through"
                " the water; give the thrust of the tests (thrust_pct, or the thrust output and its"
                " trim), or a prior with this vehicle's speed"
            )
    return ""


def two_vehicles(screenings: Mapping[str, RunScreening], runs: Sequence[Run]) -> str:
    """Return the reason if a log seems to be of another vehicle than the others.

    Parameters
    ----------
    screenings : mapping of str to RunScreening
        Outlier tests by run name.
    runs : sequence of Run
        The runs; the part of a name before its last ``/`` is the log.

    Returns
    -------
    str
        One line; empty if the logs agree, or if there is only one.
    """
    errors: dict[Plane, dict[str, _GainErrors]] = {plane: {} for plane in Plane}
    for run in runs:
        log = run.name.rpartition("/")[0]
        gain_errors = errors[run.plane].setdefault(log, _GainErrors([], []))
        for anomaly in screenings[run.name].scores.anomalies:
            if anomaly.kind == "gain error":
                gain_errors.sizes_percent.append(abs(anomaly.size))
                gain_errors.significances.append(abs(anomaly.statistic))
    for plane, by_log in errors.items():
        for log, own in by_log.items():
            others = [e for other, e in by_log.items() if other != log]
            if others and _stands_out(own, others):
                return (
                    f"two different vehicles among the logs, or one that was changed: the response"
                    f" to the {PLANES[plane].surface} in {log} is off by"
                    f" {median(own.sizes_percent):.0f} % in the median of its"
                    f" {len(own.sizes_percent)} tests; fit the logs of one vehicle"
                )
    return ""


def _stands_out(own: _GainErrors, others: Sequence[_GainErrors]) -> bool:
    """Return whether the gain errors of one log are large, and larger than those of the others."""
    if len(own.sizes_percent) < MIN_RUNS:
        return False
    size = median(own.sizes_percent)
    usual = median(size for errors in others for size in errors.sizes_percent)
    return (
        size >= max(MIN_GAIN_ERROR_PERCENT, MIN_RATIO * usual)
        and median(own.significances) >= MIN_SIGNIFICANCE
    )
