"""MCAP logs: what ground and the vehicle record, and anyone who follows their log contract
(docs/logs.md)."""

import json
from collections import defaultdict
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from sysid.data import ros1
from sysid.data.dataset import Array, Log, LogError
from sysid.data.readers.messages import DUCT, DUCT_COMPONENT, Messages, assemble, messages_to_read
from sysid.data.readers.servo_channels import ServoChannels

if TYPE_CHECKING:
    from mcap.summary import Summary


def read(path: Path, outputs: ServoChannels) -> Log:
    """Read one MCAP log.

    Raises:
        LogError: the file is missing, unfinished, no MCAP, or lacks a message that identification
        needs.
    """
    messages, parameters, ahead = _load(path)
    return assemble(path, messages, parameters, outputs, ahead)


def _load(path: Path) -> tuple[Messages, dict[str, float], tuple[Array, Array]]:
    """The vehicle's messages, the parameters, and how far the log's clock is ahead of hers."""
    from mcap.exceptions import McapError
    from mcap.reader import make_reader

    try:
        with path.open("rb") as stream:
            reader = make_reader(stream)
            summary = reader.get_summary()
            if summary is None:
                raise LogError(
                    f"{path}: was never finished; `ground log recover` makes it readable"
                )
            messages = _channels(stream, summary, path)
            parameters = _parameters(reader, path)
    except McapError as error:
        raise LogError(
            f"{path}: is no readable MCAP file ({error}); `ground log recover` mends a cut one"
        ) from None
    except OSError as error:
        raise LogError(f"{path}: {error.strerror}; give an MCAP log") from None
    return messages, parameters, _clock_lead(messages)


def _channels(stream: IO[bytes], summary: "Summary", path: Path) -> Messages:
    from sysid.data.readers import mcap_chunks

    topics = _vehicle_topics(summary, path)
    names = {
        number: topics[each.topic]
        for number, each in summary.channels.items()
        if each.topic in topics
    }
    payloads: dict[str, list[bytes]] = defaultdict(list)
    stamps: dict[str, list[int]] = defaultdict(list)
    for channel, time_ns, data in mcap_chunks.messages(stream, summary, names):
        payloads[names[channel]].append(data)
        stamps[names[channel]].append(time_ns)
    schemas = {
        name: summary.schemas[summary.channels[number].schema_id] for number, name in names.items()
    }
    try:
        records = {
            name: ros1.decode(payloads[name], ros1.record_type(schemas[name].data.decode()))
            for name in payloads
        }
    except ValueError as error:
        raise LogError(f"{path}: {error}") from None
    start_ns = _start_ns(records, stamps, path)

    def seconds(name: str) -> Array:
        return np.array([stamp - start_ns for stamp in stamps[name]], np.float64) * 1e-9

    return {name: (seconds(name), records[name]) for name in records}


def _vehicle_topics(summary: "Summary", path: Path) -> dict[str, str]:
    """Message name by topic, of the one system that sends ATTITUDE."""
    topics = sorted({channel.topic for channel in summary.channels.values()})
    parts = [(topic, topic.split("/")) for topic in topics if topic.startswith("/mavlink/")]
    vehicles = sorted({(p[2], p[3]) for _, p in parts if len(p) == 5 and p[4] == "ATTITUDE"})
    if len(vehicles) > 1:
        raise LogError(
            f"{path}: {len(vehicles)} vehicles send ATTITUDE; a log for identification holds one"
        )
    sent = {t: p[4] for t, p in parts if len(p) == 5 and (p[2], p[3]) in vehicles}
    names = messages_to_read(set(sent.values()))
    ducts = {f"/mavlink/{system}/{DUCT_COMPONENT}/ACTUATOR_OUTPUT_STATUS" for system, _ in vehicles}
    return {t: name for t, name in sent.items() if name in names} | {
        t: DUCT for t in topics if t in ducts
    }


def _start_ns(records: dict[str, NDArray[Any]], stamps: dict[str, list[int]], path: Path) -> int:
    """UNIX time of vehicle time zero: log time less the time that the vehicle put in its
    messages."""
    if "ATTITUDE" not in records:
        return 0
    attitude = records["ATTITUDE"]
    if "time_boot_ms" not in (attitude.dtype.names or ()):
        raise LogError(
            f"{path}: ATTITUDE carries no time_boot_ms; it must follow the MAVLink definition"
        )
    return int(stamps["ATTITUDE"][0]) - int(attitude["time_boot_ms"][0]) * 1_000_000


def _clock_lead(messages: Messages) -> tuple[Array, Array]:
    """Times of ATTITUDE, and by how much they are ahead of those in the messages."""
    if "ATTITUDE" not in messages:
        return np.empty(0), np.empty(0)
    time_s, record = messages["ATTITUDE"]
    return time_s, time_s - record["time_boot_ms"] * 1e-3


def _parameters(reader: Any, path: Path) -> dict[str, float]:
    for attachment in reader.iter_attachments():
        if attachment.name == "params.json":
            try:
                return {
                    str(name): float(value) for name, value in json.loads(attachment.data).items()
                }
            except (ValueError, TypeError, AttributeError):
                raise LogError(
                    f"{path}: attachment params.json must be an object of numbers by name"
                ) from None
    return {}
