"""MCAP logs of ground and of the vehicle, or of others with the same layout (docs/logs.md)."""

from collections import defaultdict
from collections.abc import Callable, Container, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mavlink_io.logging.mcap_reader import (
    McapAttachment,
    McapBatch,
    McapChannel,
    McapError,
    McapReader,
    format_damage,
)
from mavlink_io.text_files import open_regular, parse_json
from mavlink_io.vehicle_clock import WRAP_US
from sysid.data import ros1
from sysid.data.dataset import Array, Log, LogError
from sysid.data.readers.messages import (
    ATTITUDES,
    CANDIDATES,
    DEVICES,
    IMU,
    Messages,
    assemble,
    messages_to_read,
    refuse_several,
)
from sysid.data.readers.parameter_history import ParameterHistory
from sysid.data.readers.samples import NO_DAMAGE, FileDamage, MessageColumns
from sysid.data.readers.servo_channels import OutputOptions


def read(path: Path, options: OutputOptions) -> Log:
    """Read one MCAP log.

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
        The file is missing, unfinished, damaged, no MCAP file, or has not all required messages.
    """
    streams = _streams(path, _may_be_needed)
    messages, zero_unix_ns = _decoded(streams, path)
    parameters = _parameters(streams.parameters, path)
    history = ParameterHistory(parameters)
    log = assemble(path, messages, history, options, _clock_lead(messages))
    return replace(log, clock=replace(log.clock, zero_unix_ns=zero_unix_ns))


def load(path: Path) -> tuple[dict[str, MessageColumns], FileDamage]:
    """Return all MAVLink messages by topic, in vehicle time or else since the first message.

    Raises LogError for a file that is not a finished, undamaged MCAP log.
    """
    streams = _streams(path, lambda channel: channel.topic.startswith("/mavlink/"))
    records = {
        topic: _records(streams.channels[topic], batches, path)
        for topic, batches in streams.batches.items()
    }
    stamps = {
        topic: np.concatenate([batch.times_ns for batch in batches])
        for topic, batches in streams.batches.items()
    }
    attitudes = {topic.rsplit("/", 1)[1]: topic for topic in reversed(records)}
    timed = {name: attitudes[name] for name in ATTITUDES if name in attitudes} or attitudes
    zero_ns = _start_ns(
        {name: records[topic] for name, topic in timed.items()},
        {name: stamps[topic] for name, topic in timed.items()},
        path,
    )
    tables = {
        topic: MessageColumns(
            (stamps[topic] - zero_ns).astype(np.float64) * 1e-9,
            {name: record[name] for name in record.dtype.names or ()},
        )
        for topic, record in records.items()
    }
    return tables, NO_DAMAGE


def _streams(path: Path, wanted: Callable[[McapChannel], bool]) -> "_Streams":
    """Return the content of a finished, undamaged file. Raises LogError."""
    streams = _Streams()
    try:
        with open_regular(path) as file:
            reader = McapReader(file, wanted, batched=True)
            if not reader.finished:
                raise LogError(
                    f"{path}: was never finished; `ground log recover` makes it readable"
                )
            for item in reader.items():
                streams.add(item)
    except McapError as error:
        raise LogError(f"{path}: is no readable MCAP file: {error}") from None
    except OSError as error:
        raise LogError(f"{path}: {error.strerror}; give an MCAP log") from None
    if reader.damage:
        remedy = "`ground log recover` saves the rest"
        raise LogError(f"{path}: is damaged: {format_damage(reader)}; {remedy}")
    return streams


def _may_be_needed(channel: McapChannel) -> bool:
    """Return True for the channel of a message that identification can use."""
    return channel.topic.startswith("/mavlink/") and channel.topic.rsplit("/", 1)[1] in CANDIDATES


class _Streams:
    """Content of a file: channels, payloads, log times and the parameters."""

    def __init__(self) -> None:
        self.channels: dict[str, McapChannel] = {}
        self.batches: dict[str, list[McapBatch]] = defaultdict(list)
        self.parameters: bytes | None = None
        self._topics: dict[int, str] = {}

    def add(self, item: object) -> None:
        """Store one record of the file."""
        match item:
            case McapBatch():
                self.batches[self._topics[item.channel]].append(item)
            case McapChannel():
                self.channels[item.topic] = item
                self._topics[item.number] = item.topic
            case McapAttachment() if item.name == "params.json" and self.parameters is None:
                self.parameters = item.data


def _decoded(streams: _Streams, path: Path) -> tuple[Messages, int]:
    """Return vehicle times (s) and records by message name, and the UNIX time (ns) of time zero."""
    topics = {name: topic for topic, name in _vehicle_topics(streams.channels, path).items()}
    records, stamps = {}, {}
    for name, topic in topics.items():
        if topic in streams.batches:
            batches = streams.batches[topic]
            records[name] = _records(streams.channels[topic], batches, path)
            stamps[name] = np.concatenate([batch.times_ns for batch in batches])
    start_ns = _start_ns(records, stamps, path)

    def seconds(name: str) -> Array:
        return (stamps[name] - start_ns).astype(np.float64) * 1e-9

    return {name: (seconds(name), records[name]) for name in records}, start_ns


def _records(channel: McapChannel, batches: Sequence[McapBatch], path: Path) -> NDArray[Any]:
    """Decode the messages of a channel with its schema."""
    if channel.schema is None:
        raise LogError(f"{path}: {channel.topic} has no schema; it must be a ros1msg definition")
    try:
        record = ros1.record_type(channel.schema.data.decode())
        lengths = np.concatenate([batch.lengths for batch in batches])
        return ros1.decode_joined(b"".join(batch.data for batch in batches), lengths, record)
    except (ValueError, OverflowError) as error:
        raise LogError(f"{path}: {channel.topic}: {error}") from None


def _vehicle_topics(channels: dict[str, McapChannel], path: Path) -> dict[str, str]:
    """Return the message name by topic of the one vehicle that sends ATTITUDE."""
    topics = sorted(channels)
    parts = [(topic, topic.split("/")) for topic in topics if topic.startswith("/mavlink/")]
    vehicles = sorted({(p[2], p[3]) for _, p in parts if len(p) == 5 and p[4] in ATTITUDES})
    one = f"mcap filter {path.name} -y '/mavlink/SYSTEM/.*' --include-attachments"
    refuse_several(path, vehicles, f"{one} -o vehicle_SYSTEM.mcap")
    sent = {t: p[4] for t, p in parts if len(p) == 5 and (p[2], p[3]) in vehicles}
    names = messages_to_read(set(sent.values()))
    devices = {
        f"/mavlink/{system}/{component}/{name}": device
        for system, _ in vehicles
        for (component, name), device in DEVICES.items()
    }
    devices |= {t: IMU for t, p in parts if len(p) == 5 and p[4] == IMU}
    return {t: name for t, name in sent.items() if name in names} | {
        t: devices[t] for t in topics if t in devices
    }


def _start_ns(
    records: dict[str, NDArray[Any]], stamps: dict[str, NDArray[np.int64]], path: Path
) -> int:
    """Return the UNIX time of vehicle time zero, ns: log time minus the time in the message."""
    name = _timed(records)
    if not name:
        return int(min((times[0] for times in stamps.values()), default=0))
    attitude = records[name]
    if "time_boot_ms" not in (attitude.dtype.names or ()):
        raise LogError(f"{path}: {name} has no time_boot_ms; it must follow the MAVLink definition")
    return int(stamps[name][0]) - int(attitude["time_boot_ms"][0]) * 1_000_000


def _timed(names: Container[str]) -> str:
    """Return the attitude message with a time; empty without any (AHRS2 has none)."""
    return next((name for name in ATTITUDES[:2] if name in names), "")


def _clock_lead(messages: Messages) -> tuple[Array, Array]:
    """Return (log times of the attitude, log time minus time in the message), s."""
    name = _timed(messages)
    if not name:
        return np.empty(0), np.empty(0)
    time_s, record = messages[name]
    ahead_s = time_s - record["time_boot_ms"] * 1e-3
    wrap_s = 1e-6 * WRAP_US
    return time_s, ahead_s - wrap_s * np.round((ahead_s - ahead_s[0]) / wrap_s)


def _parameters(data: bytes | None, path: Path) -> dict[str, float]:
    """Return the parameters from the attachment params.json; empty without it."""
    if data is None:
        return {}
    try:
        return {str(name): float(value) for name, value in parse_json(data).items()}
    except (ValueError, TypeError, AttributeError, OverflowError, RecursionError):
        needed = "must be an object of numbers by name"
        raise LogError(f"{path}: attachment params.json {needed}") from None
