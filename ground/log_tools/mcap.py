"""Inspect and recover MCAP logs, also unfinished and damaged ones."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from ground.output_files import open_new
from mavlink_io import dialect
from mavlink_io.errors import ErrorCode, InputError
from mavlink_io.frame_loss import FrameLoss
from mavlink_io.logging import mcap_reader
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
from mavlink_io.text_files import open_regular

MAX_GAP_S = 10.0
"""Time without data from which on `info` reports a gap, s."""


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
    """Return duration, messages by topic, lost frames, attachments, damage and gaps of a log.

    ``gaps`` holds begin (``start_s``, since the first message) and length (``length_s``) of the
    times without any message, s.

    Raises
    ------
    McapFileError
        The file is missing, is not an MCAP file, or is unfinished.
    """
    topics: dict[str, int] = {}
    first_ns, last_ns = None, 0
    attachments: list[str] = []
    metadata: dict[str, dict[str, str]] = {}
    silences: list[tuple[int, int]] = []
    losses: dict[str, FrameLoss] = {}
    counters: dict[int, tuple[FrameLoss, int | None]] = {}
    with _opened(path) as reader:
        names: dict[int, str] = {}
        for item in reader.items():
            match item:
                case McapMessage():
                    topic = names[item.channel]
                    topics[topic] = topics.get(topic, 0) + 1
                    if first_ns is not None and item.time_ns - last_ns > MAX_GAP_S * 1e9:
                        silences.append((last_ns, item.time_ns))
                    first_ns = item.time_ns if first_ns is None else min(first_ns, item.time_ns)
                    last_ns = max(last_ns, item.time_ns)
                    if item.channel in counters:
                        loss, number = counters[item.channel]
                        loss.count(item.sequence & 0xFF, number, item.data)
                case McapChannel():
                    names[item.number] = item.topic
                    if item.topic.startswith("/mavlink/"):
                        sender = item.topic.rpartition("/")[0]
                        loss = losses.setdefault(sender, FrameLoss())
                        counters[item.number] = loss, _message_id(item.topic)
                case McapAttachment():
                    attachments.append(item.name)
                case McapMetadata():
                    metadata[item.name] = item.values
    return {
        "file": str(path),
        "bytes": path.stat().st_size,
        "vehicle_s": 0.0 if first_ns is None else (last_ns - first_ns) / 1e9,
        "messages": sum(topics.values()),
        "lost_frames": sum(loss.lost for loss in losses.values()),
        "topics": dict(sorted(topics.items())),
        "attachments": attachments,
        "metadata": metadata,
        "damage": mcap_reader.damage_texts(reader),
        "gaps": [
            {"start_s": (begin - (first_ns or 0)) / 1e9, "length_s": (end - begin) / 1e9}
            for begin, end in silences
        ],
    }


def attachment(path: Path, name: str) -> bytes | None:
    """Return a file that is attached to a finished log.

    Parameters
    ----------
    path : Path
        The log.
    name : str
        Name of the attachment.

    Returns
    -------
    bytes or None
        Its content; None without it.

    Raises
    ------
    McapFileError
        The file is missing, is not an MCAP file, or is unfinished.
    """
    with _opened(path, lambda channel: False) as reader:
        for item in reader.items():
            if isinstance(item, McapAttachment) and item.name == name:
                return item.data
    return None


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
    with _opened(path, unfinished=True) as reader, open_new(out) as target:
        writer = McapWriter(target, PROFILE, "caribou recover")
        saved = copy(reader, writer)
        writer.finish()
    return Recovered(saved, mcap_reader.damage_texts(reader))


def copy(
    reader: McapReader, writer: McapWriter, before: Callable[[int], None] | None = None
) -> int:
    """Copy all readable records to another log.

    Parameters
    ----------
    reader : McapReader
        Log that is read.
    writer : McapWriter
        Log that is written; the caller finishes it.
    before : Callable, optional
        Called with the log time (ns) of each message before it is written.

    Returns
    -------
    int
        Number of messages.
    """
    schemas: dict[int, int] = {}
    channels: dict[int, int] = {}
    saved = 0
    for item in reader.items():
        match item:
            case McapMessage():
                if before is not None:
                    before(item.time_ns)
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


def _message_id(topic: str) -> int | None:
    """Return the number of the message of a topic; None if the dialect does not define it."""
    name = topic.rpartition("/")[2]
    return dialect.by_name(name).message_id if name in dialect.names() else None


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
        file = open_regular(path)
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
