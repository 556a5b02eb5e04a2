"""Start and end of onboard logs: from arming to shortly after disarming, or always."""

import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any, BinaryIO, ParamSpec

from autopilot.comms.guard import Guard
from autopilot.control.types import US_PER_S
from autopilot.onboard_log import channels
from autopilot.onboard_log.session import LogSession
from autopilot.onboard_log.storage import LogStore, StorageLimits
from autopilot.onboard_log.writer import BackgroundFile
from autopilot.vehicle import Vehicle
from mavlink_io.clock import Interval, wall_s
from mavlink_io.codec import Frame
from mavlink_io.dialect import MessageType
from mavlink_io.services.log_transfer.source import LogFile

P = ParamSpec("P")

FLUSH_S = 0.2
"""Interval of flushes: a killed process loses at most this much of the log."""
RETRY_S = 10.0
"""Wall time after a failed log until the next one is tried."""
AFTER_DISARM_US, AFTER_DISARM_WALL_S = 2 * US_PER_S, 1.0
"""Duration of a log after disarming, in vehicle and wall time; the first to expire ends it."""


class OnboardLog:
    """Writes one log at a time. Errors of the disk end the log but never the flight."""

    def __init__(self, vehicle: Vehicle, folder: Path | None, version: str = "") -> None:
        """Log to ``folder``; None turns logging off."""
        self._vehicle, self._version = vehicle, version
        self.store = LogStore(folder, self._path_being_written) if folder else None
        self._guard = Guard(vehicle.send_statustext)
        self._session: LogSession | None = None
        self._file: BackgroundFile | None = None
        self._path: Path | None = None
        self._armed = False
        self._retry_s = 0.0
        """Wall time from which a log may begin after one that failed."""
        self._reported_error = ""
        self._disarmed_us, self._disarmed_s = 0, 0.0
        self._newest_us = -1
        self._flush = Interval(FLUSH_S)

    def tick(self, frames: Sequence[Frame]) -> None:
        """Log a tick with its received frames, the HIL_SENSOR frame last."""
        if self.store is not None:
            self._run(self._tick, frames)

    def log_sent(self, message: MessageType, values: tuple[Any, ...]) -> None:
        """Log a sent message: an event, a changed parameter or an acknowledgement."""
        if self.store is not None:
            self._run(self._log_sent, message, values)

    def log_received(self, frame: Frame) -> None:
        """Log a message from ground that can change the vehicle's behaviour."""
        if self.store is not None and frame.message_id in channels.LOGGED_FROM_GROUND:
            self._run(self._log_received, frame)

    def poll(self) -> None:
        """Flush the log several times per second, and report errors of the disk."""
        if self.store is not None and self._flush.due():
            self._run(self._poll)

    def _tick(self, frames: Sequence[Frame]) -> None:
        """Log a tick when a log is open."""
        if session := self._update_session():
            session.tick(frames)

    def _log_sent(self, message: MessageType, values: tuple[Any, ...]) -> None:
        """Log a sent message when a log is open."""
        if session := self._update_session():
            session.message(message, values)

    def _log_received(self, frame: Frame) -> None:
        """Log a received message when a log is open."""
        if session := self._update_session():
            session.frame(frame)

    def _poll(self) -> None:
        """Flush the open log, and report its errors."""
        session = self._update_session()
        if session is None:
            return
        session.flush()
        if session.file.error:
            self._report_error(session.file.error)
            self._session, self._retry_s = None, wall_s() + RETRY_S
        elif session.overrun:
            session.overrun = False
            self._vehicle.send_statustext("Log: the disk is too slow, data is dropped")

    def _report_error(self, error: str) -> None:
        """Report why a log has ended, once per arming and reason."""
        if error != self._reported_error:
            self._reported_error = error
            self._vehicle.send_statustext(
                f"Log stopped: {error}; the dive goes on, a new log is tried every {RETRY_S:g} s"
            )

    def files(self) -> Sequence[LogFile]:
        """Return the existing logs, the oldest first."""
        return self.store.files() if self.store else ()

    def erase(self) -> str:
        """Remove all logs except the open one; return the error text, "" for success."""
        return self.store.erase() if self.store else ""

    def close(self) -> None:
        """End the open log, and wait until it is on disk."""
        self._run(self._finish)
        if self._file is not None:
            self._file.wait()

    def _run(self, work: Callable[P, None], *args: P.args, **kwargs: P.kwargs) -> None:
        """Call a method of the log; an unexpected exception ends the log but never the flight."""
        if self._guard.run("onboard log", work, *args, **kwargs):
            return
        session, self._session, self._retry_s = self._session, None, wall_s() + RETRY_S
        if session is not None and not self._guard.run("onboard log", session.finish):
            session.file.close()

    def _update_session(self) -> LogSession | None:
        """Begin or end a log by the arming state; return the log to write now."""
        vehicle, config = self._vehicle, self._vehicle.params.config
        armed, time_us = vehicle.armed, vehicle.time_us
        if armed != self._armed or time_us < self._newest_us:
            self._on_arming_change(armed, time_us < self._newest_us)
        self._newest_us = time_us
        is_on = config.log_enabled and (armed or config.log_disarmed)
        if self._session is None:
            if is_on and wall_s() >= self._retry_s:
                self._begin()
        elif not is_on and not self._within_tail():
            self._finish()
        return self._session

    def _on_arming_change(self, armed: bool, restarted: bool) -> None:
        """End the log when the vehicle is armed or vehicle time restarts; record the time."""
        if armed or restarted:
            self._finish()
            self._retry_s = 0.0
            self._reported_error = ""
        self._disarmed_us, self._disarmed_s = self._vehicle.time_us, wall_s()
        self._armed = armed

    def _within_tail(self) -> bool:
        """Return whether the log still continues after disarming."""
        since_us = self._vehicle.time_us - self._disarmed_us
        return since_us < AFTER_DISARM_US and wall_s() - self._disarmed_s < AFTER_DISARM_WALL_S

    def _begin(self) -> None:
        """Begin a new log."""
        config, now_s = self._vehicle.params.config, time.time()
        limits = StorageLimits(config.log_max_mb, config.log_free_mb)
        assert self.store is not None, "no log begins without a folder"
        file = BackgroundFile(
            partial(self._open, now_s, limits), partial(self.store.make_room, limits), self._file
        )
        self._session, self._file = LogSession(self._vehicle, file, self._version), file

    def _open(self, unix_s: float, limits: StorageLimits) -> BinaryIO:
        """Open the next file; called by the writer thread, because a slow disk delays it."""
        assert self.store is not None, "no file is opened without a folder"
        self._path, file = self.store.create(unix_s, limits)
        return file

    def _finish(self) -> None:
        """End the open log without waiting for the disk."""
        if self._session is not None:
            self._session.finish()
            self._session = None

    def _path_being_written(self) -> Path | None:
        """Return the path of the open log."""
        return self._path if self._file is not None and self._file.writing else None
