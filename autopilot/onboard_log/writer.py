"""File written by a separate thread, so that a slow disk never delays a tick."""

import os
from collections.abc import Callable
from queue import SimpleQueue
from threading import Event, Thread
from typing import BinaryIO

from autopilot.disk import disk_error_text
from mavlink_io.clock import Interval

SYNC_S = 2.0
"""Interval of fsync: data on the disk survives a loss of power."""
FREE_SPACE_CHECK_BYTES = 1_000_000
"""Number of bytes written between two checks of the free space."""
FINISH_TIMEOUT_S = 10.0
"""Longest wait for a slow disk when the process ends."""

Work = Callable[[], None]
"""A function that the thread calls."""


class BackgroundFile:
    """Runs queued work in a thread, in order. Errors are stored in ``error``, never raised."""

    def __init__(
        self,
        open_file: Callable[[], BinaryIO],
        make_room: Work,
        previous: "BackgroundFile | None" = None,
    ) -> None:
        """Start the thread; it opens the file after ``previous``, so that log numbers increase.

        ``make_room`` is called regularly, and raises OSError when the file must end.
        """
        self._open, self._make_room, self._previous = open_file, make_room, previous
        self._opened = Event()
        self._queue: SimpleQueue[Work | None] = SimpleQueue()
        self._queued_count = self._done_count = 0
        self._unchecked_bytes = 0
        self._sync = Interval(SYNC_S)
        self.error = ""
        """Reason why writing has failed; "" without an error."""
        self._thread = Thread(target=self._run, name="log", daemon=True)
        self._thread.start()

    @property
    def waiting(self) -> int:
        """Number of queued pieces of work that are not done."""
        return self._queued_count - self._done_count

    @property
    def writing(self) -> bool:
        """Whether the thread may still write to the file."""
        return self._thread.is_alive()

    def enqueue(self, work: Work) -> None:
        """Queue work for the thread. After an error of the file, work is no longer done."""
        self._queued_count += 1
        self._queue.put(work)

    def write(self, data: bytes, /) -> None:
        """Write data, and check the free space regularly. Only for the thread."""
        self._file.write(data)
        self._unchecked_bytes += len(data)
        if self._unchecked_bytes > FREE_SPACE_CHECK_BYTES:
            self._unchecked_bytes = 0
            self._make_room()

    def flush(self) -> None:
        """Flush to the operating system, and to the disk every SYNC_S. Only for the thread."""
        self._file.flush()
        if self._sync.due():
            os.fsync(self._file.fileno())

    def close(self) -> None:
        """End the file after the queued work. Returns at once; use ``wait`` to wait."""
        self._queue.put(None)

    def wait(self) -> None:
        """Wait until this file and the previous one are closed, at most FINISH_TIMEOUT_S."""
        self._thread.join(FINISH_TIMEOUT_S)

    def _run(self) -> None:
        """Work after the previous file is open, and end after it is closed."""
        previous, self._previous = self._previous, None
        if previous is not None:
            previous._opened.wait()
        self._work()
        if previous is not None:
            previous._thread.join(FINISH_TIMEOUT_S)

    def _work(self) -> None:
        """Open the file and run the queued work."""
        try:
            file = self._open()
        except Exception as error:
            self.error = disk_error_text(error)
            return
        finally:
            self._opened.set()
        try:
            with file as self._file:
                while work := self._queue.get():
                    work()
                    self._done_count += 1
        except Exception as error:
            if isinstance(error, OSError) and error.filename is None:
                error.filename = getattr(file, "name", None)  # a failed write names no file
            self.error = disk_error_text(error)
