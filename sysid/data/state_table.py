"""The state of the vehicle as one table: every signal of a log on one time base, in SI units.

Angles are radians. Axes are MAVLink's: north, east, down; forward, starboard, down. The columns are
those that the CSV reader takes (docs/logs.md), with position and set-points.
"""

import numpy as np
from numpy.typing import NDArray

from sysid.data.dataset import Array, Attitude, Log, Position
from sysid.data.events import TestAxis, TestEnded, TestStarted

COLUMNS = (
    "time_s",
    "north_m",
    "east_m",
    "depth_m",
    "depth_rate_mps",
    "roll_rad",
    "pitch_rad",
    "heading_rad",
    "p_radps",
    "q_radps",
    "r_radps",
    "u_mps",
    "v_mps",
    "w_mps",
    "rudder_rad",
    "elevator_rad",
    "thrust_pct",
    "heading_setpoint_rad",
    "pitch_setpoint_rad",
    "depth_setpoint_m",
)
"""Names of the columns, in their order."""
_TEXT_OF_AXIS = {
    TestAxis.RUDDER: "rudder",
    TestAxis.ELEVATOR: "elevator",
    TestAxis.BOTH: "both",
}


def state_table(log: Log) -> dict[str, Array]:
    """Return the state of the vehicle at the times of its attitude.

    Parameters
    ----------
    log : Log
        A recorded dive.

    Returns
    -------
    dict
        Arrays of equal length by the names of `COLUMNS`. Measured values are interpolated;
        commands and set-points are the latest ones. NaN where the log has no value: before the
        first sample, and for signals that it lacks. Attitude and depth that are zero throughout
        are lacking. ``heading_rad`` lies in 0 to 2 pi. Without a recorded position, north and east
        are integrated from velocity and attitude.
    """
    attitude, time_s = log.attitude, log.attitude.time_s
    depth, actuators, setpoints, velocity = log.depth, log.actuators, log.setpoints, log.velocity
    body = [
        _interpolated(time_s, velocity.time_s, axis)
        for axis in (velocity.forward_mps, velocity.starboard_mps, velocity.down_mps)
    ]
    position = log.position if log.position.time_s.size else _dead_reckoned(attitude, body)
    values = (
        time_s,
        _interpolated(time_s, position.time_s, position.north_m),
        _interpolated(time_s, position.time_s, position.east_m),
        _interpolated(time_s, depth.time_s, _nan_if_zero(depth.depth_m)),
        _interpolated(time_s, depth.time_s, _nan_if_zero(depth.rate_mps)),
        _nan_if_zero(attitude.roll_rad),
        _nan_if_zero(attitude.pitch_rad),
        np.mod(_nan_if_zero(attitude.yaw_rad), 2 * np.pi),
        _nan_if_zero(attitude.p_radps),
        _nan_if_zero(attitude.q_radps),
        _nan_if_zero(attitude.r_radps),
        *body,
        _latest(time_s, actuators.time_s, actuators.rudder_rad),
        _latest(time_s, actuators.time_s, actuators.elevator_rad),
        100.0 * _latest(time_s, actuators.time_s, actuators.thrust),
        np.mod(
            _latest(time_s, setpoints.attitude_time_s, setpoints.heading_rad),
            2 * np.pi,
        ),
        _latest(time_s, setpoints.attitude_time_s, setpoints.pitch_rad),
        _latest(time_s, setpoints.depth_time_s, setpoints.depth_m),
    )
    return dict(zip(COLUMNS, values, strict=True))


def tested_surfaces(log: Log) -> list[str]:
    """Return the surface under test at the times of the attitude.

    Parameters
    ----------
    log : Log
        A recorded dive.

    Returns
    -------
    list of str
        "rudder", "elevator", "both" or "", as in the column ``test`` of a CSV log.
    """
    time_s = log.attitude.time_s
    surfaces = np.full(time_s.size, "", dtype="U8")
    for event in log.events:
        if isinstance(event.value, TestStarted):
            surfaces[time_s >= event.time_s] = _TEXT_OF_AXIS.get(event.value.axis, "")
        elif isinstance(event.value, TestEnded):
            surfaces[time_s >= event.time_s] = ""
    return [str(surface) for surface in surfaces]


def _nan_if_zero(samples: Array) -> Array:
    """Return samples; NaN for zeros throughout, by which readers replace a missing signal."""
    return samples if np.any(samples) else np.full(samples.size, np.nan)


def _interpolated(time_s: Array, sample_s: Array, samples: Array) -> Array:
    """Return samples at other times by linear interpolation, NaN outside their range."""
    if not sample_s.size:
        return np.full(time_s.size, np.nan)
    return np.interp(time_s, sample_s, samples, left=np.nan, right=np.nan)


def _latest(time_s: Array, sample_s: Array, samples: Array) -> Array:
    """Return the latest sample at each time, NaN before the first."""
    if not sample_s.size:
        return np.full(time_s.size, np.nan)
    index: NDArray[np.int64] = np.searchsorted(sample_s, time_s, side="right") - 1
    return np.where(index >= 0, samples[np.maximum(index, 0)], np.nan)


def _dead_reckoned(attitude: Attitude, body_mps: list[Array]) -> Position:
    """Return the position from velocity and attitude; empty without a velocity.

    u, v, w velocity in body axes (FRD, m/s), phi, theta, psi roll, pitch and yaw (rad):
    north and east are the first two rows of R(phi, theta, psi) [u v w] (Fossen 2011, eq. 2.18),
    integrated by the trapezoidal rule. Unknown v and w count as zero.
    """
    u, v, w = body_mps
    if not np.isfinite(u).any():
        return Position()
    u, v, w = (np.nan_to_num(axis) for axis in (u, v, w))
    phi, theta, psi = attitude.roll_rad, attitude.pitch_rad, attitude.yaw_rad
    across = u * np.cos(theta) + (v * np.sin(phi) + w * np.cos(phi)) * np.sin(theta)
    sideways = v * np.cos(phi) - w * np.sin(phi)
    north_mps = np.cos(psi) * across - np.sin(psi) * sideways
    east_mps = np.sin(psi) * across + np.cos(psi) * sideways
    return Position(
        attitude.time_s,
        _integral(attitude.time_s, north_mps),
        _integral(attitude.time_s, east_mps),
    )


def _integral(time_s: Array, rate: Array) -> Array:
    """Return the integral of a rate from the first sample, by the trapezoidal rule."""
    steps = np.diff(time_s) * (rate[1:] + rate[:-1]) / 2
    return np.concatenate(([0.0], np.cumsum(steps)))
