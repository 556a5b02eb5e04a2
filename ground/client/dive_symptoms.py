"""Symptoms of a whole dive that explain its errors: surfaces, weight, current, reported faults.

Only the vehicle's own telemetry is used. Axes are those of `sysid.data.dataset`.
"""

import math
from collections.abc import Iterator, Sequence
from enum import StrEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.data.dataset import Log, VelocitySource
from sysid.data.events import Armed, Failsafe, InjectedFault, PlainText
from sysid.data.readers.servo_channels import names_surfaces
from sysid.monitor.tracking_metrics import SUBMERGED_M, SteadyWindow

Array = NDArray[np.float64]

HARD_OVER = 0.9
"""Fraction of the travel from which a surface counts as hard over."""
REACTION_S = 4.0
"""Time a surface must be hard over before its effect is judged (s).

The duct takes 2 s from stop to stop, and the yaw rate follows with about 1 s."""
MIN_JUDGED_S = 2.0
"""Minimum time with an effect that can be judged, per direction of the surface (s)."""
MIN_THRUST = 0.1
"""Thrust, as a fraction of full, below which a surface has too little flow to be judged."""
MIN_YAW_RATE_RADPS = math.radians(0.5)
"""Yaw rate below which the vehicle does not turn."""
MIN_PITCH_RAD = math.radians(3.0)
"""Pitch below which a hard-over elevator has no effect."""
HELD_DEG = 5.0
"""Heading error below which the rudder was in control."""
HELD_S = 8.0
"""Time for which the error must stay below `HELD_DEG` (s): a turn passes through it faster."""
NOSE_UP_DEG = 3.0
"""Mean pitch of level flight from which the vehicle counts as too heavy.

A neutral Caribou flies level 2 deg nose down, and 1 kg more raises that by 0.8 deg."""
NOSE_DOWN_DEG = -6.0
"""Mean pitch of level flight below which the vehicle counts as too light."""
MIN_AFLOAT_S = 60.0
"""Time (s) at the surface with the elevator hard down from which a vehicle counts as too light."""
STRONG_CURRENT_MPS = 0.3
"""Current from which the path over ground differs much from the heading: 13 deg at 1.3 m/s."""
MIN_TURN_DEG = 15.0
"""Difference of the mean headings of two windows from which the current along the heading can be
estimated."""
WORST_SEVERITY = 3
"""Largest MAV_SEVERITY of texts that are listed: 3 is an error."""
_OVER_GROUND = (VelocitySource.BOTTOM_TRACK, VelocitySource.ESTIMATE)


class SymptomKind(StrEnum):
    """Kind of a symptom."""

    REVERSED = "surface acts in the wrong direction"
    STUCK = "surface has no effect"
    HEAVY = "too heavy"
    LIGHT = "too light"
    AFLOAT = "does not leave the surface"
    CURRENT = "strong current"
    FAILSAFE = "failsafe"
    INJECTED = "fault injected by the simulator"
    REPORTED = "reported by the vehicle"
    CUT_OFF = "log ends under way"


_SURFACE_REMEDIES = {
    SymptomKind.REVERSED: "reverse the {0} (output or wiring); `ground bench-test` shows its sign",
    SymptomKind.STUCK: "check the {0} and its linkage with `ground bench-test`",
}
_TRIM_REMEDY = (
    "check that the vehicle floats level and move ballast if it does not (`ground vehicle check`"
    " predicts it); then check the elevator's linkage, output and wiring (`ground bench-test` shows"
    " its sign)"
)
"""Remedy for an elevator that does not win on one side: weight at one end has the same effect."""

_REPORT_REMEDY = "find the cause of this report before gains or trims are changed"
"""Remedy of the first report of each kind; later ones often follow from it."""
_INJECTED_REMEDY = "judge gains and trims by a dive without injected faults"


class Symptom(NamedTuple):
    """Property of a whole dive that explains errors, or that the errors do not show."""

    kind: SymptomKind
    axis: str
    """``heading`` or ``depth`` if the errors of this axis are explained; empty otherwise."""
    message: str
    remedy: str
    """Next step; empty if none is known."""


def start_s(log: Log) -> float:
    """Return the vehicle time at which the vehicle was armed, or of the log's first attitude.

    Parameters
    ----------
    log : Log
        Log of the dive.

    Returns
    -------
    float
        Time from which the times of verdicts and reports count (s).
    """
    armed_s = _armed_s(log)
    return float(log.attitude.time_s[0]) if armed_s is None else armed_s


def _armed_s(log: Log) -> float | None:
    """Return the vehicle time of the first arming; None if the log has none."""
    return next((event.time_s for event in log.events if isinstance(event.value, Armed)), None)


def _when(log: Log, time_s: float) -> str:
    """Return a vehicle time as text, from the arming or from the start of the log."""
    seconds = time_s - start_s(log)
    origin = "the start of the log" if _armed_s(log) is None else "arming"
    return f"{abs(seconds):.0f} s {'before' if seconds < -0.5 else 'after'} {origin}"


def find_symptoms(log: Log, windows: Sequence[SteadyWindow]) -> tuple[Symptom, ...]:
    """Return the symptoms of a dive, the gravest first.

    Parameters
    ----------
    log : Log
        Log of the dive.
    windows : sequence of SteadyWindow
        Stretches of constant set-points.

    Returns
    -------
    tuple of Symptom
        Surfaces first, then weight, current, failsafes and other reports, and a log that ends
        under way.
    """
    return (
        *_surfaces(log),
        *_weight(log, windows),
        *_current(log, windows),
        *_reports(log),
        *_end_under_way(log),
    )


def _end_under_way(log: Log) -> Iterator[Symptom]:
    """Yield a symptom if the log of an armed vehicle ends under water with running thruster."""
    if not names_surfaces(log.parameters) or _armed_s(log) is None:
        return
    depth_m, thrust = log.depth.depth_m, log.actuators.thrust
    if depth_m.size and thrust.size and depth_m[-1] > SUBMERGED_M and thrust[-1] > MIN_THRUST:
        end_s = float(log.attitude.time_s[-1])
        yield Symptom(
            SymptomKind.CUT_OFF,
            "",
            f"the log ends at {depth_m[-1]:.1f} m depth while the vehicle is armed,"
            f" {_when(log, end_s)}",
            "find out why the link, the simulator or the autopilot ended; the vehicle's own log"
            " shows more (`ground log download`)",
        )


def _surfaces(log: Log) -> Iterator[Symptom]:
    """Yield a symptom for a rudder or elevator without effect or with the wrong one.

    Outputs of a log that does not say which one is the rudder may belong to motors.
    """
    if not names_surfaces(log.parameters):
        return
    attitude, commands = log.attitude, log.actuators
    rows = [
        ("rudder", "heading", commands.rudder_rad, attitude.r_radps, MIN_YAW_RATE_RADPS),
        ("elevator", "depth", commands.elevator_rad, attitude.pitch_rad, MIN_PITCH_RAD),
    ]
    for surface, axis, command_rad, response, threshold in rows:
        means = _responses_when_hard_over(log, command_rad, response)
        wrong = {side: mean for side, mean in means.items() if side * mean < -threshold}
        if not wrong:
            continue
        motion = "turns" if surface == "rudder" else "pitches"
        since = _lost_at(log) if surface == "rudder" else ""
        kind = SymptomKind.REVERSED
        if len(wrong) == 2:
            cause = (
                f"the {surface} acts in the wrong direction: hard over to one side, the vehicle"
                f" {motion} to the other"
            )
        elif surface == "elevator":
            kind = SymptomKind.STUCK if len(means) == 2 else SymptomKind.REVERSED
            end = "nose" if 1 in wrong else "tail"
            cause = (
                f"the vehicle pitches against its elevator: it is {end}-heavy, or the elevator is"
                " stuck or acts in the wrong direction"
            )
        elif len(means) == 2 or since:
            kind = SymptomKind.STUCK
            cause = (
                f"the {surface} is stuck or disconnected{since}: the vehicle {motion} to one side"
                " whatever the command"
            )
        else:
            cause = (
                f"the {surface} acts in the wrong direction or is stuck: the vehicle {motion}"
                " against its command"
            )
        is_trim = surface == "elevator" and len(wrong) < 2
        remedy = _TRIM_REMEDY if is_trim else _SURFACE_REMEDIES[kind].format(surface)
        yield Symptom(kind, axis, cause, remedy)


def _responses_when_hard_over(log: Log, command_rad: Array, response: Array) -> dict[int, float]:
    """Return the mean response by the side (1 or -1) to which a surface was hard over."""
    time_s = log.actuators.time_s
    sides = np.where(np.abs(command_rad) >= HARD_OVER * log.actuators.travel_rad, 1, 0)
    sides = sides * np.sign(command_rad).astype(int)
    edges = np.flatnonzero(np.diff(sides, prepend=2))
    began_s = np.repeat(time_s[edges], np.diff(np.append(edges, sides.size)))
    depth_m = np.interp(time_s, log.depth.time_s, log.depth.depth_m)
    under_way = (depth_m > SUBMERGED_M) & (log.actuators.thrust > MIN_THRUST)
    judged = (sides != 0) & (time_s - began_s >= REACTION_S) & under_way
    values = np.interp(time_s, log.attitude.time_s, response)
    step_s = float(np.median(np.diff(time_s))) if time_s.size > 1 else 0.0
    means = {}
    for side in (1, -1):
        samples = values[judged & (sides == side)]
        if samples.size * step_s >= MIN_JUDGED_S:
            means[side] = float(np.mean(samples))
    return means


def _lost_at(log: Log) -> str:
    """Return since when the heading was no longer held, as text; empty if it never was."""
    points, attitude = log.setpoints, log.attitude
    if points.attitude_time_s.size == 0:
        return ""
    setpoint = np.interp(attitude.time_s, points.attitude_time_s, points.heading_rad)
    error = (attitude.yaw_rad - setpoint + math.pi) % (2.0 * math.pi) - math.pi
    held = np.abs(np.degrees(error)) < HELD_DEG
    edges = np.flatnonzero(np.diff(held.astype(int), prepend=0, append=0))
    last = attitude.time_s.size - 1
    ends_s = [
        float(attitude.time_s[min(end, last)])
        for start, end in zip(edges[::2], edges[1::2], strict=True)
        if attitude.time_s[min(end, last)] - attitude.time_s[start] >= HELD_S
    ]
    return f" since about {_when(log, ends_s[-1])}" if ends_s else ""


def _weight(log: Log, windows: Sequence[SteadyWindow]) -> Iterator[Symptom]:
    """Yield a symptom for a vehicle that does not dive, or flies level at a large pitch."""
    if (afloat_s := _hard_down_afloat_s(log)) >= MIN_AFLOAT_S:
        yield Symptom(
            SymptomKind.AFLOAT,
            "depth",
            f"the vehicle does not leave the surface: elevator hard down for {afloat_s:.0f} s",
            "add ballast, or fly faster",
        )
        return
    attitude = log.attitude
    pitches = [
        attitude.pitch_rad[(attitude.time_s >= w.start_s) & (attitude.time_s < w.stop_s)]
        for w in windows
    ]
    means_deg = [float(np.degrees(np.mean(pitch))) for pitch in pitches if pitch.size]
    if not means_deg:
        return
    pitch_deg = float(np.median(means_deg))
    if pitch_deg > NOSE_UP_DEG:
        yield Symptom(
            SymptomKind.HEAVY,
            "depth",
            f"the vehicle is too heavy: level flight takes {pitch_deg:.1f} deg nose up",
            "take ballast out, or fly faster",
        )
    elif pitch_deg < NOSE_DOWN_DEG:
        yield Symptom(
            SymptomKind.LIGHT,
            "depth",
            f"the vehicle is too light: level flight takes {-pitch_deg:.1f} deg nose down",
            "add ballast, or fly faster",
        )


def _hard_down_afloat_s(log: Log) -> float:
    """Return the time under way at the surface with the elevator hard down."""
    commands = log.actuators
    if not names_surfaces(log.parameters) or commands.time_s.size < 2:
        return 0.0
    depth_m = np.interp(commands.time_s, log.depth.time_s, log.depth.depth_m)
    hard_down = commands.elevator_rad <= -HARD_OVER * commands.travel_rad
    judged = hard_down & (depth_m < SUBMERGED_M) & (commands.thrust > MIN_THRUST)
    return float(np.sum(judged) * np.median(np.diff(commands.time_s)))


def _current(log: Log, windows: Sequence[SteadyWindow]) -> Iterator[Symptom]:
    """Yield a symptom for a strong current.

    Model: v = U (cos psi, sin psi) + c, with v the velocity over ground (north, east, m/s), U the
    speed through the water, psi the heading and c the current. Least squares over the steady
    windows; with one heading only the current across it is known.
    """
    velocity, attitude = log.velocity, log.attitude
    if velocity.source not in _OVER_GROUND or not windows:
        return
    inside = np.zeros(velocity.time_s.size, bool)
    for window in windows:
        inside |= (velocity.time_s >= window.start_s) & (velocity.time_s < window.stop_s)
    inside &= np.isfinite(velocity.forward_mps) & np.isfinite(velocity.starboard_mps)
    if not inside.any():
        return
    ahead, abeam = velocity.forward_mps[inside], velocity.starboard_mps[inside]
    psi = np.interp(velocity.time_s[inside], attitude.time_s, attitude.yaw_rad)
    drifts_rad = _means(windows, velocity.time_s[inside], np.arctan2(abeam, ahead))
    drift_deg = float(np.degrees(np.max(np.abs(drifts_rad))))
    headings_rad = _means(windows, velocity.time_s[inside], psi)
    turns_rad = np.angle(np.exp(1j * (headings_rad - headings_rad[0])))  # without whole turns
    if np.degrees(np.ptp(turns_rad)) < MIN_TURN_DEG:
        speed, where = abs(float(np.mean(abeam))), "across the heading"
    else:
        north = ahead * np.cos(psi) - abeam * np.sin(psi)
        east = ahead * np.sin(psi) + abeam * np.cos(psi)
        one, none = np.ones(psi.size), np.zeros(psi.size)
        matrix = np.vstack(
            [np.column_stack([np.cos(psi), one, none]), np.column_stack([np.sin(psi), none, one])]
        )
        (_, c_north, c_east), *_ = np.linalg.lstsq(matrix, np.append(north, east), rcond=None)
        speed = math.hypot(c_north, c_east)
        where = f"towards {np.rint(math.degrees(math.atan2(c_east, c_north))) % 360.0:.0f} deg"
    if speed > STRONG_CURRENT_MPS:
        yield Symptom(
            SymptomKind.CURRENT,
            "",
            f"strong current: {speed:.1f} m/s {where}; the path over ground is up to"
            f" {drift_deg:.0f} deg off the heading",
            "legs hold a heading, not a path over ground: use waypoints, or plan for the drift",
        )


def _means(windows: Sequence[SteadyWindow], time_s: Array, values: Array) -> Array:
    """Return the mean of the values in each window that has samples."""
    parts = [values[(time_s >= w.start_s) & (time_s < w.stop_s)] for w in windows]
    return np.array([float(np.mean(part)) for part in parts if part.size])


def _reports(log: Log) -> Iterator[Symptom]:
    """Yield each failsafe, injected fault and error text of the vehicle, with its first time."""
    seen: dict[str, SymptomKind] = {}
    for event in log.events:
        value = event.value
        if isinstance(value, Failsafe):
            kind, text = SymptomKind.FAILSAFE, value.text
        elif isinstance(value, InjectedFault):
            kind, text = SymptomKind.INJECTED, value.name
        elif isinstance(value, PlainText) and value.severity <= WORST_SEVERITY:
            kind, text = SymptomKind.REPORTED, value.text
        else:
            continue
        if text not in seen:
            is_injected = kind is SymptomKind.INJECTED
            remedy = _INJECTED_REMEDY if is_injected else _REPORT_REMEDY
            source = "the simulator injected a fault" if is_injected else "the vehicle reported"
            message = f"{source} {_when(log, event.time_s)}: {text}"
            yield Symptom(kind, "", message, "" if kind in seen.values() else remedy)
            seen[text] = kind
