"""A serial line that survives being unplugged, and never holds its owner back."""

import contextlib
import errno
import os
import sys
from collections.abc import Callable, Sequence

import serial

from mavlink_io.clock import wall_s
from mavlink_io.transport.base import AddressError, Handle, readable

REOPEN_S = 1.0
"""Wall seconds from one attempt to open a lost device to the next."""
READ_BYTES = 4096
BACKLOG_BYTES = 4096
"""What may wait here once the driver takes no more: less than half a second at 115200 baud."""

Report = Callable[[str], None]
_NOT_THERE = (errno.ENOENT, errno.ENXIO, errno.ENODEV)
_FULL = (BlockingIOError, InterruptedError)


class SerialTransport:
    """A serial line, opened for this process alone.

    Once it was open it is never lost for good: a device that goes away is closed and tried again
    every ``REOPEN_S``, and what is sent meanwhile is lost, as on a radio without a peer. ``tell``
    hears of both, once each. With ``awaited`` a device that does not exist yet is waited for in the
    same way.

    Writing never waits. What the driver does not take at once is kept here, up to
    ``BACKLOG_BYTES``; beyond that whole sends are dropped, so that no frame is cut."""

    def __init__(
        self,
        address: str,
        device: str,
        baud: int,
        *,
        awaited: bool = False,
        tell: Report | None = None,
    ) -> None:
        """Raises AddressError: the device cannot be opened, or not at this baud rate."""
        self.address = address
        self._device, self._baud, self._tell = device, baud, tell or _report_on_stderr
        self._backlog = b""
        self._port: serial.Serial | None = None
        self._retry_s = wall_s() + REOPEN_S
        try:
            self._port = self._open()
        except (OSError, ValueError) as error:
            if not awaited or getattr(error, "errno", None) not in _NOT_THERE:
                raise AddressError(f"address {address!r}: {error}") from None
            self._tell(f"{address}: not there yet; trying every second")

    def handles(self) -> Sequence[Handle]:
        if self._port is None:
            self._reopen()
        elif self._backlog:
            self._drain()
        return () if self._port is None else (self._port,)

    def send(self, data: bytes) -> None:
        if self._port is None:
            return
        if not self._backlog or len(self._backlog) + len(data) <= BACKLOG_BYTES:
            self._backlog += data
        self._drain()

    def receive(self) -> bytes:
        if self._port is None or not readable(self._port):
            return b""
        try:
            data = os.read(self._port.fileno(), READ_BYTES)
        except _FULL:
            return b""
        except OSError as error:
            return self._lose(error)
        return data or self._lose(
            OSError("hung up")
        )  # ready to be read, and nothing there: the end of the line

    def close(self) -> None:
        if self._port is not None:
            self._port.close()
            self._port = None
        self._retry_s = float("inf")

    def _open(self) -> serial.Serial:
        return serial.Serial(self._device, self._baud, timeout=0, exclusive=True)

    def _drain(self) -> None:
        assert self._port is not None
        try:
            self._backlog = self._backlog[os.write(self._port.fileno(), self._backlog) :]
        except _FULL:
            return
        except OSError as error:
            self._lose(error)

    def _lose(self, error: OSError) -> bytes:
        assert self._port is not None
        self._port.close()
        self._port, self._backlog = None, b""
        self._retry_s = wall_s() + REOPEN_S
        self._tell(f"{self.address}: lost ({error.strerror or error}); trying every second")
        return b""

    def _reopen(self) -> None:
        """Try again when it is time to. Any failure may pass: a device that is back is not its
        user's at once."""
        if wall_s() < self._retry_s:
            return
        self._retry_s = wall_s() + REOPEN_S
        try:
            self._port = self._open()
        except (OSError, ValueError):
            return
        self._tell(f"{self.address}: back")


def _report_on_stderr(text: str) -> None:
    with contextlib.suppress(OSError, ValueError):  # a terminal that is gone must not end its owner
        print(text, file=sys.stderr, flush=True)
