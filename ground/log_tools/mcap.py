"""What can be done with a finished or broken log: look into it, export it, save what is left of
it."""

import csv
import json
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import zstandard
from mcap.exceptions import InvalidMagic, McapError
from mcap.reader import make_reader
from mcap.records import Attachment, Channel, Message, Metadata, Schema
from mcap.stream_reader import StreamReader

from ground.client.file_names import safe_file_name
from ground.errors import InputError
from mavlink_io import dialect
from mavlink_io.logging import ros1
from mavlink_io.logging.mcap import McapWriter


class McapFileError(InputError):
    """A file that is no log, or no finished one; the message says which and what to do."""


def info(path: Path) -> dict[str, Any]:
    """What a finished log holds: span, messages by topic, gaps in the senders' sequence numbers,
    attachments.

    Raises:
        LogError: the file is missing, no MCAP, or unfinished.
    """
    topics: dict[str, int] = {}
    first, last = 0, 0
    gaps = _Gaps()
    for channel, message in _messages(path):
        topics[channel.topic] = topics.get(channel.topic, 0) + 1
        first = min(first or message.log_time, message.log_time)
        last = max(last, message.log_time)
        gaps.count(channel.topic, message.sequence)
    with path.open("rb") as file:
        reader = make_reader(file)
        attachments = [attachment.name for attachment in reader.iter_attachments()]
        metadata = {record.name: dict(record.metadata) for record in reader.iter_metadata()}
    return {
        "file": str(path),
        "bytes": path.stat().st_size,
        "vehicle_s": (last - first) / 1e9,
        "messages": sum(topics.values()),
        "lost_frames": gaps.lost,
        "topics": dict(sorted(topics.items())),
        "attachments": attachments,
        "metadata": metadata,
    }


def export_csv(path: Path, out: Path) -> list[Path]:
    """Write each MAVLink topic as a CSV file into folder ``out``; returns the files.

    Columns: vehicle or log time in seconds since the first message, then the fields, arrays as
    ``name[i]``.

    Raises:
        LogError: the log is unreadable.
        FileExistsError: a file of that name is there already.
    """
    out.mkdir(parents=True, exist_ok=True)
    rows: dict[str, list[list[Any]]] = {}
    start_ns: int | None = None
    for channel, message in _messages(path):
        if channel.message_encoding != ros1.MESSAGE_ENCODING:
            continue
        start_ns = message.log_time if start_ns is None else start_ns
        fields = dialect.by_name(channel.topic.rsplit("/", 1)[1]).unpack(message.data)
        rows.setdefault(channel.topic, []).append(
            [(message.log_time - start_ns) / 1e9, *_flatten(fields)]
        )
    return [_write_csv(out, topic, rows[topic]) for topic in sorted(rows)]


def recover(path: Path, out: Path) -> int:
    """Copy every whole record of an unfinished log into a finished one; returns the number of
    messages saved.

    Raises:
        LogError: ``path`` is no MCAP file at all.
        FileExistsError: ``out`` is there already.
    """
    try:
        source = path.open("rb")
    except OSError as error:
        raise McapFileError(f"{path}: {error.strerror}") from None
    with source, out.open("xb") as target:
        writer = McapWriter(target, "ros1", "caribou recover")
        saved = _copy(source, writer, path)
        writer.finish()
    return saved


def read_attachment(path: Path, name: str) -> bytes | None:
    """The file called ``name`` inside a finished log, or None."""
    with path.open("rb") as file:
        found = (a.data for a in make_reader(file).iter_attachments() if a.name == name)
        return next(found, None)


def read_parameters(path: Path) -> dict[str, float]:
    """The parameters that were flown; LogError when the log carries none."""
    data = read_attachment(path, "params.json")
    if data is None:
        raise McapFileError(f"{path}: holds no attachment params.json")
    values: dict[str, float] = json.loads(data)
    return values


class _Gaps:
    """Counts what is missing between the sequence numbers of each sender."""

    def __init__(self) -> None:
        self.lost = 0
        self._expected: dict[str, int] = {}

    def count(self, topic: str, sequence: int) -> None:
        if not topic.startswith("/mavlink/"):
            return
        sender = topic.rsplit("/", 1)[0]
        expected = self._expected.get(sender)
        if expected is not None:
            self.lost += (sequence - expected) & 0xFF
        self._expected[sender] = (sequence + 1) & 0xFF


def _messages(path: Path) -> Iterator[tuple[Channel, Message]]:
    try:
        with path.open("rb") as file:
            for _, channel, message in make_reader(file).iter_messages(log_time_order=False):
                yield channel, message
    except OSError as error:
        raise McapFileError(f"{path}: {error.strerror}") from None
    except (McapError, struct.error):
        raise McapFileError(
            f"{path}: no finished MCAP log; ground log recover saves what an unfinished one holds"
        ) from None


def _copy(source: Any, writer: McapWriter, path: Path) -> int:
    schemas: dict[int, int] = {0: 0}
    channels: dict[int, int] = {}
    saved = 0
    try:
        for record in StreamReader(source).records:
            match record:
                case Schema() if record.id not in schemas:
                    schemas[record.id] = writer.register_schema(
                        record.name, record.encoding, record.data
                    )
                case Channel() if record.id not in channels:
                    schema = schemas[record.schema_id]
                    channels[record.id] = writer.register_channel(
                        record.topic, record.message_encoding, schema
                    )
                case Message():
                    writer.add_message(
                        channels[record.channel_id], record.log_time, record.data, record.sequence
                    )
                    saved += 1
                case Attachment():
                    writer.add_attachment(
                        record.log_time, record.name, record.media_type, record.data
                    )
                case Metadata():
                    writer.add_metadata(record.name, record.metadata)
    except InvalidMagic as error:
        raise McapFileError(f"{path}: no MCAP file ({error})") from None
    except (McapError, struct.error, ValueError, zstandard.ZstdError):
        pass  # the torn end
    return saved


def _flatten(fields: Any) -> list[Any]:
    return [part for value in fields for part in (value if isinstance(value, tuple) else (value,))]


def _write_csv(out: Path, topic: str, rows: list[list[Any]]) -> Path:
    target = out / safe_file_name(topic.removeprefix("/mavlink/").replace("/", "-") + ".csv")
    header = ["time_s"]
    for field in dialect.by_name(topic.rsplit("/", 1)[1]).fields:
        is_array = field.array_length and field.type != "char"
        header += (
            [f"{field.name}[{i}]" for i in range(field.array_length)] if is_array else [field.name]
        )
    with target.open("x", newline="") as file:
        csv.writer(file).writerows([header, *rows])
    return target
