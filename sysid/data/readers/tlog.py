"""MAVLink telemetry logs (.tlog) of QGroundControl, Mission Planner, MAVProxy and ground.

Times are the vehicle's times in the messages, not the times of reception, because a radio link has
a variable delay.
"""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mavlink_io.logging import tlog
from mavlink_io.logging.ros1 import schema_text
from mavlink_io.logging.tlog import MessageSeries
from mavlink_io.param_bytes import PX4, decode_bytewise
from mavlink_io.text_files import read_limited
from sysid.data import ros1
from sysid.data.dataset import Array, Log, LogError
from sysid.data.readers.messages import (
    ATTITUDES,
    AUTOPILOT_COMPONENT,
    DEVICES,
    Messages,
    assemble,
    messages_to_read,
    refuse_several,
)
from sysid.data.readers.parameter_history import ParameterHistory, history_of
from sysid.data.readers.samples import FileDamage, MessageColumns
from sysid.data.readers.servo_channels import OutputOptions


def read(path: Path, options: OutputOptions) -> Log:
    """Read a tlog with one vehicle.

    Parameters
    ----------
    path : Path
        The file.
    options : OutputOptions
        Output numbers of rudder, elevator and thrust, and the travel.

    Returns
    -------
    Log
        Arrays in MAVLink's axes, vehicle time.

    Raises
    ------
    LogError
        The file cannot be read, has several vehicles, or has not all required messages.
    """
    data = _content(path)
    streams = _streams(path, data)
    vehicles = sorted({(s.system, s.component) for s in streams if s.message.name in ATTITUDES})
    # A camera or a companion computer of the vehicle may send its attitude too.
    vehicles = [v for v in vehicles if v[1] == AUTOPILOT_COMPONENT] or vehicles
    one = f"mavlogdump.py --source-system SYSTEM -o vehicle_SYSTEM.tlog {path.name}"
    refuse_several(path, [(str(system), str(part)) for system, part in vehicles], one)
    # Without any attitude all messages count, so that the refusal names only what is missing.
    senders = vehicles or [(s.system, s.component) for s in streams]
    own = {s.message.name: s for s in streams if (s.system, s.component) in senders}
    messages: Messages = {name: _decode(own[name]) for name in messages_to_read(own) if name in own}
    for stream in streams:
        device = DEVICES.get((stream.component, stream.message.name))
        if device and any(stream.system == system for system, _ in vehicles):
            messages[device] = _decode(stream)
    nothing = np.empty(0)
    damage = FileDamage(*tlog.find_damage(data))
    history = _parameters(own.get("PARAM_VALUE"), bytewise=_is_px4(own.get("HEARTBEAT")))
    return assemble(path, messages, history, options, (nothing, nothing), damage)


def load(path: Path) -> tuple[dict[str, MessageColumns], FileDamage]:
    """Return all messages by ``/mavlink/SYSTEM/COMPONENT/NAME``, and the damage.

    Raises LogError for a bad file.
    """
    columns_by_topic = {}
    data = _content(path)
    for stream in _streams(path, data):
        time_s, record = _decode(stream)
        columns = {name: record[name] for name in record.dtype.names or ()}
        columns_by_topic[f"/mavlink/{stream.system}/{stream.component}/{stream.message.name}"] = (
            MessageColumns(time_s, columns)
        )
    return columns_by_topic, FileDamage(*tlog.find_damage(data))


def _content(path: Path) -> bytes:
    """Return the bytes of a file; raise LogError if it cannot be read."""
    try:
        return read_limited(path)
    except OSError as error:
        raise LogError(f"{path}: {error.strerror}; give a tlog") from None


def _streams(path: Path, data: bytes) -> list[MessageSeries]:
    """Return the messages of a file by sender and name; raise LogError without any."""
    streams = tlog.read(data)
    if not streams:
        raise LogError(f"{path}: holds no MAVLink message; is it a tlog?")
    return streams


def _decode(stream: MessageSeries) -> tuple[Array, NDArray[Any]]:
    """Return the vehicle times (s) and records of a stream."""
    record = ros1.decode(stream.payloads, ros1.record_type(schema_text(stream.message)))
    return np.array(stream.times_us, np.float64) * 1e-6, record


def _is_px4(heartbeats: MessageSeries | None) -> bool:
    """Return whether the autopilot is PX4."""
    return heartbeats is not None and PX4 in _decode(heartbeats)[1]["autopilot"]


def _parameters(stream: MessageSeries | None, *, bytewise: bool) -> ParameterHistory:
    """Return the parameters from PARAM_VALUE; with `bytewise` integers have their bytes in it."""
    if stream is None:
        return ParameterHistory({})
    time_s, record = _decode(stream)
    names = (
        row.tobytes().split(b"\0", 1)[0].decode("ascii", "replace") for row in record["param_id"]
    )
    values = record["param_value"].tolist()
    if bytewise:
        values = [
            decode_bytewise(row["param_value"].tobytes(), int(row["param_type"])) for row in record
        ]
    return history_of(zip(time_s.tolist(), names, values, strict=True))
