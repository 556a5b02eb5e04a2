"""A file on a disk that may be slow: a thread of its own compresses and writes, so that no tick
ever waits."""

import os
from collections.abc import Callable
from queue import SimpleQueue
from threading import Event, Thread
from typing import BinaryIO

from mavlink_io.clock import Every

SYNC_S = 2.0
"""How often the operating system is asked to bring what it has to the disk itself: a vehicle may
lose her power."""
FREE_SPACE_CHECK_BYTES = 1_000_000
FINISH_TIMEOUT_S = 10.0
"""How long the end of a process waits for a slow disk."""

Work = Callable[[], None]


class BackgroundFile:
    """Does work in a thread, in order. What goes wrong with the file is told by ``error`` and never
    raised."""

    def __init__(
        self,
        open_file: Callable[[], BinaryIO],
        make_room: Work,
        before: "BackgroundFile | None" = None,
    ) -> None:
        """``make_room`` is called now and then, and raises OSError when the file has to end.

        The file is opened after the one ``before``: their names tell which came first.
        """
        self._open, self._make_room, self._before = open_file, make_room, before
        self._opened = Event()
        self._queue: SimpleQueue[Work | None] = SimpleQueue()
        self._given = self._done = 0
        self._unchecked_bytes = 0
        self._sync = Every(SYNC_S)
        self.error = ""
        """Why writing has ended before its time; empty while all is well."""
        self._thread = Thread(target=self._run, name="log", daemon=True)
        self._thread.start()

    @property
    def waiting(self) -> int:
        """How many pieces of work are not done yet."""
        return self._given - self._done

    @property
    def writing(self) -> bool:
        """Whether more may still reach the file."""
        return self._thread.is_alive()

    def later(self, work: Work) -> None:
        """Have the thread do some work that writes; nothing more is done once the file has
        failed."""
        self._given += 1
        self._queue.put(work)

    def write(self, data: bytes, /) -> None:
        """For the thread only: write, and see now and then that there is room."""
        self._file.write(data)
        self._unchecked_bytes += len(data)
        if self._unchecked_bytes > FREE_SPACE_CHECK_BYTES:
            self._unchecked_bytes = 0
            self._make_room()

    def flush(self) -> None:
        """For the thread only: hand what was written to the operating system, and now and then to
        the disk."""
        self._file.flush()
        if self._sync.due():
            os.fsync(self._file.fileno())

    def close(self) -> None:
        """Nothing more is to come. Returns at once; ``wait`` waits until all is done."""
        self._queue.put(None)

    def wait(self) -> None:
        self._thread.join(FINISH_TIMEOUT_S)

    def _run(self) -> None:
        if self._before is not None:
            self._before._opened.wait()
            self._before = None
        try:
            file = self._open()
        except Exception as error:
            self.error = _reason(error)
            return
        finally:
            self._opened.set()
        try:
            with file as self._file:
                while work := self._queue.get():
                    work()
                    self._done += 1
        except Exception as error:
            self.error = _reason(error)


def _reason(error: Exception) -> str:
    if not isinstance(error, OSError):
        return f"internal error: {type(error).__name__} {error}"
    return f"{error.strerror or error}" + (f": {error.filename}" if error.filename else "")
