"""Inspect, export and recover MCAP logs, also unfinished and damaged ones."""

import csv
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from ground.client.file_names import safe_file_name
from mavlink_io import dialect
from mavlink_io.errors import ErrorCode, InputError
from mavlink_io.logging import mcap_reader, ros1
from mavlink_io.logging.mavlink_log import PROFILE
from mavlink_io.logging.mcap import McapWriter
from mavlink_io.logging.mcap_reader import (
    McapAttachment,
    McapChannel,
    McapError,
    McapMessage,
    McapMetadata,
    McapReader,
)


class Recovered(NamedTuple):
    """Result of the recovery of an unfinished or damaged log."""

    messages: int
    """Number of saved messages."""
    damage: list[str]
    """Description of each lost part."""


class McapFileError(InputError):
    """Error for a file that is not a finished MCAP log; the message includes the remedy."""

    code = ErrorCode.MCAP_FILE


def info(path: Path) -> dict[str, Any]:
    """Return duration, messages by topic, lost frames, attachments and damage of a finished log.

    Raises
    ------
    McapFileError
        The file is missing, is not an MCAP file, or is unfinished.
    """
    topics: dict[str, int] = {}
    first_ns, last_ns = None, 0
    attachments: list[str] = []
    metadata: dict[str, dict[str, str]] = {}
    gaps = _Gaps()
    with _opened(path) as reader:
        names: dict[int, str] = {}
        for item in reader.items():
            match item:
                case McapMessage():
                    topic = names[item.channel]
                    topics[topic] = topics.get(topic, 0) + 1
                    first_ns = item.time_ns if first_ns is None else min(first_ns, item.time_ns)
                    last_ns = max(last_ns, item.time_ns)
                    gaps.count(topic, item.sequence)
                case McapChannel():
                    names[item.number] = item.topic
                case McapAttachment():
                    attachments.append(item.name)
                case McapMetadata():
                    metadata[item.name] = item.values
    return {
        "file": str(path),
        "bytes": path.stat().st_size,
        "vehicle_s": 0.0 if first_ns is None else (last_ns - first_ns) / 1e9,
        "messages": sum(topics.values()),
        "lost_frames": gaps.lost,
        "topics": dict(sorted(topics.items())),
        "attachments": attachments,
        "metadata": metadata,
        "damage": mcap_reader.damage_texts(reader),
    }


def export_csv(path: Path, out: Path) -> list[Path]:
    """Write each MAVLink topic as a CSV file.

    The first column is the time since the first message in s. The other columns are the fields;
    an array becomes the columns ``name[i]``.

    Parameters
    ----------
    path : Path
        Log file.
    out : Path
        Folder for the CSV files; created if missing.

    Returns
    -------
    list of Path
        Written files.

    Raises
    ------
    McapFileError
        The log cannot be read or is damaged.
    FileExistsError
        A file to be written exists already.
    """
    rows: dict[str, list[list[Any]]] = {}
    start_ns: int | None = None
    with _opened(path, _is_mavlink) as reader:
        names: dict[int, str] = {}
        for item in reader.items():
            match item:
                case McapMessage():
                    topic = names[item.channel]
                    start_ns = item.time_ns if start_ns is None else start_ns
                    time_s = (item.time_ns - start_ns) / 1e9
                    rows.setdefault(topic, []).append([time_s, *_fields(path, topic, item.data)])
                case McapChannel():
                    names[item.number] = item.topic
    _refuse_damaged(path, reader)
    out.mkdir(parents=True, exist_ok=True)
    return [_write_csv(out, topic, rows[topic]) for topic in sorted(rows)]


def recover(path: Path, out: Path) -> Recovered:
    """Copy every intact record of an unfinished or damaged log into a finished log.

    Parameters
    ----------
    path : Path
        Unfinished or damaged log.
    out : Path
        File to write.

    Returns
    -------
    Recovered
        Number of saved messages and list of damages.

    Raises
    ------
    McapFileError
        `path` is not an MCAP file.
    FileExistsError
        `out` exists already.
    """
    with _opened(path, unfinished=True) as reader, out.open("xb") as target:
        writer = McapWriter(target, PROFILE, "caribou recover")
        try:
            saved = _copy(reader, writer)
        except McapError:
            out.unlink()
            raise
        writer.finish()
    return Recovered(saved, mcap_reader.damage_texts(reader))


class _Gaps:
    """Counter of lost frames, from gaps in the sequence numbers of each sender."""

    def __init__(self) -> None:
        self.lost = 0
        self._expected: dict[str, int] = {}

    def count(self, topic: str, sequence: int) -> None:
        """Add the frames that are missing before the sequence number of a sender's message."""
        if not topic.startswith("/mavlink/"):
            return
        sender = topic.rsplit("/", 1)[0]
        expected = self._expected.get(sender)
        if expected is not None:
            self.lost += (sequence - expected) & 0xFF
        self._expected[sender] = (sequence + 1) & 0xFF


@contextmanager
def _opened(
    path: Path,
    wanted: Callable[[McapChannel], bool] = lambda channel: True,
    *,
    unfinished: bool = False,
) -> Iterator[McapReader]:
    """Open a log, which must be finished unless ``unfinished``.

    Raises McapFileError, also during reading, if the file is not MCAP or exceeds a limit.
    """
    try:
        file = path.open("rb")
    except OSError as error:
        raise McapFileError(f"{path}: {error.strerror}") from None
    remedy = "" if unfinished else "; `ground log recover` saves the content of an unfinished log"
    with file:
        try:
            reader = McapReader(file, wanted)
            if not reader.finished and not unfinished:
                raise McapError("it has no end record")
            yield reader
        except McapError as error:
            what = "not a readable MCAP file" if unfinished else "not a finished MCAP log"
            raise McapFileError(f"{path}: {what} ({error}){remedy}") from None


def _refuse_damaged(path: Path, reader: McapReader) -> None:
    if reader.damage:
        damage = mcap_reader.format_damage(reader)
        raise McapFileError(f"{path}: is damaged: {damage}; `ground log recover` saves the rest")


def _is_mavlink(channel: McapChannel) -> bool:
    """Return whether a channel contains a message of the dialect."""
    if not channel.topic.startswith("/mavlink/") or channel.encoding != ros1.MESSAGE_ENCODING:
        return False
    return channel.topic.rsplit("/", 1)[1] in dialect.names()


def _fields(path: Path, topic: str, payload: bytes) -> list[Any]:
    """Return the values of a message. Raises McapFileError if its size is wrong."""
    message = dialect.by_name(topic.rsplit("/", 1)[1])
    if len(payload) != message.struct.size:
        sizes = f"{len(payload)} bytes, expected {message.struct.size}"
        raise McapFileError(f"{path}: {topic}: {sizes}")
    return _flatten(message.unpack(payload))


def _copy(reader: McapReader, writer: McapWriter) -> int:
    """Copy all readable records and return the number of messages."""
    schemas: dict[int, int] = {}
    channels: dict[int, int] = {}
    saved = 0
    for item in reader.items():
        match item:
            case McapMessage():
                writer.add_message(channels[item.channel], item.time_ns, item.data, item.sequence)
                saved += 1
            case McapChannel():
                schema = 0
                if item.schema is not None:
                    known, name, encoding, data = item.schema
                    if known not in schemas:
                        schemas[known] = writer.register_schema(name, encoding, data)
                    schema = schemas[known]
                channels[item.number] = writer.register_channel(item.topic, item.encoding, schema)
            case McapAttachment():
                writer.add_attachment(item.time_ns, item.name, item.media_type, item.data)
            case McapMetadata():
                writer.add_metadata(item.name, item.values)
    return saved


def _flatten(fields: Any) -> list[Any]:
    return [part for value in fields for part in (value if isinstance(value, tuple) else (value,))]


def _write_csv(out: Path, topic: str, rows: list[list[Any]]) -> Path:
    """Write the messages of a topic as a new CSV file and return its path."""
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
