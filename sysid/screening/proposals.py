"""Proposal of test segments in a log that marks none.

A segment begins where a surface departs from quiet motion: its change over CHANGE_S exceeds the
usual change in this log several times. It ends after the command has been quiet for QUIET_S. Each
candidate is then judged as a test is: by the screening rules for a single run, by the effect of the
surface on its plane, which must be significant, and by the screening rules for all tests together.
"""

import itertools
import math
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from sysid.data import segments
from sysid.data.dataset import Log
from sysid.data.runs import Run
from sysid.data.segments import MarkedInterval
from sysid.planes import PLANES, Plane
from sysid.screening import excitation, rules, screen
from sysid.screening.control_effect import control_effect
from sysid.screening.preroll import DEFAULT_PREROLL

Array = NDArray[np.float64]

GRID_S = 0.1
"""Step of the search."""
CHANGE_S = 1.0
"""Time over which a change of the command is measured."""
MIN_CHANGE_DEG = 0.5
"""Smallest change that begins a segment."""
USUAL_CHANGES = 4.0
"""Change that begins a segment, in units of the usual change."""
USUAL_PERCENTILE = 75.0
"""Percentile of all changes that is the usual one: course keeping, if tests are less than a quarter
of the log."""
QUIET_S = 8.0
"""Time without a large change that ends a segment."""
HELD_RAD = math.radians(0.02)
"""Largest change of a command that is held."""
MARGIN_S = 0.3
"""Time by which a segment begins before the change."""
MIN_S, MAX_S = 5.0, 60.0
"""Shortest and longest segment."""
BEFORE_S = 5.0
"""Time between the beginning of the log and the first segment."""
MIN_SIGNIFICANCE = 5.0
"""Smallest effect of the surface, in standard deviations."""


def propose(log: Log) -> list[MarkedInterval]:
    """Return the segments of a log that can be used as tests, in the order of time.

    Parameters
    ----------
    log : Log
        A log; tests that it marks are not left out.

    Returns
    -------
    list of MarkedInterval
        Time ranges with their plane, rounded to 0.1 s, with the name of the log.
    """
    candidates = [mark for plane in Plane for mark in _candidates(log, plane)]
    if not candidates:
        return []
    unmarked = segments.without_tests(log)
    ordered = sorted(candidates, key=lambda mark: (mark.start_s, mark.plane))
    runs = segments.cut_runs(unmarked, ordered)
    return _accepted([(m, run) for m, run in zip(ordered, runs, strict=True) if _is_usable(run)])


def _accepted(proposed: Sequence[tuple[MarkedInterval, Run]]) -> list[MarkedInterval]:
    """Return the segments that a refit accepts together: its limits depend on all its tests."""
    screenings = screen([run for _, run in proposed])
    accepted = [pair for pair, s in zip(proposed, screenings, strict=True) if s.accepted]
    if len(accepted) < len(proposed):
        return _accepted(accepted)
    return [mark for mark, _ in accepted]


def format_marks(marks: Sequence[MarkedInterval]) -> str:
    """Return segments as text, each as ``--segment`` takes it.

    Parameters
    ----------
    marks : sequence of MarkedInterval
        The segments.

    Returns
    -------
    str
        For example "2 usable segments found: 10.0..30.0:rudder, 80.0..95.5:elevator".
    """
    if not marks:
        return "no usable segment found"
    count = "1 usable segment" if len(marks) == 1 else f"{len(marks)} usable segments"
    texts = [mark.text for mark in marks]
    if len({m.log for m in marks}) > 1:
        texts = [f"{m.log}:{text}" for m, text in zip(marks, texts, strict=True)]
    return f"{count} found: {', '.join(texts)}"


def _candidates(log: Log, plane: Plane) -> Iterator[MarkedInterval]:
    """Yield the time ranges in which the command of a surface departs from quiet motion."""
    actuators, attitude = log.actuators, log.attitude
    first_s = max(actuators.time_s[0], attitude.time_s[0], log.depth.time_s[0])
    last_s = min(actuators.time_s[-1], attitude.time_s[-1], log.depth.time_s[-1])
    gaps_s = sorted(_gaps_s(attitude.time_s) + _gaps_s(actuators.time_s))
    grid_s = segments.grid_without_gaps(attitude.time_s, first_s, last_s, GRID_S)
    span = round(CHANGE_S / GRID_S)
    if grid_s.size < 2 * span:
        return
    command = (actuators.rudder_rad, actuators.elevator_rad)[PLANES[plane].index]
    latest = np.searchsorted(actuators.time_s, grid_s + 1e-6, side="right") - 1
    held = command[np.clip(latest, 0, None)]
    change = np.abs(held[span:] - held[:-span])
    usual = float(np.percentile(change, USUAL_PERCENTILE))
    large = change > max(USUAL_CHANGES * usual, math.radians(MIN_CHANGE_DEG))
    times_s = grid_s[span:][large]
    clusters = [*_clusters(times_s), (math.inf, math.inf)]
    for (start_s, stop_s), (next_s, _) in itertools.pairwise(clusters):
        begin_s = start_s - MARGIN_S
        end_s = max(stop_s + QUIET_S - CHANGE_S, _held_until_s(grid_s, held, stop_s))
        gap_s = next((t for t in gaps_s if t > begin_s), last_s)
        end_s = min(end_s, begin_s + MAX_S, gap_s, next_s - MARGIN_S)
        if begin_s >= first_s + BEFORE_S and end_s - begin_s >= MIN_S:
            stop_s = math.floor(10.0 * end_s) / 10.0
            yield MarkedInterval(round(begin_s, 1), stop_s, plane, log.name)


def _gaps_s(time_s: Array) -> list[float]:
    """Return the times at which gaps begin that a run must not contain."""
    starts: list[float] = time_s[:-1][np.diff(time_s) > rules.MAX_SAMPLE_GAP_S].tolist()
    return starts


def _held_until_s(grid_s: Array, command_rad: Array, since_s: float) -> float:
    """Return the time until which a command stays constant, as in an open-loop step."""
    first = min(int(np.searchsorted(grid_s, since_s)), grid_s.size - 1)
    moved = np.abs(command_rad[first:] - command_rad[first]) > HELD_RAD
    last = first + int(np.argmax(moved)) - 1 if moved.any() else grid_s.size - 1
    return float(grid_s[last])


def _clusters(times_s: Array) -> Iterator[tuple[float, float]]:
    """Yield first and last time of each group of large changes, at most MAX_S long."""
    start_s = previous_s = -math.inf
    for time_s in times_s.tolist():
        if time_s - previous_s > QUIET_S or time_s - start_s > MAX_S - QUIET_S:
            if math.isfinite(start_s):
                yield start_s, previous_s
            start_s = time_s
        previous_s = time_s
    if math.isfinite(start_s):
        yield start_s, previous_s


def _is_usable(run: Run) -> bool:
    """Return whether a candidate passes the rules for a single run and excites its plane."""
    reasons = (
        rules.gap(run),
        rules.clock(run),
        rules.no_depth(run),
        rules.saturation(run),
        rules.unsteady_start(run, DEFAULT_PREROLL),
        rules.thrust_change(run),
        rules.attitude_rate_mismatch(run),
        rules.depth_pitch_mismatch(run),
        excitation.no_deflection(run),
        excitation.feedback_only(run),
    )
    effect = control_effect([run], run.plane, run.plane)
    return not any(reasons) and effect is not None and abs(effect.significance) >= MIN_SIGNIFICANCE
