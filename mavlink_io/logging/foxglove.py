"""Views that log viewers draw without being told: the Log, Map and 3D panels' schemas, as JSON.

Schema names are Foxglove's own (docs.foxglove.dev/docs/sdk/schemas); world axes are east-north-up
and body axes forward-left-up, as those panels expect."""

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

_TIME = {
    "type": "object",
    "title": "time",
    "properties": {"sec": {"type": "integer"}, "nsec": {"type": "integer"}},
}
_NUMBER, _TEXT, _INTEGER = {"type": "number"}, {"type": "string"}, {"type": "integer"}
_LEVEL_OF_SEVERITY = (5, 5, 5, 4, 3, 2, 2, 1)
"""foxglove.Log levels (1 debug, 2 info, 3 warning, 4 error, 5 fatal) of MAV_SEVERITY 0 emergency
... 7 debug."""


class ViewerTopic(NamedTuple):
    """A topic that viewers understand."""

    topic: str
    schema_name: str
    properties: dict[str, Any]

    @property
    def schema_text(self) -> str:
        return json.dumps(
            {"title": self.schema_name, "type": "object", "properties": self.properties}
        )


def _vector(*names: str) -> dict[str, Any]:
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
    """Turns some MAVLink messages into what the panels draw: every text, position and pose a few
    times a second."""

    def __init__(self, show: Callable[[ViewerTopic, bytes, int], None]) -> None:
        """``show`` gets the view, the JSON and the log time in nanoseconds."""
        self._show = show
        self._positions: dict[int, bytes] = {}
        self._texts = TextJoiner()
        self._shown_ns: dict[tuple[int, str], int] = {}

    def viewer(self, name: str) -> Callable[[int, bytes, int], None] | None:
        """What to call with the system, the full-length payload and the log time of a message
        called ``name``."""
        return {
            "STATUSTEXT": self._show_text,
            "GLOBAL_POSITION_INT": self._show_location,
            "LOCAL_POSITION_NED": self._remember_position,
            "ATTITUDE": self._show_pose,
        }.get(name)

    def _show_text(self, system: int, payload: bytes, time_ns: int) -> None:
        message = dialect.by_name("STATUSTEXT").unpack(payload)
        text = self._texts.add(system, message)
        if text is not None:
            self._show(LOG, log_entry(time_ns, message.severity, text, f"system {system}"), time_ns)

    def _show_location(self, system: int, payload: bytes, time_ns: int) -> None:
        if self._due(system, LOCATION, time_ns):
            position = dialect.by_name("GLOBAL_POSITION_INT").unpack(payload)
            self._show(LOCATION, location_fix(time_ns, position), time_ns)

    def _remember_position(self, system: int, payload: bytes, time_ns: int) -> None:
        self._positions[system] = payload

    def _show_pose(self, system: int, payload: bytes, time_ns: int) -> None:
        if system in self._positions and self._due(system, TRANSFORM, time_ns):
            attitude = dialect.by_name("ATTITUDE").unpack(payload)
            position = dialect.by_name("LOCAL_POSITION_NED").unpack(self._positions[system])
            self._show(TRANSFORM, frame_transform(time_ns, attitude, position), time_ns)

    def _due(self, system: int, view: ViewerTopic, time_ns: int) -> bool:
        last_ns = self._shown_ns.get((system, view.topic))
        if last_ns is not None and 0 <= time_ns - last_ns < PERIOD_NS:
            return False
        self._shown_ns[system, view.topic] = time_ns
        return True


def log_entry(time_ns: int, severity: int, text: str, name: str) -> bytes:
    """One line of text for the Log panel; ``severity`` is MAV_SEVERITY."""
    level = _LEVEL_OF_SEVERITY[min(severity, 7)]
    return _json(time_ns, level=level, message=text, name=name, file="", line=0)


def location_fix(time_ns: int, position: Message) -> bytes:
    """A GLOBAL_POSITION_INT for the Map panel; altitude is above the water surface."""
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
    """The pose of an ATTITUDE and a LOCAL_POSITION_NED for the 3D panel, from frame ``map`` to
    frame ``auv``."""
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
    seconds, nanoseconds = divmod(time_ns, 1_000_000_000)
    return json.dumps({"timestamp": {"sec": seconds, "nsec": nanoseconds}, **fields}).encode()
