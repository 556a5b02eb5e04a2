"""ArduPilot's own logs (.bin), decoded a whole message type at a time by pymavlink's table of field
codes.

pymavlink's DFReader itself decodes message by message, and a damaged FMT of length 0 keeps it
reading for ever. Messages are those of ArduPilot's LogStructure.h. Angles come in degrees, altitude
upwards, outputs as pulses."""

import re
import struct
from collections import defaultdict
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.data.dataset import (
    Actuators,
    Array,
    Attitude,
    Depth,
    Log,
    LogError,
    Setpoints,
    TextEvent,
)
from sysid.data.readers.samples import (
    DEFAULT_TRAVEL_DEG,
    MessageColumns,
    clock_steps,
    foreign_log,
    sample_nearest,
    strictly_increasing,
)
from sysid.data.readers.servo_channels import ServoChannels, surface_commands

_HEAD = b"\xa3\x95"
_HEAD_LENGTH = 3
_FMT = 0x80
_format = struct.Struct("<BB4s16s64s")
"""An FMT message: number, length, name, field codes and columns of another."""
_REQUIRED_MESSAGES = "ATT, RATE or IMU, RCOU, and the altitude in CTUN, POS or BARO"
_ALTITUDES = (("CTUN", "Alt"), ("POS", "RelHomeAlt"), ("BARO", "Alt"))
"""Where altitude stands, the best first."""
_MIXER_AXES = range(10, 14)
"""Of SIDS.Ax: those whose magnitude is a share of the output's travel, and no angle."""
_TEST_MODE_WINDOW_S = 0.5
"""So long after the start of a test its own mode is told."""

Tables = dict[str, MessageColumns]


def read(path: Path, outputs: ServoChannels) -> Log:
    """Read one .bin.

    Raises:
        LogError: the file is broken, or lacks what identification needs.
    """
    found = tables(path)
    parameters = _parameters(found)
    travel_deg = parameters.get("ACT_TRAVEL_DEG", DEFAULT_TRAVEL_DEG)
    attitude, actuators = _attitude(path, found), _actuators(path, found, travel_deg, outputs)
    depth = _depth(path, found)
    steps = [step for name in ("ATT", "RCOU") for step in clock_steps(name, found[name].time_s)]
    events = _events(found, travel_deg)
    return foreign_log(
        path, attitude, actuators, depth, _setpoints(found), events, parameters, steps
    )


def tables(path: Path) -> Tables:
    """Every message that carries a time, by its name. Raises LogError."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise LogError(f"{path}: {error.strerror}; give an ArduPilot .bin") from None
    decoded = {
        kind.name: _decode(np.frombuffer(data, np.uint8), kind, found)
        for kind, found in _index(data)
    }
    tables = {name: table for name, table in decoded.items() if table is not None}
    if not tables:
        raise LogError(f"{path}: holds no message of an ArduPilot log")
    return tables


class _MessageFormat(NamedTuple):
    """A message type, as an FMT message tells it."""

    name: str
    length: int
    """Of a whole message, in bytes."""
    codes: str
    columns: tuple[str, ...]


def _index(data: bytes) -> list[tuple[_MessageFormat, list[int]]]:
    """Message types, and where their messages begin. What is between messages is passed over."""
    kinds, places, at = (
        {_FMT: _MessageFormat("FMT", _HEAD_LENGTH + _format.size, "", ())},
        defaultdict[int, list[int]](list),
        0,
    )
    while 0 <= at <= len(data) - _HEAD_LENGTH:
        kind = kinds.get(data[at + 2]) if data.startswith(_HEAD, at) else None
        if kind is None or at + kind.length > len(data):
            at = data.find(_HEAD, at + 1)
            continue
        places[data[at + 2]].append(at)
        if kind.name == "FMT":
            number, length, *texts = _format.unpack_from(data, at + _HEAD_LENGTH)
            name, codes, columns = (
                text.split(b"\0", 1)[0].decode("ascii", "replace") for text in texts
            )
            if length > _HEAD_LENGTH:
                kinds.setdefault(
                    number, _MessageFormat(name, length, codes, tuple(columns.split(",")))
                )
        at += kind.length
    return [(kinds[number], found) for number, found in places.items()]


def _decode(
    data: NDArray[np.uint8], kind: _MessageFormat, places: list[int]
) -> MessageColumns | None:
    """All messages of one type; None where they carry no time, or are not as long as their FMT
    says."""
    from pymavlink.DFReader import FORMAT_TO_STRUCT

    codes = [FORMAT_TO_STRUCT[code] for code in kind.codes if code in FORMAT_TO_STRUCT]
    time_column = next((name for name in ("TimeUS", "TimeMS") if name in kind.columns), None)
    if time_column is None or not len(kind.codes) == len(codes) == len(set(kind.columns)) == len(
        kind.columns
    ):
        return None
    record = np.dtype(
        [(name, _scalar(code[0])) for name, code in zip(kind.columns, codes, strict=True)]
    )
    if record.itemsize != kind.length - _HEAD_LENGTH:
        return None
    rows = data[np.array(places)[:, None] + np.arange(_HEAD_LENGTH, kind.length)].view(record)[:, 0]
    columns = {
        name: rows[name] * code[1] if code[1] else rows[name]
        for name, code in zip(kind.columns, codes, strict=True)
    }
    if columns[time_column].dtype.kind not in "iuf":
        return None
    return MessageColumns(
        columns[time_column] * (1e-6 if time_column == "TimeUS" else 1e-3), columns
    )


def _scalar(code: str) -> str:
    """The numpy type of a field's ``struct`` code."""
    return f"S{code[:-1]}" if code.endswith("s") else np.dtype(f"<{code}").str


def _table(path: Path, found: Tables, name: str, *columns: str) -> MessageColumns:
    """The first instance of a message, its samples in order of time. Raises LogError where a column
    is missing."""
    missing = [
        column for column in columns if name not in found or column not in found[name].columns
    ]
    if missing:
        raise LogError(
            f"{path}: holds no {name}.{missing[0]}; identification needs {_REQUIRED_MESSAGES}"
        )
    time_s, values = found[name]
    first = values["I"] == 0 if "I" in values else np.ones(time_s.size, bool)
    first[first] = strictly_increasing(time_s[first])
    return MessageColumns(time_s[first], {column: array[first] for column, array in values.items()})


def _attitude(path: Path, found: Tables) -> Attitude:
    time_s, angles = _table(path, found, "ATT", "Roll", "Pitch", "Yaw")
    if "RATE" in found:
        rates = _table(path, found, "RATE", "R", "P", "Y")
        body = [np.radians(rates.columns[name].astype(np.float64)) for name in ("R", "P", "Y")]
    else:
        rates = _table(path, found, "IMU", "GyrX", "GyrY", "GyrZ")
        body = [rates.columns[name].astype(np.float64) for name in ("GyrX", "GyrY", "GyrZ")]
    near = sample_nearest(time_s, rates.time_s, body[0])[0]
    p, q, r = (sample_nearest(time_s, rates.time_s, values)[1][near] for values in body)
    roll, pitch, yaw = (
        np.radians(angles[name][near].astype(np.float64)) for name in ("Roll", "Pitch", "Yaw")
    )
    if not near.any():
        raise LogError(f"{path}: ATT and the rates were never logged at the same time")
    return Attitude(time_s[near], roll, pitch, np.unwrap(yaw), p, q, r)


def _actuators(path: Path, found: Tables, travel_deg: float, outputs: ServoChannels) -> Actuators:
    time_s, columns = _table(path, found, "RCOU", "C1")
    names = sorted(
        (name for name in columns if re.fullmatch(r"C\d+", name)), key=lambda name: int(name[1:])
    )
    pulses = np.stack([columns[name].astype(np.float64) for name in names], axis=1)
    rudder, elevator, thrust = surface_commands(pulses, outputs, f"{path}: RCOU")
    return Actuators(
        time_s, rudder * np.radians(travel_deg), elevator * np.radians(travel_deg), thrust
    )


def _depth(path: Path, found: Tables) -> Depth:
    name, column = next(
        ((n, c) for n, c in _ALTITUDES if n in found and c in found[n].columns), _ALTITUDES[0]
    )
    time_s, columns = _table(path, found, name, column)
    depth_m = -columns[column].astype(np.float64)
    if time_s.size < 2:
        raise LogError(
            f"{path}: {name}.{column} was logged {time_s.size} times; identification needs depth"
            " throughout"
        )
    return Depth(time_s, depth_m, np.gradient(depth_m, time_s))


def _setpoints(found: Tables) -> Setpoints:
    (heading_s, heading), (_, pitch) = (
        _setpoint_column(found, "ATT", "DesYaw"),
        _setpoint_column(found, "ATT", "DesPitch"),
    )
    depth_s, depth_m = _setpoint_column(found, "CTUN", "DAlt")
    return Setpoints(
        heading_s, np.unwrap(np.radians(heading)), np.radians(pitch), depth_s, -depth_m
    )


def _setpoint_column(found: Tables, name: str, column: str) -> tuple[Array, Array]:
    """Times and values of a column, empty where the log has none."""
    if name not in found or column not in found[name].columns:
        return np.empty(0), np.empty(0)
    time_s, columns = found[name]
    keep = strictly_increasing(time_s)
    return time_s[keep], columns[column][keep].astype(np.float64)


def _events(found: Tables, travel_deg: float) -> tuple[TextEvent, ...]:
    """The texts, and tests in the words of our own logs: begun with SIDS, ended by text or by a
    change of mode."""
    events: list[TextEvent] = []
    if "MSG" in found and "Message" in found["MSG"].columns:
        said = zip(found["MSG"].time_s, found["MSG"].columns["Message"], strict=True)
        events += [
            TextEvent(float(t), 6, bytes(text).decode("utf-8", "replace")) for t, text in said
        ]
    if "SIDS" in found and {"Ax", "Mag"} <= found["SIDS"].columns.keys():
        time_s, columns = found["SIDS"]
        events = [event for event in events if not event.text.startswith("SystemID Starting")]
        for t, axis, size in zip(time_s, columns["Ax"], columns["Mag"], strict=True):
            magnitude = float(size) * (travel_deg if axis in _MIXER_AXES else 1.0)
            events.append(
                TextEvent(
                    float(t),
                    6,
                    f"SystemID Starting: axis={axis} wave=chirp magnitude={magnitude:.4f}",
                )
            )
        events += _mode_changes(found, time_s)
    return tuple(sorted(events, key=lambda event: event.time_s))


def _mode_changes(found: Tables, starts_s: Array) -> list[TextEvent]:
    """Changes of mode that are not those with which a test begins."""
    if "MODE" not in found:
        return []
    changes_s = found["MODE"].time_s
    own = [bool(np.any((t >= starts_s) & (t - starts_s < _TEST_MODE_WINDOW_S))) for t in changes_s]
    return [
        TextEvent(float(t), 6, "SystemID Stopped: the mode changed")
        for t, begins in zip(changes_s, own, strict=True)
        if not begins
    ]


def _parameters(found: Tables) -> dict[str, float]:
    if "PARM" not in found or not {"Name", "Value"} <= found["PARM"].columns.keys():
        return {}
    columns = found["PARM"].columns
    names = (bytes(name).decode("ascii", "replace") for name in columns["Name"])
    return dict(zip(names, map(float, columns["Value"]), strict=True))
