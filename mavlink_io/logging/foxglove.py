"""JSON messages that log viewers display without configuration, in their Log, Map and 3D panels.

Schemas: Foxglove (docs.foxglove.dev/docs/sdk/schemas). World axes are east-north-up and body axes
forward-left-up, as these panels require.
"""

import json
import math
from collections.abc import Callable
from typing import Any, NamedTuple

from mavlink_io import dialect, frames
from mavlink_io.dialect import Message
from mavlink_io.logging.statustext import TextJoiner

SCHEMA_ENCODING = "jsonschema"
MESSAGE_ENCODING = "json"
PERIOD_NS = 200_000_000
"""Minimum log time between two positions or poses of a system, in nanoseconds."""

_TIME = {
    "type": "object",
    "title": "time",
    "properties": {"sec": {"type": "integer"}, "nsec": {"type": "integer"}},
}
_NUMBER, _TEXT, _INTEGER = {"type": "number"}, {"type": "string"}, {"type": "integer"}
_LEVEL_OF_SEVERITY = (5, 5, 5, 4, 3, 2, 2, 1)
"""foxglove.Log level (1 debug, 2 info, 3 warning, 4 error, 5 fatal) by MAV_SEVERITY, 0 to 7."""


class ViewerTopic(NamedTuple):
    """A topic with a schema that viewers support."""

    topic: str
    schema_name: str
    properties: dict[str, Any]
    """Fields of the message, as of JSON Schema."""

    @property
    def schema_text(self) -> str:
        """JSON Schema of the message."""
        return json.dumps(
            {"title": self.schema_name, "type": "object", "properties": self.properties}
        )


def _vector(*names: str) -> dict[str, Any]:
    """Return the JSON Schema of an object with number fields."""
    return {"type": "object", "properties": dict.fromkeys(names, _NUMBER)}


LOG = ViewerTopic(
    "/log",
    "foxglove.Log",
    {
        "timestamp": _TIME,
        "level": _INTEGER,
        "message": _TEXT,
        "name": _TEXT,
        "file": _TEXT,
        "line": _INTEGER,
    },
)
LOCATION = ViewerTopic(
    "/foxglove/location",
    "foxglove.LocationFix",
    {
        "timestamp": _TIME,
        "frame_id": _TEXT,
        "latitude": _NUMBER,
        "longitude": _NUMBER,
        "altitude": _NUMBER,
        "position_covariance": {"type": "array", "items": _NUMBER},
        "position_covariance_type": _INTEGER,
    },
)
TRANSFORM = ViewerTopic(
    "/tf",
    "foxglove.FrameTransform",
    {
        "timestamp": _TIME,
        "parent_frame_id": _TEXT,
        "child_frame_id": _TEXT,
        "translation": _vector("x", "y", "z"),
        "rotation": _vector("x", "y", "z", "w"),
    },
)


class ViewerTopics:
    """Convert MAVLink messages to viewer messages: all texts, and positions and poses at 5 Hz.

    Parameters
    ----------
    write : callable
        Receive the topic, the JSON and the log time in nanoseconds of each viewer message.
    """

    def __init__(self, write: Callable[[ViewerTopic, bytes, int], None]) -> None:
        self._write = write
        self._positions: dict[int, bytes] = {}
        self._texts = TextJoiner()
        self._last_ns: dict[tuple[int, str], int] = {}

    def converter(self, name: str) -> Callable[[int, bytes, int], None] | None:
        """Return the function that converts a message.

        Parameters
        ----------
        name : str
            Name of the message.

        Returns
        -------
        callable or None
            Function of system id, full-length payload and log time in nanoseconds; None for a
            message that no viewer message is made from.
        """
        return {
            "STATUSTEXT": self._convert_text,
            "GLOBAL_POSITION_INT": self._convert_location,
            "LOCAL_POSITION_NED": self._store_position,
            "ATTITUDE": self._convert_pose,
        }.get(name)

    def _convert_text(self, system: int, payload: bytes, time_ns: int) -> None:
        """Write a log entry for a STATUSTEXT, after its last chunk."""
        message = dialect.by_name("STATUSTEXT").unpack(payload)
        text = self._texts.add(system, message)
        if text is not None:
            entry = log_entry(time_ns, message.severity, text, f"system {system}")
            self._write(LOG, entry, time_ns)

    def _convert_location(self, system: int, payload: bytes, time_ns: int) -> None:
        """Write the location of a GLOBAL_POSITION_INT, if it is due."""
        if self._is_due(system, LOCATION, time_ns):
            position = dialect.by_name("GLOBAL_POSITION_INT").unpack(payload)
            self._write(LOCATION, location_fix(time_ns, position), time_ns)

    def _store_position(self, system: int, payload: bytes, time_ns: int) -> None:
        """Store a LOCAL_POSITION_NED for the next pose."""
        self._positions[system] = payload

    def _convert_pose(self, system: int, payload: bytes, time_ns: int) -> None:
        """Write the pose of an ATTITUDE and the last position, if it is due and finite."""
        if system not in self._positions:
            return
        attitude = dialect.by_name("ATTITUDE").unpack(payload)
        position = dialect.by_name("LOCAL_POSITION_NED").unpack(self._positions[system])
        pose = attitude.roll, attitude.pitch, attitude.yaw, position.x, position.y, position.z
        # JSON has no NaN, and an infinite angle has no sine
        if all(map(math.isfinite, pose)) and self._is_due(system, TRANSFORM, time_ns):
            self._write(TRANSFORM, frame_transform(time_ns, attitude, position), time_ns)

    def _is_due(self, system: int, topic: ViewerTopic, time_ns: int) -> bool:
        """Return whether ``PERIOD_NS`` has passed since the last message of a system and topic."""
        last_ns = self._last_ns.get((system, topic.topic))
        if last_ns is not None and 0 <= time_ns - last_ns < PERIOD_NS:
            return False
        self._last_ns[system, topic.topic] = time_ns
        return True


def log_entry(time_ns: int, severity: int, text: str, name: str) -> bytes:
    """Return a text for the Log panel as JSON; ``severity`` is MAV_SEVERITY."""
    level = _LEVEL_OF_SEVERITY[min(severity, 7)]
    return _json(time_ns, level=level, message=text, name=name, file="", line=0)


def location_fix(time_ns: int, position: Message) -> bytes:
    """Return a GLOBAL_POSITION_INT for the Map panel as JSON; altitude above the surface in m."""
    return _json(
        time_ns,
        frame_id="auv",
        latitude=position.lat / 1e7,
        longitude=position.lon / 1e7,
        altitude=position.relative_alt / 1e3,
        position_covariance=[0.0] * 9,
        position_covariance_type=0,
    )


def frame_transform(time_ns: int, attitude: Message, position: Message) -> bytes:
    """Return the pose of frame ``auv`` in frame ``map`` for the 3D panel as JSON.

    The result is in forward-left-up and east-north-up axes: pitch changes sign and yaw becomes
    pi/2 - yaw.

    Parameters
    ----------
    time_ns : int
        Log time, in nanoseconds.
    attitude : namedtuple
        ATTITUDE, or an object with its roll, pitch and yaw (FRD in NED, rad).
    position : namedtuple
        LOCAL_POSITION_NED, or an object with its x, y and z (m).

    Returns
    -------
    bytes
        A foxglove.FrameTransform.
    """
    w, x, y, z = frames.quaternion_from_euler(
        attitude.roll, -attitude.pitch, math.pi / 2 - attitude.yaw
    )
    return _json(
        time_ns,
        parent_frame_id="map",
        child_frame_id="auv",
        translation={"x": position.y, "y": position.x, "z": -position.z},
        rotation={"x": x, "y": y, "z": z, "w": w},
    )


def _json(time_ns: int, **fields: Any) -> bytes:
    """Return a viewer message with its time stamp as JSON."""
    seconds, nanoseconds = divmod(time_ns, 1_000_000_000)
    return json.dumps({"timestamp": {"sec": seconds, "nsec": nanoseconds}, **fields}).encode()
