"""The estimate of one vehicle under test, live: telemetry in, readings out."""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ground.client.vehicle import StatusText
from ground.live.telemetry import MAX_GAP_S, Gap, Telemetry
from mavlink_io.codec import Frame
from sysid.data import segments
from sysid.data.dataset import LogError
from sysid.data.segments import END_TEXTS, PREROLL_S, START_TEXT, Plane, Run
from sysid.estimation.recursive import estimator, prediction, report
from sysid.estimation.recursive.estimator import Knowledge, TestState
from sysid.estimation.recursive.report import PlaneReport
from sysid.estimation.recursive.square_root_information import Information

PLANES: tuple[Plane, ...] = ("yaw", "pitch")
MIN_RUN_TICKS = 60
"""Ticks of a run that is worth looking at."""
CLOCK_RESTART_S = 1.0
"""A clock that goes back by more has been started anew; by less, a datagram was late."""
LOG_ENDED_REASON = "the log ended"
"""How `runs.cut` calls a test that its log does not see stop."""


class EstimateStatus(NamedTuple):
    """What there is to show."""

    readings: dict[Plane, PlaneReport]
    """Planes of which a test has told something."""
    testing: tuple[Plane, ...]
    """Under test now."""
    trouble: str
    """Why a test that runs tells nothing; empty when it does."""


class LiveEstimate:
    """Grows with each test. It looks at what it heard only in ``look``: that is the dear part."""

    def __init__(self, knowledge: Knowledge, parameters: Mapping[str, float]) -> None:
        """``parameters`` are those aboard, as far as they are known."""
        self._knowledge = knowledge
        self._telemetry = Telemetry(parameters)
        self._states: dict[Plane, TestState] = {}
        self._told: dict[Plane, Information] = {}
        """Since the last look."""
        self._readings: dict[Plane, PlaneReport] = {}
        self._trouble = ""
        gains = parameters if "HDG_P" in parameters else None
        self._crossover_radps: dict[Plane, float] = {
            plane: report.crossover_radps(knowledge.prior, plane, gains) for plane in PLANES
        }

    def on_frame(self, frame: Frame) -> None:
        """Take a frame of the vehicle's autopilot."""
        before_s = self._telemetry.now_s
        if self._telemetry.on_frame(frame) < before_s - CLOCK_RESTART_S:
            self._begin_anew(frame)

    def on_text(self, text: StatusText) -> None:
        """Take a text of the vehicle's."""
        if text.text.startswith((START_TEXT, *END_TEXTS)):
            self._telemetry.on_text(text.severity, text.text)

    def poll(self) -> EstimateStatus:
        """What has been told up to now."""
        self._trouble = ""
        while (gap := self._telemetry.gap()) is not None:
            self._pass_over(gap)
        self._follow(self._telemetry.complete_s)
        if not self._telemetry.events:
            self._telemetry.forget(self._telemetry.now_s - PREROLL_S - 1.0)
        self._read()
        return EstimateStatus(dict(self._readings), tuple(self._states), self._trouble)

    def _begin_anew(self, frame: Frame) -> None:
        """The vehicle's clock has gone back: her test is over, and what she told of it before
        stays."""
        self._end()
        self._telemetry.restart()
        self._telemetry.on_frame(frame)

    def _pass_over(self, gap: Gap) -> None:
        """A test that was under way goes on behind the gap as one of its own; what it told before
        stays."""
        telemetry = self._telemetry
        self._follow(gap.start_s)
        self._end()
        heard = [event for event in telemetry.events if event.time_s < gap.end_s]
        telemetry.events = [event for event in telemetry.events if event.time_s >= gap.end_s]
        if heard and heard[-1].text.startswith(START_TEXT):
            telemetry.events.insert(0, replace(heard[-1], time_s=gap.end_s))
            limit_s = MAX_GAP_S[gap.what]
            self._trouble = (
                f"{gap.end_s - gap.start_s:.2f} s without {gap.what}, at most {limit_s:g}"
            )
        telemetry.forget(gap.end_s)

    def _follow(self, until_s: float) -> None:
        """The tests up to a time: those that ended, and the one that is under way."""
        telemetry = self._telemetry
        if not telemetry.events:
            return
        try:
            found = segments.cut_runs(telemetry.log(until_s))
        except LogError as error:
            self._trouble = str(error)
            return
        for run in found:
            self._advance(run)
        heard = [event for event in telemetry.events if event.time_s <= until_s]
        if heard and not heard[-1].text.startswith(START_TEXT):
            telemetry.events = telemetry.events[len(heard) :]
        elif len(heard) > 1:
            telemetry.events = telemetry.events[len(heard) - 1 :]

    def _advance(self, run: Run) -> None:
        if run.time_s.size > MIN_RUN_TICKS:
            state = self._states.get(run.plane) or estimator.begin(
                self._knowledge, run.plane, _held_rad(run)
            )
            self._knowledge = state.knowledge
            state = estimator.update(state, prediction.steps(run, len(state.steps.thrust)))
            self._states[run.plane] = state
            self._told[run.plane] = estimator.information_with_test(state)
        if run.stop_reason != LOG_ENDED_REASON:
            self._end([run.plane])

    def _end(self, planes: Iterable[Plane] = PLANES) -> None:
        """No test of these is under way any more."""
        for plane in planes:
            state = self._states.pop(plane, None)
            if state is not None:
                self._knowledge = estimator.finish(state._replace(knowledge=self._knowledge))
                self._told[plane] = self._knowledge.information

    def _read(self) -> None:
        prior = self._knowledge.prior
        for plane, known in self._told.items():
            self._readings[plane] = report.read(prior, known, plane, self._crossover_radps[plane])
        self._told = {}


def _held_rad(run: Run) -> float:
    """The command that steered her straight before the test."""
    return float(np.mean(run.command_rad[run.preroll])) if run.preroll.any() else run.trim_rad
