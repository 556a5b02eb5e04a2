"""Cut identification tests from a log: one ``Run`` per test.

A test begins with `events.TestStarted` and ends with `events.TestEnded`. For logs without these
events the user gives the time ranges (``MarkedInterval``).
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from mavlink_io.mission_items import LOOP_ON
from sysid.data.dataset import Log, LogError, VelocitySource
from sysid.data.events import StopReason, TestAxis, TestEnded, TestStarted, TestWave
from sysid.data.runs import RATE_HZ, STEADY_S, Array, Run
from sysid.planes import PLANES, Plane
from sysid.signal_processing import without_spikes

PREROLL_S = 15.0
"""Duration of the pre-roll, which gives the commands, actuator bias and initial state of a test."""
MAX_GAP_S = 10.0
"""Longest time without attitude over which samples are interpolated, s.

A longer one, such as a clock that jumps to UTC, has no samples; screening rejects a test much
earlier (`sysid.screening.rules`).
"""
MAX_VELOCITY_AGE_S = 1.0
"""Distance in time to the next sample of velocity or acceleration from which on it is unknown."""

MAX_OVERLAP = 0.1
"""Fraction of a marked test that may belong to another one: its quiet end."""
PLANE_OF_AXIS = {TestAxis(traits.sid_axis): plane for plane, traits in PLANES.items()}
"""Plane by axis."""
MEASURED_SPEED = (
    VelocitySource.WATER_TRACK,
    VelocitySource.BOTTOM_TRACK,
    VelocitySource.COLUMN,
)
"""Sources of a velocity that show the loss of speed in a turn.

A recorded ground speed may be the estimate of an autopilot without satellite fixes."""
LOOP_RATE, OWN_PARAMETER = "SCHED_LOOP_RATE", "HDG_REF_RATE"
"""ArduPilot's parameter for the rate of its control loops, Hz, and one that only Caribou has."""
MAX_HOLD_STEPS = 0.75
"""Largest interval of a log's commands, in steps of the grid, that shows how long they are held."""
SAME_THRUST = 0.01
"""Difference of thrust, as a fraction of full thrust, up to which the speed is the same."""


class Hold(NamedTuple):
    """Time for which the autopilot held a command, with its standard deviation; s."""

    mean_s: float
    sd_s: float


@dataclass(frozen=True)
class TestInterval:
    """Time range of a test and its settings."""

    start_s: float
    stop_s: float
    axis: TestAxis
    wave: TestWave
    magnitude_deg: float
    stop_reason: StopReason
    stop_detail: str = ""
    """Reason of an early end with value and limit; empty for a complete test."""
    elevator_deg: float = 0.0
    """Elevator magnitude in a test of both surfaces; ``magnitude_deg`` is that of the rudder."""
    both: bool = False
    """True for a test of both surfaces."""


class MarkedInterval(NamedTuple):
    """Time range of a test given by the user, in the log's time."""

    start_s: float
    stop_s: float
    plane: Plane
    log: str = ""
    """Name of the log; empty if there is only one."""

    @property
    def text(self) -> str:
        """The interval as ``--segment`` takes it, without the log."""
        return f"{self.start_s:.1f}..{self.stop_s:.1f}:{PLANES[self.plane].surface}"


def cut_runs(log: Log, marks: Sequence[MarkedInterval] = ()) -> list[Run]:
    """Cut the tests from a log.

    Parameters
    ----------
    log : Log
        The log.
    marks : sequence of MarkedInterval
        Additional time ranges of tests, in the log's time.

    Returns
    -------
    list of Run
        One run per test and plane, in the order of time. Tests of axes other than rudder and
        elevator are left out.

    Raises
    ------
    LogError
        A mark is outside the log.
    """
    stem = log.name.removesuffix(".mcap")
    numbered, hold = enumerate(_tests(log, marks), start=1), hold_of(log)
    runs = [_run(log, span, f"{stem}/{number}", hold) for number, span in numbered]
    return [replace(run, straight_speed_mps=_straight_speed_mps(run, runs)) for run in runs]


def times_of_tests(log: Log, marks: Sequence[MarkedInterval] = ()) -> list[tuple[float, float]]:
    """Return start and end of each test of ``cut_runs``.

    Parameters
    ----------
    log : Log
        The log.
    marks : sequence of MarkedInterval
        Additional time ranges of tests, in the log's time.

    Returns
    -------
    list of (float, float)
        Start and end, in the log's time, s.

    Raises
    ------
    LogError
        A mark is outside the log.
    """
    return [(span.start_s, span.stop_s) for span in _tests(log, marks)]


def without_tests(log: Log) -> Log:
    """Return a log without the events that mark tests.

    Parameters
    ----------
    log : Log
        The log.

    Returns
    -------
    Log
        The log with its other events.
    """
    events = [event for event in log.events if not isinstance(event.value, TestStarted | TestEnded)]
    return replace(log, events=tuple(events))


def _tests(log: Log, marks: Sequence[MarkedInterval]) -> list[TestInterval]:
    """Return the tests of rudder or elevator in the order of their start.

    Raises LogError for a mark that overlaps another test of its surface.
    """
    tests = [part for span in intervals_of_tests(log) for part in _by_plane(span)]
    for mark in marks:
        marked = _interval_of_mark(log, mark)
        for test in tests:
            if test.axis == marked.axis and _overlap(test, marked) > MAX_OVERLAP:
                raise LogError(
                    f"{log.name}: run {mark.start_s:g}..{mark.stop_s:g} overlaps the test of the"
                    f" {PLANES[mark.plane].surface} at {test.start_s:.1f}..{test.stop_s:.1f} s,"
                    " whose data would count twice; mark other times"
                )
        tests.append(marked)
    return sorted(tests, key=lambda span: span.start_s)


def _overlap(one: TestInterval, other: TestInterval) -> float:
    """Return the time that two intervals share, as a fraction of the shorter; negative without."""
    shared_s = min(one.stop_s, other.stop_s) - max(one.start_s, other.start_s)
    shorter_s = min(one.stop_s - one.start_s, other.stop_s - other.start_s)
    return shared_s / max(shorter_s, 1.0 / RATE_HZ)


def _by_plane(span: TestInterval) -> list[TestInterval]:
    """Return a test per surface: two for a test of both, none for another axis."""
    axis = TestAxis(span.axis % LOOP_ON)
    if axis == TestAxis.BOTH:
        elevator = replace(span, axis=TestAxis.ELEVATOR, magnitude_deg=span.elevator_deg, both=True)
        return [replace(span, axis=TestAxis.RUDDER, both=True), elevator]
    return [replace(span, axis=axis)] if axis in PLANE_OF_AXIS else []


def intervals_of_tests(log: Log) -> Iterator[TestInterval]:
    """Yield the time range of each test.

    A test without an end in the log ends with the log, with that as its stop reason.

    Parameters
    ----------
    log : Log
        Log with the events of the vehicle.

    Yields
    ------
    TestInterval
        In the order of time.
    """
    running: tuple[float, TestStarted] | None = None
    for time_s, event in log.events:
        if not isinstance(event, TestStarted | TestEnded):
            continue
        if running:
            ending = event if isinstance(event, TestEnded) else _unreported(StopReason.END_LOST)
            yield _interval(log, running, time_s, ending)
        running = (time_s, event) if isinstance(event, TestStarted) else None
    if running:
        log_end_s = float(log.attitude.time_s[-1])
        yield _interval(log, running, log_end_s, _unreported(StopReason.LOG_ENDED))


def _unreported(reason: StopReason) -> TestEnded:
    """Return the end of a test that the log does not hold."""
    return TestEnded(reason, reason.value)


def _interval(
    log: Log, running: tuple[float, TestStarted], stop_s: float, ending: TestEnded
) -> TestInterval:
    """Return the interval of a test; ``running`` is its start with the time."""
    start_s, test = running
    magnitude_deg = test.magnitude
    if magnitude_deg is None:
        magnitude_deg = _size_deg(log, test.axis, start_s, stop_s)
    return TestInterval(
        start_s=start_s,
        stop_s=stop_s,
        axis=test.axis,
        wave=test.wave,
        magnitude_deg=magnitude_deg,
        stop_reason=ending.reason,
        stop_detail=ending.detail,
        elevator_deg=test.elevator_deg,
    )


def _interval_of_mark(log: Log, mark: MarkedInterval) -> TestInterval:
    """Return the interval of a mark; raise LogError outside the log."""
    first_s, last_s = float(log.attitude.time_s[0]), float(log.attitude.time_s[-1])
    if not mark.start_s < mark.stop_s:
        raise LogError(
            f"{log.name}: run {mark.start_s:g}..{mark.stop_s:g}: its start must be before its stop"
        )
    if not first_s <= mark.start_s < mark.stop_s <= last_s:
        raise LogError(
            f"{log.name}: run {mark.start_s:g}..{mark.stop_s:g} must lie within the log,"
            f" {first_s:.1f}..{last_s:.1f} s"
        )
    axis = TestAxis(PLANES[mark.plane].sid_axis)
    return TestInterval(
        start_s=mark.start_s,
        stop_s=mark.stop_s,
        axis=axis,
        wave=TestWave.MARKED,
        magnitude_deg=_size_deg(log, axis, mark.start_s, mark.stop_s),
        stop_reason=StopReason.COMPLETE,
    )


def _size_deg(log: Log, axis: TestAxis, start_s: float, stop_s: float) -> float:
    """Return the largest deviation of the command from its value at the start, deg."""
    actuators = log.actuators
    plane = PLANE_OF_AXIS.get(axis, Plane.PITCH)
    command = (actuators.rudder_rad, actuators.elevator_rad)[PLANES[plane].index]
    first, end = np.searchsorted(actuators.time_s, [start_s, stop_s])
    deviation = command[first:end] - command[max(first - 1, 0)] if end > first else np.zeros(1)
    return float(np.degrees(deviation[np.argmax(np.abs(deviation))]))


def _run(log: Log, span: TestInterval, name: str, hold: Hold) -> Run:
    """Return a test on the grid: measurements and commands interpolated linearly.

    A log has the command at its own samples. Between two of them it changed at an unknown time;
    half way, in the mean. A command held from the earlier sample would be late by half the interval
    of the log, which the fit would subtract from the delay of the surface. The fit holds a command
    for a step of the grid. Where the autopilot held it for less, the command of half the difference
    later is taken: in the mean over the step it is the one that acted.
    """
    attitude, actuators, depth = log.attitude, log.actuators, log.depth
    first_s = max(attitude.time_s[0], actuators.time_s[0], depth.time_s[0])
    before = int(np.floor((span.start_s - max(span.start_s - PREROLL_S, first_s)) * RATE_HZ))
    last_s = _data_until_s(attitude.time_s, span.start_s, span.stop_s)
    after = int(np.floor((last_s - span.start_s) * RATE_HZ))
    time_s = np.arange(-max(before, 0), max(after, 1) + 1) / RATE_HZ
    grid_s = span.start_s + time_s
    later_s = 0.5 * (1.0 / RATE_HZ - hold.mean_s)
    end_s = float(grid_s[-1]) if last_s == span.stop_s else span.stop_s

    def smooth(values: Array) -> Array:
        return np.interp(grid_s, attitude.time_s, values)

    def command(values: Array) -> Array:
        return np.interp(grid_s + later_s, actuators.time_s, values)

    run = Run(
        name=name,
        plane=PLANE_OF_AXIS[span.axis],
        wave=span.wave,
        magnitude_deg=span.magnitude_deg,
        time_s=time_s,
        rudder_rad=command(actuators.rudder_rad),
        elevator_rad=command(actuators.elevator_rad),
        thrust=command(actuators.thrust),
        p_radps=smooth(attitude.p_radps),
        q_radps=smooth(attitude.q_radps),
        r_radps=smooth(attitude.r_radps),
        roll_rad=smooth(attitude.roll_rad),
        pitch_rad=smooth(attitude.pitch_rad),
        heading_rad=smooth(attitude.yaw_rad),
        depth_m=np.interp(grid_s, depth.time_s, depth.depth_m),
        stop_reason=span.stop_reason,
        longest_gap_s=max(
            _max_gap_s(t, float(grid_s[0]), end_s) for t in (attitude.time_s, actuators.time_s)
        ),
        longest_depth_gap_s=_max_gap_s(depth.time_s, float(grid_s[0]), end_s),
        rudder_trim_rad=np.radians(log.parameters.get("TRIM_RUD_DEG", 0.0)),
        elevator_trim_rad=np.radians(log.parameters.get("TRIM_ELE_DEG", 0.0)),
        clock_back=_clock_step_reason(log, grid_s),
        clock_drift_s=_clock_drift_s(log, grid_s),
        both=span.both,
        stop_detail=span.stop_detail,
        travel_rad=actuators.travel_rad,
        has_elevator=actuators.has_elevator,
        velocity_source=log.velocity.source,
        delay_sd_s=math.hypot(0.5 * hold.sd_s, _command_time_sd_s(actuators.time_s)),
    )
    return replace(run, **_optional_series(log, grid_s))


def loop_rate_hz(parameters: Mapping[str, float]) -> float:
    """Return the rate at which an autopilot renews its commands.

    Parameters
    ----------
    parameters : mapping of str to float
        Parameters of the autopilot.

    Returns
    -------
    float
        Rate in Hz, of Caribou's autopilot by a parameter that no other has; 0 if it is unknown.
    """
    return parameters.get(LOOP_RATE, RATE_HZ if OWN_PARAMETER in parameters else 0.0)


def hold_of(log: Log) -> Hold:
    """Return the time for which the autopilot held a command, at most a step of the grid.

    It is known from the rate of the loops, of other autopilots by their parameter, or from a log
    with more samples than the grid. A log with fewer does not show it: the autopilot may have
    renewed its command once in a step of the grid, or often.

    Parameters
    ----------
    log : Log
        The log.

    Returns
    -------
    Hold
        The time.
    """
    step_s, intervals_s = 1.0 / RATE_HZ, np.diff(log.actuators.time_s)
    if intervals_s.size and np.median(intervals_s) < MAX_HOLD_STEPS * step_s:
        return Hold(float(np.median(intervals_s)), 0.0)
    loop_hz = loop_rate_hz(log.parameters)
    if loop_hz > 0.0:
        return Hold(min(1.0 / loop_hz, step_s), 0.0)
    return Hold(0.5 * step_s, step_s / math.sqrt(12.0))


def _command_time_sd_s(time_s: Array) -> float:
    """Return the standard deviation of the time at which a command changed, s.

    Between two rows of a log it may be any, and it is common to tests that switch in step with the
    rows. A log with the rate of the grid shows it.
    """
    interval_s = float(np.median(np.diff(time_s))) if time_s.size > 1 else 0.0
    return math.sqrt(max(0.0, interval_s**2 - 1.0 / RATE_HZ**2) / 12.0)


def _straight_speed_mps(run: Run, runs: Sequence[Run]) -> float:
    """Return the speed of straight flight with the thrust of a run; NaN if it is not measured.

    A turn before the test may have slowed the vehicle, which needs up to a minute to gain speed. So
    the speed is the highest median before any test of the log with the same thrust. Over ground it
    is that before the test itself: other tests may have had the current from another side.
    """
    if run.velocity_source not in MEASURED_SPEED:
        return math.nan
    through_water = run.velocity_source != VelocitySource.BOTTOM_TRACK
    alike = [other for other in runs if _same_thrust(run, other)] if through_water else [run]
    speeds = [_speed_before_mps(other) for other in alike]
    return math.nan if math.isnan(_speed_before_mps(run)) else float(np.nanmax(speeds))


def _same_thrust(run: Run, other: Run) -> bool:
    """Return whether two runs have the same thrust in the median."""
    return abs(float(np.median(run.thrust) - np.median(other.thrust))) <= SAME_THRUST


def _speed_before_mps(run: Run) -> float:
    """Return the median speed before a test; NaN if it is not measured."""
    known = run.forward_mps.size and run.preroll.any()
    return float(np.median(run.forward_mps[run.preroll])) if known else math.nan


def _optional_series(log: Log, grid_s: Array) -> dict[str, Any]:
    """Return velocity and specific force on the grid by the names of a run's arrays.

    A Doppler log that detects a false echo gives a wrong velocity for a single sample.
    """
    velocity, force = log.velocity, log.specific_force
    series = {
        "forward_mps": (velocity.time_s, without_spikes(velocity.forward_mps)),
        "starboard_mps": (velocity.time_s, without_spikes(velocity.starboard_mps)),
        "down_mps": (velocity.time_s, without_spikes(velocity.down_mps)),
        "specific_force_x_mps2": (force.time_s, force.x_mps2),
        "specific_force_y_mps2": (force.time_s, force.y_mps2),
        "specific_force_z_mps2": (force.time_s, force.z_mps2),
    }
    return {
        name: _interpolate_near(grid_s, time_s, values)
        for name, (time_s, values) in series.items()
        if time_s.size > 1
    }


def _interpolate_near(grid_s: Array, time_s: Array, values: Array) -> Array:
    """Interpolate linearly; NaN further than MAX_VELOCITY_AGE_S from a sample."""
    after = np.clip(np.searchsorted(time_s, grid_s), 1, time_s.size - 1)
    age_s = np.minimum(np.abs(grid_s - time_s[after - 1]), np.abs(grid_s - time_s[after]))
    return np.where(age_s <= MAX_VELOCITY_AGE_S, np.interp(grid_s, time_s, values), np.nan)


def _clock_step_reason(log: Log, grid_s: Array) -> str:
    """Return a text on the first clock step within the run; empty without one."""
    steps = [step for step in log.clock.steps if grid_s[0] <= step.time_s <= grid_s[-1] + STEADY_S]
    if not steps:
        return ""
    return (
        f"the time of {steps[0].message} went back by {steps[0].back_s:.1f} s (a restart?); give"
        " what follows as a log of its own"
    )


def _clock_drift_s(log: Log, grid_s: Array) -> float:
    """Return the drift of the recorder's clock over the run, s.

    Medians of a quarter of the run each, because single messages may be late.
    """
    within_run = (log.clock.time_s >= grid_s[0]) & (log.clock.time_s <= grid_s[-1])
    ahead_s = log.clock.ahead_s[within_run]
    quarter = ahead_s.size // 4
    return float(np.median(ahead_s[-quarter:]) - np.median(ahead_s[:quarter])) if quarter else 0.0


def _max_gap_s(time_s: Array, start_s: float, end_s: float) -> float:
    """Return the largest step of ``time_s`` between two times, including both of them."""
    return float(np.max(np.diff(_with_ends(time_s, start_s, end_s))))


def _with_ends(time_s: Array, start_s: float, end_s: float) -> Array:
    """Return the times between two times, and these."""
    within = time_s[(time_s > start_s) & (time_s < end_s)]
    return np.concatenate(([start_s], within, [end_s]))


def _data_until_s(time_s: Array, start_s: float, stop_s: float) -> float:
    """Return the end of a test, or the beginning of its first gap above MAX_GAP_S."""
    edges_s = _with_ends(time_s, start_s, stop_s)
    gaps = np.flatnonzero(np.diff(edges_s) > MAX_GAP_S)
    return float(edges_s[gaps[0]]) if gaps.size else stop_s


def grid_without_gaps(time_s: Array, first_s: float, last_s: float, step_s: float) -> Array:
    """Return times at a constant step, without those in gaps above MAX_GAP_S.

    Parameters
    ----------
    time_s : ndarray, shape (n,)
        Increasing times of samples, s.
    first_s, last_s : float
        Range of the times, s; ``last_s`` is excluded.
    step_s : float
        Step, s.

    Returns
    -------
    ndarray
        Times, s; after each gap they begin again at the next sample.
    """
    edges_s = _with_ends(time_s, first_s, last_s)
    gaps = np.flatnonzero(np.diff(edges_s) > MAX_GAP_S)
    starts_s = [first_s, *edges_s[gaps + 1].tolist()]
    ends_s = [*edges_s[gaps].tolist(), last_s]
    pieces = zip(starts_s, ends_s, strict=True)
    return np.concatenate([np.arange(start_s, end_s, step_s) for start_s, end_s in pieces])
