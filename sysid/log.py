"""A recorded dive as arrays: MCAP written by ground (or anyone who follows its log contract) to a ``Log``.

Axes are MAVLink's: NED and FRD, depth positive down, heading clockwise from north. Time is vehicle time in seconds.
"""

import hashlib
import json
import math
from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sysid import ros1

Array = NDArray[np.float64]

DEFAULT_TRAVEL_DEG = 15.0
"""Duct travel that a control of 1 stands for, unless the log's parameters say otherwise (ACT_TRAVEL_DEG)."""

_WANTED = (
    "ATTITUDE",
    "ACTUATOR_OUTPUT_STATUS",
    "LOCAL_POSITION_NED",
    "ATTITUDE_TARGET",
    "POSITION_TARGET_LOCAL_NED",
    "STATUSTEXT",
)
_NEEDED = _WANTED[:3]
_DUCT = "duct"
"""The name here of what the tailcone's component sends under the name of the autopilot's own message."""
_DUCT_COMPONENT = "140"
"""MAV_COMP_ID_SERVO1."""


class LogError(ValueError):
    """A file that is no usable log; the message names the file, what is wrong and what would be right."""


@dataclass(frozen=True)
class Attitude:
    """ATTITUDE; arrays of equal length. Yaw is unwrapped."""

    time_s: Array
    roll_rad: Array
    pitch_rad: Array
    yaw_rad: Array
    p_radps: Array
    q_radps: Array
    r_radps: Array


@dataclass(frozen=True)
class Actuators:
    """ACTUATOR_OUTPUT_STATUS: what was commanded, after the autopilot's limits."""

    time_s: Array
    rudder_rad: Array
    elevator_rad: Array
    thrust: Array
    """Fraction of full thrust, -1..1."""


@dataclass(frozen=True)
class Duct:
    """ACTUATOR_OUTPUT_STATUS of the tailcone's own encoder: where the duct really stood. Empty where it has none."""

    time_s: Array
    rudder_rad: Array
    elevator_rad: Array


@dataclass(frozen=True)
class Depth:
    """LOCAL_POSITION_NED: depth and its rate, positive down."""

    time_s: Array
    depth_m: Array
    rate_mps: Array


@dataclass(frozen=True)
class Setpoints:
    """ATTITUDE_TARGET and POSITION_TARGET_LOCAL_NED. Arrays are empty where the log has none."""

    attitude_time_s: Array
    heading_rad: Array
    """Unwrapped."""
    pitch_rad: Array
    depth_time_s: Array
    depth_m: Array


@dataclass(frozen=True)
class Event:
    """One STATUSTEXT, its chunks joined."""

    time_s: float
    severity: int
    text: str


@dataclass(frozen=True)
class Log:
    name: str
    sha256: str
    """Of the vehicle's messages and parameters, whenever and wherever they were recorded."""
    attitude: Attitude
    actuators: Actuators
    depth: Depth
    setpoints: Setpoints
    events: tuple[Event, ...]
    parameters: dict[str, float]
    duct: Duct


def read(path: str | Path) -> Log:
    """Read one MCAP log.

    Raises:
        LogError: the file is missing, unfinished, no MCAP, or lacks a message that identification needs.
    """
    path = Path(path)
    messages, parameters, digest = _load(path)
    missing = [name for name in _NEEDED if name not in messages]
    if missing:
        raise LogError(f"{path}: holds no {', '.join(missing)} of a vehicle; identification needs {', '.join(_NEEDED)}")
    travel_rad = math.radians(parameters.get("ACT_TRAVEL_DEG", DEFAULT_TRAVEL_DEG))
    return Log(
        name=path.name,
        sha256=digest,
        attitude=_attitude(*messages["ATTITUDE"]),
        actuators=_actuators(*messages["ACTUATOR_OUTPUT_STATUS"], travel_rad),
        depth=_depth(*messages["LOCAL_POSITION_NED"]),
        setpoints=_setpoints(messages),
        events=_events(*messages["STATUSTEXT"]) if "STATUSTEXT" in messages else (),
        parameters=parameters,
        duct=_duct(*messages[_DUCT], travel_rad) if _DUCT in messages else Duct(*(np.empty(0),) * 3),
    )


Messages = dict[str, tuple[Array, NDArray[Any]]]


def _load(path: Path) -> tuple[Messages, dict[str, float], str]:
    """Vehicle times and records by message name, the parameters, and the digest of both."""
    from mcap.exceptions import McapError
    from mcap.reader import make_reader

    try:
        with path.open("rb") as stream:
            reader = make_reader(stream)
            if reader.get_summary() is None:
                raise LogError(f"{path}: was never finished; `ground log recover` makes it readable")
            messages = _channels(reader, path)
            parameters = _parameters(reader, path)
    except McapError as error:
        raise LogError(f"{path}: is no readable MCAP file ({error}); `ground log recover` mends a cut one") from None
    except OSError as error:
        raise LogError(f"{path}: {error.strerror}; give an MCAP log") from None
    return messages, parameters, _digest(messages, parameters)


def _digest(messages: Messages, parameters: dict[str, float]) -> str:
    """SHA-256 of what identification reads: every payload, and the parameters.

    Not of the file, which also carries the wall clock: a dive that is flown again has the same digest.
    """
    digest = hashlib.sha256(json.dumps(parameters, sort_keys=True).encode())
    for name in sorted(messages):
        digest.update(name.encode())
        digest.update(messages[name][1].tobytes())
    return digest.hexdigest()


def _channels(reader: Any, path: Path) -> Messages:
    topics = _vehicle_topics(reader, path)
    payloads: dict[str, list[bytes]] = defaultdict(list)
    stamps: dict[str, list[int]] = defaultdict(list)
    schemas: dict[str, str] = {}
    for schema, channel, message in reader.iter_messages(topics=list(topics), log_time_order=False):
        name = topics[channel.topic]
        payloads[name].append(message.data)
        stamps[name].append(message.log_time)
        if name not in schemas:
            schemas[name] = schema.data.decode()
    try:
        records = {name: ros1.decode(payloads[name], ros1.record_type(schemas[name])) for name in payloads}
    except ValueError as error:
        raise LogError(f"{path}: {error}") from None
    start_ns = _start_ns(records, stamps, path)

    def seconds(name: str) -> Array:
        return np.array([stamp - start_ns for stamp in stamps[name]], np.float64) * 1e-9

    return {name: (seconds(name), records[name]) for name in records}


def _vehicle_topics(reader: Any, path: Path) -> dict[str, str]:
    """Message name by topic, of the one system that sends ATTITUDE."""
    topics = sorted({channel.topic for channel in reader.get_summary().channels.values()})
    parts = [(topic, topic.split("/")) for topic in topics if topic.startswith("/mavlink/")]
    vehicles = sorted({(p[2], p[3]) for _, p in parts if len(p) == 5 and p[4] == "ATTITUDE"})
    if len(vehicles) > 1:
        raise LogError(f"{path}: {len(vehicles)} vehicles send ATTITUDE; a log for identification holds one")
    wanted = {t: p[4] for t, p in parts if len(p) == 5 and p[4] in _WANTED and (p[2], p[3]) in vehicles}
    ducts = {f"/mavlink/{system}/{_DUCT_COMPONENT}/ACTUATOR_OUTPUT_STATUS" for system, _ in vehicles}
    return wanted | {topic: _DUCT for topic in topics if topic in ducts}


def _start_ns(records: dict[str, NDArray[Any]], stamps: dict[str, list[int]], path: Path) -> int:
    """UNIX time of vehicle time zero: log time less the time that the vehicle put in its messages."""
    if "ATTITUDE" not in records:
        return 0
    attitude = records["ATTITUDE"]
    if "time_boot_ms" not in (attitude.dtype.names or ()):
        raise LogError(f"{path}: ATTITUDE carries no time_boot_ms; it must follow the MAVLink definition")
    return int(stamps["ATTITUDE"][0]) - int(attitude["time_boot_ms"][0]) * 1_000_000


def _parameters(reader: Any, path: Path) -> dict[str, float]:
    for attachment in reader.iter_attachments():
        if attachment.name == "params.json":
            try:
                return {str(name): float(value) for name, value in json.loads(attachment.data).items()}
            except (ValueError, TypeError, AttributeError):
                raise LogError(f"{path}: attachment params.json must be an object of numbers by name") from None
    return {}


def _increasing(time_s: Array) -> NDArray[np.bool_]:
    """Samples that are later than every one before: repeated and reordered ones are left out."""
    latest = np.maximum.accumulate(time_s)
    return np.concatenate(([True], time_s[1:] > latest[:-1]))


def _columns(record: NDArray[Any], keep: NDArray[np.bool_], *names: str) -> list[Array]:
    return [record[name][keep].astype(np.float64) for name in names]


def _attitude(time_s: Array, record: NDArray[Any]) -> Attitude:
    keep = _increasing(time_s)
    roll, pitch, yaw, p, q, r = _columns(record, keep, "roll", "pitch", "yaw", "rollspeed", "pitchspeed", "yawspeed")
    return Attitude(time_s[keep], roll, pitch, np.unwrap(yaw), p, q, r)


def _actuators(time_s: Array, record: NDArray[Any], travel_rad: float) -> Actuators:
    keep = _increasing(time_s)
    controls = record["actuator"][keep].astype(np.float64)
    return Actuators(time_s[keep], controls[:, 0] * travel_rad, controls[:, 1] * travel_rad, controls[:, 2])


def _duct(time_s: Array, record: NDArray[Any], travel_rad: float) -> Duct:
    keep = _increasing(time_s)
    angles = record["actuator"][keep].astype(np.float64) * travel_rad
    return Duct(time_s[keep], angles[:, 0], angles[:, 1])


def _depth(time_s: Array, record: NDArray[Any]) -> Depth:
    keep = _increasing(time_s)
    return Depth(time_s[keep], *_columns(record, keep, "z", "vz"))


def _setpoints(messages: Messages) -> Setpoints:
    nothing = np.empty(0)
    attitude_time, heading, pitch, depth_time, depth = nothing, nothing, nothing, nothing, nothing
    if "ATTITUDE_TARGET" in messages:
        time_s, record = messages["ATTITUDE_TARGET"]
        keep = _increasing(time_s)
        w, x, y, z = record["q"][keep].astype(np.float64).T
        attitude_time, pitch = time_s[keep], np.arcsin(np.clip(2.0 * (w * y - z * x), -1.0, 1.0))
        heading = np.unwrap(np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)))
    if "POSITION_TARGET_LOCAL_NED" in messages:
        time_s, record = messages["POSITION_TARGET_LOCAL_NED"]
        keep = _increasing(time_s)
        depth_time, (depth,) = time_s[keep], _columns(record, keep, "z")
    return Setpoints(attitude_time, heading, pitch, depth_time, depth)


def _events(time_s: Array, record: NDArray[Any]) -> tuple[Event, ...]:
    """Status texts, the chunks of a long one (id not 0) joined in the order of their sequence numbers."""
    events: list[Event] = []
    open_id = 0
    for time, row in zip(time_s, record, strict=True):
        text = row["text"].tobytes().split(b"\0", 1)[0].decode("utf-8", "replace")
        if open_id and row["id"] == open_id and row["chunk_seq"] > 0:
            last = events.pop()
            events.append(Event(last.time_s, last.severity, last.text + text))
        else:
            events.append(Event(float(time), int(row["severity"]), text))
        open_id = int(row["id"])
    return tuple(events)
