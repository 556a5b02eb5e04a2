"""Format the messages of a vehicle as rows of text and numbers.

`ROWS` lists each row with the messages that it can be read from.
"""

import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple, Protocol

from ground.client.commands import readable_name
from ground.live.watch import mode_names
from ground.live.watch.receiver import LatestMessage, Receiver
from mavlink_io.device_messages import UNKNOWN_U16
from mavlink_io.dialect import constant, enum_names
from mavlink_io.frames import euler_from_quaternion
from mavlink_io.records import ARMED_FLAG

LEVEL_MPS = 0.005
"""Vertical speed below which no direction is shown."""
STALE_AFTER_S, STALE_AFTER_PERIODS = 3.0, 3.0
_SUBMARINE = constant("MAV_TYPE_SUBMARINE")
_CRITICAL = constant("MAV_STATE_CRITICAL")
_LOOKING_DOWN = constant("MAV_SENSOR_ROTATION_PITCH_270")
_EXTENSION_USED = constant("MAV_SYS_STATUS_EXTENSION_USED")
_GEOFENCE, _PREARM = constant("MAV_SYS_STATUS_GEOFENCE"), constant("MAV_SYS_STATUS_PREARM_CHECK")
_FIX_3D = 3
_NO_SIGNAL = 1
"""``signal_quality`` of a DISTANCE_SENSOR without a valid echo; 0: not reported."""


class Cell(NamedTuple):
    """Content of a row: text, value for JSON (SI units, angles in degrees) and alarm flag."""

    text: str
    value: Any
    alarm: bool = False


class WatchRow(NamedTuple):
    """One line of the view; ``cell`` and ``age_s`` are None without data."""

    section: str
    label: str
    cell: Cell | None
    age_s: float | None
    stale: bool


class RowContext(NamedTuple):
    """Data that a reader needs in addition to its message."""

    under_water: bool
    modes: Mapping[int, str]


ReadCell = Callable[[Any, RowContext], Cell | None]


def vehicle(m: Any, context: RowContext) -> Cell:
    """Return the types of vehicle and autopilot of a HEARTBEAT."""
    kind, autopilot = readable_name(m.type, "MAV_TYPE"), readable_name(m.autopilot, "MAV_AUTOPILOT")
    return Cell(f"{kind} ({autopilot})", {"type": kind, "autopilot": autopilot})


def version(m: Any, context: RowContext) -> Cell:
    """Return the firmware version of an AUTOPILOT_VERSION."""
    number = m.flight_sw_version
    words = ".".join(str(number >> shift & 0xFF) for shift in (24, 16, 8))
    return Cell(words, words)


def mode(m: Any, context: RowContext) -> Cell:
    """Return the name of the flight mode of a HEARTBEAT."""
    words = mode_names.name(m, context.modes)
    return Cell(words, words)


def armed(m: Any, context: RowContext) -> Cell:
    """Return whether the vehicle of a HEARTBEAT is armed."""
    is_armed = bool(m.base_mode & ARMED_FLAG)
    return Cell("ARMED" if is_armed else "disarmed", is_armed)


def state(m: Any, context: RowContext) -> Cell:
    """Return the system status of a HEARTBEAT; alarm from MAV_STATE_CRITICAL on."""
    words = readable_name(m.system_status, "MAV_STATE")
    return Cell(words, words, m.system_status >= _CRITICAL)


def under_way(m: Any, context: RowContext) -> Cell:
    """Return the landed state of an EXTENDED_SYS_STATE."""
    words = readable_name(m.landed_state, "MAV_LANDED_STATE")
    if context.under_water:
        words = {"on ground": "moored", "in air": "under way"}.get(words, words)
    return Cell(words, words)


def _words(value: float, spec: str) -> str:
    """Return a number as text, or the word for an unknown one."""
    return format(value, spec) if math.isfinite(value) else "unknown"


def _cell(text: str, **values: float) -> Cell | None:
    """Return a cell with None for unknown numbers; None if all are unknown."""
    known = {name: value if math.isfinite(value) else None for name, value in values.items()}
    return Cell(text, known) if any(value is not None for value in known.values()) else None


def _height(up_m: float, context: RowContext) -> Cell | None:
    """Return depth (m, under water) or altitude (m) of a height ``up_m``, positive up."""
    if not math.isfinite(up_m):
        return None
    if context.under_water:
        return Cell(f"{-up_m:z.2f} m deep", {"depth_m": -up_m})
    return Cell(f"{up_m:.1f} m up", {"altitude_m": up_m})


def height_of_global_position(m: Any, context: RowContext) -> Cell | None:
    """Return depth or altitude (m) of a GLOBAL_POSITION_INT, relative to home."""
    return _height(m.relative_alt / 1000.0, context)


def height_of_local_position(m: Any, context: RowContext) -> Cell | None:
    """Return depth or altitude (m) of a LOCAL_POSITION_NED."""
    return _height(-m.z, context)


def height_of_hud(m: Any, context: RowContext) -> Cell | None:
    """Return depth or altitude (m) of a VFR_HUD."""
    return _height(m.alt, context)


def _attitude(roll_rad: float, pitch_rad: float) -> Cell | None:
    """Return roll and pitch in degrees."""
    roll_deg, pitch_deg = math.degrees(roll_rad), math.degrees(pitch_rad)
    return _cell(
        f"roll {_words(roll_deg, '+z.1f')}, pitch {_words(pitch_deg, '+z.1f')} deg",
        roll_deg=roll_deg,
        pitch_deg=pitch_deg,
    )


def attitude(m: Any, context: RowContext) -> Cell | None:
    """Return roll and pitch (deg) of an ATTITUDE."""
    return _attitude(m.roll, m.pitch)


def attitude_of_quaternion(m: Any, context: RowContext) -> Cell | None:
    """Return roll and pitch (deg) of an ATTITUDE_QUATERNION; None if it is unknown."""
    quaternion = m.q1, m.q2, m.q3, m.q4
    if not all(map(math.isfinite, quaternion)):
        return None
    roll_rad, pitch_rad, _ = euler_from_quaternion(*quaternion)
    return _attitude(roll_rad, pitch_rad)


def _heading(deg: float) -> Cell | None:
    """Return a heading in [0, 360) degrees; None if it is unknown."""
    if not math.isfinite(deg):
        return None
    return Cell(f"{round(deg) % 360:03d} deg", deg % 360.0)


def heading_of_attitude(m: Any, context: RowContext) -> Cell | None:
    """Return the heading (deg) of an ATTITUDE."""
    return _heading(math.degrees(m.yaw))


def heading_of_global_position(m: Any, context: RowContext) -> Cell | None:
    """Return the heading (deg) of a GLOBAL_POSITION_INT; None if it is unknown."""
    return _heading(m.hdg / 100.0)


def speed(m: Any, context: RowContext) -> Cell | None:
    """Return the speeds through the water and over ground (m/s) of a VFR_HUD."""
    through, over_ground = _words(m.airspeed, ".2f"), _words(m.groundspeed, ".2f")
    unit = " m/s" if math.isfinite(m.airspeed) else ""
    return _cell(
        f"{through}{unit}, {over_ground} over ground",
        through_mps=m.airspeed,
        over_ground_mps=m.groundspeed,
    )


def vertical_speed(m: Any, context: RowContext) -> Cell | None:
    """Return the vertical speed (m/s, positive up) of a VFR_HUD; None if it is unknown."""
    direction = "" if abs(m.climb) < LEVEL_MPS else " up" if m.climb > 0 else " down"
    return _cell(f"{abs(m.climb):.2f} m/s{direction}", climb_mps=m.climb)


def has_position(m: Any) -> bool:
    """Return whether latitude and longitude of a GLOBAL_POSITION_INT are known."""
    return math.isfinite(m.lat) and math.isfinite(m.lon) and bool(m.lat or m.lon)


def position(m: Any, context: RowContext) -> Cell | None:
    """Return latitude and longitude (deg) of a GLOBAL_POSITION_INT; None if it has none."""
    if not has_position(m):
        return None
    return Cell(
        f"{m.lat / 1e7:.6f}, {m.lon / 1e7:.6f}", {"lat_deg": m.lat / 1e7, "lon_deg": m.lon / 1e7}
    )


def offset(m: Any, context: RowContext) -> Cell | None:
    """Return the position north and east of the origin (m) of a LOCAL_POSITION_NED."""
    text = f"{_words(m.x, '+z.1f')} m north, {_words(m.y, '+z.1f')} m east"
    return _cell(text, north_m=m.x, east_m=m.y)


def gps(m: Any, context: RowContext) -> Cell | None:
    """Return fix type and number of satellites of a GPS_RAW_INT; None if the fix is unknown."""
    if not math.isfinite(m.fix_type):
        return None
    fix = readable_name(m.fix_type, "GPS_FIX_TYPE")
    satellites = "" if m.satellites_visible in (0, 255) else f", {m.satellites_visible} satellites"
    return Cell(fix + satellites, {"fix": fix, "good": m.fix_type >= _FIX_3D})


def bottom(m: Any, context: RowContext) -> Cell | None:
    """Return the distance to the bottom (m) of a DISTANCE_SENSOR; None if it does not look down."""
    if m.orientation != _LOOKING_DOWN:
        return None
    if m.signal_quality == _NO_SIGNAL:
        return Cell("no echo", None)
    if not m.min_distance <= m.current_distance <= m.max_distance:
        return Cell("out of range", None)
    return Cell(f"{m.current_distance / 100.0:.1f} m below", m.current_distance / 100.0)


def battery(m: Any, context: RowContext) -> Cell | None:
    """Return voltage (V), current (A) and charge (%) of a BATTERY_STATUS; None if unknown."""
    cells_mv = [mv for mv in (*m.voltages, *m.voltages_ext) if mv not in (0, UNKNOWN_U16)]
    return _battery(
        sum(cells_mv) / 1e3 if cells_mv else None, m.current_battery, m.battery_remaining
    )


def battery_of_status(m: Any, context: RowContext) -> Cell | None:
    """Return voltage (V), current (A) and charge (%) of a SYS_STATUS; None if unknown."""
    volts = None if m.voltage_battery == UNKNOWN_U16 else m.voltage_battery / 1e3
    return _battery(volts, m.current_battery, m.battery_remaining)


def _battery(volts: float | None, centiamperes: int, percent: int) -> Cell | None:
    """Return the known values of a battery, with an alarm below 20 % of charge."""
    amperes = None if centiamperes == -1 else centiamperes / 100.0
    remaining_pct = percent if 0 <= percent <= 100 else None
    parts = [
        f"{volts:.2f} V" if volts is not None else "",
        f"{amperes:.1f} A" if amperes is not None else "",
    ]
    parts.append(f"{remaining_pct} % left" if remaining_pct is not None else "")
    if not any(parts):
        return None
    value = {"voltage_v": volts, "current_a": amperes, "remaining_pct": remaining_pct}
    return Cell(
        ", ".join(filter(None, parts)), value, remaining_pct is not None and remaining_pct < 20
    )


def mission(m: Any, context: RowContext) -> Cell | None:
    """Return the current mission item, counted from 1, and the state of a MISSION_CURRENT.

    None if the item is unknown.
    """
    if not math.isfinite(m.seq):
        return None
    stage = readable_name(m.mission_state, "MISSION_STATE") if m.mission_state else ""
    total = m.total if m.total not in (0, UNKNOWN_U16) else None
    words = (
        f"item {m.seq + 1} of {total}"
        if total
        else "none"
        if stage == "no mission"
        else f"item {m.seq + 1}"
    )
    words += f", {stage}" if stage and stage != "no mission" else ""
    return Cell(words, {"item": m.seq, "items": total, "state": stage or None})


def aim(m: Any, context: RowContext) -> Cell | None:
    """Return bearing (deg) and distance (m) to the target of a NAV_CONTROLLER_OUTPUT."""
    bearing_deg = m.target_bearing % 360
    text = f"{_words(bearing_deg, '03.0f')} deg, {_words(m.wp_dist, '.0f')} m to go"
    return _cell(text, bearing_deg=bearing_deg, distance_m=m.wp_dist)


def health(m: Any, context: RowContext) -> Cell:
    """Return the sensors that are present, enabled and unhealthy, without the pre-arm check."""
    unhealthy = (
        m.onboard_control_sensors_enabled
        & m.onboard_control_sensors_present
        & ~m.onboard_control_sensors_health
    )
    unhealthy &= ~(_EXTENSION_USED | _GEOFENCE | _PREARM)
    names = [_sensor(bit) for bit in enum_names("MAV_SYS_STATUS_SENSOR") if unhealthy & bit]
    if m.onboard_control_sensors_present & _EXTENSION_USED:
        extended = (
            m.onboard_control_sensors_enabled_extended & m.onboard_control_sensors_present_extended
        )
        extended &= ~m.onboard_control_sensors_health_extended
        names += [
            _sensor(bit, "_EXTENDED")
            for bit in enum_names("MAV_SYS_STATUS_SENSOR_EXTENDED")
            if extended & bit
        ]
    return Cell("unhealthy: " + ", ".join(names) if names else "all healthy", names, bool(names))


def ready(m: Any, context: RowContext) -> Cell | None:
    """Return whether the pre-arm check of a SYS_STATUS passes; None without such a check."""
    if not m.onboard_control_sensors_present & _PREARM:
        return None
    good = bool(m.onboard_control_sensors_health & _PREARM)
    return Cell("ready to arm" if good else "not ready to arm", good, not good)


def _sensor(bit: int, extended: str = "") -> str:
    """Return the readable name of a sensor bit of a SYS_STATUS."""
    words = (
        enum_names(f"MAV_SYS_STATUS_SENSOR{extended}")[bit]
        .removeprefix("MAV_SYS_STATUS_")
        .removeprefix("SENSOR_")
    )
    return words.replace("_", " ").lower()


ROWS: tuple[tuple[str, str, tuple[tuple[str, ReadCell], ...]], ...] = (
    ("vehicle", "identity", (("HEARTBEAT", vehicle),)),
    ("vehicle", "version", (("AUTOPILOT_VERSION", version),)),
    ("vehicle", "mode", (("HEARTBEAT", mode),)),
    ("vehicle", "armed", (("HEARTBEAT", armed),)),
    ("vehicle", "state", (("HEARTBEAT", state),)),
    ("vehicle", "is", (("EXTENDED_SYS_STATE", under_way),)),
    ("vehicle", "health", (("SYS_STATUS", health),)),
    ("vehicle", "checks", (("SYS_STATUS", ready),)),
    ("vehicle", "battery", (("BATTERY_STATUS", battery), ("SYS_STATUS", battery_of_status))),
    (
        "motion",
        "height",
        (
            ("GLOBAL_POSITION_INT", height_of_global_position),
            ("LOCAL_POSITION_NED", height_of_local_position),
            ("VFR_HUD", height_of_hud),
        ),
    ),
    ("motion", "climb", (("VFR_HUD", vertical_speed),)),
    (
        "motion",
        "heading",
        (("ATTITUDE", heading_of_attitude), ("GLOBAL_POSITION_INT", heading_of_global_position)),
    ),
    (
        "motion",
        "attitude",
        (("ATTITUDE", attitude), ("ATTITUDE_QUATERNION", attitude_of_quaternion)),
    ),
    ("motion", "speed", (("VFR_HUD", speed),)),
    ("motion", "position", (("GLOBAL_POSITION_INT", position),)),
    ("motion", "offset", (("LOCAL_POSITION_NED", offset),)),
    ("motion", "gps", (("GPS_RAW_INT", gps),)),
    ("motion", "bottom", (("DISTANCE_SENSOR", bottom),)),
    ("mission", "mission", (("MISSION_CURRENT", mission),)),
    ("mission", "aim", (("NAV_CONTROLLER_OUTPUT", aim),)),
)
"""Section, label and sources of each row; the first source with data is shown."""
NEVER_STALE = frozenset(("AUTOPILOT_VERSION",))
"""Messages that are sent once and do not become stale."""


class LatestMessages(Protocol):
    """Source of the rows: the latest messages of a vehicle and the names of its modes."""

    latest: dict[str, LatestMessage]
    modes: dict[int, str]


def rows(receiver: LatestMessages, now_s: float) -> list[WatchRow]:
    """Return every line of the view, with present ages."""
    heartbeat = receiver.latest.get("HEARTBEAT")
    context = RowContext(
        heartbeat is not None and heartbeat.message.type == _SUBMARINE, receiver.modes
    )
    return [
        _row(section, label, sources, receiver.latest, context, now_s)
        for section, label, sources in ROWS
    ]


def _row(
    section: str,
    label: str,
    sources: tuple[tuple[str, ReadCell], ...],
    latest: Mapping[str, LatestMessage],
    context: RowContext,
    now_s: float,
) -> WatchRow:
    """Return the row of the first source with a recent message."""
    for name, reader in sources:
        latest_message = latest.get(name)
        if (
            latest_message is not None
            and (cell := reader(latest_message.message, context)) is not None
        ):
            age_s = now_s - latest_message.at_s
            return WatchRow(
                section=section,
                label=label,
                cell=cell,
                age_s=age_s,
                stale=name not in NEVER_STALE and is_stale(latest_message, now_s),
            )
    return WatchRow(section=section, label=label, cell=None, age_s=None, stale=True)


def is_stale(latest_message: LatestMessage, now_s: float) -> bool:
    """Return whether a message is overdue by several periods."""
    return now_s - latest_message.at_s > max(
        STALE_AFTER_S, STALE_AFTER_PERIODS * latest_message.period_s
    )


def as_json(receiver: Receiver, now_s: float) -> dict[str, Any]:
    """Return all rows with value and age (s) as JSON values."""
    rate_bytes, rate_messages = receiver.rates(now_s)
    row_values = {
        row.label: {
            "value": row.cell.value,
            "text": row.cell.text,
            "age_s": round(row.age_s or 0.0, 2),
            "stale": row.stale,
        }
        for row in rows(receiver, now_s)
        if row.cell is not None
    }
    return {
        "system": receiver.vehicle_id.system if receiver.vehicle_id else None,
        "component": receiver.vehicle_id.component if receiver.vehicle_id else None,
        **row_values,
        "link": {
            "address": receiver.address,
            "bytes_per_s": round(rate_bytes),
            "messages_per_s": round(rate_messages, 1),
            "lost_messages": receiver.lost_frames,
            "rejected_messages": receiver.rejected_frames,
        },
        "texts": [
            {"severity": text.severity, "text": text.text, "age_s": round(now_s - text.at_s, 1)}
            for text in receiver.texts
        ],
    }
