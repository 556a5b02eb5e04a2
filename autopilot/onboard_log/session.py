"""One log under way: the vehicle's ticks, her words and ground's, in the format of every log."""

import time
from collections.abc import Sequence
from typing import Any

from autopilot.onboard_log import channels
from autopilot.onboard_log.writer import BackgroundFile
from autopilot.telemetry.encoding import packed
from autopilot.telemetry.identity import COMPONENT
from autopilot.vehicle import Vehicle
from mavlink_io import dialect
from mavlink_io.codec import Frame
from mavlink_io.dialect import MessageType
from mavlink_io.logging.mavlink_log import Channel, MavlinkLog, MessageTable
from mavlink_io.request import MavlinkId
from mavlink_io.services.missions import item_fields

MAX_UNWRITTEN_CHUNKS = 250
"""When so much waits for the disk, some 15 MB, the log leaves out rather than take all memory."""


class LogSession:
    """Call ``finish`` at its end. ``log_time`` is the UNIX time at which it began plus vehicle time
    since then."""

    def __init__(self, vehicle: Vehicle, file: BackgroundFile, version: str) -> None:
        self._vehicle, self.file = vehicle, file
        self._log = MavlinkLog(file, file.later)
        self._system = vehicle.system
        self._began_us = vehicle.state.time_us
        self._zero_ns = time.time_ns() - self._began_us * 1000
        self._channels: dict[tuple[int, int, int], Channel] = {}
        self._sequences: dict[tuple[int, int], int] = {}
        self._table: MessageTable | None = None
        self._slot = -1
        self.late = False
        """Whether something had to be left out."""
        self._describe(version)

    @property
    def time_us(self) -> int:
        """Vehicle time of the newest tick."""
        return self._vehicle.state.time_us

    def tick(self, heard: Sequence[Frame]) -> None:
        """Write one tick: the frames that came for it, the sensors' last, and what became of it."""
        if self.file.waiting > MAX_UNWRITTEN_CHUNKS:
            self.late = True
            return
        for frame in heard[:-1]:
            self.frame(frame, self._system)
        sensors, snapshot = heard[-1], self._vehicle.snapshot()
        if self._table is None:
            self._table = self._log.table(channels.columns(self._system, sensors.component))
        own = self._next(self._system, COMPONENT, 4)
        sequences = self._next(self._system, sensors.component), own, own + 1, own + 2, own + 3
        self._table.write(self._now_ns(), channels.fields(snapshot, sensors.payload), sequences)
        slot = self.time_us // channels.SLOT_US
        if slot != self._slot:
            self._slot = slot
            for stream, slots in channels.SLOW:
                if slot % slots == 0:
                    self.message(stream.message, stream.build(snapshot))

    def message(self, message: MessageType, values: tuple[Any, ...]) -> None:
        """Write something that the autopilot says."""
        self._write(self._system, COMPONENT, message, packed(message, values))

    def frame(self, frame: Frame, system: int | None = None) -> None:
        """Write something that others say; what the vehicle's own devices say counts as of her
        system."""
        message = dialect.by_id(frame.message_id)
        assert message is not None, "the codec lets only known messages pass"
        self._write(
            frame.system if system is None else system, frame.component, message, frame.payload
        )

    def flush(self) -> None:
        """Hand what was written to the disk."""
        self._log.flush()

    def finish(self) -> None:
        """Write the index and let the file end. Does not wait for the disk."""
        self._log.finish()
        self.file.close()

    def _describe(self, version: str) -> None:
        """What was flown, and with which parameters and mission."""
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
        for item in self._vehicle.state.mission.items:
            self.message(item_message, item_message.values(**item_fields(item, MavlinkId(0, 0))))

    def _write(self, system: int, component: int, message: MessageType, payload: bytes) -> None:
        key = system, component, message.message_id
        channel = self._channels.get(key)
        if channel is None:
            channel = self._channels[key] = self._log.channel(system, component, message)
        self._log.write(channel, self._now_ns(), payload, self._next(system, component))

    def _now_ns(self) -> int:
        return self._zero_ns + self.time_us * 1000

    def _next(self, system: int, component: int, count: int = 1) -> int:
        """The first of the next ``count`` sequence numbers of a sender: none is missing, as nothing
        is lost."""
        sender = system, component
        first = self._sequences.get(sender, 0)
        self._sequences[sender] = first + count
        return first
