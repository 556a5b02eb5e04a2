"""A serial line that reopens after it was unplugged and never blocks its user."""

import contextlib
import errno
import os
import sys
import termios
from collections.abc import Callable, Sequence

import serial

from mavlink_io.clock import wall_s
from mavlink_io.transport.base import AddressError, Handle, readable

REOPEN_S = 1.0
"""Wall time between two attempts to open a lost device, in seconds."""
READ_BYTES = 4096
"""Maximum number of bytes that one receive reads."""
BACKLOG_BYTES = 4096
"""Maximum number of bytes that wait for a full driver: under half a second at 115200 baud."""

Report = Callable[[str], None]
"""Show one line of text to the user."""
_MISSING_DEVICE_ERRORS = (errno.ENOENT, errno.ENXIO, errno.ENODEV)
_FULL_DRIVER_ERRORS = (BlockingIOError, InterruptedError)
_NO_TERMINAL = "not a serial line"
_REASONS = {
    **dict.fromkeys(_MISSING_DEVICE_ERRORS, "no such device"),
    errno.EAGAIN: "in use by another program",
    errno.EBUSY: "in use by another program",
    errno.EACCES: "permission denied: the user is not in the group of the device",
    errno.ENOTTY: _NO_TERMINAL,
    errno.EISDIR: _NO_TERMINAL,
}
"""Reasons for which a device cannot be opened, by error number."""


class SerialTransport:
    """A serial line, opened for exclusive use by this process.

    Parameters
    ----------
    address : str
        Address of the line, for error messages.
    device : str
        Path of the device.
    baud : int
        Baud rate, in bit/s.
    wait_for_device : bool
        Whether to wait for a device that does not exist yet, instead of raising AddressError.
    report : callable, optional
        Receive a text when the line is lost and when it is back; by default stderr.

    Raises
    ------
    AddressError
        The device cannot be opened, or not at this baud rate.

    Notes
    -----
    An open line is never lost for good: a device that disappears is closed and reopened every
    ``REOPEN_S``. Data sent in the meantime are lost, as on a radio without a peer.

    Writing never blocks. Up to ``BACKLOG_BYTES`` that the driver does not accept at once are kept
    and written later; beyond that whole sends are dropped, so that no frame is cut.
    """

    def __init__(
        self,
        address: str,
        device: str,
        baud: int,
        *,
        wait_for_device: bool = False,
        report: Report | None = None,
    ) -> None:
        self.address = address
        self._device, self._baud, self._report = device, baud, report or _report_on_stderr
        self._backlog = b""
        self._port: serial.Serial | None = None
        self._retry_s = wall_s() + REOPEN_S
        try:
            self._port = self._open()
        except (OSError, ValueError) as error:
            number = _error_number(error)
            if not wait_for_device or number not in _MISSING_DEVICE_ERRORS:
                raise AddressError(f"address {address!r}: {_REASONS.get(number, error)}") from None
            self._report(f"{address}: not there yet; trying every second")

    def handles(self) -> Sequence[Handle]:
        """Return the open port; reopen a lost device, or write the backlog."""
        if self._port is None:
            self._reopen()
        elif self._backlog:
            self._drain()
        return () if self._port is None else (self._port,)

    def send(self, data: bytes) -> None:
        """Send whole frames; drop them if the line is closed or the backlog is full."""
        if self._port is None:
            return
        if not self._backlog or len(self._backlog) + len(data) <= BACKLOG_BYTES:
            self._backlog += data
        self._drain()

    def receive(self) -> bytes:
        """Return the bytes that have arrived, b"" if none; close a lost line, reopen it later."""
        if self._port is None:
            self._reopen()
        if self._port is None or not readable(self._port):
            return b""
        try:
            data = os.read(self._port.fileno(), READ_BYTES)
        except _FULL_DRIVER_ERRORS:
            return b""
        except OSError as error:
            return self._close_lost_port(error)
        # a readable line without data has been hung up
        return data or self._close_lost_port(OSError("hung up"))

    def close(self) -> None:
        """Close the line for good."""
        if self._port is not None:
            self._port.close()
            self._port = None
        self._retry_s = float("inf")

    def _open(self) -> serial.Serial:
        """Open the device without a read timeout. Raises OSError or ValueError."""
        return serial.Serial(self._device, self._baud, timeout=0, exclusive=True)

    def _drain(self) -> None:
        """Write as much of the backlog as the driver accepts."""
        assert self._port is not None
        try:
            self._backlog = self._backlog[os.write(self._port.fileno(), self._backlog) :]
        except _FULL_DRIVER_ERRORS:
            return
        except OSError as error:
            self._close_lost_port(error)

    def _close_lost_port(self, error: OSError) -> bytes:
        """Close a port that failed, report it, and return no bytes."""
        assert self._port is not None
        self._port.close()
        self._port, self._backlog = None, b""
        self._retry_s = wall_s() + REOPEN_S
        self._report(f"{self.address}: lost ({error.strerror or error}); trying every second")
        return b""

    def _reopen(self) -> None:
        """Try to open the device again if it is due; ignore every failure.

        A device that is back may deny access for a moment.
        """
        if wall_s() < self._retry_s:
            return
        self._retry_s = wall_s() + REOPEN_S
        try:
            self._port = self._open()
        except (OSError, ValueError):
            return
        self._report(f"{self.address}: back")


def _error_number(error: BaseException) -> int:
    """Return the error number of a failed opening, 0 if unknown; pyserial hides the driver's."""
    cause = error.__context__
    if isinstance(cause, termios.error):
        return int(cause.args[0])
    return getattr(error, "errno", None) or 0


def _report_on_stderr(text: str) -> None:
    """Print a text on stderr."""
    with contextlib.suppress(OSError, ValueError):  # a closed terminal must not end the program
        print(text, file=sys.stderr, flush=True)
