"""Writer of MCAP files of MAVLink messages: the one log format of all programs.

A message of system 1, component 1 is written to channel ``/mavlink/1/1/NAME``. Its payload,
zero-padded to full length, is a ROS 1 message (`mavlink_io.logging.ros1`). Additional channels
contain messages for log viewers (`mavlink_io.logging.foxglove`).
"""

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

ViewerCallback = Callable[[int, bytes, int], None]
"""Receive system id, full-length payload and log time in nanoseconds of a message."""

PROFILE = ""
"""MCAP profile of the file: none. ``ros1`` requires ROS 1 in every channel; the views are JSON.

Source: https://mcap.dev/spec/registry, "Profiles".
"""


class Channel(NamedTuple):
    """The log channel of one message of one sender."""

    number: int
    """Number of the MCAP channel."""
    system: int
    """System id of the sender."""
    length: int
    """Length of the payload without truncation, in bytes."""
    view: ViewerCallback | None
    """Function that writes the viewer message of a payload; None if there is none."""


class Column(NamedTuple):
    """One message of the rows of a `MessageTable`."""

    system: int
    component: int
    message: MessageType
    formats: str
    """``struct`` formats of the first fields of the message; the fields after them are zero."""


class _Schemas:
    """Schemas of a file by name."""

    def __init__(self, writer: McapWriter) -> None:
        self._writer = writer
        self._numbers: dict[str, int] = {}

    def number(self, name: str, encoding: str, text: str) -> int:
        """Return the number of a schema; register it at the first use."""
        if name not in self._numbers:
            self._numbers[name] = self._writer.register_schema(name, encoding, text.encode())
        return self._numbers[name]


class _ViewerChannels:
    """Channels of viewer messages.

    They do not refer to the log: a log in a reference cycle would stay in memory after its end
    until Python's collector of cycles finds it, which takes many logs.
    """

    def __init__(self, writer: McapWriter, schemas: _Schemas) -> None:
        self._writer, self._schemas = writer, schemas
        self._numbers: dict[str, int] = {}

    def write(self, topic: ViewerTopic, data: bytes, time_ns: int) -> None:
        """Write a viewer message; open its channel at the first use."""
        if topic.topic not in self._numbers:
            schema = self._schemas.number(
                topic.schema_name, foxglove.SCHEMA_ENCODING, topic.schema_text
            )
            self._numbers[topic.topic] = self._writer.register_channel(
                topic.topic, foxglove.MESSAGE_ENCODING, schema
            )
        self._writer.add_message(self._numbers[topic.topic], time_ns, data, 0)


class MavlinkLog:
    """A log that is being written. Call ``finish`` on every exit.

    A log that was not finished can be read up to the last flush.

    Parameters
    ----------
    file : Sink
        Binary file; the caller closes it.
    later : Scheduler
        Run a function that writes to the file, now or later.
    """

    def __init__(self, file: Sink, later: Scheduler = run_immediately) -> None:
        self._writer = McapWriter(file, PROFILE, "caribou", later)
        self._schemas = _Schemas(self._writer)
        self._viewer_topics = ViewerTopics(_ViewerChannels(self._writer, self._schemas).write)
        self.message_count = 0
        """Number of MAVLink messages written."""

    def channel(self, system: int, component: int, message: MessageType) -> Channel:
        """Open the channel of a sender's message; call it once for each.

        Parameters
        ----------
        system, component : int
            Ids of the sender.
        message : MessageType
            Type of the message.

        Returns
        -------
        Channel
            The channel, for ``write``.
        """
        topic = f"/mavlink/{system}/{component}/{message.name}"
        schema = self._schemas.number(
            ros1.schema_name(message), ros1.SCHEMA_ENCODING, ros1.schema_text(message)
        )
        number = self._writer.register_channel(topic, ros1.MESSAGE_ENCODING, schema)
        view = self._viewer_topics.converter(message.name)
        return Channel(number=number, system=system, length=message.struct.size, view=view)

    def write(self, channel: Channel, time_ns: int, payload: bytes, sequence: int) -> None:
        """Write one message.

        Parameters
        ----------
        channel : Channel
            Channel of the message.
        time_ns : int
            Log time: UNIX time, in nanoseconds.
        payload : bytes
            Payload; trailing zeros may be missing.
        sequence : int
            Sequence number of the message.
        """
        payload = payload[: channel.length].ljust(channel.length, b"\0")
        self._writer.add_message(channel.number, time_ns, payload, sequence)
        self.message_count += 1
        if channel.view is not None:
            channel.view(channel.system, payload, time_ns)

    def table(self, columns: Sequence[Column]) -> "MessageTable":
        """Open channels whose messages are always written together.

        Parameters
        ----------
        columns : sequence of Column
            The messages of a row.

        Returns
        -------
        MessageTable
            Writes the rows.
        """
        return MessageTable(self, self._writer, columns)

    def attach(self, time_ns: int, name: str, data: bytes, media_type: str) -> None:
        """Store a file inside the log, such as the mission.

        Parameters
        ----------
        time_ns : int
            Log time: UNIX time, in nanoseconds.
        name : str
            Name of the file.
        data : bytes
            Content of the file.
        media_type : str
            Media type, such as "application/json".
        """
        self._writer.add_attachment(time_ns, name, media_type, data)

    def attach_parameters(self, time_ns: int, values: Mapping[str, float]) -> None:
        """Store the vehicle's parameters as ``params.json``: an object of numbers by name.

        Parameters
        ----------
        time_ns : int
            Log time: UNIX time, in nanoseconds.
        values : mapping of str to float
            Parameters by name.
        """
        text = json.dumps(dict(sorted(values.items())), indent=1)
        self.attach(time_ns, "params.json", text.encode(), "application/json")

    def annotate(self, name: str, values: Mapping[str, str]) -> None:
        """Store texts inside the log, such as versions and seeds.

        Parameters
        ----------
        name : str
            Name of the group of texts.
        values : mapping of str to str
            Texts by name.
        """
        self._writer.add_metadata(name, values)

    def flush(self) -> None:
        """Pass all written data to the operating system."""
        self._writer.flush()

    def finish(self) -> None:
        """Write the index; the caller closes the file."""
        self._writer.finish()


class MessageTable:
    """Writer of messages that are always written together, many times a second.

    It packs all messages of a row in one call, several times faster than one by one.

    Parameters
    ----------
    log : MavlinkLog
        The log.
    writer : McapWriter
        Writer of the log's file.
    columns : sequence of Column
        The messages of a row.
    """

    def __init__(self, log: MavlinkLog, writer: McapWriter, columns: Sequence[Column]) -> None:
        self._log, self._writer = log, writer
        self._prefixes: list[bytes] = []
        self._viewed: list[tuple[Channel, int]] = []
        self._viewed_ns = 0
        layout, offset, spots = "<", 0, []
        for column in columns:
            channel = log.channel(column.system, column.component, column.message)
            padding = channel.length - struct.calcsize("<" + column.formats)
            spots.append((channel.number, offset))
            layout += f"{MESSAGE_HEAD_FORMAT}{column.formats}{padding}x"
            offset = struct.calcsize(layout)
            self._prefixes.append(message_prefix(channel.number, channel.length))
            if channel.view is not None:
                self._viewed.append((channel, offset - channel.length))
        self._pack = struct.Struct(layout).pack
        self._rows = writer.open_rows(spots)

    def write(
        self, time_ns: int, fields: Sequence[tuple[Any, ...]], sequences: Sequence[int]
    ) -> None:
        """Write one row: one message of each column.

        Parameters
        ----------
        time_ns : int
            Log time: UNIX time, in nanoseconds.
        fields : sequence of tuple
            First fields of each message, as in ``Column.formats``.
        sequences : sequence of int
            Sequence number of each message.
        """
        values: list[Any] = []
        for prefix, sequence, first_fields in zip(self._prefixes, sequences, fields, strict=True):
            values += (prefix, sequence, time_ns, time_ns, *first_fields)
        records = self._pack(*values)
        self._writer.add_row(self._rows, time_ns, records)
        self._log.message_count += len(self._prefixes)
        if time_ns - self._viewed_ns >= PERIOD_NS:
            self._viewed_ns = time_ns
            for channel, offset in self._viewed:
                assert channel.view is not None, "the list contains only channels with a view"
                channel.view(channel.system, records[offset : offset + channel.length], time_ns)
