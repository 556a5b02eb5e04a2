"""Tests in the water, cut from a log: one ``Run`` from "SystemID Starting" to "SystemID Finished"
or "Stopped".

Logs that do not say when a test ran are cut where somebody marks them.
"""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.data.dataset import Log, LogError

Array = NDArray[np.float64]
Plane = Literal["yaw", "pitch"]

RATE_HZ = 50.0
"""The grid of a run: the autopilot's tick."""
PREROLL_S = 15.0
"""Motion before a test that is kept: known commands, the actuator's bias, and the state in which
the test starts."""
STEADY_S = 5.0
"""The last part of it, which must be steady."""

PLANE_OF_AXIS: dict[int, Plane] = {11: "pitch", 12: "yaw"}
"""ArduPilot's SID_AXIS numbers of the mixer inputs: 11 pitch (elevator), 12 yaw (rudder)."""
BOTH_AXIS, LOOP_ON = 23, 100
"""Both at once; added to an axis whose loop stayed on."""

AXIS_OF_PLANE = {plane: axis for axis, plane in PLANE_OF_AXIS.items()}

START_TEXT, END_TEXTS = "SystemID Starting", ("SystemID Finished", "SystemID Stopped")
"""What a vehicle says first of a test, and last."""
_STARTING = re.compile(r"SystemID Starting: axis=(\d+)(?: wave=(\w+) magnitude=(-?[\d.]+))?")
"""ArduPilot says the axis only; its wave is a chirp."""
_ELEVATOR = re.compile(r"elevator=(-?[\d.]+)")
_STOPPED = re.compile(r"SystemID Stopped: ?(.*)")


@dataclass(frozen=True)
class Run:
    """One test on a uniform grid of ``RATE_HZ``; arrays of equal length. Axes are MAVLink's (FRD,
    NED)."""

    name: str
    plane: Plane
    wave: str
    magnitude_deg: float
    time_s: Array
    """Zero at the start of the test; the pre-roll is negative."""
    rudder_rad: Array
    """Commanded, trim included."""
    elevator_rad: Array
    thrust: Array
    p_radps: Array
    q_radps: Array
    r_radps: Array
    roll_rad: Array
    pitch_rad: Array
    heading_rad: Array
    """Unwrapped."""
    depth_m: Array
    stop_reason: str
    """Empty when the test ran to its end."""
    longest_gap_s: float
    """Largest distance between two received samples of attitude or actuators within the run."""
    rudder_trim_rad: float
    elevator_trim_rad: float
    clock_back: str = ""
    """Whose time stamps went back during the run, and by how much; empty for a clock that ran."""
    clock_drift_s: float = 0.0
    """How much the recorder's clock gained on the vehicle's from the first quarter of the run to
    the last."""
    both: bool = False
    """The other surface was under test at the same time: this is one plane's half."""
    earlier_rad: tuple[Array, Array] = (np.empty(0), np.empty(0))
    """Rudder and elevator as commanded before the first sample, where that is known: the duct was
    still following."""

    @property
    def command_rad(self) -> Array:
        """Command of the surface under test."""
        return self.rudder_rad if self.plane == "yaw" else self.elevator_rad

    @property
    def rate_radps(self) -> Array:
        """Rate in the plane under test."""
        return self.r_radps if self.plane == "yaw" else self.q_radps

    @property
    def trim_rad(self) -> float:
        return self.rudder_trim_rad if self.plane == "yaw" else self.elevator_trim_rad

    @property
    def preroll(self) -> NDArray[np.bool_]:
        return self.time_s < 0.0

    @property
    def approach(self) -> NDArray[np.bool_]:
        """The last STEADY_S before the test."""
        return (self.time_s < 0.0) & (self.time_s >= -STEADY_S)

    def history_rad(self, surface: Plane) -> Array:
        """Commands of a plane's surface, the ones before the first sample included."""
        rudder, elevator = self.earlier_rad
        now = self.rudder_rad if surface == "yaw" else self.elevator_rad
        return np.concatenate([rudder if surface == "yaw" else elevator, now])

    def since(self, start_s: float) -> "Run":
        """The same run without what lies before ``start_s``, of which the commands stay known."""
        first = int(np.searchsorted(self.time_s, start_s - 1e-9))
        rudder, elevator = self.history_rad("yaw"), self.history_rad("pitch")
        end = rudder.size - self.time_s.size + first
        left = {name: getattr(self, name)[first:] for name in _SERIES}
        return replace(self, **left, earlier_rad=(rudder[:end], elevator[:end]))

    def until(self, stop_s: float) -> "Run":
        """The same run without what lies after ``stop_s``."""
        end = int(np.searchsorted(self.time_s, stop_s + 1e-9))
        return replace(self, **{name: getattr(self, name)[:end] for name in _SERIES})


_SERIES = tuple(field.name for field in fields(Run) if field.type is Array)


@dataclass(frozen=True)
class TestInterval:
    """When a test ran, and what the vehicle said of it."""

    start_s: float
    stop_s: float
    axis: int
    wave: str
    magnitude_deg: float
    stop_reason: str
    elevator_deg: float = 0.0
    """Of a test of both surfaces, whose ``magnitude_deg`` is the rudder's."""
    both: bool = False


class MarkedInterval(NamedTuple):
    """A test that a person has found in a log, in the log's own time."""

    start_s: float
    stop_s: float
    plane: Plane
    log: str = ""
    """The name of the log; empty for the only one."""


def cut_runs(log: Log, marks: Sequence[MarkedInterval] = ()) -> list[Run]:
    """The tests of a log in the order they were run. Tests of other axes than rudder and elevator
    are left out.

    Raises:
        LogError: a mark lies outside the log.
    """
    stem = log.name.removesuffix(".mcap")
    known = [part for span in intervals_of_tests(log) for part in _by_plane(span)]
    known = sorted(
        [*known, *(_interval_of_mark(log, mark) for mark in marks)], key=lambda span: span.start_s
    )
    return [_run(log, span, f"{stem}/{number}") for number, span in enumerate(known, start=1)]


def _by_plane(span: TestInterval) -> list[TestInterval]:
    """A test as one surface's: that of both is one of each. What counts is the command, not who
    gave it."""
    axis = span.axis % LOOP_ON
    if axis == BOTH_AXIS:
        elevator = replace(span, axis=11, magnitude_deg=span.elevator_deg, both=True)
        return [replace(span, axis=12, both=True), elevator]
    return [replace(span, axis=axis)] if axis in PLANE_OF_AXIS else []


def intervals_of_tests(log: Log) -> Iterator[TestInterval]:
    """When which tests ran. A test that the log does not see stop ends with the log, and says
    so."""
    running: tuple[float, re.Match[str]] | None = None
    for event in log.events:
        starting, stopped = _STARTING.search(event.text), _STOPPED.search(event.text)
        if running and (starting or stopped or "SystemID Finished" in event.text):
            reason = "the log lost its end" if starting else stopped[1] if stopped else ""
            yield _interval(log, running, event.time_s, reason)
            running = None
        if starting:
            running = event.time_s, starting
    if running:
        yield _interval(log, running, float(log.attitude.time_s[-1]), "the log ended")


def _interval(
    log: Log, running: tuple[float, re.Match[str]], stop_s: float, reason: str
) -> TestInterval:
    start_s, match = running
    axis = int(match[1])
    magnitude_deg = float(match[3]) if match[3] else _size_deg(log, axis, start_s, stop_s)
    elevator = _ELEVATOR.search(match.string)
    elevator_deg = float(elevator[1]) if elevator else 0.0
    return TestInterval(
        start_s, stop_s, axis, match[2] or "chirp", magnitude_deg, reason, elevator_deg
    )


def _interval_of_mark(log: Log, mark: MarkedInterval) -> TestInterval:
    first_s, last_s = float(log.attitude.time_s[0]), float(log.attitude.time_s[-1])
    if not first_s <= mark.start_s < mark.stop_s <= last_s:
        raise LogError(
            f"{log.name}: run {mark.start_s:g}..{mark.stop_s:g} must lie within the log,"
            f" {first_s:.1f}..{last_s:.1f} s"
        )
    axis = AXIS_OF_PLANE[mark.plane]
    return TestInterval(
        mark.start_s,
        mark.stop_s,
        axis,
        "marked",
        _size_deg(log, axis, mark.start_s, mark.stop_s),
        "",
    )


def _size_deg(log: Log, axis: int, start_s: float, stop_s: float) -> float:
    """The farthest that the surface was commanded from where it stood when the test began."""
    actuators = log.actuators
    command = actuators.rudder_rad if PLANE_OF_AXIS.get(axis) == "yaw" else actuators.elevator_rad
    first, end = np.searchsorted(actuators.time_s, [start_s, stop_s])
    away = command[first:end] - command[max(first - 1, 0)] if end > first else np.zeros(1)
    return float(np.degrees(away[np.argmax(np.abs(away))]))


def _run(log: Log, span: TestInterval, name: str) -> Run:
    attitude, actuators, depth = log.attitude, log.actuators, log.depth
    first_s = max(attitude.time_s[0], actuators.time_s[0], depth.time_s[0])
    before = int(np.floor((span.start_s - max(span.start_s - PREROLL_S, first_s)) * RATE_HZ))
    after = int(np.floor((span.stop_s - span.start_s) * RATE_HZ))
    time_s = np.arange(-max(before, 0), max(after, 1) + 1) / RATE_HZ
    grid_s = span.start_s + time_s

    def smooth(values: Array) -> Array:
        return np.interp(grid_s, attitude.time_s, values)

    def held(values: Array) -> Array:
        latest = np.searchsorted(actuators.time_s, grid_s + 1e-6, side="right") - 1
        return values[np.clip(latest, 0, None)]

    return Run(
        name=name,
        plane=PLANE_OF_AXIS[span.axis],
        wave=span.wave,
        magnitude_deg=span.magnitude_deg,
        time_s=time_s,
        rudder_rad=held(actuators.rudder_rad),
        elevator_rad=held(actuators.elevator_rad),
        thrust=held(actuators.thrust),
        p_radps=smooth(attitude.p_radps),
        q_radps=smooth(attitude.q_radps),
        r_radps=smooth(attitude.r_radps),
        roll_rad=smooth(attitude.roll_rad),
        pitch_rad=smooth(attitude.pitch_rad),
        heading_rad=smooth(attitude.yaw_rad),
        depth_m=np.interp(grid_s, depth.time_s, depth.depth_m),
        stop_reason=span.stop_reason,
        longest_gap_s=max(
            _max_gap_s(t, grid_s) for t in (attitude.time_s, actuators.time_s, depth.time_s)
        ),
        rudder_trim_rad=np.radians(log.parameters.get("TRIM_RUD_DEG", 0.0)),
        elevator_trim_rad=np.radians(log.parameters.get("TRIM_ELE_DEG", 0.0)),
        clock_back=_clock_step_reason(log, grid_s),
        clock_drift_s=_clock_drift_s(log, grid_s),
        both=span.both,
    )


def _clock_step_reason(log: Log, grid_s: Array) -> str:
    steps = [step for step in log.clock.steps if grid_s[0] <= step.time_s <= grid_s[-1] + STEADY_S]
    return f"the time of {steps[0].what} went back by {steps[0].back_s:.1f} s" if steps else ""


def _clock_drift_s(log: Log, grid_s: Array) -> float:
    """Medians of a quarter each, as single messages may be late."""
    inside = (log.clock.time_s >= grid_s[0]) & (log.clock.time_s <= grid_s[-1])
    ahead_s = log.clock.ahead_s[inside]
    quarter = ahead_s.size // 4
    return float(np.median(ahead_s[-quarter:]) - np.median(ahead_s[:quarter])) if quarter else 0.0


def _max_gap_s(time_s: Array, grid_s: Array) -> float:
    """Largest step of ``time_s`` that touches the grid's span, its ends included."""
    inside = time_s[(time_s > grid_s[0]) & (time_s < grid_s[-1])]
    return float(np.max(np.diff(np.concatenate(([grid_s[0]], inside, [grid_s[-1]])))))
