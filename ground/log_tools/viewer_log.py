"""MCAP log for Foxglove, Lichtblick and PlotJuggler: the log with the vehicle's state and shape.

`/caribou/state` is a ROS 1 message in degrees, metres and m/s. `/caribou/scene` is a
foxglove.SceneUpdate with hull, deflected duct and trail. Both are derived from the log afterwards,
so that recording takes no more time in flight and logs of every format can be viewed.
"""

import heapq
import json
import math
import struct
from collections.abc import Iterator
from operator import itemgetter
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ground.log_tools import mcap
from ground.output_files import open_new
from mavlink_io import frames
from mavlink_io.logging import foxglove, ros1
from mavlink_io.logging.foxglove import ViewerTopic
from mavlink_io.logging.mavlink_log import PROFILE
from mavlink_io.logging.mcap import McapWriter
from mavlink_io.logging.mcap_reader import McapReader
from sysid.data import readers, state_table
from sysid.data.dataset import Array, Log

STATE_TOPIC = "/caribou/state"
STATE_PERIOD_S = 0.05
SCENE_PERIOD_S = 0.5
TRAIL_POINTS = 400
"""Maximum number of points of the trail; a longer one has every second, fourth ... point."""
HULL_LENGTH_M, HULL_DIAMETER_M = 3.54, 0.53
DUCT_DIAMETER_M, DUCT_CHORD_M = 0.415, 0.12
"""Size of Caribou (`sitl/vehicle/caribou_nominal.toml`); a log does not contain the size."""

_TO_DEGREES = {"_rad": "_deg", "_radps": "_degps"}


class StateField(NamedTuple):
    """Field of `/caribou/state`."""

    name: str
    column: str
    """Column of the state table."""
    factor: float
    """Unit of the column in the unit of the field."""


def _state_field(column: str) -> StateField:
    """Return the field of a column: radians become degrees."""
    for suffix, degrees in _TO_DEGREES.items():
        if column.endswith(suffix):
            return StateField(column.removesuffix(suffix) + degrees, column, math.degrees(1.0))
    return StateField(column, column, 1.0)


STATE_FIELDS = tuple(map(_state_field, state_table.COLUMNS))
STATE_SCHEMA_NAME = "caribou/State"
STATE_SCHEMA = "".join(f"float64 {field.name}\n" for field in STATE_FIELDS)
"""ROS 1 definition of the state; NaN is a value that the log does not have."""

_NUMBER, _TEXT, _FLAG = {"type": "number"}, {"type": "string"}, {"type": "boolean"}


def _object(title: str, **properties: Any) -> dict[str, Any]:
    """Return the JSON Schema of an object."""
    return {"type": "object", "title": title, "properties": properties}


def _list(items: dict[str, Any]) -> dict[str, Any]:
    """Return the JSON Schema of an array."""
    return {"type": "array", "items": items}


_TIME = _object("time", sec={"type": "integer"}, nsec={"type": "integer"})
_DURATION = _object("duration", sec={"type": "integer"}, nsec={"type": "integer"})
_VECTOR = _object("foxglove.Vector3", x=_NUMBER, y=_NUMBER, z=_NUMBER)
_POINT = _object("foxglove.Point3", x=_NUMBER, y=_NUMBER, z=_NUMBER)
_QUATERNION = _object("foxglove.Quaternion", x=_NUMBER, y=_NUMBER, z=_NUMBER, w=_NUMBER)
_POSE = _object("foxglove.Pose", position=_VECTOR, orientation=_QUATERNION)
_COLOR = _object("foxglove.Color", r=_NUMBER, g=_NUMBER, b=_NUMBER, a=_NUMBER)
_INDICES = _list({"type": "integer", "minimum": 0})
_SOLID = {"pose": _POSE, "size": _VECTOR, "color": _COLOR}
_MESH = {
    "pose": _POSE,
    "points": _list(_POINT),
    "color": _COLOR,
    "colors": _list(_COLOR),
    "indices": _INDICES,
}
_ENTITY = _object(
    "foxglove.SceneEntity",
    timestamp=_TIME,
    frame_id=_TEXT,
    id=_TEXT,
    lifetime=_DURATION,
    frame_locked=_FLAG,
    metadata=_list(_object("foxglove.KeyValuePair", key=_TEXT, value=_TEXT)),
    arrows=_list(
        _object(
            "foxglove.ArrowPrimitive",
            pose=_POSE,
            shaft_length=_NUMBER,
            shaft_diameter=_NUMBER,
            head_length=_NUMBER,
            head_diameter=_NUMBER,
            color=_COLOR,
        )
    ),
    cubes=_list(_object("foxglove.CubePrimitive", **_SOLID)),
    spheres=_list(_object("foxglove.SpherePrimitive", **_SOLID)),
    cylinders=_list(
        _object("foxglove.CylinderPrimitive", **_SOLID, bottom_scale=_NUMBER, top_scale=_NUMBER)
    ),
    lines=_list(
        _object(
            "foxglove.LinePrimitive",
            type={"type": "integer"},
            thickness=_NUMBER,
            scale_invariant=_FLAG,
            **_MESH,
        )
    ),
    triangles=_list(_object("foxglove.TriangleListPrimitive", **_MESH)),
    texts=_list(
        _object(
            "foxglove.TextPrimitive",
            pose=_POSE,
            billboard=_FLAG,
            font_size=_NUMBER,
            scale_invariant=_FLAG,
            color=_COLOR,
            text=_TEXT,
        )
    ),
    models=_list(
        _object(
            "foxglove.ModelPrimitive",
            pose=_POSE,
            scale=_VECTOR,
            color=_COLOR,
            override_color=_FLAG,
            url=_TEXT,
            media_type=_TEXT,
            data={"type": "string", "contentEncoding": "base64"},
        )
    ),
)
SCENE = ViewerTopic(
    "/caribou/scene",
    "foxglove.SceneUpdate",
    {
        "deletions": _list(
            _object(
                "foxglove.SceneEntityDeletion",
                timestamp=_TIME,
                type={"type": "integer"},
                id=_TEXT,
            )
        ),
        "entities": _list(_ENTITY),
    },
)
"""Schema: docs.foxglove.dev/docs/sdk/schemas/scene-update."""

_LINE_STRIP = 0
_HULL_COLOR = {"r": 0.95, "g": 0.75, "b": 0.1, "a": 1.0}
_DUCT_COLOR = {"r": 0.2, "g": 0.2, "b": 0.25, "a": 1.0}
_TRAIL_COLOR = {"r": 0.0, "g": 0.45, "b": 0.7, "a": 1.0}
_NO_TURN = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}

Stamps = NDArray[np.int64]
_Derived = tuple[int, str, bytes]
"""Log time (ns), topic and message."""


def write(path: Path, log: Log, target: Path) -> None:
    """Write a log for viewers as a new file.

    Parameters
    ----------
    path : Path
        The log. All channels, attachments and metadata of an MCAP log are copied.
    log : Log
        Its content.
    target : Path
        File to write.

    Raises
    ------
    FileExistsError
        `target` exists already.
    """
    is_mcap = readers.format_of(path) == "mcap"
    with open_new(target) as file:
        writer = McapWriter(file, PROFILE, "caribou export")
        if is_mcap:
            with path.open("rb") as source:
                _merge(McapReader(source), writer, derived_messages(log))
        else:
            _Channels(writer).add_until(derived_messages(log, with_poses=True), None)
        writer.finish()


def derived_messages(log: Log, *, with_poses: bool = False) -> Iterator[_Derived]:
    """Yield the state, the scene and optionally the poses of a log in the order of time.

    Parameters
    ----------
    log : Log
        A recorded dive.
    with_poses : bool
        Whether to yield `/tf`, for a log that has no poses.

    Yields
    ------
    tuple
        Log time (ns), topic and message.
    """
    table = state_table.state_table(log)
    times_ns: Stamps = log.clock.zero_unix_ns + np.rint(1e9 * table["time_s"]).astype(np.int64)
    series = [_states(table, times_ns), _scenes(table, times_ns)]
    if with_poses:
        series.append(_poses(table, times_ns))
    yield from heapq.merge(*series, key=itemgetter(0))


class _Channels:
    """Channels of derived messages, opened at the first use."""

    def __init__(self, writer: McapWriter) -> None:
        self._writer = writer
        self._numbers: dict[str, int] = {}
        self._waiting: _Derived | None = None

    def add_until(self, messages: Iterator[_Derived], time_ns: int | None) -> None:
        """Write the messages up to a log time; all with None."""
        message = self._waiting or next(messages, None)
        while message is not None and (time_ns is None or message[0] <= time_ns):
            at_ns, topic, data = message
            if topic not in self._numbers:
                self._numbers[topic] = self._open(topic)
            self._writer.add_message(self._numbers[topic], at_ns, data, 0)
            message = next(messages, None)
        self._waiting = message

    def _open(self, topic: str) -> int:
        """Register the channel of a topic and its schema."""
        if topic == STATE_TOPIC:
            schema = self._writer.register_schema(
                STATE_SCHEMA_NAME, ros1.SCHEMA_ENCODING, STATE_SCHEMA.encode()
            )
            return self._writer.register_channel(topic, ros1.MESSAGE_ENCODING, schema)
        view = SCENE if topic == SCENE.topic else foxglove.TRANSFORM
        schema = self._writer.register_schema(
            view.schema_name, foxglove.SCHEMA_ENCODING, view.schema_text.encode()
        )
        return self._writer.register_channel(topic, foxglove.MESSAGE_ENCODING, schema)


def _merge(reader: McapReader, writer: McapWriter, derived: Iterator[_Derived]) -> None:
    """Copy a log and insert derived messages at their times."""
    channels = _Channels(writer)
    mcap.copy(reader, writer, lambda time_ns: channels.add_until(derived, time_ns))
    channels.add_until(derived, None)


def _every(times_ns: Stamps, period_s: float) -> Iterator[int]:
    """Yield the indices of samples at least a period apart."""
    due_ns = None
    for k, time_ns in enumerate(times_ns.tolist()):
        if due_ns is None or time_ns >= due_ns:
            yield k
            due_ns = time_ns + round(0.99e9 * period_s)


def _states(table: dict[str, Array], times_ns: Stamps) -> Iterator[_Derived]:
    """Yield `/caribou/state`."""
    columns = np.column_stack([field.factor * table[field.column] for field in STATE_FIELDS])
    pack = struct.Struct(f"<{len(STATE_FIELDS)}d").pack
    for k in _every(times_ns, STATE_PERIOD_S):
        yield int(times_ns[k]), STATE_TOPIC, pack(*columns[k])


def _poses(table: dict[str, Array], times_ns: Stamps) -> Iterator[_Derived]:
    """Yield `/tf`."""
    east, north, up = (np.nan_to_num(axis) for axis in _enu(table))
    for k in _every(times_ns, STATE_PERIOD_S):
        attitude = SimpleNamespace(
            roll=table["roll_rad"][k], pitch=table["pitch_rad"][k], yaw=table["heading_rad"][k]
        )
        position = SimpleNamespace(x=float(north[k]), y=float(east[k]), z=-float(up[k]))
        data = foxglove.frame_transform(int(times_ns[k]), attitude, position)
        yield int(times_ns[k]), foxglove.TRANSFORM.topic, data


def _enu(table: dict[str, Array]) -> tuple[Array, Array, Array]:
    """Return east, north and up, m."""
    return table["east_m"], table["north_m"], -table["depth_m"]


def _scenes(table: dict[str, Array], times_ns: Stamps) -> Iterator[_Derived]:
    """Yield `/caribou/scene`: each is complete, so that a viewer can start at any time."""
    places = np.nan_to_num(np.column_stack(_enu(table)))
    trail: list[dict[str, float]] = []
    stride = 1
    for number, k in enumerate(_every(times_ns, SCENE_PERIOD_S)):
        here = dict(zip("xyz", (round(float(value), 3) for value in places[k]), strict=True))
        shown = [*trail, here]
        if number % stride == 0:
            trail.append(here)
        if len(trail) >= TRAIL_POINTS:
            trail, stride = trail[::2], 2 * stride
        time_ns = int(times_ns[k])
        rudder_rad, elevator_rad = (
            float(np.nan_to_num(table[name][k])) for name in ("rudder_rad", "elevator_rad")
        )
        entities = [
            _entity(time_ns, "auv", "hull", **_hull()),
            _entity(time_ns, "auv", "duct", cylinders=[_duct(rudder_rad, elevator_rad)]),
            _entity(time_ns, "map", "trail", lines=[_line(shown)]),
        ]
        data = json.dumps({"deletions": [], "entities": entities}, separators=(",", ":"))
        yield time_ns, SCENE.topic, data.encode()


def _entity(time_ns: int, frame: str, name: str, **shapes: Any) -> dict[str, Any]:
    """Return a foxglove.SceneEntity that stays until it is replaced."""
    seconds, nanoseconds = divmod(time_ns, 1_000_000_000)
    empty: dict[str, list[Any]] = {
        kind: []
        for kind in (
            *("arrows", "cubes", "spheres", "cylinders"),
            *("lines", "triangles", "texts", "models"),
        )
    }
    return {
        "timestamp": {"sec": seconds, "nsec": nanoseconds},
        "frame_id": frame,
        "id": name,
        "lifetime": {"sec": 0, "nsec": 0},
        "frame_locked": True,
        "metadata": [],
        **empty,
        **shapes,
    }


def _hull() -> dict[str, list[dict[str, Any]]]:
    """Return the hull, in body axes (forward-left-up): nose, middle and tapering tail."""
    nose_m, tail_m = 0.15 * HULL_LENGTH_M, 0.3 * HULL_LENGTH_M
    middle_m = HULL_LENGTH_M - nose_m - tail_m
    front_m = HULL_LENGTH_M / 2 - nose_m
    nose = {
        "pose": _pose(front_m, _NO_TURN),
        "size": {"x": 2 * nose_m, "y": HULL_DIAMETER_M, "z": HULL_DIAMETER_M},
        "color": _HULL_COLOR,
    }
    return {
        "spheres": [nose],
        "cylinders": [
            _cylinder(front_m - middle_m / 2, middle_m, HULL_DIAMETER_M, 1.0),
            _cylinder(front_m - middle_m - tail_m / 2, tail_m, HULL_DIAMETER_M, 0.15),
        ],
    }


def _cylinder(centre_m: float, length_m: float, diameter_m: float, aft: float) -> dict[str, Any]:
    """Return a cylinder along the hull; ``aft`` is its radius aft over that forward."""
    # A cylinder lies along z from bottom to top; half a right angle about y turns z forward.
    half = math.sqrt(0.5)
    return {
        "pose": _pose(centre_m, {"x": 0.0, "y": half, "z": 0.0, "w": half}),
        "size": {"x": diameter_m, "y": diameter_m, "z": length_m},
        "bottom_scale": aft,
        "top_scale": 1.0,
        "color": _HULL_COLOR,
    }


def _duct(rudder_rad: float, elevator_rad: float) -> dict[str, Any]:
    """Return the duct at its commanded angles.

    A positive rudder turns the nose to starboard: the trailing edge moves to starboard. A positive
    elevator turns the nose up: the trailing edge moves up.
    """
    # In forward-left-up axes the duct's axis a = (1, 0, 0) turns about up by the rudder and about
    # left by the elevator, so that -a, the trailing edge, points to starboard and up.
    w, x, y, z = frames.quaternion_from_euler(0.0, math.pi / 2 + elevator_rad, rudder_rad)
    return {
        "pose": _pose(-HULL_LENGTH_M / 2, {"x": x, "y": y, "z": z, "w": w}),
        "size": {"x": DUCT_DIAMETER_M, "y": DUCT_DIAMETER_M, "z": DUCT_CHORD_M},
        "bottom_scale": 1.0,
        "top_scale": 1.0,
        "color": _DUCT_COLOR,
    }


def _line(points: list[dict[str, float]]) -> dict[str, Any]:
    """Return the trail."""
    return {
        "type": _LINE_STRIP,
        "pose": {"position": {"x": 0.0, "y": 0.0, "z": 0.0}, "orientation": _NO_TURN},
        "thickness": 2.0,
        "scale_invariant": True,
        "points": points,
        "color": _TRAIL_COLOR,
        "colors": [],
        "indices": [],
    }


def _pose(forward_m: float, orientation: dict[str, float]) -> dict[str, Any]:
    """Return a pose on the axis of the hull."""
    return {"position": {"x": forward_m, "y": 0.0, "z": 0.0}, "orientation": orientation}
