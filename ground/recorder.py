"""Writes every MAVLink frame that arrives into an MCAP file, as it came.

A frame becomes one message of channel ``/mavlink/<system>/<component>/<NAME>``: its payload, zero-padded to full
length, is a ROS 1 message (`ground.ros1`). ``log_time`` is the UNIX time at which the vehicle's clock stood at zero
plus vehicle time; a message that carries no time has that of the last one of its system that did. Chunks are small
and handed to the operating system several times a second, so that a killed process loses next to nothing.
"""

import json
import struct
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import NamedTuple

from mcap.writer import Writer

from ground import foxglove, ros1
from ground.foxglove import Panels, View
from link import dialect
from link.clock import Every, wall_s
from link.codec import Frame

CHUNK_BYTES = 60_000
FLUSH_PERIOD_S = 0.2
RESTART_US = 10_000_000
"""A step back of vehicle time by more than this is a restart, by less an old sample such as a satellite fix."""

_tlog_stamp = struct.Struct(">Q")


class _Channel(NamedTuple):
    number: int
    length: int
    read_time_us: Callable[[bytes], int | None] | None
    show: Callable[[int, bytes, int], None] | None


class _Clock:
    """The vehicle time of one sending system, and where it stands in UNIX time."""

    def __init__(self, start_unix_ns: int) -> None:
        self.start_unix_ns = start_unix_ns
        self.known = False
        self.vehicle_us = 0


class Recorder:
    """An open log. Close it with ``finish`` in every exit; what was flushed before can be recovered without."""

    def __init__(self, path: Path, tlog: Path | None = None, now_unix_ns: Callable[[], int] = time.time_ns) -> None:
        self.path = path
        self.message_count = 0
        self._now_unix_ns = now_unix_ns
        self._opened_unix_ns = now_unix_ns()
        self._channels: dict[tuple[int, int, int], _Channel] = {}
        self._views: dict[str, int] = {}
        self._schemas: dict[str, int] = {}
        self._clocks: dict[int, _Clock] = {}
        self._panels = Panels(self._show)
        self._file = path.open("wb")
        self._tlog = tlog.open("wb") if tlog else None
        self._writer = Writer(self._file, chunk_size=CHUNK_BYTES)
        self._writer.start(profile="ros1", library="caribou")
        self._flush = Every(FLUSH_PERIOD_S, wall_s)
        self._finished = False

    @property
    def vehicle_s(self) -> float:
        """Vehicle time of the newest message, over all systems."""
        return max((clock.vehicle_us for clock in self._clocks.values()), default=0) / 1e6

    def heard(self, component: int, name: str) -> bool:
        """Whether any system's ``component`` has sent a message of that name."""
        message_id = dialect.by_name(name).message_id
        return any(key[1:] == (component, message_id) for key in self._channels)

    def record(self, frame: Frame) -> None:
        """Write one received frame."""
        key = frame.system, frame.component, frame.message_id
        channel = self._channels.get(key) or self._open_channel(frame)
        clock = self._clocks.get(frame.system) or self._clocks.setdefault(frame.system, _Clock(self._opened_unix_ns))
        payload = frame.payload[: channel.length].ljust(channel.length, b"\0")
        own_us = None if channel.read_time_us is None else channel.read_time_us(payload)
        if own_us is not None:
            self._set_clock(frame.system, clock, own_us)
        time_ns = clock.start_unix_ns + (clock.vehicle_us if own_us is None else own_us) * 1000
        self._writer.add_message(channel.number, time_ns, payload, time_ns, frame.sequence)
        self.message_count += 1
        if channel.show is not None:
            channel.show(frame.system, payload, time_ns)
        if self._tlog is not None:
            self._tlog.write(_tlog_stamp.pack(time_ns // 1000) + frame.raw)

    def attach(self, name: str, data: bytes, media_type: str) -> None:
        """Keep a file inside the log, such as the parameters that were flown."""
        now = self._now_unix_ns()
        self._writer.add_attachment(now, now, name, media_type, data)

    def attach_parameters(self, values: Mapping[str, float]) -> None:
        """Keep the vehicle's parameters as ``params.json``: an object of numbers by name."""
        self.attach("params.json", json.dumps(dict(sorted(values.items())), indent=1).encode(), "application/json")

    def annotate(self, name: str, values: Mapping[str, str]) -> None:
        """Keep named texts inside the log, such as versions and seeds."""
        self._writer.add_metadata(name, dict(values))

    def flush_when_due(self) -> None:
        """Hand what was recorded to the operating system, a few times a second. Call it often, also in silence."""
        if self._flush.due():
            self.flush()

    def flush(self) -> None:
        """Hand what was recorded to the operating system now."""
        self._writer.flush()  # type: ignore[no-untyped-call]
        if self._tlog is not None:
            self._tlog.flush()

    def finish(self) -> None:
        """Write the index and close the file; a second call does nothing."""
        if self._finished:
            return
        self._finished = True
        self._writer.finish()  # type: ignore[no-untyped-call]
        self._file.close()
        if self._tlog is not None:
            self._tlog.close()

    def _set_clock(self, system: int, clock: _Clock, vehicle_us: int) -> None:
        if not clock.known:
            clock.known = True
            clock.start_unix_ns = self._now_unix_ns() - vehicle_us * 1000
            self.annotate(f"clock/{system}", {"vehicle_time_zero_unix_ns": str(clock.start_unix_ns)})
        if not 0 < clock.vehicle_us - vehicle_us < RESTART_US:
            clock.vehicle_us = vehicle_us

    def _open_channel(self, frame: Frame) -> _Channel:
        message = dialect.by_id(frame.message_id)
        assert message is not None, "the codec lets only known messages pass"
        topic = f"/mavlink/{frame.system}/{frame.component}/{message.name}"
        schema = self._schema(ros1.schema_name(message), ros1.SCHEMA_ENCODING, ros1.schema_text(message))
        number = self._writer.register_channel(topic, ros1.MESSAGE_ENCODING, schema)
        read_time_us, show = ros1.vehicle_time_reader(message), self._panels.viewer(message.name)
        channel = _Channel(number, message.struct.size, read_time_us, show)
        self._channels[frame.system, frame.component, frame.message_id] = channel
        return channel

    def _schema(self, name: str, encoding: str, text: str) -> int:
        if name not in self._schemas:
            self._schemas[name] = self._writer.register_schema(name, encoding, text.encode())
        return self._schemas[name]

    def _show(self, view: View, data: bytes, time_ns: int) -> None:
        if view.topic not in self._views:
            schema = self._schema(view.schema_name, foxglove.SCHEMA_ENCODING, view.schema_text)
            self._views[view.topic] = self._writer.register_channel(view.topic, foxglove.MESSAGE_ENCODING, schema)
        self._writer.add_message(self._views[view.topic], time_ns, data, time_ns)
