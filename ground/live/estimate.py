"""Recursive estimate of one vehicle under test from live telemetry."""

from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np

from ground.client.vehicle import StatusText
from ground.live.telemetry import MAX_GAP_S, Gap, Telemetry
from mavlink_io.codec import Frame
from sysid.data import segments
from sysid.data.dataset import LogError
from sysid.data.events import StopReason, TestEnded, TestStarted
from sysid.data.runs import Run
from sysid.data.segments import PREROLL_S
from sysid.estimation.recursive import estimator, intervals, prediction, report
from sysid.estimation.recursive.estimator import Knowledge, TestState
from sysid.estimation.recursive.intervals import Estimate
from sysid.estimation.recursive.report import PlaneReport
from sysid.planes import Plane

MIN_RUN_TICKS = 60
"""Minimum length of a test segment that is evaluated (ticks)."""


class EstimateStatus(NamedTuple):
    """Current estimate for display."""

    readings: dict[Plane, PlaneReport]
    """Estimate of each plane that has been tested."""
    testing: tuple[Plane, ...]
    """Planes under test now."""
    trouble: str
    """Reason why the current test gives no estimate; empty without a problem."""


class LiveEstimate:
    """Estimate that is updated with each test.

    Received data are evaluated only in `poll`, because the evaluation takes long.

    Parameters
    ----------
    knowledge : Knowledge
        Prior of the vehicle, with the information of earlier tests.
    parameters : mapping of str to float
        Known parameters of the vehicle.
    """

    def __init__(self, knowledge: Knowledge, parameters: Mapping[str, float]) -> None:
        self._knowledge = knowledge
        self._telemetry = Telemetry(parameters)
        self._states: dict[Plane, TestState] = {}
        self._updated: dict[Plane, Estimate] = {}
        """Estimate that was updated since the last evaluation, by plane."""
        self._readings: dict[Plane, PlaneReport] = {}
        self._trouble = ""
        gains = parameters if "HDG_P" in parameters else None
        self._crossover_radps: dict[Plane, float] = {
            plane: report.crossover_radps(knowledge.prior, plane, gains) for plane in Plane
        }

    def on_frame(self, frame: Frame) -> None:
        """Store a frame of the vehicle's autopilot.

        A restart of the vehicle's clock ends the current test; its information is kept.
        """
        self._telemetry.on_frame(frame, on_restart=self._end)

    def on_text(self, text: StatusText) -> None:
        """Store a text of the vehicle if it marks the start or the end of a test."""
        if isinstance(text.event, TestStarted | TestEnded):
            self._telemetry.on_event(text.event)

    def poll(self) -> EstimateStatus:
        """Evaluate all stored telemetry and return the estimate."""
        self._trouble = ""
        while (gap := self._telemetry.gap()) is not None:
            self._pass_over(gap)
        self._follow(self._telemetry.complete_s)
        if not self._telemetry.events:
            self._telemetry.forget(self._telemetry.now_s - PREROLL_S - 1.0)
        self._read()
        return EstimateStatus(dict(self._readings), tuple(self._states), self._trouble)

    def _pass_over(self, gap: Gap) -> None:
        """Split a test at a gap in the telemetry.

        The part after the gap continues as a separate test. The information of the part before the
        gap is kept.
        """
        telemetry = self._telemetry
        self._follow(gap.start_s)
        self._end()
        past_events = [event for event in telemetry.events if event.time_s < gap.end_s]
        telemetry.events = [event for event in telemetry.events if event.time_s >= gap.end_s]
        if past_events and isinstance(past_events[-1].value, TestStarted):
            telemetry.events.insert(0, past_events[-1]._replace(time_s=gap.end_s))
            limit_s = MAX_GAP_S[gap.message_name]
            self._trouble = (
                f"{gap.end_s - gap.start_s:.2f} s without {gap.message_name}, at most {limit_s:g}"
            )
        telemetry.forget(gap.end_s)

    def _follow(self, until_s: float) -> None:
        """Evaluate all tests up to a vehicle time (s), finished and unfinished."""
        telemetry = self._telemetry
        if not telemetry.events:
            return
        try:
            runs = segments.cut_runs(telemetry.log(until_s))
        except LogError as error:
            self._trouble = str(error)
            return
        for run in runs:
            self._advance(run)
        past_events = [event for event in telemetry.events if event.time_s <= until_s]
        if past_events and not isinstance(past_events[-1].value, TestStarted):
            telemetry.events = telemetry.events[len(past_events) :]
        elif len(past_events) > 1:
            telemetry.events = telemetry.events[len(past_events) - 1 :]

    def _advance(self, run: Run) -> None:
        """Update the estimate with the present samples of a run; end a run that has stopped."""
        if run.time_s.size > MIN_RUN_TICKS:
            state = self._states.get(run.plane)
            if state is None:
                state = estimator.begin(self._knowledge, run.plane, _held_rad(run))
                self._knowledge = state.knowledge
            state = estimator.update(state, prediction.steps(run, len(state.steps.thrust)))
            self._states[run.plane] = state
            self._updated[run.plane] = intervals.estimate(self._knowledge, state)
        if run.stop_reason != StopReason.LOG_ENDED:
            self._end([run.plane])

    def _end(self, planes: Iterable[Plane] = Plane) -> None:
        """Finish the current tests of these planes."""
        for plane in planes:
            state = self._states.pop(plane, None)
            if state is not None:
                self._knowledge = estimator.finish(state._replace(knowledge=self._knowledge))
                self._updated[plane] = intervals.estimate(self._knowledge)

    def _read(self) -> None:
        """Compute the report of each plane with new information."""
        prior = self._knowledge.prior
        for plane, estimate in self._updated.items():
            self._readings[plane] = report.read(
                prior, estimate, plane, self._crossover_radps[plane]
            )
        self._updated = {}


def _held_rad(run: Run) -> float:
    """Return the mean command before the test, which kept the vehicle straight (rad)."""
    return float(np.mean(run.command_rad[run.preroll])) if run.preroll.any() else run.trim_rad
