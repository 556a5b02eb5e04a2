"""When a log begins and ends: from arming to a little after disarming, or always."""

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
from mavlink_io.clock import Every, wall_s
from mavlink_io.codec import Frame
from mavlink_io.dialect import MessageType
from mavlink_io.services.log_transfer.source import LogFile

P = ParamSpec("P")

FLUSH_S = 0.2
"""A killed process loses no more than what it did since."""
AFTER_DISARM_US, AFTER_DISARM_WALL_S = 2 * US_PER_S, 1.0
"""How long a log goes on after disarming: by vehicle time, or by the wall clock where that comes
first."""


class OnboardLog:
    """Keeps one log at a time. Whatever happens to its disk, the flight goes on."""

    def __init__(self, vehicle: Vehicle, folder: Path | None, version: str = "") -> None:
        """Without a ``folder`` nothing is logged."""
        self._vehicle, self._version = vehicle, version
        self.store = LogStore(folder, self._being_written) if folder else None
        self._guard = Guard(vehicle.send_statustext)
        self._entry: LogSession | None = None
        self._file: BackgroundFile | None = None
        self._path: Path | None = None
        self._armed = False
        self._given_up = False
        self._disarmed_us, self._disarmed_s = 0, 0.0
        self._newest_us = -1
        self._flush = Every(FLUSH_S)

    def tick(self, heard: Sequence[Frame]) -> None:
        """Log what became of the frames that came for a tick, the sensors' last."""
        if self.store is not None:
            self._run(self._tick, heard)

    def note(self, message: MessageType, values: tuple[Any, ...]) -> None:
        """Log what the vehicle says: an event, a changed parameter, an acknowledgement."""
        if self.store is not None:
            self._run(self._note, message, values)

    def hear(self, frame: Frame) -> None:
        """Log what ground says, if it can change what the vehicle does."""
        if self.store is not None and frame.message_id in channels.LOGGED_FROM_GROUND:
            self._run(self._hear, frame)

    def poll(self) -> None:
        """Hand on what was logged, a few times a second, and say what went wrong with it."""
        if self.store is not None and self._flush.due():
            self._run(self._poll)

    def _tick(self, heard: Sequence[Frame]) -> None:
        if entry := self._follow():
            entry.tick(heard)

    def _note(self, message: MessageType, values: tuple[Any, ...]) -> None:
        if entry := self._follow():
            entry.message(message, values)

    def _hear(self, frame: Frame) -> None:
        if entry := self._follow():
            entry.frame(frame)

    def _poll(self) -> None:
        entry = self._follow()
        if entry is None:
            return
        entry.flush()
        if entry.file.error:
            self._vehicle.send_statustext(f"Log stopped: {entry.file.error}")
            self._entry, self._given_up = None, True
        elif entry.late:
            entry.late = False
            self._vehicle.send_statustext("Log: the disk is too slow, something is left out")

    def files(self) -> Sequence[LogFile]:
        """The logs there are, the oldest first."""
        return self.store.files() if self.store else ()

    def erase(self) -> str:
        """Remove all logs but one that is being written; returns why not, or nothing."""
        return self.store.erase() if self.store else ""

    def close(self) -> None:
        """End the log that is under way, and wait until it is on disk."""
        self._run(self._finish)
        if self._file is not None:
            self._file.wait()

    def _run(self, work: Callable[P, None], *args: P.args, **kwargs: P.kwargs) -> None:
        """Do some work on the log; an unexpected exception ends the log and never the flight."""
        if self._guard.run("onboard log", work, *args, **kwargs):
            return
        entry, self._entry, self._given_up = self._entry, None, True
        if entry is not None and not self._guard.run("onboard log", entry.finish):
            entry.file.close()

    def _follow(self) -> LogSession | None:
        """The log that is to be written now, begun and ended as the vehicle is armed and
        disarmed."""
        state, config = self._vehicle.state, self._vehicle.params.config
        if state.armed != self._armed or state.time_us < self._newest_us:
            self._turn(state.armed, state.time_us < self._newest_us)
        self._newest_us = state.time_us
        wanted = config.log_enabled and (state.armed or config.log_disarmed)
        if self._entry is None:
            if wanted and not self._given_up:
                self._begin()
        elif not wanted and not self._in_tail():
            self._finish()
        return self._entry

    def _turn(self, armed: bool, restarted: bool) -> None:
        """Arming begins a new log; so does vehicle time that begins again."""
        if armed or restarted:
            self._finish()
            self._given_up = False
        self._disarmed_us, self._disarmed_s = self._vehicle.state.time_us, wall_s()
        self._armed = armed

    def _in_tail(self) -> bool:
        since_us = self._vehicle.state.time_us - self._disarmed_us
        return since_us < AFTER_DISARM_US and wall_s() - self._disarmed_s < AFTER_DISARM_WALL_S

    def _begin(self) -> None:
        config, now_s = self._vehicle.params.config, time.time()
        limits = StorageLimits(config.log_max_mb, config.log_free_mb)
        assert self.store is not None, "nothing begins without a folder"
        file = BackgroundFile(
            partial(self._open, now_s, limits), partial(self.store.make_room, limits), self._file
        )
        self._entry, self._file = LogSession(self._vehicle, file, self._version), file

    def _open(self, unix_s: float, limits: StorageLimits) -> BinaryIO:
        """Called by the thread that writes: a slow disk may take its time to open a file, too."""
        assert self.store is not None, "nothing is opened without a folder"
        self._path, file = self.store.create(unix_s, limits)
        return file

    def _finish(self) -> None:
        if self._entry is not None:
            self._entry.finish()
            self._entry = None

    def _being_written(self) -> Path | None:
        return self._path if self._file is not None and self._file.writing else None
