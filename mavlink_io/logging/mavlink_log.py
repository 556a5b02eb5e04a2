"""An MCAP file of MAVLink messages: the one format of every log, whoever writes it.

A message of system 1, component 1 stands in channel ``/mavlink/1/1/NAME``: its payload, zero-padded
to full length, is a ROS 1 message (`mavlink_io.logging.ros1`). Beside them stand a few views that
viewers draw untold (`mavlink_io.logging.foxglove`)."""

import json
import struct
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from mavlink_io.dialect import MessageType
from mavlink_io.logging import foxglove, ros1
from mavlink_io.logging.foxglove import PERIOD_NS, ViewerTopic, ViewerTopics
from mavlink_io.logging.mcap import (
    MESSAGE_HEAD_FORMAT,
    McapWriter,
    Scheduler,
    Sink,
    message_prefix,
    run_immediately,
)

ViewCallback = Callable[[int, bytes, int], None]


class Channel(NamedTuple):
    """One message of one sender."""

    number: int
    system: int
    length: int
    """Of the payload at full length, in bytes."""
    show: ViewCallback | None


class Column(NamedTuple):
    """One message of a row: whose it is and which of its fields are given. Left out fields at its
    end are zero."""

    system: int
    component: int
    message: MessageType
    given: str
    """Of the fields, in the language of ``struct``."""


class MavlinkLog:
    """A log under way. Call ``finish`` in every exit; what was flushed before can be recovered
    without."""

    def __init__(self, file: Sink, later: Scheduler = run_immediately) -> None:
        """``later`` does, now or later, all that touches the file."""
        self._writer = McapWriter(file, "ros1", "caribou", later)
        self._schemas: dict[str, int] = {}
        self._views: dict[str, int] = {}
        self._panels = ViewerTopics(self._show)
        self.message_count = 0

    def channel(self, system: int, component: int, message: MessageType) -> Channel:
        """Open the channel of a sender's message; call it once for each."""
        topic = f"/mavlink/{system}/{component}/{message.name}"
        schema = self._schema(
            ros1.schema_name(message), ros1.SCHEMA_ENCODING, ros1.schema_text(message)
        )
        number = self._writer.register_channel(topic, ros1.MESSAGE_ENCODING, schema)
        return Channel(number, system, message.struct.size, self._panels.viewer(message.name))

    def write(self, channel: Channel, time_ns: int, payload: bytes, sequence: int) -> None:
        """Write one payload, whose trailing zeros may be missing. ``time_ns`` is UNIX time."""
        payload = payload[: channel.length].ljust(channel.length, b"\0")
        self._writer.add_message(channel.number, time_ns, payload, sequence)
        self.message_count += 1
        if channel.show is not None:
            channel.show(channel.system, payload, time_ns)

    def table(self, columns: Sequence[Column]) -> "MessageTable":
        """Open channels whose messages are always written together."""
        return MessageTable(self, self._writer, columns)

    def attach(self, time_ns: int, name: str, data: bytes, media_type: str) -> None:
        """Keep a file inside the log, such as the mission that was flown."""
        self._writer.add_attachment(time_ns, name, media_type, data)

    def attach_parameters(self, time_ns: int, values: Mapping[str, float]) -> None:
        """Keep the vehicle's parameters as ``params.json``: an object of numbers by name."""
        text = json.dumps(dict(sorted(values.items())), indent=1)
        self.attach(time_ns, "params.json", text.encode(), "application/json")

    def annotate(self, name: str, values: Mapping[str, str]) -> None:
        """Keep named texts inside the log, such as versions and seeds."""
        self._writer.add_metadata(name, values)

    def flush(self) -> None:
        """Hand what was written to the operating system now."""
        self._writer.flush()

    def finish(self) -> None:
        """Write the index. The file itself is its opener's to close."""
        self._writer.finish()

    def _schema(self, name: str, encoding: str, text: str) -> int:
        if name not in self._schemas:
            self._schemas[name] = self._writer.register_schema(name, encoding, text.encode())
        return self._schemas[name]

    def _show(self, view: ViewerTopic, data: bytes, time_ns: int) -> None:
        if view.topic not in self._views:
            schema = self._schema(view.schema_name, foxglove.SCHEMA_ENCODING, view.schema_text)
            self._views[view.topic] = self._writer.register_channel(
                view.topic, foxglove.MESSAGE_ENCODING, schema
            )
        self._writer.add_message(self._views[view.topic], time_ns, data, 0)


class MessageTable:
    """Messages that are written together many times a second: packed in one go, several times
    faster than singly."""

    def __init__(self, log: MavlinkLog, writer: McapWriter, columns: Sequence[Column]) -> None:
        self._log, self._writer = log, writer
        self._prefixes: list[bytes] = []
        self._shown: list[tuple[Channel, int]] = []
        self._shown_ns = 0
        layout, at, spots = "<", 0, []
        for column in columns:
            channel = log.channel(column.system, column.component, column.message)
            left_out = channel.length - struct.calcsize("<" + column.given)
            spots.append((channel.number, at))
            layout += f"{MESSAGE_HEAD_FORMAT}{column.given}{left_out}x"
            at = struct.calcsize(layout)
            self._prefixes.append(message_prefix(channel.number, channel.length))
            if channel.show is not None:
                self._shown.append((channel, at - channel.length))
        self._pack = struct.Struct(layout).pack
        self._rows = writer.open_rows(spots)

    def write(
        self, time_ns: int, fields: Sequence[tuple[Any, ...]], sequences: Sequence[int]
    ) -> None:
        """Write one message of each column: its given fields, and its sequence number."""
        values: list[Any] = []
        for prefix, sequence, given in zip(self._prefixes, sequences, fields, strict=True):
            values += (prefix, sequence, time_ns, time_ns, *given)
        records = self._pack(*values)
        self._writer.add_row(self._rows, time_ns, records)
        self._log.message_count += len(self._prefixes)
        if time_ns - self._shown_ns >= PERIOD_NS:
            self._shown_ns = time_ns
            for channel, at in self._shown:
                assert channel.show is not None, "only what can be shown is listed"
                channel.show(channel.system, records[at : at + channel.length], time_ns)
