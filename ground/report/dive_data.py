"""Content of a dive's report: log, assessment, track and events on one time axis."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ground.client import assessment, dive_symptoms
from ground.client.assessment import Assessment
from sysid.data import readers
from sysid.data.dataset import Log, VelocitySource
from sysid.data.events import (
    Armed,
    Failsafe,
    InjectedFault,
    ModeChanged,
    PlainText,
    TestEnded,
    TestStarted,
    TrimLearned,
    VehicleEvent,
)
from sysid.data.readers.servo_channels import FROM_LOG, OutputOptions, names_surfaces

Array = NDArray[np.float64]

ASSUMED_SPEED_MPS = 1.0
"""Speed of the track of a log without any velocity: its shape is right, its scale is not."""
TRACK_STEP_S = 0.1
"""Integration step of the track: positions change by 0.2 m at most."""


class DiveEvent(NamedTuple):
    """Event of a dive for charts and tables."""

    time_s: float
    """Time since the vehicle was armed."""
    kind: str
    """``mode``, ``test``, ``failsafe`` or ``text``."""
    text: str


class Track(NamedTuple):
    """Path of the vehicle; arrays of equal length."""

    time_s: Array
    """Time since the vehicle was armed."""
    north_m: Array
    east_m: Array
    depth_m: Array
    source: str
    """How the horizontal position was computed."""


class ReportedDive(NamedTuple):
    """One log with all that its report shows."""

    label: str
    """Short name, unique among the dives of a report."""
    path: Path
    log: Log
    start_s: float
    """Vehicle time at which the vehicle was armed; first sample of the log without arming."""
    assessment: Assessment
    track: Track
    events: tuple[DiveEvent, ...]
    names_surfaces: bool = True
    """Whether it is known which outputs are rudder, elevator and thrust."""


def read_dives(paths: Sequence[Path], options: OutputOptions = FROM_LOG) -> list[ReportedDive]:
    """Read and assess the dives of a report.

    Parameters
    ----------
    paths : sequence of Path
        Logs of any format that `sysid.data.readers` reads.
    options : OutputOptions
        Output numbers of rudder, elevator and thrust of a log without them.

    Returns
    -------
    list of ReportedDive
        Dives in the order of the paths.

    Raises
    ------
    LogError
        A log cannot be read.
    """
    return [
        reported_dive(path, label, readers.read(path, options), options)
        for path, label in zip(paths, _labels(paths), strict=True)
    ]


def _labels(paths: Sequence[Path]) -> list[str]:
    """Return file names, with their folders where names are equal, and numbers as a last resort."""
    names = [path.name for path in paths]
    if len(set(names)) < len(names):
        names = [f"{path.resolve().parent.name}/{path.name}" for path in paths]
    if len(set(names)) < len(names):
        names = [f"{number}: {name}" for number, name in enumerate(names, 1)]
    return names


def reported_dive(
    path: Path, label: str, log: Log, options: OutputOptions = FROM_LOG
) -> ReportedDive:
    """Return one dive with its assessment, track and events.

    Parameters
    ----------
    path : Path
        File of the log.
    label : str
        Short name of the dive.
    log : Log
        Content of the file.
    options : OutputOptions
        Options with which it was read.

    Returns
    -------
    ReportedDive
        Everything that the report shows.
    """
    start_s = dive_symptoms.start_s(log)
    learned = [event.value.text for event in log.events if isinstance(event.value, TrimLearned)]
    return ReportedDive(
        label=label,
        path=path,
        log=log,
        start_s=start_s,
        assessment=assessment.assess_read_log(log, learned[-1] if learned else ""),
        track=integrate_track(log, start_s),
        events=tuple(
            DiveEvent(event.time_s - start_s, *describe(event.value)) for event in log.events
        ),
        names_surfaces=(
            options.channels is not None
            or path.suffix.lower() == ".csv"
            or names_surfaces(log.parameters)
        ),
    )


def describe(value: VehicleEvent) -> tuple[str, str]:
    """Return kind and text of an event.

    Parameters
    ----------
    value : VehicleEvent
        Event of a log.

    Returns
    -------
    tuple of str
        Kind as in `DiveEvent`, and text.
    """
    match value:
        case ModeChanged(mode):
            return "mode", f"mode {mode.name if mode else 'of another autopilot'}"
        case Armed():
            return "mode", "armed"
        case TestStarted():
            size = "" if value.magnitude is None else f" {value.magnitude:g}"
            return "test", f"test: {value.axis.name.lower().replace('_', ' ')} {value.wave}{size}"
        case TestEnded():
            return "test", f"test ended{': ' + value.detail if value.detail else ''}"
        case Failsafe():
            return "failsafe", value.text
        case TrimLearned():
            return "text", f"trim learned: {value.text}"
        case InjectedFault():
            return "text", f"fault injected: {value.name}"
        case PlainText():
            return "text", value.text


def integrate_track(log: Log, start_s: float) -> Track:
    """Return the path by dead reckoning from the log's velocity and attitude.

    Parameters
    ----------
    log : Log
        Log with or without a velocity.
    start_s : float
        Vehicle time at which the track begins at (0, 0).

    Returns
    -------
    Track
        Samples every `TRACK_STEP_S`, fewer for logs of more than an hour.

    Notes
    -----
    d(north, east)/dt = R_z(psi) R_y(theta) R_x(phi) (u, v, w), horizontal part (Fossen 2021,
    equation 2.31); u, v, w: velocity forward, starboard, down (m/s). Where only the speed is
    known, it is along the heading.
    """
    attitude, velocity = log.attitude, log.velocity
    time_s = _grid(log, start_s)
    roll, pitch, yaw = (
        np.interp(time_s, attitude.time_s, angle)
        for angle in (attitude.roll_rad, attitude.pitch_rad, attitude.yaw_rad)
    )
    u, v, w = (
        _at(time_s, velocity.time_s, axis)
        for axis in (velocity.forward_mps, velocity.starboard_mps, velocity.down_mps)
    )
    source = f"integrated from the velocity ({velocity.source})"
    if velocity.source in (VelocitySource.NONE, VelocitySource.GROUND_SPEED) or not u.any():
        if velocity.source is not VelocitySource.GROUND_SPEED:
            thrust = np.interp(time_s, log.actuators.time_s, log.actuators.thrust)
            u = np.where(thrust > 0.0, ASSUMED_SPEED_MPS, 0.0)
            source = (
                f"heading at an assumed {ASSUMED_SPEED_MPS:g} m/s ahead while the thrust is"
                " positive, as the log has no velocity"
            )
        v, w = np.zeros(time_s.size), np.zeros(time_s.size)
    below = v * np.sin(roll) + w * np.cos(roll)
    ahead = u * np.cos(pitch) + below * np.sin(pitch)
    abeam = v * np.cos(roll) - w * np.sin(roll)
    step_s = np.diff(time_s, prepend=time_s[0])
    return Track(
        time_s=time_s - start_s,
        north_m=np.cumsum(step_s * (ahead * np.cos(yaw) - abeam * np.sin(yaw))),
        east_m=np.cumsum(step_s * (ahead * np.sin(yaw) + abeam * np.cos(yaw))),
        depth_m=np.interp(time_s, log.depth.time_s, log.depth.depth_m),
        source=source,
    )


def _grid(log: Log, start_s: float) -> Array:
    """Return the sample times of the track, from the arming to the last attitude."""
    end_s = float(log.attitude.time_s[-1])
    begin_s = min(start_s, end_s)
    count = int(np.clip(math.ceil((end_s - begin_s) / TRACK_STEP_S), 1, 200_000)) + 1
    return np.linspace(begin_s, end_s, count)


def _at(time_s: Array, sample_s: Array, values: Array) -> Array:
    """Return values at times, 0 where nothing finite is known; a gap is interpolated."""
    known = np.isfinite(values)
    if not known.any():
        return np.zeros(time_s.size)
    return np.interp(time_s, sample_s[known], values[known])
