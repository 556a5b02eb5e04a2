"""One open log: ticks, sent and received messages in the common log format (MCAP)."""

import time
from collections.abc import Sequence
from typing import Any

from autopilot.onboard_log import channels
from autopilot.onboard_log.writer import BackgroundFile
from autopilot.telemetry.encoding import pack_payload
from autopilot.telemetry.identity import COMPONENT
from autopilot.vehicle import Vehicle
from mavlink_io import dialect
from mavlink_io.codec import Frame
from mavlink_io.dialect import MessageType
from mavlink_io.logging.mavlink_log import Channel, MavlinkLog, MessageTable
from mavlink_io.request import MavlinkId
from mavlink_io.services.missions import item_fields

MAX_UNWRITTEN_CHUNKS = 250
"""Queue length for the disk, about 15 MB, above which ticks are dropped to limit memory."""


class LogSession:
    """Writes one log; call ``finish`` at its end.

    ``log_time`` is the UNIX time of the start plus the vehicle time since then.
    """

    def __init__(self, vehicle: Vehicle, file: BackgroundFile, version: str) -> None:
        self._vehicle, self.file = vehicle, file
        self._log = MavlinkLog(file, file.enqueue)
        self._system = vehicle.system
        self._start_us = vehicle.time_us
        self._zero_ns = time.time_ns() - self._start_us * 1000
        self._channels: dict[tuple[int, int, int], Channel] = {}
        self._sequences: dict[tuple[int, int], int] = {}
        self._table: MessageTable | None = None
        self._slot = -1
        self.overrun = False
        """Whether ticks were dropped because the disk is too slow."""
        self._describe(version)

    @property
    def time_us(self) -> int:
        """Vehicle time of the newest tick."""
        return self._vehicle.time_us

    def tick(self, frames: Sequence[Frame]) -> None:
        """Write one tick: its received frames, HIL_SENSOR last, and the resulting state."""
        if self.file.waiting > MAX_UNWRITTEN_CHUNKS:
            self.overrun = True
            return
        for frame in frames[:-1]:
            self.frame(frame, self._system)
        sensors, report = frames[-1], self._vehicle.report()
        if self._table is None:
            self._table = self._log.table(channels.columns(self._system, sensors.component))
        own = self._next_sequence(self._system, COMPONENT, 4)
        sensor_sequence = self._next_sequence(self._system, sensors.component)
        sequences = sensor_sequence, own, own + 1, own + 2, own + 3
        self._table.write(self._now_ns(), channels.fields(report, sensors.payload), sequences)
        slot = self.time_us // channels.SLOT_US
        if slot != self._slot:
            self._slot, snapshot = slot, self._vehicle.snapshot()
            for stream, slots in channels.SLOW_CHANNELS:
                if slot % slots == 0:
                    self.message(stream.message, stream.build(snapshot))

    def message(self, message: MessageType, values: tuple[Any, ...]) -> None:
        """Write a message of the autopilot."""
        self._write(self._system, COMPONENT, message, pack_payload(message, values))

    def frame(self, frame: Frame, system: int | None = None) -> None:
        """Write a received frame; ``system`` replaces its system id (for onboard devices)."""
        message = dialect.by_id(frame.message_id)
        assert message is not None, "the codec lets only known messages pass"
        self._write(
            frame.system if system is None else system, frame.component, message, frame.payload
        )

    def flush(self) -> None:
        """Pass the buffered data to the writer thread."""
        self._log.flush()

    def finish(self) -> None:
        """Write the index and close the file, without waiting for the disk."""
        self._log.finish()
        self.file.close()

    def _describe(self, version: str) -> None:
        """Write vehicle, software version, parameters and plans at the start of the log."""
        now_ns, params = self._now_ns(), self._vehicle.params
        self._log.annotate(
            "vehicle", {"system": str(self._system), "autopilot": f"caribou {version}"}
        )
        self._log.annotate(
            f"clock/{self._system}", {"vehicle_time_zero_unix_ns": str(self._zero_ns)}
        )
        self._log.annotate("trace", channels.trace_names())
        self._log.attach_parameters(now_ns, {name: params.get(name) for name in params.names()})
        item_message = dialect.by_name("MISSION_ITEM_INT")
        state = self._vehicle.state
        for item in (*state.mission.items, *state.fence.items, *state.rally.items):
            self.message(item_message, item_message.values(**item_fields(item, MavlinkId(0, 0))))

    def _write(self, system: int, component: int, message: MessageType, payload: bytes) -> None:
        """Write a payload on the channel of its sender and message."""
        key = system, component, message.message_id
        channel = self._channels.get(key)
        if channel is None:
            channel = self._channels[key] = self._log.channel(system, component, message)
        self._log.write(channel, self._now_ns(), payload, self._next_sequence(system, component))

    def _now_ns(self) -> int:
        """Return the log time: UNIX time in ns."""
        return self._zero_ns + self.time_us * 1000

    def _next_sequence(self, system: int, component: int, count: int = 1) -> int:
        """Reserve ``count`` sequence numbers of a sender and return the first of them."""
        sender = system, component
        first = self._sequences.get(sender, 0)
        self._sequences[sender] = first + count
        return first
