"""MAVLink 2 message signing: accept frames of senders with the key, and each of them only once.

A signature is 13 bytes after the frame: the link's number, a timestamp of 48 bits, and the first 48
bits of the SHA-256 of key, frame, link number and timestamp. Source:
https://mavlink.io/en/guide/message_signing.html. Its rules on timestamps:

- The timestamp counts 10 us units since 2015-01-01 UTC on the wall clock, and grows with every sent
  frame.
- A correctly signed frame sets the timestamp to its own, if that is later.
- The timestamps of each stream (system, component, link number) must grow. The first frame of a
  stream may be at most one minute behind the timestamp.
- The timestamp is stored over restarts, so that recorded frames cannot be replayed. The autopilot
  stores those of the streams too: frames of the last minute could be replayed otherwise.
"""

import hashlib
import hmac
import os
import re
import stat
import time
from collections.abc import Callable, Mapping
from pathlib import Path

from mavlink_io import dialect
from mavlink_io.clock import Interval
from mavlink_io.codec import Frame
from mavlink_io.errors import ErrorCode, InputError
from mavlink_io.user_data_dir import replace_file

Stream = tuple[int, int, int]
"""System, component and link number of a sender."""
KEY_BYTES = 32
"""Length of a key."""
EPOCH_UNIX_S = 1_420_070_400
"""Origin of timestamps, 2015-01-01 UTC, in UNIX seconds."""
UNITS_PER_S = 100_000
"""Timestamp units per second."""
MAX_TIMESTAMP = (1 << 48) - 1
"""Largest timestamp that a signature can carry."""
MAX_STREAM_AGE_UNITS = 60 * UNITS_PER_S
"""Maximum delay of the first frame of a stream, in timestamp units."""
SAVE_S = 60.0
"""Wall time between two saves of the timestamp, in seconds."""
TIMESTAMP_FILE = "signing_timestamp"
"""File in the state directory with the timestamp that all programs of this user continue from."""

_HASH_BYTES = 6
_TIMESTAMP = slice(1, 1 + 6)
_RADIO_STATUS = dialect.by_name("RADIO_STATUS").message_id
"""The only message that is accepted unsigned: the radio that sends it has no key."""
_HEX_KEY = re.compile(r"[0-9a-fA-F]{64}")


class KeyFileError(InputError):
    """A key file cannot be used; the text contains the file, the reason and what is expected."""

    code = ErrorCode.KEY_FILE


def key_from_passphrase(passphrase: str) -> bytes:
    """Return the SHA-256 of a passphrase, as MAVProxy's ``signing setup`` and Mission Planner do.

    Parameters
    ----------
    passphrase : str
        Any text.

    Returns
    -------
    bytes
        Key of 32 bytes.
    """
    return hashlib.sha256(passphrase.encode()).digest()


def load_key(path: Path) -> bytes:
    """Read the key in a file.

    Parameters
    ----------
    path : Path
        Text file with one line: 64 hexadecimal digits are the key itself, any other line is a
        passphrase.

    Returns
    -------
    bytes
        Key of 32 bytes.

    Raises
    ------
    KeyFileError
        Other users may read the file (ssh refuses such a key too), or it contains no key.
    """
    try:
        with path.open(encoding="utf-8") as file:
            if mode := _exposed_mode(os.fstat(file.fileno())):
                raise KeyFileError(
                    f"{path}: mode {mode}: others may read this key; chmod 600 {path}"
                )
            text = file.read().strip()
    except (OSError, UnicodeDecodeError) as error:
        raise KeyFileError(f"{path}: {getattr(error, 'strerror', None) or 'no text'}") from None
    if not text or "\n" in text:
        raise KeyFileError(f"{path}: must hold one line, a passphrase or 64 hexadecimal digits")
    return bytes.fromhex(text) if _HEX_KEY.fullmatch(text) else key_from_passphrase(text)


def _exposed_mode(status: os.stat_result) -> str:
    """Return the octal mode of a file that other users may access, "" for a private file.

    The group may access a file that belongs to another user: an administrator can give a key to a
    service in this way.
    """
    mode = stat.S_IMODE(status.st_mode)
    private = os.name != "posix" or not mode & (0o077 if status.st_uid == os.geteuid() else 0o007)
    return "" if private or not stat.S_ISREG(status.st_mode) else f"{mode:o}"


def save_key(path: Path, key: bytes) -> None:
    """Write a key to a file that only its owner can read.

    Parameters
    ----------
    path : Path
        The file; an old one is replaced.
    key : bytes
        The key.

    Raises
    ------
    OSError
        The file cannot be written; the old one is unchanged.
    """
    replace_file(path, key.hex() + "\n")


class Timestamp:
    """The timestamp that all signed links of a program share.

    Parameters
    ----------
    path : Path, optional
        File that keeps the timestamp over restarts.
    unix_s : callable
        Return the UNIX time, in seconds.
    """

    def __init__(self, path: Path | None = None, unix_s: Callable[[], float] = time.time) -> None:
        self._path, self._unix_s = path, unix_s
        self._last = max(_read_timestamp(path), self._clock() - 1)
        self._save = Interval(SAVE_S)

    def next(self) -> int:
        """Return the timestamp of the next sent frame, in 10 us units since 2015-01-01 UTC."""
        self._last = min(MAX_TIMESTAMP, max(self._last + 1, self._clock()))
        return self._last

    def advance_to(self, timestamp: int) -> None:
        """Set the timestamp to that of a correctly signed frame, if it is later.

        Parameters
        ----------
        timestamp : int
            Timestamp of the frame, in units of 10 us since 2015-01-01 (UTC).
        """
        self._last = max(self._last, timestamp)

    def now(self) -> int:
        """Return the present timestamp, with which the first frame of a stream is compared."""
        return max(self._last, self._clock())

    def save_when_due(self) -> None:
        """Save the timestamp once a minute. Raises OSError."""
        if self._path is not None and self._save.due():
            self.save()

    def save(self) -> None:
        """Save the timestamp now, unless another program has saved a later one. Raises OSError.

        Call it at the end of the program.
        """
        if self._path is not None:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            replace_file(self._path, f"{max(self._last, _read_timestamp(self._path))}\n")

    def _clock(self) -> int:
        """Return the wall clock in timestamp units."""
        return int((max(self._unix_s(), EPOCH_UNIX_S) - EPOCH_UNIX_S) * UNITS_PER_S)


class Signing:
    """The key of one link and the last timestamp of each stream on it.

    Parameters
    ----------
    key : bytes
        Key of 32 bytes.
    link_id : int
        Number of the link in the signatures of sent frames, 0 to 255.
    timestamp : Timestamp
        The program's timestamp, shared by all links.
    streams : mapping, optional
        Timestamps of an earlier run: frames up to these are replays.
    """

    def __init__(
        self,
        key: bytes,
        link_id: int,
        timestamp: Timestamp,
        streams: Mapping[Stream, int] | None = None,
    ) -> None:
        assert len(key) == KEY_BYTES
        self._key, self._link_id, self._timestamp = key, link_id, timestamp
        self._streams: dict[Stream, int] = dict(streams or {})
        self.unsigned_frames = self.refused_signatures = 0
        """Number of received frames without a signature, and with another key or an old timestamp.
        """

    def sign(self, frame: bytes) -> bytes:
        """Append a signature to a frame.

        Parameters
        ----------
        frame : bytes
            MAVLink 2 frame whose SIGNED_FLAG is set.

        Returns
        -------
        bytes
            The frame with its signature.
        """
        signed = frame + bytes((self._link_id,)) + self._timestamp.next().to_bytes(6, "little")
        return signed + self._hash(signed)

    def accepts(self, frame: Frame) -> bool:
        """Return whether a received frame is signed with the key and no replay.

        Parameters
        ----------
        frame : Frame
            A received frame.

        Returns
        -------
        bool
            True for a correct signature with a new timestamp, and for an unsigned RADIO_STATUS.
        """
        unsigned_radio = frame.message_id == _RADIO_STATUS and not frame.signature
        if unsigned_radio or self._verify(frame):
            return True
        if frame.signature:
            self.refused_signatures += 1
        else:
            self.unsigned_frames += 1
        return False

    def recent_streams(self) -> dict[Stream, int]:
        """Return the last timestamp of each stream that a replay could still follow.

        Returns
        -------
        dict of (system, component, link number) to int
            Streams with a frame in the last minute; older frames are refused by their age.
        """
        oldest = self._timestamp.now() - MAX_STREAM_AGE_UNITS
        return {stream: last for stream, last in self._streams.items() if last >= oldest}

    def change_key(self, key: bytes) -> None:
        """Use another key from now on.

        Parameters
        ----------
        key : bytes
            Key of 32 bytes.
        """
        assert len(key) == KEY_BYTES
        self._key = key
        self._streams.clear()

    def _verify(self, frame: Frame) -> bool:
        """Return whether the signature is correct and its timestamp new; store the timestamp."""
        signature = frame.signature
        if not hmac.compare_digest(self._hash(frame.raw[:-_HASH_BYTES]), signature[-_HASH_BYTES:]):
            return False
        timestamp = int.from_bytes(signature[_TIMESTAMP], "little")
        stream = frame.system, frame.component, signature[0]
        last = self._streams.get(stream, self._timestamp.now() - MAX_STREAM_AGE_UNITS - 1)
        if timestamp <= last:
            return False
        self._streams[stream] = timestamp
        self._timestamp.advance_to(timestamp)
        return True

    def _hash(self, signed: bytes) -> bytes:
        """Return the last 6 bytes of a signature: the first ones of the SHA-256."""
        return hashlib.sha256(self._key + signed).digest()[:_HASH_BYTES]


def _read_timestamp(path: Path | None) -> int:
    """Return the saved timestamp; 0 without a file or with a file that contains no timestamp."""
    try:
        text = path.read_text(encoding="ascii").strip() if path else ""
    except (OSError, UnicodeDecodeError):
        return 0
    return int(text) if text.isdecimal() and int(text) <= MAX_TIMESTAMP else 0
