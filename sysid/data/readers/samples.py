"""Common functions of the readers: time stamps, resampling, attitude angles, content hash."""

import hashlib
import json
import re
from bisect import bisect_left
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.data.dataset import (
    Actuators,
    Array,
    Attitude,
    Clock,
    ClockStep,
    Depth,
    DuctAngles,
    Log,
    LogEvent,
    Setpoints,
    SpecificForce,
    Velocity,
    VelocitySource,
)

CLOCK_STEP_SAMPLES = 5
"""Number of consecutive samples older than an earlier one that counts as a backward clock step.

Fewer such samples are late datagrams."""
_PARAMETER_NAME = re.compile(r"[A-Z0-9_]+")
GAP_INTERVALS = 1.9
"""Interval of two samples, in usual intervals, from which on samples are lost."""
MAX_ABS_VALUE = 1e9
"""Largest value of a measurement in any unit that logs use (mm, cm/s, deg, rad)."""
MAX_TIME_DIFFERENCE_S = 0.1
"""Maximum time difference of corresponding samples of two streams."""


class FileDamage(NamedTuple):
    """Bytes of a file that belong to no message."""

    skipped_bytes: int = 0
    """Number of such bytes before the last whole message."""
    places: int = 0
    """Number of places with such bytes before the last whole message."""
    trailing_bytes: int = 0
    """Number of such bytes at the end: the file ends within a message."""
    dropouts_s: tuple[float, ...] = ()
    """Durations in which the vehicle's logger reports that it lost messages, s."""
    contradicted_s: tuple[float, ...] = ()
    """Times before samples that their neighbours contradict and that were left out, s."""
    impossible_names: int = 0
    """Number of names and texts with characters that none has, or that differ in one bit from one
    that is read and is missing."""
    texts: tuple[str, ...] = ()
    """Further damage in words."""


NO_DAMAGE = FileDamage()
"""Damage of a whole file."""


def is_parameter_name(name: str) -> bool:
    """Return whether ArduPilot or PX4 may have a parameter of this name.

    Parameters
    ----------
    name : str
        Name in a log.

    Returns
    -------
    bool
        False if it is empty or has other characters than capital letters, digits and underscores.
    """
    return _PARAMETER_NAME.fullmatch(name) is not None


def format_damage(damage: FileDamage, time_s: Array) -> str:
    """Return the damaged places of a file and the time that is lost, in one line.

    Parameters
    ----------
    damage : FileDamage
        Bytes that belong to no message.
    time_s : ndarray, shape (n,)
        Times of the samples of one regular message, which show the gaps.

    Returns
    -------
    str
        Empty for a whole file.
    """
    texts = []
    if damage.places:
        places = "1 place" if damage.places == 1 else f"{damage.places} places"
        texts.append(
            f"{damage.skipped_bytes} bytes in {places} are unreadable, {_format_gaps(time_s)}"
        )
    if damage.dropouts_s:
        count, lost_s = len(damage.dropouts_s), sum(damage.dropouts_s)
        dropouts = "1 dropout" if count == 1 else f"{count} dropouts"
        texts.append(f"the vehicle's logger lost {lost_s:.2g} s in {dropouts}")
    if times_s := damage.contradicted_s:
        samples = "1 sample is" if len(times_s) == 1 else f"{len(times_s)} samples are"
        where = f"at {times_s[0]:.1f} s"
        if len(times_s) > 1:
            where = f"between {times_s[0]:.1f} and {times_s[-1]:.1f} s"
        texts.append(f"{samples} contradicted by the ones around and left out, {where}")
    if count := damage.impossible_names:
        names = "1 name or text is" if count == 1 else f"{count} names or texts are"
        texts.append(f"{names} damaged: a message or a parameter may be missing")
    if damage.trailing_bytes:
        texts.append(
            f"it ends within a message ({damage.trailing_bytes} bytes) at {time_s[-1]:.1f} s;"
            " what followed is lost"
        )
    return "; ".join((*texts, *damage.texts))


def _format_gaps(time_s: Array) -> str:
    """Return the time that is missing in a regular series, and where."""
    intervals_s = np.diff(time_s)
    usual_s = float(np.median(intervals_s)) if intervals_s.size else 0.0
    gaps = np.flatnonzero(intervals_s > GAP_INTERVALS * usual_s)
    if not gaps.size:
        return "no time is lost"
    lost_s = float(np.sum(intervals_s[gaps])) - usual_s * gaps.size
    where = (
        f"at {time_s[gaps[0]]:.1f} s"
        if gaps.size == 1
        else (f"between {time_s[gaps[0]]:.1f} and {time_s[gaps[-1] + 1]:.1f} s")
    )
    return f"{lost_s:.2f} s are lost {where}"


class MessageColumns(NamedTuple):
    """All messages of one name as columns of the length of ``time_s``; text is bytes."""

    time_s: Array
    columns: Mapping[str, NDArray[Any]]


def strictly_increasing(time_s: Array) -> NDArray[np.bool_]:
    """Return a mask of samples later than all before; repeated and late samples are excluded.

    Single samples with a time far ahead are excluded too (`ahead_of_others`).
    """
    fitting = ~ahead_of_others(time_s)
    latest = np.maximum.accumulate(np.where(fitting, time_s, -np.inf))
    return fitting & np.concatenate(([True], time_s[1:] > latest[:-1]))[: time_s.size]


def ahead_of_others(time_s: Array) -> NDArray[np.bool_]:
    """Return a mask of single samples with a time far ahead of those that follow.

    Such a sample is none of the longest strictly increasing subsequence and is later than
    CLOCK_STEP_SAMPLES samples of it that follow. So many in a row are a clock step, and stay.

    Parameters
    ----------
    time_s : ndarray, shape (n,)
        Times in the order of the file.

    Returns
    -------
    ndarray of bool, shape (n,)
        Mask; false throughout for times that are in order but for late and repeated ones.
    """
    nothing = np.zeros(time_s.size, bool)
    late = time_s < np.maximum.accumulate(time_s)
    if np.count_nonzero(late) < CLOCK_STEP_SAMPLES:
        return nothing
    regular = nothing.copy()
    regular[_longest_increasing(time_s.tolist())] = True
    earlier = np.searchsorted(time_s[regular], time_s)
    ahead: NDArray[np.bool_] = ~regular & (earlier - np.cumsum(regular) >= CLOCK_STEP_SAMPLES)
    return ahead & ~_in_long_series(ahead)


def _longest_increasing(values: Sequence[float]) -> list[int]:
    """Return the indices of the longest strictly increasing subsequence.

    Source: Fredman 1975, "On computing the length of longest increasing subsequences".
    """
    last: list[float] = []  # smallest last value of an increasing subsequence, by its length - 1
    last_index: list[int] = []
    previous = [-1] * len(values)
    for index, value in enumerate(values):
        length = bisect_left(last, value)
        if length == len(last):
            last.append(value)
            last_index.append(index)
        elif value < last[length]:  # of equal values the first one stays
            last[length], last_index[length] = value, index
        else:
            continue
        previous[index] = last_index[length - 1] if length else -1
    chain, index = list[int](), last_index[-1] if last_index else -1
    while index >= 0:
        chain.append(index)
        index = previous[index]
    return chain[::-1]


def out_of_order(time_s: Array) -> NDArray[np.bool_]:
    """Return a mask of single samples with a time far ahead, or earlier than one before.

    Repeated times, and CLOCK_STEP_SAMPLES earlier ones in a row, which are a clock step, are in
    order.

    Parameters
    ----------
    time_s : ndarray, shape (n,)
        Times in the order of the file.

    Returns
    -------
    ndarray of bool, shape (n,)
        Mask.
    """
    ahead = ahead_of_others(time_s)
    late = time_s < np.maximum.accumulate(np.where(ahead, -np.inf, time_s))
    return ahead | (late & ~_in_long_series(late))


def without_ahead(table: MessageColumns) -> tuple[MessageColumns, list[float]]:
    """Return a table without single samples far ahead, and the times before those, s.

    Parameters
    ----------
    table : MessageColumns
        Messages in the order of the file.

    Returns
    -------
    MessageColumns
        The other messages.
    list of float
        Time of the sample before each sample that is left out.
    """
    ahead = ahead_of_others(table.time_s)
    if not ahead.any():
        return table, []
    columns = {name: values[~ahead] for name, values in table.columns.items()}
    return MessageColumns(table.time_s[~ahead], columns), times_before(ahead, table.time_s)


def times_before(mask: NDArray[np.bool_], time_s: Array) -> list[float]:
    """Return the time of the last sample outside a mask before each sample of it, s.

    Parameters
    ----------
    mask : ndarray of bool, shape (n,)
        Samples whose own time may be wrong.
    time_s : ndarray, shape (n,)
        Times.

    Returns
    -------
    list of float
        Times; that of the first sample outside the mask where none is before.
    """
    others_s = time_s[~mask]
    before = np.cumsum(~mask)[mask] - 1
    return [float(t) for t in others_s[np.maximum(before, 0)]] if others_s.size else []


def _in_long_series(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return a mask of the samples in series of at least CLOCK_STEP_SAMPLES that are true."""
    result = np.zeros(mask.size, bool)
    for first, end in _series(mask):
        result[first:end] = end - first >= CLOCK_STEP_SAMPLES
    return result


def _series(mask: NDArray[np.bool_]) -> Iterator[tuple[int, int]]:
    """Yield the first index and the end of each series of samples that are true."""
    edges = np.flatnonzero(np.diff(np.concatenate(([0], mask.astype(np.int8), [0]))))
    yield from zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True)


def usable(time_s: Array, *columns: NDArray[Any]) -> NDArray[np.bool_]:
    """Return a mask of samples with finite values, each later than all usable ones before it.

    Values beyond MAX_ABS_VALUE are no measurements.
    """
    finite = np.isfinite(time_s)
    for column in columns:
        finite &= np.isfinite(column) & (np.abs(column) <= MAX_ABS_VALUE)
    finite[finite] = strictly_increasing(time_s[finite])
    return finite


def clock_steps(message: str, time_s: Array) -> list[ClockStep]:
    """Return the backward steps of a clock, e.g. by a restart of the autopilot.

    Parameters
    ----------
    message : str
        Name of the message.
    time_s : ndarray, shape (n,)
        Its times in the order of the file.

    Returns
    -------
    list of ClockStep
        Steps after which at least CLOCK_STEP_SAMPLES samples are earlier.
    """
    time_s = time_s[~ahead_of_others(time_s)]
    stale = ~strictly_increasing(time_s)
    latest = np.maximum.accumulate(time_s)
    return [
        ClockStep(
            message=message,
            time_s=float(latest[first]),
            back_s=float(latest[first] - time_s[first]),
        )
        for first, end in _series(stale)
        if end - first >= CLOCK_STEP_SAMPLES and latest[first] > time_s[first]
    ]


def sample_nearest(time_s: Array, other_s: Array, values: Array) -> tuple[NDArray[np.bool_], Array]:
    """Return (mask, values) of another stream at the times of this one.

    The mask is true where the other stream has a sample within MAX_TIME_DIFFERENCE_S; the values
    are interpolated linearly.
    """
    if other_s.size < 2:
        return np.zeros(time_s.size, bool), np.zeros(time_s.size)
    after = np.clip(np.searchsorted(other_s, time_s), 1, other_s.size - 1)
    nearest = np.minimum(np.abs(time_s - other_s[after - 1]), np.abs(time_s - other_s[after]))
    return nearest <= MAX_TIME_DIFFERENCE_S, np.interp(time_s, other_s, values)


def euler_rad(w: Array, x: Array, y: Array, z: Array) -> tuple[Array, Array, Array]:
    """Return roll, pitch and yaw (rad) of a quaternion from FRD to NED.

    Source: Diebel 2006, equation 290.
    """
    roll = np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    pitch = np.arcsin(np.clip(2.0 * (w * y - z * x), -1.0, 1.0))
    return roll, pitch, np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def derivative(time_s: Array, values: Array) -> Array:
    """Return the time derivative by central differences; zero for fewer than two samples."""
    return np.gradient(values, time_s) if time_s.size > 1 else np.zeros(values.size)


def zero_depth(time_s: Array) -> Depth:
    """Return the depth of a log without one: zero throughout.

    Tests of the rudder need no depth; screening rejects those of the elevator.
    """
    return Depth(time_s, np.zeros(time_s.size), np.zeros(time_s.size))


def attitude_of_angles(time_s: Array, angles_rad: Sequence[Array]) -> Attitude:
    """Return roll, pitch and yaw with the rates by their differences, for a log without rates."""
    roll, pitch, yaw = angles_rad
    return _attitude(time_s, angles_rad, body_rates(time_s, roll, pitch, np.unwrap(yaw)))


def attitude_with_rates(
    time_s: Array, angles_rad: Sequence[Array], rates_s: Array, rates_radps: Sequence[Array]
) -> Attitude:
    """Return roll, pitch and yaw at the times that have body rates; empty without any."""
    known = usable(rates_s, *rates_radps)
    nearest = [sample_nearest(time_s, rates_s[known], rate[known]) for rate in rates_radps]
    near = nearest[0][0]
    angles = [angle[near] for angle in angles_rad]
    return _attitude(time_s[near], angles, [rate[near] for _, rate in nearest])


def _attitude(time_s: Array, angles_rad: Sequence[Array], rates_radps: Sequence[Array]) -> Attitude:
    """Return the record of roll, pitch, yaw and body rates, with the yaw unwrapped."""
    roll, pitch, yaw = angles_rad
    p, q, r = rates_radps
    return Attitude(
        time_s=time_s,
        roll_rad=roll,
        pitch_rad=pitch,
        yaw_rad=np.unwrap(yaw),
        p_radps=p,
        q_radps=q,
        r_radps=r,
    )


def body_rates(time_s: Array, roll: Array, pitch: Array, yaw: Array) -> tuple[Array, Array, Array]:
    """Return body rates p, q, r (rad/s) from angles (rad, yaw unwrapped).

    Source: Fossen 2021, equation 2.41, inverted.
    """
    roll_rate, pitch_rate, yaw_rate = (derivative(time_s, angle) for angle in (roll, pitch, yaw))
    p = roll_rate - yaw_rate * np.sin(pitch)
    q = pitch_rate * np.cos(roll) + yaw_rate * np.cos(pitch) * np.sin(roll)
    r = yaw_rate * np.cos(pitch) * np.cos(roll) - pitch_rate * np.sin(roll)
    return p, q, r


def body_velocity(
    attitude: Attitude, time_s: Array, north_mps: Array, east_mps: Array, down_mps: Array
) -> Velocity:
    """Return a velocity in body axes from one in NED, rotated with the attitude at its times.

    A horizontal velocity that never changes is the output of an estimator without a measurement;
    the result is empty then. Source: Fossen 2021, equation 2.31, transposed.
    """
    keep = usable(time_s, north_mps, east_mps, down_mps)
    time_s, north, east, down = (x[keep] for x in (time_s, north_mps, east_mps, down_mps))
    if time_s.size < 2 or not (np.ptp(north) or np.ptp(east)):
        return Velocity()
    roll, pitch, yaw = (
        np.interp(time_s, attitude.time_s, angle)
        for angle in (attitude.roll_rad, attitude.pitch_rad, attitude.yaw_rad)
    )
    ahead = north * np.cos(yaw) + east * np.sin(yaw)
    abeam = east * np.cos(yaw) - north * np.sin(yaw)
    below = ahead * np.sin(pitch) + down * np.cos(pitch)
    return Velocity(
        time_s=time_s,
        forward_mps=ahead * np.cos(pitch) - down * np.sin(pitch),
        starboard_mps=abeam * np.cos(roll) + below * np.sin(roll),
        down_mps=below * np.cos(roll) - abeam * np.sin(roll),
        source=VelocitySource.ESTIMATE,
    )


def ground_speed(time_s: Array, speed_mps: Array) -> Velocity:
    """Return a velocity of which only the speed over ground is known; empty if it is constant."""
    keep = usable(time_s, speed_mps)
    if np.count_nonzero(keep) < 2 or not np.ptp(speed_mps[keep]):
        return Velocity()
    unknown = np.full(np.count_nonzero(keep), np.nan)
    return Velocity(
        time_s=time_s[keep],
        forward_mps=speed_mps[keep],
        starboard_mps=unknown,
        down_mps=unknown,
        source=VelocitySource.GROUND_SPEED,
    )


def accelerometer(time_s: Array, *axes_mps2: Array) -> SpecificForce:
    """Return the usable samples of an accelerometer with the axes x, y and z.

    Axes that never change belong to no sensor; the result is empty then.
    """
    keep = usable(time_s, *axes_mps2)
    if np.count_nonzero(keep) < 2 or not any(np.ptp(axis[keep]) for axis in axes_mps2):
        return SpecificForce()
    return SpecificForce(time_s[keep], *(axis[keep] for axis in axes_mps2))


def content_sha256(parts: Mapping[str, bytes], parameters: Mapping[str, float]) -> str:
    """Return the SHA-256 of the data that identification reads and of the parameters.

    The wall-clock time in the file is excluded: a repeated simulation has the same hash.
    """
    total = hashlib.sha256(json.dumps(parameters, sort_keys=True).encode())
    for name in sorted(parts):
        total.update(name.encode())
        total.update(parts[name])
    return total.hexdigest()


def foreign_log(
    path: Path,
    *,
    attitude: Attitude,
    actuators: Actuators,
    depth: Depth,
    setpoints: Setpoints,
    events: tuple[LogEvent, ...],
    parameters: dict[str, float],
    steps: Iterable[ClockStep],
    damage: str = "",
    velocity: Velocity | None = None,
    specific_force: SpecificForce | None = None,
) -> Log:
    """Return the log of another autopilot, which has one clock and no duct encoder."""
    parts = {"attitude": attitude, "actuators": actuators, "depth": depth}
    read_from = {
        f"{part}.{name}": values.tobytes()
        for part, record in parts.items()
        for name, values in vars(record).items()
        if isinstance(values, np.ndarray)
    }
    return Log(
        name=path.name,
        sha256=content_sha256(read_from, parameters),
        attitude=attitude,
        actuators=actuators,
        depth=depth,
        setpoints=setpoints,
        events=events,
        parameters=parameters,
        duct=DuctAngles(*(np.empty(0),) * 3),
        clock=Clock(tuple(steps)),
        damage=damage,
        velocity=velocity or Velocity(),
        specific_force=specific_force or SpecificForce(),
    )
