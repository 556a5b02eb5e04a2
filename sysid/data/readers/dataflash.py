"""ArduPilot's logs (.bin), decoded one message type at a time with pymavlink's field codes.

pymavlink's DFReader is not used: it decodes single messages, and does not return for a damaged FMT
of length 0. Messages are those of ArduPilot's LogStructure.h: angles in degrees, altitude positive
up, outputs as pulses in microseconds.
"""

import math
import re
import struct
from collections import defaultdict
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mavlink_io.text_files import read_limited
from sysid.data.bit_errors import damaged_names
from sysid.data.dataset import (
    Actuators,
    Array,
    Attitude,
    Depth,
    Log,
    LogError,
    LogEvent,
    Setpoints,
    SpecificForce,
    Velocity,
)
from sysid.data.events import (
    StopReason,
    TestAxis,
    TestEnded,
    TestStarted,
    TestWave,
    is_damaged,
    parse_text,
)
from sysid.data.readers.parameter_history import ParameterHistory, history_of
from sysid.data.readers.samples import (
    FileDamage,
    MessageColumns,
    accelerometer,
    ahead_of_others,
    attitude_of_angles,
    attitude_with_rates,
    body_velocity,
    clock_steps,
    foreign_log,
    format_damage,
    ground_speed,
    is_parameter_name,
    strictly_increasing,
    usable,
    zero_depth,
)
from sysid.data.readers.servo_channels import (
    READ_PARAMETERS,
    OutputOptions,
    actuator_commands,
    travel_rad,
)
from sysid.data.readers.spikes import Plausible, drop_contradicted, merged

_HEAD = b"\xa3\x95"
_HEAD_LENGTH = 3
_FMT = 0x80
_format = struct.Struct("<BB4s16s64s")
"""Body of an FMT message: number, length, name, field codes and columns of a message type."""
_REQUIRED_MESSAGES = (
    "ATT or AHR2, RCOU, and for tests of the elevator the altitude in CTUN, POS, BARO, XKF1, NKF1"
    " or AHR2"
)
_ATTITUDES = ("ATT", "AHR2")
"""Messages with Roll, Pitch and Yaw in degrees, the best source first."""
_ANGLES = ("Roll", "Pitch", "Yaw")
_RATES = (
    ("RATE", ("R", "P", "Y"), math.radians(1.0)),
    ("IMU", ("GyrX", "GyrY", "GyrZ"), 1.0),
    ("GYR", ("GyrX", "GyrY", "GyrZ"), 1.0),
)
"""Messages with the body rates: columns and factor to rad/s. RATE is ArduSub's and ArduCopter's;
ArduRover and ArduPlane log IMU."""
_ALTITUDES = (
    ("CTUN", "Alt", -1.0),
    ("POS", "RelHomeAlt", -1.0),
    ("BARO", "Alt", -1.0),
    ("XKF1", "PD", 1.0),
    ("NKF1", "PD", 1.0),
    ("AHR2", "Alt", -1.0),
)
"""Message and column of altitude or depth, and the factor to depth, the best source first."""
_VELOCITIES = ("XKF1", "NKF1")
"""Messages with the velocity of the estimator over ground: VN, VE and VD in m/s."""
_ACCELEROMETERS = ("IMU", "ACC")
"""Messages with AccX, AccY and AccZ in m/s2."""
_ACCELERATION = ("AccX", "AccY", "AccZ")
_ANGLE, _YAW = Plausible(floor=1.0), Plausible(floor=1.0, period=360.0)
_OUTPUT = re.compile(r"(?:C|Ch|Chan)(\d+)")
_DEPTH, _SPEED, _FORCE = Plausible(floor=0.2), Plausible(floor=0.2), Plausible(floor=0.5)
_PLAUSIBLE = merged(
    {
        name: {"Roll": _ANGLE, "Pitch": _ANGLE, "Yaw": _YAW, "DesPitch": _ANGLE, "DesYaw": _YAW}
        for name in _ATTITUDES
    },
    {
        name: dict.fromkeys(columns, Plausible(floor=math.radians(3.0) / factor))
        for name, columns, factor in _RATES
    },
    {name: {column: _DEPTH} for name, column, _ in _ALTITUDES if name != "AHR2"},
    {name: dict.fromkeys(("VN", "VE", "VD"), _SPEED) for name in _VELOCITIES},
    {name: dict.fromkeys(_ACCELERATION, _FORCE) for name in _ACCELEROMETERS},
    {
        "CTUN": {"DAlt": _DEPTH},
        "GPS": {"Spd": _SPEED},
        "RCOU": {
            f"{prefix}{n}": Plausible(25.0) for prefix in ("C", "Ch", "Chan") for n in range(15)
        },
    },
)
"""Smallest spikes that are reported: 1 deg, 3 deg/s, 0.2 m, 25 us, 0.2 m/s, 0.5 m/s2."""
_TIMES = ("TimeUS",)
_EVENTS = {"MSG": ("Message",), "MODE": ("Mode",), "SIDS": ("Ax", "Mag")}
"""Messages of events, with the columns that are read."""
_READ = {
    name: (*_TIMES, *columns)
    for name, columns in {**_PLAUSIBLE, **_EVENTS, "PARM": ("Name", "Value")}.items()
}
"""Columns that are read, by message."""
_UNTIMED = {"PARM": ("Name", "Value"), "MSG": ("Message",), "MODE": ("Mode",)}
"""Messages that have no time in versions before 2015, with the columns that are read."""
_SIMILAR = {"IMT"}
"""ArduPilot's messages whose names differ in one bit from one of `_READ`."""
_EARLIER, _EVENT_AHEAD_S, _EVENT_BEHIND_S = 10, 0.1, 1.0
"""Number of regular messages written before an event, and the largest times by which it may be
later and earlier than they are."""
_SPANS_AHEAD = 1.5
"""Span of these messages by which an event may be later, too: some logs have 10 Hz."""
_MESSAGE_NAME, _COLUMN_NAME = re.compile(r"[A-Za-z0-9_]{1,4}"), re.compile(r"[\w\[\]]*", re.ASCII)
_INSTANCES = ("I", "C")
"""Columns with the number of a sensor or of an estimator; the first is read."""
_MIXER_AXES = range(10, 14)
"""Values of SIDS.Ax with a magnitude in fractions of the travel, not in degrees."""
_INFO = 6
"""MAV_SEVERITY_INFO: MSG has no severity."""
_TEST_MODE_WINDOW_S = (-0.1, 0.5)
"""Times from the start of a test between which the log reports the mode of the test."""

Tables = dict[str, MessageColumns]


def read(path: Path, options: OutputOptions) -> Log:
    """Read one .bin.

    Parameters
    ----------
    path : Path
        The file.
    options : OutputOptions
        Output numbers of rudder, elevator and thrust, and the travel.

    Returns
    -------
    Log
        Arrays in MAVLink's axes, time since boot.

    Raises
    ------
    LogError
        The file is damaged, or has not all required messages.
    """
    message_tables, damage = load(path)
    checked = {
        name: _first_instance(table) for name, table in message_tables.items() if name in _PLAUSIBLE
    }
    checked, spikes = drop_contradicted(checked, _PLAUSIBLE)
    message_tables |= checked
    history = _parameters(message_tables)
    parameters = history.latest()
    damage = damage._replace(
        contradicted_s=(*damage.contradicted_s, *spikes.contradicted_s),
        impossible_names=damage.impossible_names + _damaged_names(message_tables, parameters),
    )
    attitude, actuators = (
        _attitude(path, message_tables),
        _actuators(path, message_tables, options, history),
    )
    depth = _depth(path, message_tables, attitude.time_s)
    steps = [
        step
        for name in (*_ATTITUDES, "RCOU")
        if name in message_tables
        for step in clock_steps(name, message_tables[name].time_s)
    ]
    events = _events(message_tables, float(np.degrees(travel_rad(parameters, options))))
    return foreign_log(
        path,
        attitude=attitude,
        actuators=actuators,
        depth=depth,
        setpoints=_setpoints(message_tables),
        events=events,
        parameters=parameters,
        steps=steps,
        damage=format_damage(damage, attitude.time_s),
        velocity=_velocity(path, message_tables, attitude),
        specific_force=_specific_force(path, message_tables),
    )


def load(path: Path) -> tuple[Tables, FileDamage]:
    """Return all messages with a time by name, and the damage; raise LogError for a bad file."""
    try:
        data = read_limited(path)
    except OSError as error:
        raise LogError(f"{path}: {error.strerror}; give an ArduPilot .bin") from None
    index, damage = _index(data)
    tables, untimed = Tables(), dict[str, dict[str, NDArray[Any]]]()
    offsets_by_name = dict[str, list[int]]()
    for kind, offsets in index:
        columns = _decode(np.frombuffer(data, np.uint8), kind, offsets)
        if columns is None:
            continue
        offsets_by_name[kind.name] = offsets
        time_s = _times_s(columns)
        if time_s is not None:
            tables[kind.name] = MessageColumns(time_s, columns)
        elif kind.name in _UNTIMED and set(_UNTIMED[kind.name]) <= columns.keys():
            untimed[kind.name] = columns
    for name, columns in untimed.items():
        time_s = _times_before(offsets_by_name[name], tables, offsets_by_name)
        if time_s is not None:
            tables[name] = MessageColumns(time_s, columns)
    if not tables:
        raise LogError(f"{path}: holds no message of an ArduPilot log")
    return _drop_misplaced(tables, offsets_by_name, damage)


def _drop_misplaced(
    tables: Tables, offsets: dict[str, list[int]], damage: FileDamage
) -> tuple[Tables, FileDamage]:
    """Leave out the events whose time contradicts the messages written before them.

    The latest of these does not count: its time may be damaged. Events before the first regular
    messages are not compared.
    """
    regular = [name for name in tables if name in _PLAUSIBLE]
    if not regular:
        return tables, damage
    places = np.concatenate([np.empty(0), *(np.array(offsets[name], float) for name in regular)])
    order = np.argsort(places)
    times_s = np.concatenate([np.empty(0), *(tables[name].time_s for name in regular)])[order]
    kept, dropped_s = dict(tables), list[float]()
    for name in tables.keys() & _EVENTS:
        time_s, columns = tables[name]
        ends = np.searchsorted(places[order], offsets[name])
        before = [np.sort(times_s[max(0, end - _EARLIER) : end]) for end in ends]
        known = [
            (recent[-2], recent[-2] - recent[1]) if recent.size == _EARLIER else (t, 0.0)
            for recent, t in zip(before, time_s, strict=True)
        ]
        latest_s, span_s = np.array(known).reshape(-1, 2).T
        ahead_s = time_s - latest_s
        good = (ahead_s >= -_EVENT_BEHIND_S) & (
            ahead_s <= np.maximum(_EVENT_AHEAD_S, _SPANS_AHEAD * span_s)
        )
        kept[name] = MessageColumns(
            _times_after_restart(tables, offsets, name)[good],
            {k: v[good] for k, v in columns.items()},
        )
        dropped_s += latest_s[~good].tolist()
    return kept, damage._replace(contradicted_s=tuple(dropped_s))


def _times_after_restart(tables: Tables, offsets: dict[str, list[int]], name: str) -> Array:
    """Return the times of events; those after a restart have the latest time before it.

    Samples after the restart are left out until they are later than that. Their times would be
    those of other samples, or of none.
    """
    regular = max(_PLAUSIBLE.keys() & tables.keys(), key=lambda n: tables[n].time_s.size)
    time_s = tables[regular].time_s
    latest_s = np.maximum.accumulate(np.where(ahead_of_others(time_s), -np.inf, time_s))
    latest_s = np.where(latest_s - time_s > _EVENT_BEHIND_S, latest_s, -np.inf)
    last = np.searchsorted(offsets[regular], offsets[name]) - 1
    return np.maximum(tables[name].time_s, np.where(last < 0, -np.inf, latest_s[last]))


def _damaged_names(tables: Tables, parameters: Collection[str]) -> int:
    """Return the number of names and texts with characters or bits that none has."""
    possible = [name for name in parameters if is_parameter_name(name)]
    number = len(parameters) - len(possible) + damaged_names(possible, READ_PARAMETERS)
    if "MSG" in tables and "Message" in tables["MSG"].columns:
        number += sum(map(is_damaged, _texts(tables["MSG"])))
    return number


def _texts(table: MessageColumns) -> list[str]:
    """Return the texts of MSG."""
    return [bytes(text).decode("utf-8", "replace") for text in table.columns["Message"]]


class _MessageFormat(NamedTuple):
    """Message type, as defined by an FMT message."""

    name: str
    length: int
    """Length of a whole message with header, bytes."""
    codes: str
    """Field codes, one character per column."""
    columns: tuple[str, ...]
    """Names of the columns."""


def _index(data: bytes) -> tuple[list[tuple[_MessageFormat, list[int]]], FileDamage]:
    """Return the message types with the offsets of their messages; other bytes are skipped."""
    skipped: list[int] = []
    end = 0
    kinds, offsets_by_kind, offset = (
        {
            _FMT: _MessageFormat(
                name="FMT", length=_HEAD_LENGTH + _format.size, codes="", columns=()
            )
        },
        defaultdict[int, list[int]](list),
        0,
    )
    while 0 <= offset <= len(data) - _HEAD_LENGTH:
        kind = kinds.get(data[offset + 2]) if data.startswith(_HEAD, offset) else None
        if kind is None or offset + kind.length > len(data):
            offset = data.find(_HEAD, offset + 1)
            continue
        if offset > end:
            skipped.append(offset - end)
        offsets_by_kind[data[offset + 2]].append(offset)
        if kind.name == "FMT":
            number, length, *texts = _format.unpack_from(data, offset + _HEAD_LENGTH)
            name, codes, columns = (
                text.split(b"\0", 1)[0].decode("ascii", "replace") for text in texts
            )
            if length > _HEAD_LENGTH:
                kinds.setdefault(
                    number,
                    _MessageFormat(
                        name=name, length=length, codes=codes, columns=tuple(columns.split(","))
                    ),
                )
        offset += kind.length
        end = offset
    impossible = sum(
        not _MESSAGE_NAME.fullmatch(kind.name) or not all(map(_COLUMN_NAME.fullmatch, kind.columns))
        for kind in kinds.values()
        if kind.name != "FMT"
    )
    impossible += damaged_names({kind.name for kind in kinds.values()} - _SIMILAR, _READ.keys())
    impossible += sum(
        damaged_names(kind.columns, _READ.get(kind.name, _TIMES)) for kind in kinds.values()
    )
    impossible += sum(not _is_consistent(kind) for kind in kinds.values() if kind.codes)
    damage = FileDamage(sum(skipped), len(skipped), len(data) - end, impossible_names=impossible)
    return [(kinds[number], offsets) for number, offsets in offsets_by_kind.items()], damage


def _is_consistent(kind: _MessageFormat) -> bool:
    """Return whether field codes, columns and length of a message type agree."""
    from pymavlink.DFReader import FORMAT_TO_STRUCT

    if not set(kind.codes) <= FORMAT_TO_STRUCT.keys():
        return False
    sizes = (struct.calcsize(f"<{FORMAT_TO_STRUCT[code][0]}") for code in kind.codes)
    return len(kind.codes) == len(kind.columns) and sum(sizes) == kind.length - _HEAD_LENGTH


def _decode(
    data: NDArray[np.uint8], kind: _MessageFormat, offsets: list[int]
) -> dict[str, NDArray[Any]] | None:
    """Return the columns of all messages of one type; None with a length unlike the FMT."""
    from pymavlink.DFReader import FORMAT_TO_STRUCT

    codes = [FORMAT_TO_STRUCT[code] for code in kind.codes if code in FORMAT_TO_STRUCT]
    names = kind.columns
    if not (all(names) and len(kind.codes) == len(codes) == len(set(names)) == len(names)):
        return None
    record = np.dtype([(name, _scalar(code[0])) for name, code in zip(names, codes, strict=True)])
    if record.itemsize != kind.length - _HEAD_LENGTH:
        return None
    windows = np.lib.stride_tricks.sliding_window_view(data, record.itemsize)
    rows = windows[np.array(offsets) + _HEAD_LENGTH].view(record)[:, 0]
    return {
        name: rows[name] * code[1] if code[1] else rows[name]
        for name, code in zip(names, codes, strict=True)
    }


def _times_s(columns: Mapping[str, NDArray[Any]]) -> Array | None:
    """Return the times of messages; None without a column of them.

    Versions before 2015 have milliseconds. In their GPS, TimeMS is the time of the week, and T the
    time since boot.
    """
    name = "T" if "Week" in columns and "T" in columns else "TimeMS"
    for column, factor in (("TimeUS", 1e-6), (name, 1e-3)):
        if column in columns:
            is_number = columns[column].dtype.kind in "iuf"
            return columns[column] * factor if is_number else None
    return None


def _times_before(
    offsets: Collection[int], tables: Tables, offsets_by_name: Mapping[str, list[int]]
) -> Array | None:
    """Return the times of the regular messages written before others, which have no time.

    Those before the first regular message have its time. None without regular messages.
    """
    regular = [name for name in tables if name in _PLAUSIBLE]
    if not regular:
        return None
    places = np.concatenate([offsets_by_name[name] for name in regular])
    order = np.argsort(places)
    times_s = np.concatenate([tables[name].time_s for name in regular])[order]
    before = np.searchsorted(places[order], np.array([*offsets])) - 1
    return times_s[np.maximum(before, 0)]


def _scalar(code: str) -> str:
    """Return the numpy type of a ``struct`` code."""
    return f"S{code[:-1]}" if code.endswith("s") else np.dtype(f"<{code}").str


def _table(path: Path, message_tables: Tables, name: str, *columns: str) -> MessageColumns:
    """Return the first instance of a message in order of time.

    Raise LogError for a missing column.
    """
    missing = [
        column
        for column in columns
        if name not in message_tables or column not in message_tables[name].columns
    ]
    if missing:
        raise LogError(
            f"{path}: holds no {name}.{missing[0]}; identification needs {_REQUIRED_MESSAGES}"
        )
    time_s, values = _first_instance(message_tables[name])
    later = strictly_increasing(time_s)
    return MessageColumns(time_s[later], {column: array[later] for column, array in values.items()})


def _first_instance(table: MessageColumns) -> MessageColumns:
    """Return the messages of the first sensor or estimator."""
    time_s, values = table
    first = np.ones(time_s.size, bool)
    for column in _INSTANCES:
        if column in values and values[column].dtype.kind in "iu":
            first &= values[column] == np.min(values[column])
    return MessageColumns(time_s[first], {column: array[first] for column, array in values.items()})


def _attitude(path: Path, message_tables: Tables) -> Attitude:
    """Return attitude from one of _ATTITUDES and rates from one of _RATES, else by differences."""
    name = next((name for name in _ATTITUDES if name in message_tables), _ATTITUDES[0])
    time_s, columns = _table(path, message_tables, name, *_ANGLES)
    known = usable(time_s, *(columns[angle] for angle in _ANGLES))
    angles_rad = [np.radians(columns[angle][known].astype(np.float64)) for angle in _ANGLES]
    rates = next((r for r in _RATES if r[0] in message_tables), None)
    if rates is None:
        return attitude_of_angles(time_s[known], angles_rad)
    source, fields, factor = rates
    rates_s, rate_columns = _table(path, message_tables, source, *fields)
    rates_radps = [factor * rate_columns[field].astype(np.float64) for field in fields]
    attitude = attitude_with_rates(time_s[known], angles_rad, rates_s, rates_radps)
    if not attitude.time_s.size:
        raise LogError(f"{path}: {name} and {source} were never logged at the same time")
    return attitude


def _actuators(
    path: Path, message_tables: Tables, options: OutputOptions, history: ParameterHistory
) -> Actuators:
    """Return the commands from the pulses in RCOU; old logs name its columns Ch1 or Chan1."""
    known = message_tables["RCOU"].columns if "RCOU" in message_tables else {}
    numbers = {int(match[1]): name for name in known if (match := _OUTPUT.fullmatch(name))}
    names = [numbers[number] for number in sorted(numbers)] or ["C1"]
    time_s, columns = _table(path, message_tables, "RCOU", *names)
    pulses = np.stack([columns[name].astype(np.float64) for name in names], axis=1)
    return actuator_commands(time_s, pulses, options, history, f"{path}: RCOU")


def _depth(path: Path, message_tables: Tables, attitude_s: Array) -> Depth:
    """Return depth and its rate by differences; zero at the times of the attitude without any."""
    source = next((s for s in _ALTITUDES if _has(message_tables, *s[:2])), None)
    if source is None:
        return zero_depth(attitude_s)
    name, column, factor = source
    time_s, columns = _table(path, message_tables, name, column)
    known = usable(time_s, columns[column])
    time_s, depth_m = time_s[known], factor * columns[column][known].astype(np.float64)
    if time_s.size < 2:
        raise LogError(
            f"{path}: {name}.{column} was logged {time_s.size} times; identification needs depth"
            " throughout"
        )
    return Depth(time_s, depth_m, np.gradient(depth_m, time_s))


def _has(message_tables: Tables, name: str, *columns: str) -> bool:
    """Return whether a log has all columns of a message."""
    return name in message_tables and set(columns) <= message_tables[name].columns.keys()


def _floats(table: MessageColumns, *columns: str) -> list[Array]:
    """Return columns as floats."""
    return [table.columns[column].astype(np.float64) for column in columns]


def _velocity(path: Path, message_tables: Tables, attitude: Attitude) -> Velocity:
    """Return the velocity of the estimator, or else the speed of the satellite receiver."""
    for name in _VELOCITIES:
        if _has(message_tables, name, "VN", "VE", "VD"):
            table = _table(path, message_tables, name, "VN")
            velocity = body_velocity(attitude, table.time_s, *_floats(table, "VN", "VE", "VD"))
            if velocity.time_s.size:
                return velocity
    if _has(message_tables, "GPS", "Spd"):
        table = _table(path, message_tables, "GPS", "Spd")
        return ground_speed(table.time_s, *_floats(table, "Spd"))
    return Velocity()


def _specific_force(path: Path, message_tables: Tables) -> SpecificForce:
    """Return the acceleration of the first sensor."""
    for name in _ACCELEROMETERS:
        if _has(message_tables, name, *_ACCELERATION):
            table = _table(path, message_tables, name, *_ACCELERATION)
            return accelerometer(table.time_s, *_floats(table, *_ACCELERATION))
    return SpecificForce()


def _setpoints(message_tables: Tables) -> Setpoints:
    """Return heading, pitch and depth setpoints from ATT and CTUN."""
    attitude_s, heading, pitch = _setpoint_columns(message_tables, "ATT", "DesYaw", "DesPitch")
    depth_s, depth_m = _setpoint_columns(message_tables, "CTUN", "DAlt")
    return Setpoints(
        attitude_time_s=attitude_s,
        heading_rad=np.unwrap(np.radians(heading)),
        pitch_rad=np.radians(pitch),
        depth_time_s=depth_s,
        depth_m=-depth_m,
    )


def _setpoint_columns(message_tables: Tables, name: str, *columns: str) -> list[Array]:
    """Return times and finite values of columns; empty arrays without them."""
    if not _has(message_tables, name, *columns):
        return [np.empty(0)] * (1 + len(columns))
    table = message_tables[name]
    values = _floats(table, *columns)
    keep = usable(table.time_s, *values)
    return [array[keep] for array in (table.time_s, *values)]


def _events(message_tables: Tables, travel_deg: float) -> tuple[LogEvent, ...]:
    """Return the events of the texts and of the tests.

    A test begins with a SIDS message and ends with a text or a change of mode.
    """
    events: list[LogEvent] = []
    if "MSG" in message_tables and "Message" in message_tables["MSG"].columns:
        texts = zip(message_tables["MSG"].time_s, _texts(message_tables["MSG"]), strict=True)
        events += [LogEvent(float(t), parse_text(_INFO, text)) for t, text in texts]
    if "SIDS" in message_tables and {"Ax", "Mag"} <= message_tables["SIDS"].columns.keys():
        time_s, columns = message_tables["SIDS"]
        events = [event for event in events if not isinstance(event.value, TestStarted)]
        for t, axis, size in zip(time_s, columns["Ax"], columns["Mag"], strict=True):
            magnitude = float(size) * (travel_deg if axis in _MIXER_AXES else 1.0)
            started = TestStarted(TestAxis(int(axis)), TestWave.CHIRP, magnitude)
            events.append(LogEvent(float(t), started))
        events += _mode_changes(message_tables, time_s)
    return tuple(sorted(events, key=lambda event: event.time_s))


def _mode_changes(message_tables: Tables, starts_s: Array) -> list[LogEvent]:
    """Return the ends of tests by a change of mode, without changes at the start of a test."""
    if "MODE" not in message_tables:
        return []
    changes_s = message_tables["MODE"].time_s
    first_s, last_s = _TEST_MODE_WINDOW_S
    own = [bool(np.any((t - starts_s > first_s) & (t - starts_s < last_s))) for t in changes_s]
    return [
        LogEvent(float(t), TestEnded(StopReason.MODE, "the mode changed"))
        for t, begins in zip(changes_s, own, strict=True)
        if not begins
    ]


def _parameters(message_tables: Tables) -> ParameterHistory:
    """Return the parameters from PARM; empty without it."""
    if (
        "PARM" not in message_tables
        or not {"Name", "Value"} <= message_tables["PARM"].columns.keys()
    ):
        return ParameterHistory({})
    time_s, columns = message_tables["PARM"]
    names = (bytes(name).decode("ascii", "replace") for name in columns["Name"])
    return history_of(zip(time_s.tolist(), names, map(float, columns["Value"]), strict=True))
