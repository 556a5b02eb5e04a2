"""Mission scripts in TOML, and their compilation to standard MAVLink mission items.

A script has a name, a description and a list of steps::

    name = "combined"
    about = "a depth and heading change together"

    [[step]]                 # a leg; a key that is missing keeps its last value
    depth_m = 4.0
    heading_deg = -80.0
    thrust_pct = 58.0        # or speed_mps
    duration_s = 30.0
    wait_depth = false       # true: the duration counts from when the depth is reached

    [[step]]                 # a waypoint; heading_deg must be missing
    to = [120.0, -40.0]      # metres north and east of home; or lat_deg and lon_deg
    accept_m = 5.0           # acceptance radius
    duration_s = 60.0        # time to circle there

    [[step]]                 # an open-loop test about the trim; the other plane stays controlled
    test = { signal = "step", axis = "rudder", magnitude_deg = 5.0, duration_s = 15 }

    # Keys by signal:
    #   step, doublet, 3211   none
    #   chirp                 f_start_hz, f_stop_hz
    #   multisine             f_start_hz, f_stop_hz; axis = "both" excites rudder and elevator
    #   prbs                  clock_hz, seed
    #   square                runs = [3, 2, 1, 1]: relative lengths between switches
    # axis = "thrust" takes magnitude_pct instead of magnitude_deg. All signals take fade_s, the
    # time of fading in and out, and loop_on = true, which keeps the control loops on and adds the
    # signal to their commands.

    [[step]]
    surface = true           # always the last step

A leg is compiled to DO_CHANGE_SPEED, DO_CHANGE_ALTITUDE, CONDITION_YAW and NAV_DELAY, a waypoint to
NAV_WAYPOINT, a test to MAV_CMD_USER_1 and the end to NAV_LAND.
"""

import math
from collections.abc import Iterator
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any, Literal

import msgspec

from ground.errors import out_of_range
from ground.missions import signals
from mavlink_io import toml_io
from mavlink_io.errors import ErrorCode, InputError
from mavlink_io.mission_items import (
    FRAME_LOCAL_NED,
    FRAME_MISSION,
    GLOBAL_SCALE,
    LOCAL_SCALE,
    MavCmd,
    MissionItem,
)
from mavlink_io.suggestions import did_you_mean
from mavlink_io.text_files import read_text

RELATIVE_ALTITUDE = 3
"""MAV_FRAME_GLOBAL_RELATIVE_ALT: altitude above home, which is at the water surface."""

MAX_DISTANCE_M = 100_000.0
"""Maximum distance of a waypoint from home: the range of the flat-earth approximation."""
SHIPPED = files("ground") / "missions"
"""Folder of the shipped missions."""


class ScriptError(InputError):
    """An invalid mission; the message names file, key, value and what is expected."""

    code = ErrorCode.MISSION_FILE


class MissionStep(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """One step: a leg, a test, or the surfacing at the end."""

    depth_m: float | None = None
    """Depth; a key of a leg that is missing keeps its last value."""
    heading_deg: float | None = None
    """Heading, clockwise from north; not for a waypoint."""
    thrust_pct: float | None = None
    """Thrust in percent of full thrust; or ``speed_mps``."""
    speed_mps: float | None = None
    """Speed through the water; or ``thrust_pct``."""
    duration_s: float | None = None
    """Duration of a leg, or time to circle at a waypoint."""
    wait_depth: bool | None = None
    """Whether the duration counts from when the depth is reached."""
    to: tuple[float, float] | None = None
    """Waypoint: metres north and east of home; or ``lat_deg`` and ``lon_deg``."""
    lat_deg: float | None = None
    """Latitude of a waypoint."""
    lon_deg: float | None = None
    """Longitude of a waypoint."""
    accept_m: float | None = None
    """Distance at which a waypoint counts as reached."""
    test: signals.TestSignal | None = None
    """Identification test about the trim; the other plane stays controlled."""
    surface: Literal[True] | None = None
    """Surface; always the last step."""

    @property
    def leg_keys(self) -> list[str]:
        """The keys of a leg that this step gives."""
        return [key for key in _LEG_KEYS if getattr(self, key) is not None]

    @property
    def goes_somewhere(self) -> bool:
        """True for a waypoint."""
        return self.to is not None or self.lat_deg is not None or self.lon_deg is not None


_LEG_KEYS = (
    "depth_m",
    "heading_deg",
    "thrust_pct",
    "speed_mps",
    "duration_s",
    "wait_depth",
    "to",
    "lat_deg",
    "lon_deg",
    "accept_m",
)


class Script(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """A mission as in its file."""

    name: str
    """Name of the mission."""
    step: tuple[MissionStep, ...]
    """Steps in their order."""
    about: str = ""
    """Description, shown by `ground missions`."""


def shipped_names() -> list[str]:
    """Return the names of the shipped missions."""
    return sorted(
        entry.name.removesuffix(".toml")
        for entry in SHIPPED.iterdir()
        if entry.name.endswith(".toml")
    )


def load(name_or_path: str) -> Script:
    """Read a shipped mission by its name, or a file by its path.

    Parameters
    ----------
    name_or_path : str
        Name of a shipped mission, or path of a mission file.

    Returns
    -------
    Script
        Steps of the mission.

    Raises
    ------
    ScriptError
        There is no such mission, or it is invalid.
    """
    source: Traversable = SHIPPED / f"{name_or_path}.toml"
    if not source.is_file():
        source = Path(name_or_path)
    try:
        text = read_text(source)
    except (OSError, UnicodeDecodeError):
        known = ", ".join(shipped_names())
        raise ScriptError(
            f"{name_or_path}: no readable mission file, and none of {known}"
            f"{did_you_mean(name_or_path, shipped_names())}"
        ) from None
    return parse(text, name_or_path)


def parse(text: str, where: str) -> Script:
    """Parse a mission from TOML text; `where` names it in errors. Raises ScriptError."""
    tables = toml_io.read(text, where, ScriptError)
    _check_steps(tables.get("step"), where)
    script = toml_io.convert(tables, Script, where, ScriptError)
    for number, step in enumerate(script.step, start=1):
        if fault := _step_fault(step, is_first=number == 1, is_last=number == len(script.step)):
            raise ScriptError(f"{where}: step {number}: {fault}")
    if not script.step:
        raise ScriptError(
            f"{where}: step: is empty; give at least one [[step]] and a last one with surface ="
            " true"
        )
    return script


def _check_steps(steps: Any, where: str) -> None:
    """Raise ScriptError for a step with a wrong key or value; it names the step's number."""
    for number, step in enumerate(steps if isinstance(steps, list) else (), start=1):
        if isinstance(step, dict):
            toml_io.convert(step, MissionStep, f"{where}: step {number}", ScriptError)


def compile_items(script: Script) -> tuple[MissionItem, ...]:
    """Return the mission items of a script.

    Parameters
    ----------
    script : Script
        Steps of the mission.

    Returns
    -------
    tuple of MissionItem
        Items, numbered from 0; the first one is current.
    """
    items = [item for step_items in _items_by_step(script) for item in step_items]
    return tuple(item._replace(sequence=n, current=int(n == 0)) for n, item in enumerate(items))


def step_numbers(script: Script) -> tuple[int, ...]:
    """Return the number of the step, from 1, for each item of `compile_items`."""
    numbered = enumerate(_items_by_step(script), start=1)
    return tuple(number for number, step_items in numbered for _ in step_items)


def duration_s(script: Script) -> float:
    """Return the duration of legs and tests, without transits, descent and ascent."""
    return sum((s.duration_s or 0.0) + (s.test.duration_s if s.test else 0) for s in script.step)


def _items_by_step(script: Script) -> Iterator[list[MissionItem]]:
    """Yield the mission items of each step."""
    depth_m = 0.0
    for step in script.step:
        depth_m = depth_m if step.depth_m is None else step.depth_m
        yield list(_items(step, depth_m))


def _step_fault(step: MissionStep, *, is_first: bool, is_last: bool) -> str:
    """Return the first error of a step; empty if it is valid."""
    kinds = [bool(step.leg_keys), step.test is not None, step.surface is not None]
    if sum(kinds) != 1:
        return "must be a leg (depth_m, heading_deg, ...), a test or surface = true, one of them"
    if is_last != bool(step.surface):
        return (
            "surface = true must be the last step"
            if step.surface
            else "the last step must be surface = true; add one after this step"
        )
    if step.test is not None:
        return (
            "test: comes before any leg; the first step must be a leg"
            if is_first
            else signals.signal_fault(step.test)
        )
    return _leg_fault(step, is_first=is_first) if step.leg_keys else ""


def _leg_fault(step: MissionStep, *, is_first: bool) -> str:
    """Return the first error of a leg or waypoint; empty if it is valid."""
    if step.thrust_pct is not None and step.speed_mps is not None:
        return "thrust_pct and speed_mps: give one of them"
    has_speed = step.thrust_pct is not None or step.speed_mps is not None
    has_heading = step.heading_deg is not None or step.goes_somewhere
    if is_first and (step.depth_m is None or not has_heading or not has_speed):
        return "the first leg must give depth_m, heading_deg (or to) and thrust_pct or speed_mps"
    if step.wait_depth and step.depth_m is None:
        return "wait_depth = true: needs depth_m"
    if step.goes_somewhere:
        if fault := _place_fault(step):
            return fault
    elif step.accept_m is not None:
        return "accept_m: needs to, or lat_deg and lon_deg"
    elif step.duration_s is None:
        return "duration_s: is missing; give the seconds to hold this leg"
    bounds = (
        ("depth_m", step.depth_m, 0.0, 6000.0),
        ("heading_deg", step.heading_deg, -180.0, 360.0),
        ("thrust_pct", step.thrust_pct, 0.0, 100.0),
        ("speed_mps", step.speed_mps, 0.0, 10.0),
        ("duration_s", step.duration_s, 0.0, 86_400.0),
        ("lat_deg", step.lat_deg, -90.0, 90.0),
        ("lon_deg", step.lon_deg, -180.0, 180.0),
        ("accept_m", step.accept_m, 0.5, 500.0),
        *(
            (f"to[{n}]", metres, -MAX_DISTANCE_M, MAX_DISTANCE_M)
            for n, metres in enumerate(step.to or ())
        ),
    )
    return next((fault for bound in bounds if (fault := out_of_range(*bound))), "")


def _place_fault(step: MissionStep) -> str:
    """Return the first error in the position of a waypoint; empty if it is valid."""
    if (step.lat_deg is None) != (step.lon_deg is None):
        return "lat_deg and lon_deg: give both or none"
    if step.to is not None and step.lat_deg is not None:
        return "to, and lat_deg and lon_deg: give one of them"
    clash = next(
        (key for key in ("heading_deg", "wait_depth") if getattr(step, key) is not None), ""
    )
    return (
        f"{clash}: cannot be combined with a position; give it in a separate step" if clash else ""
    )


def _items(step: MissionStep, depth_m: float) -> Iterator[MissionItem]:
    """Yield the items of a step; `depth_m` is the depth of a waypoint."""
    if step.surface:
        yield _item(MavCmd.NAV_LAND)
    elif step.test is not None:
        yield _test_item(step.test)
    else:
        yield from _speed_items(step)
        yield from (_waypoint_item(step, depth_m),) if step.goes_somewhere else _leg_items(step)


def _speed_items(step: MissionStep) -> Iterator[MissionItem]:
    """Yield the item that sets thrust or speed, if the step has one."""
    if step.thrust_pct is not None:
        yield _item(MavCmd.DO_CHANGE_SPEED, 0.0, -1.0, step.thrust_pct)
    if step.speed_mps is not None:
        yield _item(MavCmd.DO_CHANGE_SPEED, 0.0, step.speed_mps, -1.0)


def _waypoint_item(step: MissionStep, depth_m: float) -> MissionItem:
    """Return a waypoint at a depth."""
    item = _item(MavCmd.NAV_WAYPOINT, step.duration_s or 0.0, step.accept_m or 0.0)
    if step.to is not None:
        north, east = (round(metres * LOCAL_SCALE) for metres in step.to)
        return item._replace(frame=FRAME_LOCAL_NED, x=north, y=east, z=depth_m)
    lat, lon = (round((angle or 0.0) * GLOBAL_SCALE) for angle in (step.lat_deg, step.lon_deg))
    if lat == lon == 0:
        lat = 1  # 11 mm off: exactly 0, 0 means "here" to most vehicles
    return item._replace(frame=RELATIVE_ALTITUDE, x=lat, y=lon, z=-depth_m)


def _leg_items(step: MissionStep) -> Iterator[MissionItem]:
    """Yield the items of a leg."""
    if step.depth_m is not None:
        yield _item(MavCmd.DO_CHANGE_ALTITUDE, -step.depth_m, RELATIVE_ALTITUDE)
    if step.heading_deg is not None:
        yield _item(MavCmd.CONDITION_YAW, step.heading_deg % 360.0)
    if step.wait_depth and step.depth_m is not None:
        yield _item(MavCmd.CONDITION_CHANGE_ALT, z=-step.depth_m)._replace(frame=RELATIVE_ALTITUDE)
    if step.duration_s:
        yield _item(MavCmd.NAV_DELAY, step.duration_s, -1.0, -1.0, -1.0)


def _test_item(test: signals.TestSignal) -> MissionItem:
    """Return the item of a test."""
    axis, magnitude, p3, p4, duration_s, wave, fade_s = signals.command_parameters(test)
    return _item(MavCmd.USER_1, axis, magnitude, p3, p4, fade_s)._replace(x=duration_s, y=wave)


def _item(
    command: int, p1: float = 0.0, p2: float = 0.0, p3: float = 0.0, p4: float = 0.0, z: float = 0.0
) -> MissionItem:
    """Return an item without a position."""
    assert all(map(math.isfinite, (p1, p2, p3, p4, z)))
    return MissionItem(0, FRAME_MISSION, command, p1=p1, p2=p2, p3=p3, p4=p4, z=z)
