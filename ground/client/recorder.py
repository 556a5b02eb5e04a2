"""Recorder of all received MAVLink frames in an MCAP file (`mavlink_io.logging`).

`log_time` is the UNIX time at which the vehicle clock was zero, plus vehicle time. A message
without a time stamp gets the time of the last stamped message of its system. Small chunks are
flushed several times a second, so that a killed process loses less than a second.
"""

import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import NamedTuple

from mavlink_io import dialect
from mavlink_io.clock import Interval
from mavlink_io.codec import Frame
from mavlink_io.logging import ros1
from mavlink_io.logging.mavlink_log import Channel, MavlinkLog
from mavlink_io.logging.tlog import TelemetryLog
from mavlink_io.user_data_dir import open_output
from mavlink_io.vehicle_clock import unwrap_us

FLUSH_PERIOD_S = 0.2
"""Wall time between flushes."""
RESTART_US = 10_000_000
"""Step back of vehicle time that counts as a restart of the autopilot; a smaller step is an old
sample, such as a satellite fix."""


class _Stream(NamedTuple):
    """Channel of one message of one sender, and the reader of its time stamp."""

    channel: Channel
    read_time_us: Callable[[bytes], int | None] | None


class _Clock:
    """Vehicle time of one system, and the UNIX time at its zero."""

    def __init__(self, start_unix_ns: int) -> None:
        self.start_unix_ns = start_unix_ns
        self.known = False
        self.vehicle_us = 0


class Recorder:
    """An open log. Call `finish` in all cases; without it, flushed data can still be recovered.

    Parameters
    ----------
    path : Path
        New MCAP file to write.
    tlog : Path, optional
        New telemetry log to write beside it.
    now_unix_ns : callable
        Return the UNIX time (ns).

    Raises
    ------
    OSError
        A file exists or cannot be opened; none is left behind.
    """

    def __init__(
        self, path: Path, tlog: Path | None = None, now_unix_ns: Callable[[], int] = time.time_ns
    ) -> None:
        self.path, self._tlog_path = path, tlog
        self._now_unix_ns = now_unix_ns
        self._opened_unix_ns = now_unix_ns()
        self._streams: dict[tuple[int, int, int], _Stream] = {}
        self._clocks: dict[int, _Clock] = {}
        self._file = open_output(path, "xb")
        try:
            self._tlog = TelemetryLog(open_output(tlog, "xb")) if tlog else None
        except OSError:
            self._file.close()
            path.unlink(missing_ok=True)
            raise
        self._log = MavlinkLog(self._file)
        self._flush = Interval(FLUSH_PERIOD_S)
        self._finished = False

    @property
    def message_count(self) -> int:
        """Number of recorded messages."""
        return self._log.message_count

    @property
    def vehicle_s(self) -> float:
        """Vehicle time of the newest message, over all systems."""
        return max((clock.vehicle_us for clock in self._clocks.values()), default=0) / 1e6

    def system_s(self, system: int) -> float:
        """Return the vehicle time of the newest message of a system.

        Parameters
        ----------
        system : int
            System id.

        Returns
        -------
        float
            Vehicle time (s); 0 before the first time stamp.
        """
        clock = self._clocks.get(system)
        return 0.0 if clock is None else clock.vehicle_us / 1e6

    def has_received(self, component: int, name: str) -> bool:
        """Return whether a component has sent a message.

        Parameters
        ----------
        component : int
            Component id.
        name : str
            Name of the message.

        Returns
        -------
        bool
            True if at least one was recorded, of any system.
        """
        message_id = dialect.by_name(name).message_id
        return any(key[1:] == (component, message_id) for key in self._streams)

    def record(self, frame: Frame) -> None:
        """Write one received frame.

        Parameters
        ----------
        frame : Frame
            Frame of a known message.
        """
        key = frame.system, frame.component, frame.message_id
        stream = self._streams.get(key) or self._open_stream(frame)
        clock = self._clocks.get(frame.system) or self._clocks.setdefault(
            frame.system, _Clock(self._opened_unix_ns)
        )
        stamp_us = None
        if stream.read_time_us is not None:
            stamp_us = stream.read_time_us(frame.payload.ljust(stream.channel.length, b"\0"))
        if stamp_us is not None:
            if clock.known:
                stamp_us = unwrap_us(stamp_us, clock.vehicle_us)
            self._set_clock(frame.system, clock, stamp_us)
        time_ns = clock.start_unix_ns + (clock.vehicle_us if stamp_us is None else stamp_us) * 1000
        self._log.write(stream.channel, time_ns, frame.payload, frame.sequence)
        if self._tlog is not None:
            self._tlog.write(time_ns // 1000, frame.raw)

    def attach(self, name: str, data: bytes, media_type: str) -> None:
        """Attach a file to the log, such as the mission.

        Parameters
        ----------
        name : str
            Name of the attachment.
        data : bytes
            Content.
        media_type : str
            Media type of the content.
        """
        self._log.attach(self._now_unix_ns(), name, data, media_type)

    def attach_parameters(self, values: Mapping[str, float]) -> None:
        """Attach the vehicle's parameters to the log as `params.json`.

        Parameters
        ----------
        values : mapping
            Values by name.
        """
        self._log.attach_parameters(self._now_unix_ns(), values)

    def annotate(self, name: str, values: Mapping[str, str]) -> None:
        """Write named texts, such as versions and seeds, as metadata of the log.

        Parameters
        ----------
        name : str
            Name of the metadata record.
        values : mapping
            Texts by name.
        """
        self._log.annotate(name, values)

    def flush_when_due(self) -> None:
        """Flush if `FLUSH_PERIOD_S` has passed. Call it often, also when no frame arrives."""
        if self._flush.due():
            self.flush()

    def flush(self) -> None:
        """Flush the log to the operating system."""
        self._log.flush()
        if self._tlog is not None:
            self._tlog.flush()

    def finish(self) -> None:
        """Write the index and close the file; a second call does nothing."""
        if self._finished:
            return
        self._finished = True
        self._log.finish()
        self._file.close()
        if self._tlog is not None:
            self._tlog.close()

    def remove(self) -> None:
        """Remove the files; what is recorded later is lost."""
        for path in filter(None, (self.path, self._tlog_path)):
            path.unlink(missing_ok=True)

    def _set_clock(self, system: int, clock: _Clock, vehicle_us: int) -> None:
        """Update the vehicle time of a system; its first time stamp fixes the UNIX time at zero."""
        if not clock.known:
            clock.known = True
            clock.start_unix_ns = self._now_unix_ns() - vehicle_us * 1000
            self.annotate(
                f"clock/{system}", {"vehicle_time_zero_unix_ns": str(clock.start_unix_ns)}
            )
        if not 0 < clock.vehicle_us - vehicle_us < RESTART_US:
            clock.vehicle_us = vehicle_us

    def _open_stream(self, frame: Frame) -> _Stream:
        """Create the channel of a message at its first frame."""
        message = dialect.by_id(frame.message_id)
        assert message is not None, "the codec lets only known messages pass"
        channel = self._log.channel(frame.system, frame.component, message)
        stream = _Stream(channel, ros1.time_reader(message.message_id))
        self._streams[frame.system, frame.component, frame.message_id] = stream
        return stream
