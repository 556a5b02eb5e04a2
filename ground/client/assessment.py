"""Assessment of a dive: errors of heading and depth on each leg, and likely causes of large ones.

The errors are those of `sysid.monitor.tracking_metrics`, computed from the recorded telemetry; they
are relative to the vehicle's own sensors.
"""

import math
from collections.abc import Sequence
from enum import StrEnum
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from msgspec.structs import asdict

from ground.campaign import refit
from ground.client.dive_symptoms import Symptom, SymptomKind, find_symptoms, start_s
from mavlink_io.errors import InputError
from sysid.data.dataset import Log
from sysid.data.events import TrimLearned
from sysid.monitor import tracking_metrics
from sysid.monitor.tracking_metrics import Array, Spread, SteadyWindow
from sysid.planes import PLANES
from sysid.reproduction.paper_tables import TABLE_5_INITIAL

MAX_ERROR = {"heading": TABLE_5_INITIAL.heading_deg, "depth": TABLE_5_INITIAL.depth_m}
"""Limit of the 95 % error (deg, m): the error of the paper's initial gains (Table 5)."""
UNIT = {"heading": "deg", "depth": "m"}
_SURFACE = {traits.outer_loop: traits.surface for traits in PLANES.values()}
LEARNING_TIMES = 5.0
"""Number of time constants TRIM_AUTO_S after which less than 1 % of a trim error remains."""
MIN_TRIM_ERROR_DEG = 1.0
"""Difference of mean command and trim above which the trim counts as not set."""
STOP_MARGIN_DEG = 0.5
"""Distance of the mean command from the travel limit within which it counts as at the stop."""
MAX_COURSE_RATE_DEGPS, RATE_SPAN_S = 0.3, 5.0
"""Rate of the heading set-point, over a span of time (s), above which a leg is not assessed.

The heading loop follows such a rate with a lag of about 1 deg, which is no steady error."""
MIN_LEG_S = 5.0
"""Minimum duration of a leg; shorter intervals of constant set-points are parts of a turn."""
ADVISED_LEG_S = 60.0
"""Duration of a leg that gives a useful verdict: settling, and as long again."""
_FAILURES = (SymptomKind.REVERSED, SymptomKind.STUCK, SymptomKind.FAILSAFE)
_MIN_ASSESSED_S = tracking_metrics.SETTLING_S + tracking_metrics.MIN_WINDOW_S
"""Minimum duration of a leg that can be assessed."""


class ErrorCause(StrEnum):
    """Likely cause of a large error on a leg."""

    LATE = "settled late"
    UNSETTLED = "never settled"
    AT_STOP = "surface at its stop"
    TRIM = "trim not set"
    LEARNING = "trim still being learned"
    INTEGRATOR = "integrator at its limit"
    SWINGING = "swinging"
    SYMPTOM = "symptom of the dive"
    """The cause is one of `Assessment.symptoms`."""
    UNKNOWN = "unknown"


_VARYING = (ErrorCause.LATE, ErrorCause.UNSETTLED, ErrorCause.SWINGING)
_BY_WEIGHT = (ErrorCause.INTEGRATOR, ErrorCause.TRIM, ErrorCause.AT_STOP, ErrorCause.UNKNOWN)
"""Causes of a depth error that a wrong weight explains."""


class AssessedLeg(NamedTuple):
    """One interval of constant set-points, without the settling time."""

    start_s: float
    stop_s: float
    heading_setpoint_deg: float
    depth_setpoint_m: float
    heading_deg: Spread
    depth_m: Spread
    rudder_deg: float
    """Mean rudder command including trim."""
    elevator_deg: float
    """Mean elevator command including trim."""
    pitch_deg: float
    """Mean pitch."""
    rudder_sd_deg: float
    """Standard deviation of the rudder command about its mean."""
    elevator_sd_deg: float
    """Standard deviation of the elevator command about its mean."""
    thrust_pct: float
    """Mean thrust command, percent of full."""
    at_stop_pct: float
    """Share of the time with rudder or elevator at its stop (percent)."""


class Finding(NamedTuple):
    """A large error of one axis, with its cause."""

    axis: str
    cause: ErrorCause
    legs: int
    """Number of legs with this cause."""
    message: str
    """Description of the error, the likely cause and the remedy."""
    remedy: str
    """Next step."""


class Outcome(StrEnum):
    """Result of a dive in one word."""

    GOOD = "good"
    """Every leg is within the limits."""
    ATTENTION = "needs attention"
    """A leg is outside the limits, or something odd happened."""
    FAILED = "failed"
    """A failsafe ended the dive, or a surface does not work."""
    UNKNOWN = "not assessed"
    """No leg can be assessed."""


class Assessment(NamedTuple):
    """Result of the assessment of a dive."""

    legs: tuple[AssessedLeg, ...]
    short_legs: int
    """Number of legs that were too short to assess."""
    findings: tuple[Finding, ...]
    trims_learned: str
    """Trims that the vehicle reported as learned and stored; empty without any."""
    reason: str
    """Reason why no leg can be assessed; empty otherwise."""
    symptoms: tuple[Symptom, ...] = ()
    """Properties of the whole dive, the gravest first."""
    start_s: float = 0.0
    """Vehicle time from which texts count: of arming, or of the start of a log without it."""

    @property
    def outcome(self) -> Outcome:
        """Result in one word."""
        if any(symptom.kind in _FAILURES for symptom in self.symptoms):
            return Outcome.FAILED
        if not self.legs:
            return Outcome.UNKNOWN
        return Outcome.ATTENTION if self.findings or self.symptoms else Outcome.GOOD


def assess_dive(log_file: Path, trims_learned: str = "") -> Assessment:
    """Assess a finished dive.

    Parameters
    ----------
    log_file : Path
        Log of the dive.
    trims_learned : str
        Trims that the vehicle learned during the dive; empty without any.
    """
    try:
        log = refit.read_log(log_file)
    except InputError as error:
        return _not_assessed(str(error), trims_learned)
    return assess_read_log(log, trims_learned)


def assess_read_log(log: Log, trims_learned: str = "") -> Assessment:
    """Assess a dive from its log; a log with gaps gives a reason instead of an exception.

    Parameters
    ----------
    log : Log
        Log of the dive.
    trims_learned : str
        Trims that the vehicle learned during the dive; empty without any.

    Returns
    -------
    Assessment
        Legs, findings and symptoms.
    """
    try:
        return assess_log(log, trims_learned)
    except InputError as error:
        return _not_assessed(str(error), trims_learned)
    except (ArithmeticError, IndexError, ValueError) as error:
        # The dive succeeded, so a log with gaps must not raise an exception here.
        return _not_assessed(f"{log.name}: the telemetry has gaps ({error})", trims_learned)


def _not_assessed(reason: str, trims_learned: str) -> Assessment:
    """Return an assessment without legs."""
    return Assessment(
        legs=(), short_legs=0, findings=(), trims_learned=trims_learned, reason=reason
    )


def assess_log(log: Log, trims_learned: str = "") -> Assessment:
    """Assess a dive from its log; see `assess_dive`."""
    tracking = tracking_metrics.tracking(log)
    windows = tracking.windows if tracking else ()
    steady = [part for window in windows if (part := _without_guidance(log, window)) is not None]
    recorded = [window for window in steady if _is_recorded(log, window)]
    symptoms = find_symptoms(log, recorded)
    explained = {symptom.axis: symptom for symptom in symptoms if symptom.axis}
    assessed = [(_leg(log, window), _halves(log, window)) for window in recorded]
    lengths_s = [stop - start for start, stop in tracking_metrics.stretches(log)]
    return Assessment(
        legs=tuple(leg for leg, _ in assessed),
        short_legs=sum(MIN_LEG_S <= length < _MIN_ASSESSED_S for length in lengths_s),
        findings=tuple(
            finding
            for axis in MAX_ERROR
            for finding in _findings(log, axis, assessed, explained.get(axis))
        ),
        trims_learned=trims_learned,
        reason="" if assessed else _why_no_leg(log, windows, steady),
        symptoms=symptoms,
        start_s=start_s(log),
    )


def as_json(assessment: Assessment) -> dict[str, Any]:
    """Return the assessment as plain values, every quantity with its unit in its name."""
    legs = []
    for leg in assessment.legs:
        errors = {"heading_deg": asdict(leg.heading_deg), "depth_m": asdict(leg.depth_m)}
        legs.append({**leg._asdict(), **errors})
    return {
        **assessment._asdict(),
        "legs": legs,
        "findings": [finding._asdict() for finding in assessment.findings],
        "symptoms": [symptom._asdict() for symptom in assessment.symptoms],
        "outcome": assessment.outcome,
        "settling_s": tracking_metrics.SETTLING_S,
    }


def _leg(log: Log, window: SteadyWindow) -> AssessedLeg:
    """Return errors and mean commands of one leg."""

    def mean_deg(time_s: Array, angle_rad: Array) -> float:
        inside = (time_s >= window.start_s) & (time_s < window.stop_s)
        return float(np.degrees(np.mean(angle_rad[inside])))

    commands, attitude = log.actuators, log.attitude
    inside = (commands.time_s >= window.start_s) & (commands.time_s < window.stop_s)
    rudder, elevator = commands.rudder_rad[inside], commands.elevator_rad[inside]
    stop_rad = commands.travel_rad - math.radians(STOP_MARGIN_DEG)
    at_stop = (np.abs(rudder) >= stop_rad) | (np.abs(elevator) >= stop_rad)
    return AssessedLeg(
        start_s=window.start_s,
        stop_s=window.stop_s,
        heading_setpoint_deg=window.heading_setpoint_deg,
        depth_setpoint_m=window.depth_setpoint_m,
        heading_deg=window.heading_deg,
        depth_m=window.depth_m,
        rudder_deg=mean_deg(commands.time_s, commands.rudder_rad),
        elevator_deg=mean_deg(commands.time_s, commands.elevator_rad),
        pitch_deg=mean_deg(attitude.time_s, attitude.pitch_rad),
        rudder_sd_deg=float(np.degrees(np.std(rudder))),
        elevator_sd_deg=float(np.degrees(np.std(elevator))),
        thrust_pct=100.0 * float(np.mean(commands.thrust[inside])),
        at_stop_pct=100.0 * float(np.mean(at_stop)),
    )


def _without_guidance(log: Log, window: SteadyWindow) -> SteadyWindow | None:
    """Return the longest part of a window in which the heading set-point moves slowly.

    After a waypoint the line-of-sight guidance moves the set-point until the vehicle is on the new
    line; errors before that are the lag behind it. None: the part is too short to assess.
    """
    points = log.setpoints
    inside = (points.attitude_time_s >= window.start_s) & (points.attitude_time_s < window.stop_s)
    time_s, heading_rad = points.attitude_time_s[inside], np.unwrap(points.heading_rad[inside])
    if time_s.size < 2:
        return window
    half_s = 0.5 * RATE_SPAN_S
    ahead, behind = (np.interp(time_s + dt, time_s, heading_rad) for dt in (half_s, -half_s))
    moving = np.abs(ahead - behind) > math.radians(MAX_COURSE_RATE_DEGPS) * RATE_SPAN_S
    if not moving.any():
        return window
    edges = [window.start_s, *time_s[moving].tolist(), window.stop_s]
    start_s, stop_s = max(pairwise(edges), key=lambda part: part[1] - part[0])
    if stop_s - start_s < tracking_metrics.MIN_WINDOW_S:
        return None
    return tracking_metrics.window(log, start_s, stop_s)


def _is_recorded(log: Log, window: SteadyWindow) -> bool:
    """Return whether both halves of a window hold attitude, depth and commands."""
    middle_s = 0.5 * (window.start_s + window.stop_s)
    halves = (window.start_s, middle_s), (middle_s, window.stop_s)
    times = log.attitude.time_s, log.depth.time_s, log.actuators.time_s
    return all(np.any((t >= start) & (t < stop)) for t in times for start, stop in halves)


def _halves(log: Log, window: SteadyWindow) -> tuple[SteadyWindow, SteadyWindow]:
    """Return the errors in the first and in the second half of a window."""
    start_s, stop_s = window.start_s, window.stop_s
    middle_s = 0.5 * (start_s + stop_s)
    return tracking_metrics.window(log, start_s, middle_s), tracking_metrics.window(
        log, middle_s, stop_s
    )


def _findings(
    log: Log,
    axis: str,
    legs: Sequence[tuple[AssessedLeg, tuple[SteadyWindow, SteadyWindow]]],
    symptom: Symptom | None,
) -> list[Finding]:
    """Return one finding per cause, with the text for the worst leg.

    `symptom` replaces the causes that follow from it.
    """
    by_cause: dict[ErrorCause, list[AssessedLeg]] = {}
    for leg, (first, second) in legs:
        cause = _cause(log, axis, leg, _error(first, axis), _error(second, axis))
        if cause is not None and symptom and (symptom.kind in _FAILURES or cause in _BY_WEIGHT):
            cause = ErrorCause.SYMPTOM
        if cause is not None:
            by_cause.setdefault(cause, []).append(leg)
    findings = []
    for cause, affected in by_cause.items():
        worst = max(affected, key=lambda leg: _error(leg, axis).p95)
        extent = "" if len(legs) == 1 else f" on {len(affected)} of {len(legs)} legs"
        why, remedy = (
            (symptom.message, symptom.remedy)
            if symptom and cause is ErrorCause.SYMPTOM
            else _explain(log, axis, cause, worst, all(_was_learning(log, leg) for leg in affected))
        )
        message = f"{axis} {_how_far(axis, cause, worst)}{extent}: {why}; {remedy}"
        findings.append(
            Finding(axis=axis, cause=cause, legs=len(affected), message=message, remedy=remedy)
        )
    return findings


def _error(leg: AssessedLeg | SteadyWindow, axis: str) -> Spread:
    """Return the error of one axis."""
    return leg.heading_deg if axis == "heading" else leg.depth_m


def _cause(
    log: Log, axis: str, leg: AssessedLeg, first: Spread, second: Spread
) -> ErrorCause | None:
    """Return the likely cause of an error; None if it is within the limit.

    `first`, `second`: errors in the halves of the leg.
    """
    error, limit = _error(leg, axis), MAX_ERROR[axis]
    if error.p95 <= limit:
        return None
    if second.p95 <= limit:
        return ErrorCause.LATE
    if abs(second.mean - first.mean) > limit:
        return ErrorCause.UNSETTLED
    about_mean = (max(0.0, error.rms**2 - error.mean**2)) ** 0.5
    if abs(error.mean) < about_mean:
        return ErrorCause.SWINGING
    return _offset_cause(log, axis, leg)


def _offset_cause(log: Log, axis: str, leg: AssessedLeg) -> ErrorCause:
    """Return the likely cause of a constant error."""
    command, trim_name = _surface(axis, leg)
    travel, trim = log.parameters.get("ACT_TRAVEL_DEG"), log.parameters.get(trim_name)
    if travel is not None and abs(command) >= travel - STOP_MARGIN_DEG:
        return ErrorCause.AT_STOP
    if trim is None:
        return ErrorCause.UNKNOWN
    trim_error_deg = abs(command - trim)
    if axis == "depth":
        # Level flight: pitch set-point = pitch + (elevator - trim) / PTCH_P. The depth integrator
        # contributes at most DPT_IMAX of it, a depth error the rest.
        gain = log.parameters.get("PTCH_P", 0.0)
        if not gain:
            return ErrorCause.UNKNOWN
        if trim_error_deg / gain <= abs(leg.pitch_deg):
            return ErrorCause.INTEGRATOR
    if trim_error_deg < MIN_TRIM_ERROR_DEG:
        return ErrorCause.UNKNOWN
    return ErrorCause.LEARNING if _was_learning(log, leg) else ErrorCause.TRIM


def _surface(axis: str, leg: AssessedLeg) -> tuple[float, str]:
    """Return the mean command (deg) and the name of its trim parameter."""
    if axis == "heading":
        return leg.rudder_deg, "TRIM_RUD_DEG"
    return leg.elevator_deg, "TRIM_ELE_DEG"


def _how_far(axis: str, cause: ErrorCause, leg: AssessedLeg) -> str:
    """Return the size of an error as text."""
    error, unit = _error(leg, axis), UNIT[axis]
    if cause in _VARYING or abs(error.mean) < 0.5 * error.p95:
        return f"{format_value(error.p95)} {unit} off (95 %)"
    return f"{format_value(abs(error.mean))} {unit} off in the mean"


def format_heading(heading_deg: float) -> str:
    """Return a heading in whole degrees, 0 to 359."""
    return f"{round(heading_deg) % 360}"


def format_value(value: float) -> str:
    """Return a number with two significant digits and no exponent."""
    return f"{value:.0f}" if abs(value) >= 10.0 else f"{value:.2g}"


def _explain(
    log: Log, axis: str, cause: ErrorCause, leg: AssessedLeg, was_learning: bool
) -> tuple[str, str]:
    """Return the likely cause on the worst leg, and its remedy.

    `was_learning`: all affected legs began during the learning of the trims.
    """
    name = _SURFACE[axis]
    command_deg, parameter = _surface(axis, leg)
    value = f"{parameter} to {command_deg:.1f}"
    match cause:
        case ErrorCause.LATE:
            text = f"settled later than {tracking_metrics.SETTLING_S:g} s after the change"
            why = ", while the trims were still being learned" if was_learning else ""
            remedy = _trim_remedy(log) if why else "nothing to do, or a longer leg"
            return f"{text}{why}; good in the second half of the leg", remedy
        case ErrorCause.UNSETTLED:
            return "never settled, as the error still changed", "give the leg more time"
        case ErrorCause.AT_STOP:
            remedy = "straighten the duct, or change the ballast"
            return f"the {name} is at its stop, {command_deg:.1f} deg", remedy
        case ErrorCause.TRIM:
            trim = log.parameters[parameter]
            values = f"the {name} is at {command_deg:.1f} deg on average, {parameter} is {trim:g}"
            learn = "set TRIM_AUTO_S to 10 and fly `trim`, which learns it"
            return f"the {name} trim is not set ({values})", f"set {value}, or {learn}"
        case ErrorCause.LEARNING:
            remedy = f"{_trim_remedy(log)}, or set {value}"
            return f"the {name} trim was still being learned", remedy
        case ErrorCause.INTEGRATOR:
            pitch = f"level flight takes {leg.pitch_deg:.1f} deg of pitch"
            limit = "DPT_IMAX lets the depth integrator carry less"
            return f"{pitch} and {limit}", "raise DPT_IMAX, or redesign the gains"
        case ErrorCause.SWINGING:
            why = "it oscillates about the set-point: a rough sea, or unsuitable gains"
            return why, "redesign the gains, or fly in a calmer sea"
        case _:
            known = f"the {name} is near its trim, or its trim is not known"
            return f"the telemetry does not show the cause: {known}", "look at the time plots"


def _trim_remedy(log: Log) -> str:
    """Return what makes the next dive begin with its trims."""
    if any(isinstance(event.value, TrimLearned) for event in log.events):
        return "fly again with the trims that the vehicle has learned"
    return "fly `trim` first"


def _was_learning(log: Log, leg: AssessedLeg) -> bool:
    """Return whether the leg began during the learning of the trims (`LEARNING_TIMES`)."""
    learning_s = LEARNING_TIMES * log.parameters.get("TRIM_AUTO_S", 0.0)
    return leg.start_s - float(log.attitude.time_s[0]) < learning_s


def _why_no_leg(log: Log, windows: Sequence[SteadyWindow], steady: Sequence[SteadyWindow]) -> str:
    """Return why no leg of a log can be assessed.

    `windows`: legs after settling; `steady`: their parts with a heading set-point at rest.
    """
    points = log.setpoints
    if points.attitude_time_s.size == 0 or points.depth_time_s.size == 0:
        return "the vehicle sent no set-points of heading and depth"
    if steady:
        return "the telemetry has gaps of half a leg"
    if windows:
        return "the heading set-point moved all the time; give legs of one heading, or long lines"
    leg = f"leg under water lasted {_MIN_ASSESSED_S:g} s with unchanged set-points"
    return f"too short: no {leg}; give each leg at least {ADVISED_LEG_S:g} s"
