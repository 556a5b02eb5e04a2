"""Other tools' mission files: QGroundControl's ``.plan`` and the ``QGC WPL 110`` text, read and
written."""

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from ground.missions import script
from ground.missions.script import ScriptError
from mavlink_io.dialect import has_location
from mavlink_io.mission_items import (
    FRAME_LOCAL_NED,
    FRAME_MISSION,
    GLOBAL_FRAMES,
    GLOBAL_SCALE,
    LOCAL_SCALE,
    NOT_GIVEN,
    MavCmd,
    MissionItem,
    place_fault,
)

WPL_HEADER = "QGC WPL 110"
SUBMARINE, GENERIC = 12, 0
"""MAV_TYPE and MAV_AUTOPILOT, for the plan's own note of its vehicle."""
_MAX_COORDINATE, _MAX_FRAME, _MAX_COMMAND = 1 << 31, (1 << 8) - 1, (1 << 16) - 1
"""What the fields of MISSION_ITEM_INT hold."""


class Plan(NamedTuple):
    """A mission as its file has it."""

    items: tuple[MissionItem, ...]
    labels: tuple[str, ...]
    """Where each item stands in the file: ``step 2``, or ``item 3`` where the file has no steps."""


class Limits(NamedTuple):
    """What a vehicle allows a mission, infinite where it does not say."""

    depth_m: float = math.inf
    """FS_DEPTH_M: the failsafe surfaces below it."""
    distance_m: float = math.inf
    """MIS_DIST_MAX: the farthest place from home."""

    @classmethod
    def from_parameters(cls, parameters: Mapping[str, float]) -> "Limits":
        """Read the limits from the parameters of a vehicle."""
        return cls(
            parameters.get("FS_DEPTH_M", math.inf),
            parameters.get("MIS_DIST_MAX", 0.0) or math.inf,  # 0 is no limit
        )


DEPTH_ROUNDING_M = 1e-3
"""Rounding of a depth and of its limit to float32, at 6000 m."""


def load(name_or_path: str) -> Plan:
    """Read a mission script, a ``.plan`` or a ``QGC WPL 110`` file, told apart by their content.

    Raises:
        ScriptError: the file is missing or wrong; the message says where.
    """
    path = Path(name_or_path)
    if not path.is_file() or path.suffix == ".toml":
        steps = script.load(name_or_path)
        labels = tuple(f"step {number}" for number in script.step_numbers(steps))
        return Plan(script.compile_items(steps), labels)
    text = path.read_text(encoding="utf-8", errors="replace")
    if text.startswith(WPL_HEADER):
        items = read_wpl(text, name_or_path)
    elif text.lstrip().startswith("{"):
        items = read_plan(text, name_or_path)
    else:
        raise ScriptError(
            f"{name_or_path}: neither a .toml mission, a .plan nor a {WPL_HEADER!r} file"
        )
    for item in items:
        if has_location(item.command) and (reason := place_fault(item)[1]):
            raise ScriptError(f"{name_or_path}: item {item.sequence}: {reason}")
    return Plan(items, tuple(f"item {item.sequence}" for item in items))


def load_items(name_or_path: str) -> tuple[MissionItem, ...]:
    """Return the items of ``load``. Raises ScriptError."""
    return load(name_or_path).items


def check_limits(where: str, plan: Plan, limits: Limits) -> None:
    """Refuse a mission that goes deeper or farther than a vehicle allows.

    Places in latitude and longitude are left to the vehicle, which knows its home.

    Raises:
        ScriptError: names ``where``, the step or item, the key, its value and the limit.
    """
    for item, label in zip(plan.items, plan.labels, strict=True):
        depth_m = _depth_m(item)
        if depth_m > limits.depth_m + DEPTH_ROUNDING_M:
            bounds = f"must be 0 to {limits.depth_m:g}, the vehicle's FS_DEPTH_M"
            raise ScriptError(f"{where}: {label}: depth_m = {depth_m:g}: {bounds}")
        if item.frame == FRAME_LOCAL_NED and has_location(item.command):
            north_m, east_m = item.x / LOCAL_SCALE, item.y / LOCAL_SCALE
            distance_m = math.hypot(north_m, east_m)
            if distance_m > limits.distance_m:
                bounds = f"must be at most {limits.distance_m:g} m, the vehicle's MIS_DIST_MAX"
                place = f"to = [{north_m:g}, {east_m:g}]"
                raise ScriptError(
                    f"{where}: {label}: {place}: {distance_m:.0f} m from home: {bounds}"
                )


def _depth_m(item: MissionItem) -> float:
    """The depth that an item asks for, NaN for none."""
    if item.command == MavCmd.DO_CHANGE_ALTITUDE:
        return -item.p1
    if item.command == MavCmd.CONDITION_CHANGE_ALT or has_location(item.command):
        return item.z if item.frame == FRAME_LOCAL_NED else -item.z
    return math.nan


def write_wpl(items: Sequence[MissionItem]) -> str:
    """The text form that MAVProxy and Mission Planner read.

    Line 0 is those tools' home position: it is written as one at the surface, and the mission
    follows from line 1. Set the vehicle's MIS_SEQ0_HOME to 1 when such a tool uploads the file."""
    home = MissionItem(0, 0, 16)
    rows = [_wpl_row(n, item) for n, item in enumerate((home, *items))]
    return "\n".join([WPL_HEADER, *rows]) + "\n"


def read_wpl(text: str, where: str) -> tuple[MissionItem, ...]:
    """The items of a ``QGC WPL 110`` text without its line 0, the home position. Raises
    ScriptError."""
    rows = [line.split() for line in text.splitlines()[1:] if line.strip()]
    items = []
    for number, row in enumerate(rows):
        if len(row) != 12:
            raise ScriptError(
                f"{where}: line {number + 2}: has {len(row)} columns; a waypoint line has 12"
            )
        try:
            items.append(_wpl_item(row))
        except ValueError as error:
            raise ScriptError(
                f"{where}: line {number + 2}: {error}; expected numbers that an item can hold"
            ) from None
    return _renumber(items[1:])


def write_plan(items: Sequence[MissionItem]) -> str:
    """QGroundControl's plan file."""
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
        "geoFence": {"circles": [], "polygons": [], "version": 2},
        "groundStation": "Caribou",
        "mission": mission,
        "rallyPoints": {"points": [], "version": 2},
        "version": 1,
    }
    return json.dumps(plan, indent=2) + "\n"


def read_plan(text: str, where: str) -> tuple[MissionItem, ...]:
    """The items of a plan file made of simple items. Raises ScriptError."""
    try:
        entries = json.loads(text)["mission"]["items"]
        if any(entry.get("type") != "SimpleItem" for entry in entries):
            raise ScriptError(
                f"{where}: mission.items: only SimpleItem can be flown; surveys and scans cannot"
            )
        return _renumber([_from_plan(entry) for entry in entries])
    except json.JSONDecodeError as error:
        raise ScriptError(f"{where}: not JSON: {error}") from None
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        if isinstance(error, ScriptError):
            raise
        raise ScriptError(
            f"{where}: mission.items: not a QGroundControl plan ({error!r})"
        ) from None


def _wpl_row(number: int, item: MissionItem) -> str:
    x, y = _location(item)
    columns: list[Any] = [
        number,
        int(number == 0),
        item.frame,
        item.command,
        item.p1,
        item.p2,
        item.p3,
        item.p4,
    ]
    return "\t".join(str(column) for column in [*columns, x, y, item.z, item.autocontinue])


def _wpl_item(row: list[str]) -> MissionItem:
    frame, command, autocontinue = int(row[2]), int(row[3]), int(row[11])
    p1, p2, p3, p4, x, y, z = (float(column) for column in row[4:11])
    return _with_location(
        MissionItem(0, frame, command, 0, autocontinue, p1, p2, p3, p4, z=z), x, y
    )


def _plan_item(number: int, item: MissionItem) -> dict[str, Any]:
    x, y = _location(item)
    if _takes_place(item) and item.x == item.y == NOT_GIVEN:
        x = y = math.nan
    values = [item.p1, item.p2, item.p3, item.p4, x, y, item.z]
    return {
        "autoContinue": bool(item.autocontinue),
        "command": item.command,
        "doJumpId": number,
        "frame": item.frame,
        "params": [None if math.isnan(value) else value for value in values],
        "type": "SimpleItem",
    }


def _from_plan(entry: dict[str, Any]) -> MissionItem:
    p1, p2, p3, p4, x, y, z = (
        math.nan if value is None else float(value) for value in entry["params"]
    )
    autocontinue = int(entry.get("autoContinue", True))
    item = MissionItem(
        0, int(entry["frame"]), int(entry["command"]), 0, autocontinue, p1, p2, p3, p4, z=z
    )
    if _takes_place(item) and math.isnan(x) and math.isnan(y):
        return item._replace(x=NOT_GIVEN, y=NOT_GIVEN)
    return _with_location(item, 0.0 if math.isnan(x) else x, 0.0 if math.isnan(y) else y)


def _location(item: MissionItem) -> tuple[float, float]:
    """Columns 5 and 6 of a file: degrees, or metres from home, where the item has a place, else the
    plain numbers."""
    if item.frame == FRAME_MISSION:
        return item.x, item.y
    return item.x / _scale(item), item.y / _scale(item)


def _with_location(item: MissionItem, x: float, y: float) -> MissionItem:
    """The item at a place of a file. Raises ValueError where no message can carry it."""
    if not (0 <= item.frame <= _MAX_FRAME and 0 <= item.command <= _MAX_COMMAND):
        raise ValueError(f"frame {item.frame}, command {item.command}")
    if not all(-_MAX_COORDINATE <= value * _scale(item) < _MAX_COORDINATE for value in (x, y)):
        raise ValueError(f"place {x:g}, {y:g}")
    return item._replace(x=round(x * _scale(item)), y=round(y * _scale(item)))


def _takes_place(item: MissionItem) -> bool:
    """Whether x and y are a latitude and longitude, which may be left out."""
    return item.frame in GLOBAL_FRAMES and has_location(item.command)


def _scale(item: MissionItem) -> int:
    if item.frame == FRAME_MISSION:
        return 1
    return LOCAL_SCALE if item.frame == FRAME_LOCAL_NED else GLOBAL_SCALE


def _renumber(items: Sequence[MissionItem]) -> tuple[MissionItem, ...]:
    return tuple(item._replace(sequence=n, current=int(n == 0)) for n, item in enumerate(items))
