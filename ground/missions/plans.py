"""Mission files of other tools: QGroundControl's `.plan` and the text format `QGC WPL 110`."""

import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from ground.missions import script
from ground.missions.script import ScriptError
from mavlink_io.dialect import has_location
from mavlink_io.mission_items import (
    FENCE_TYPE,
    FRAME_LOCAL_NED,
    FRAME_MISSION,
    GLOBAL_FRAMES,
    GLOBAL_SCALE,
    LENGTH_ROUNDING_M,
    LOCAL_SCALE,
    NOT_GIVEN,
    RALLY_TYPE,
    SPEED_ROUNDING_MPS,
    MavCmd,
    MissionItem,
    place_fault,
)
from mavlink_io.text_files import parse_json, read_text

N = TypeVar("N", int, float)

_INCLUSION = MavCmd.NAV_FENCE_POLYGON_VERTEX_INCLUSION
_EXCLUSION = MavCmd.NAV_FENCE_POLYGON_VERTEX_EXCLUSION
_CIRCLE_INCLUSION = MavCmd.NAV_FENCE_CIRCLE_INCLUSION
_CIRCLE_EXCLUSION = MavCmd.NAV_FENCE_CIRCLE_EXCLUSION
_CAMERA_COMMANDS = frozenset((206, 214, 530, 2000, 2001, 2003, 2500, 2501))
"""DO_SET_CAM_TRIGG_DIST and _INTERVAL, SET_CAMERA_MODE, IMAGE_* and VIDEO_*_CAPTURE,
DO_TRIGGER_CONTROL."""
_GLOBAL_RELATIVE = 3
"""MAV_FRAME_GLOBAL_RELATIVE_ALT, which QGroundControl sends."""
WPL_HEADER = "QGC WPL 110"
SUBMARINE, GENERIC = 12, 0
"""MAV_TYPE and MAV_AUTOPILOT that a plan file names."""
_MAX_COORDINATE, _MAX_FRAME, _MAX_COMMAND = 1 << 31, (1 << 8) - 1, (1 << 16) - 1
"""Limits of the fields of MISSION_ITEM_INT."""


class Plan(NamedTuple):
    """The items of a mission, with their places in the file."""

    items: tuple[MissionItem, ...]
    labels: tuple[str, ...]
    """Place of each item in the file: `step 2`, or `item 3` if the file has no steps."""
    fence: tuple[MissionItem, ...] = ()
    """Items of the geofence in the file."""
    rally: tuple[MissionItem, ...] = ()
    """Rally points in the file."""

    @property
    def places(self) -> tuple[str, ...]:
        """Place of each item in the mission: `step 2 of 3`, or `item 3 of 5` without steps."""
        numbers = {label: n for n, label in enumerate(dict.fromkeys(self.labels), start=1)}
        return tuple(
            f"{label.partition(' ')[0]} {numbers[label]} of {len(numbers)}" for label in self.labels
        )


class MissionLimits(NamedTuple):
    """Limits of a vehicle for missions; infinite if it has no such parameter."""

    depth_m: float = math.inf
    """FS_DEPTH_M: depth at which the failsafe surfaces."""
    distance_m: float = math.inf
    """MIS_DIST_MAX: maximum distance of a waypoint from home."""
    speed_mps: float = math.inf
    """Speed through the water at full thrust, by SPD_CRUISE_MPS and THR_CRUISE_PCT."""

    @classmethod
    def from_parameters(cls, parameters: Mapping[str, float]) -> "MissionLimits":
        """Read the limits from the parameters of a vehicle."""
        thrust_pct = parameters.get("THR_CRUISE_PCT", 0.0)
        cruise_mps = parameters.get("SPD_CRUISE_MPS", math.inf)
        return cls(
            parameters.get("FS_DEPTH_M", math.inf),
            parameters.get("MIS_DIST_MAX", 0.0) or math.inf,  # 0 means no limit
            100.0 * cruise_mps / thrust_pct if thrust_pct > 0.0 else math.inf,
        )


def load(name_or_path: str) -> Plan:
    """Read a mission script, a `.plan` or a `QGC WPL 110` file, recognised by its content.

    Parameters
    ----------
    name_or_path : str
        Name of a shipped mission, or path of a file.

    Returns
    -------
    Plan
        Items with their places in the file.

    Raises
    ------
    ScriptError
        The file is missing, invalid or without an item; the message names the place.
    """
    path = Path(name_or_path)
    if not path.is_file() or path.suffix == ".toml":
        steps = script.load(name_or_path)
        labels = tuple(f"step {number}" for number in script.step_numbers(steps))
        return Plan(script.compile_items(steps), labels)
    text = read_text(path, errors="replace")
    fence: tuple[MissionItem, ...] = ()
    rally: tuple[MissionItem, ...] = ()
    if text.startswith(WPL_HEADER):
        items = read_wpl(text, name_or_path)
    elif text.lstrip().startswith("{"):
        items = read_plan(text, name_or_path)
        fence, rally = read_fence(text, name_or_path), read_rally(text, name_or_path)
    else:
        raise ScriptError(
            f"{name_or_path}: neither a .toml mission, a .plan nor a {WPL_HEADER!r} file"
        )
    for item in items:
        if has_location(item.command) and (reason := place_fault(item)[1]):
            raise ScriptError(f"{name_or_path}: item {item.sequence}: {reason}")
    if not items:
        raise ScriptError(
            f"{name_or_path}: holds no mission item; give a mission with at least one"
        )
    return Plan(items, tuple(f"item {item.sequence}" for item in items), fence, rally)


def load_items(name_or_path: str) -> tuple[MissionItem, ...]:
    """Return only the items of `load`.

    Parameters
    ----------
    name_or_path : str
        Name of a shipped mission, or path of a mission file.

    Returns
    -------
    tuple of MissionItem
        Items of the mission.

    Raises
    ------
    ScriptError
        The file is missing or invalid.
    """
    return load(name_or_path).items


def check_limits(where: str, plan: Plan, limits: MissionLimits) -> None:
    """Check depths, distances and speeds of a mission against the limits of a vehicle.

    Positions in latitude and longitude are not checked here: that is left to the vehicle,
    which has its home position.

    Parameters
    ----------
    where : str
        Name of the mission in error messages.
    plan : Plan
        The mission.
    limits : MissionLimits
        Limits of the vehicle.

    Raises
    ------
    ScriptError
        The message names the step or item, the key, its value and the limit.
    """
    for item, label in zip(plan.items, plan.labels, strict=True):
        depth_m = _depth_m(item)
        if depth_m > limits.depth_m + LENGTH_ROUNDING_M:
            bounds = f"must be 0 to {limits.depth_m:g}, the vehicle's FS_DEPTH_M"
            raise ScriptError(f"{where}: {label}: depth_m = {depth_m:g}: {bounds}")
        if (
            item.command == MavCmd.DO_CHANGE_SPEED
            and item.p2 > limits.speed_mps + SPEED_ROUNDING_MPS
        ):
            bounds = f"must be at most {limits.speed_mps:.2f}, the vehicle's speed at full thrust"
            raise ScriptError(
                f"{where}: {label}: speed_mps = {item.p2:g}: {bounds} (SPD_CRUISE_MPS,"
                " THR_CRUISE_PCT)"
            )
        if item.frame == FRAME_LOCAL_NED and has_location(item.command):
            north_m, east_m = item.x / LOCAL_SCALE, item.y / LOCAL_SCALE
            distance_m = math.hypot(north_m, east_m)
            if distance_m > limits.distance_m:
                bounds = f"must be at most {limits.distance_m:g} m, the vehicle's MIS_DIST_MAX"
                place = f"to = [{north_m:g}, {east_m:g}]"
                raise ScriptError(
                    f"{where}: {label}: {place}: {distance_m:.0f} m from home: {bounds}"
                )


def check_local(where: str, plan: Plan) -> None:
    """Check that no waypoint is in latitude and longitude, for a simulation without a home.

    Parameters
    ----------
    where : str
        Name of the mission in error messages.
    plan : Plan
        The mission.

    Raises
    ------
    ScriptError
        The message names the step or item.
    """
    for item, label in zip(plan.items, plan.labels, strict=True):
        is_given = (item.x, item.y) not in ((0, 0), (NOT_GIVEN, NOT_GIVEN))
        if item.command != MavCmd.NAV_LAND and _has_global_position(item) and is_given:
            raise ScriptError(
                f"{where}: {label}: latitude and longitude cannot be simulated; give metres from"
                " home, as `to` in a .toml mission"
            )


def _depth_m(item: MissionItem) -> float:
    """Return the depth (m) that an item commands; NaN for none."""
    if item.command == MavCmd.DO_CHANGE_ALTITUDE:
        return -item.p1
    if item.command == MavCmd.CONDITION_CHANGE_ALT or has_location(item.command):
        return item.z if item.frame == FRAME_LOCAL_NED else -item.z
    return math.nan


def read_wpl(text: str, where: str) -> tuple[MissionItem, ...]:
    """Return the items of a `QGC WPL 110` text, without the home position if line 0 holds it.

    Tools of ArduPilot write home as item 0: a waypoint (command 16) in frame 0. The files of a
    vehicle whose item 0 is the first waypoint, and of some scripts, have no such line. The target
    of a DO_JUMP is an index in the file. Raises ScriptError.
    """
    rows = [line.split() for line in text.splitlines()[1:] if line.strip()]
    items: list[MissionItem] = []
    first_index = 0
    """Index in the file of the first item that is returned."""
    for number, row in enumerate(rows):
        place = f"{where}: line {number + 2}"
        if len(row) != len(_WPL_COLUMNS):
            raise ScriptError(f"{place}: has {len(row)} columns; a waypoint line has 12")
        try:
            if number == 0:
                is_home = _is_home_row(row)
                first_index = 1 if is_home else _wpl_number(row, "index", int)
                if is_home:
                    continue
            items.append(_wpl_item(row, first_index))
        except ValueError as error:
            raise ScriptError(f"{place}: {error}; expected numbers that an item can hold") from None
    return _renumber(items)


def write_plan(
    items: Sequence[MissionItem],
    fence: Sequence[MissionItem] = (),
    rally: Sequence[MissionItem] = (),
) -> str:
    """Return mission, geofence and rally points in the format of QGroundControl's plan file."""
    mission = {
        "cruiseSpeed": 1.3,
        "firmwareType": GENERIC,
        "hoverSpeed": 1.3,
        "items": [_plan_item(n, item) for n, item in enumerate(items, start=1)],
        "plannedHomePosition": [0.0, 0.0, 0.0],
        "vehicleType": SUBMARINE,
        "version": 2,
    }
    plan = {
        "fileType": "Plan",
        "geoFence": _plan_fence(fence),
        "groundStation": "Caribou",
        "mission": mission,
        "rallyPoints": {"points": [[*_degrees(item), 0.0] for item in rally], "version": 2},
        "version": 1,
    }
    return json.dumps(plan, indent=2) + "\n"


def _plan_fence(fence: Sequence[MissionItem]) -> dict[str, Any]:
    """Return a geofence as a plan file stores it; `read_fence` is the inverse."""
    polygons: list[dict[str, Any]] = []
    circles: list[dict[str, Any]] = []
    vertices: list[tuple[float, float]] = []
    for item in fence:
        inclusion = item.command in (_INCLUSION, _CIRCLE_INCLUSION)
        zone: dict[str, Any] = {"inclusion": inclusion, "version": 1}
        if item.command in (_CIRCLE_INCLUSION, _CIRCLE_EXCLUSION):
            circles.append(zone | {"circle": {"center": _degrees(item), "radius": item.p1}})
            continue
        vertices.append(_degrees(item))
        if len(vertices) >= item.p1:
            polygons.append(zone | {"polygon": vertices})
            vertices = []
    return {"circles": circles, "polygons": polygons, "version": 2}


def _degrees(item: MissionItem) -> tuple[float, float]:
    """Return latitude and longitude of an item (deg)."""
    return item.x / GLOBAL_SCALE, item.y / GLOBAL_SCALE


def read_plan(text: str, where: str) -> tuple[MissionItem, ...]:
    """Return the items of a plan file; surveys and scans as the lines that QGroundControl stored.

    The items of a survey that trigger a camera are left out. Raises ScriptError.
    """
    with _errors_named(where, "mission.items"):
        entries: list[tuple[str, dict[str, Any]]] = []
        for number, outer in enumerate(parse_json(text)["mission"]["items"]):
            part = f"mission.items[{number}]"
            with _errors_named(where, part):
                entries += [(part, entry) for entry in _simple(outer)]
        places: dict[float, int] = {}
        for n, (part, entry) in enumerate(entries):
            if entry.get("doJumpId") is not None:
                with _errors_named(where, part):
                    places[_integer(entry, "doJumpId")] = n
        items: list[MissionItem] = []
        for part, entry in entries:
            with _errors_named(where, part):
                items.append(_from_plan(entry, places))
        return _renumber(items)


def read_fence(text: str, where: str) -> tuple[MissionItem, ...]:
    """Return the items of the geofence of a plan file; none if it has none. Raises ScriptError."""
    with _errors_named(where, "geoFence"):
        fence = parse_json(text).get("geoFence") or {}
        items: list[MissionItem] = []
        for polygon in _objects(fence, "polygons"):
            command = _INCLUSION if polygon.get("inclusion", True) else _EXCLUSION
            corners = polygon["polygon"]
            items += [_place_item(command, corner, float(len(corners))) for corner in corners]
        for entry in _objects(fence, "circles"):
            command = _CIRCLE_INCLUSION if entry.get("inclusion", True) else _CIRCLE_EXCLUSION
            circle = entry["circle"]
            items.append(_place_item(command, circle["center"], float(circle["radius"])))
        return _numbered(items, FENCE_TYPE)


def read_rally(text: str, where: str) -> tuple[MissionItem, ...]:
    """Return the rally points of a plan file; none if it has none. Raises ScriptError."""
    with _errors_named(where, "rallyPoints"):
        points = (parse_json(text).get("rallyPoints") or {}).get("points", ())
        items = [_place_item(MavCmd.NAV_RALLY_POINT, point, 0.0) for point in points]
        return _numbered(items, RALLY_TYPE)


@contextmanager
def _errors_named(where: str, part: str) -> Iterator[None]:
    """Turn the errors of a wrong file into ScriptError that name the file and its part."""
    try:
        yield
    except ScriptError:
        raise
    except json.JSONDecodeError as error:
        raise ScriptError(f"{where}: not JSON: {error}") from None
    except KeyError as error:
        reason = f"the key {error} is missing"
        raise ScriptError(f"{where}: {part}: not a QGroundControl plan: {reason}") from None
    except (LookupError, TypeError, AttributeError):
        reason = "a value has another type than QGroundControl writes"
        raise ScriptError(f"{where}: {part}: not a QGroundControl plan: {reason}") from None
    except (ValueError, OverflowError) as error:
        raise ScriptError(f"{where}: {part}: not a QGroundControl plan: {error}") from None


def _simple(entry: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the simple items of an entry. Raises KeyError or ValueError."""
    if entry["type"] == "SimpleItem":
        return [entry]
    transects = entry.get("TransectStyleComplexItem", {})
    if "Items" not in transects:
        raise ValueError(f"{entry['type']} {entry.get('complexItemType', '')} without its items")
    return [item for item in transects["Items"] if item["command"] not in _CAMERA_COMMANDS]


def _place_item(command: int, place: Sequence[float], p1: float) -> MissionItem:
    """Return an item of a fence or a rally point. Raises ValueError if it is out of range."""
    item = MissionItem(0, _GLOBAL_RELATIVE, command, p1=p1)
    return _with_location(item, float(place[0]), float(place[1]))


def _numbered(items: Sequence[MissionItem], mission_type: int) -> tuple[MissionItem, ...]:
    """Set the sequence numbers from 0 and the type of the plan."""
    return tuple(
        item._replace(sequence=n, mission_type=mission_type) for n, item in enumerate(items)
    )


_WPL_COLUMNS = (
    "index",
    "current",
    "frame",
    "command",
    "param1",
    "param2",
    "param3",
    "param4",
    "x",
    "y",
    "z",
    "autocontinue",
)
"""Columns of the text format."""


def _wpl_number(row: list[str], column: str, kind: Callable[[str], N]) -> N:
    """Return the number of a column. Raises ValueError that names the column."""
    text = row[_WPL_COLUMNS.index(column)]
    try:
        return kind(text)
    except ValueError:
        raise ValueError(f"{column} = {text!r:.80}: is no {_KIND_NAMES[kind]}") from None


_KIND_NAMES: Mapping[Any, str] = {int: "integer", float: "number"}


def _is_home_row(row: list[str]) -> bool:
    """Return whether the first line of the text format is the home position."""
    index, frame, command = (_wpl_number(row, name, int) for name in ("index", "frame", "command"))
    return (index, frame, command) == (0, 0, MavCmd.NAV_WAYPOINT)


def _wpl_item(row: list[str], first_index: int) -> MissionItem:
    """Parse one line of the text format; ``first_index`` is that of item 0. Raises ValueError."""
    frame, command, autocontinue = (
        _wpl_number(row, name, int) for name in ("frame", "command", "autocontinue")
    )
    p1, p2, p3, p4, x, y, z = (_wpl_number(row, name, float) for name in _WPL_COLUMNS[4:11])
    if command == MavCmd.DO_JUMP:
        if p1 < first_index:
            home = ", the home position" if p1 == 0.0 else ""
            raise ValueError(f"DO_JUMP to item {p1:g}{home}")
        p1 -= first_index
    return _with_location(_item(frame, command, autocontinue, (p1, p2, p3, p4, z)), x, y)


def _item(
    frame: int,
    command: int,
    autocontinue: int,
    parameters: tuple[float, float, float, float, float],
) -> MissionItem:
    """Return an item of a file, without its location; ``parameters`` are param1 to param4 and z."""
    p1, p2, p3, p4, z = parameters
    return MissionItem(
        sequence=0,
        frame=frame,
        command=command,
        current=0,
        autocontinue=autocontinue,
        p1=p1,
        p2=p2,
        p3=p3,
        p4=p4,
        z=z,
    )


def _plan_item(number: int, item: MissionItem) -> dict[str, Any]:
    """Return one entry of a plan file."""
    x, y = _location(item)
    if _has_global_position(item) and item.x == item.y == NOT_GIVEN:
        x = y = math.nan
    first = item.p1 + 1.0 if item.command == MavCmd.DO_JUMP else item.p1  # a doJumpId
    values = [first, item.p2, item.p3, item.p4, x, y, item.z]
    return {
        "autoContinue": bool(item.autocontinue),
        "command": item.command,
        "doJumpId": number,
        "frame": item.frame,
        "params": [None if math.isnan(value) else value for value in values],
        "type": "SimpleItem",
    }


def _from_plan(entry: dict[str, Any], places: Mapping[float, int]) -> MissionItem:
    """Parse one entry of a plan file; ``places`` are the positions of the items by doJumpId.

    Raises KeyError, TypeError, ValueError.
    """
    try:
        p1, p2, p3, p4, x, y, z = (
            math.nan if value is None else float(value) for value in entry["params"]
        )
    except (TypeError, ValueError):
        raise ValueError(f"params = {entry['params']!r:.80}: must be 7 numbers or null") from None
    autocontinue = int(entry.get("autoContinue", True))
    frame, command = _integer(entry, "frame"), _integer(entry, "command")
    item = _item(frame, command, autocontinue, (p1, p2, p3, p4, z))
    if item.command == MavCmd.DO_JUMP:
        if p1 not in places:
            raise ValueError(f"no item has the doJumpId {p1:g}, the target of DO_JUMP")
        item = item._replace(p1=float(places[p1]))
    if _has_global_position(item) and math.isnan(x) and math.isnan(y):
        return item._replace(x=NOT_GIVEN, y=NOT_GIVEN)
    return _with_location(item, 0.0 if math.isnan(x) else x, 0.0 if math.isnan(y) else y)


def _objects(container: Any, key: str) -> list[dict[str, Any]]:
    """Return the list of objects of a key, [] without it. Raises ValueError that names the key."""
    if not isinstance(container, dict):
        raise ValueError(f"{container!r:.80}: must be an object")
    entries = container.get(key, [])
    if not (isinstance(entries, list) and all(isinstance(entry, dict) for entry in entries)):
        raise ValueError(f"{key} = {entries!r:.80}: must be a list of objects")
    return entries


def _integer(entry: dict[str, Any], key: str) -> int:
    """Return the integer of a key. Raises KeyError, or ValueError that names the key."""
    try:
        return int(entry[key])
    except (TypeError, ValueError):
        raise ValueError(f"{key} = {entry[key]!r:.80}: must be an integer") from None


def _location(item: MissionItem) -> tuple[float, float]:
    """Return parameters 5 and 6 as files hold them.

    They are degrees or metres from home if the item has a position, else the plain numbers.
    """
    if item.frame == FRAME_MISSION:
        return item.x, item.y
    return item.x / _scale(item), item.y / _scale(item)


def _with_location(item: MissionItem, x: float, y: float) -> MissionItem:
    """Return the item with a position of a file. Raises ValueError if it is out of range."""
    if not (0 <= item.frame <= _MAX_FRAME and 0 <= item.command <= _MAX_COMMAND):
        raise ValueError(f"frame {item.frame}, command {item.command}")
    if not all(-_MAX_COORDINATE <= value * _scale(item) < _MAX_COORDINATE for value in (x, y)):
        raise ValueError(f"place {x:g}, {y:g}")
    return item._replace(x=round(x * _scale(item)), y=round(y * _scale(item)))


def _has_global_position(item: MissionItem) -> bool:
    """Return whether x and y are latitude and longitude, which may be omitted."""
    return item.frame in GLOBAL_FRAMES and has_location(item.command)


def _scale(item: MissionItem) -> int:
    """Return the factor from degrees or metres to the integers of MISSION_ITEM_INT."""
    if item.frame == FRAME_MISSION:
        return 1
    return LOCAL_SCALE if item.frame == FRAME_LOCAL_NED else GLOBAL_SCALE


def _renumber(items: Sequence[MissionItem]) -> tuple[MissionItem, ...]:
    """Set the sequence numbers from 0; the first item is current."""
    return tuple(item._replace(sequence=n, current=int(n == 0)) for n, item in enumerate(items))
