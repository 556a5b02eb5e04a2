"""MAVLink 2 message signing: who holds the key may command, and nothing said twice counts twice.

A signature is 13 bytes after the frame: the link's number, a timestamp of 48 bits, and the first 48
bits of the SHA-256 of key, frame, link number and timestamp. Source:
https://mavlink.io/en/guide/message_signing.html, whose rules on timestamps are followed to the
letter:

- time is counted in 10 us since 2015-01-01 UTC, on the wall clock, and grows with every frame that
  is sent;
- a frame with a right signature moves it on to its own time, if that is ahead;
- each stream (system, component, link number) has to grow; the first frame of one may be a minute
  behind at most;
- it is kept over restarts, so that what was recorded then cannot be said again.
"""

import hashlib
import hmac
import re
import time
from collections.abc import Callable
from pathlib import Path

from mavlink_io import dialect
from mavlink_io.clock import Every
from mavlink_io.codec import Frame
from mavlink_io.user_data_dir import replace_file

KEY_BYTES = 32
EPOCH_UNIX_S = 1_420_070_400
"""2015-01-01 UTC."""
UNITS_PER_S = 100_000
MAX_TIMESTAMP = (1 << 48) - 1
MAX_STREAM_AGE_UNITS = 60 * UNITS_PER_S
"""How far behind a stream may begin."""
SAVE_S = 60.0
TIMESTAMP_FILE = "signing_timestamp"
"""In the state folder: the timestamp that every program of this user goes on from."""

_HASH_BYTES = 6
_TIMESTAMP = slice(1, 1 + 6)
_RADIO_STATUS = dialect.by_name("RADIO_STATUS").message_id
"""What a radio says of itself: it holds no key."""
_HEX_KEY = re.compile(r"[0-9a-fA-F]{64}")


class KeyFileError(ValueError):
    """A key file that holds no key; the message says which and what would be right."""


def key_from_passphrase(passphrase: str) -> bytes:
    """The key that MAVProxy's ``signing setup`` and Mission Planner make of a passphrase: its
    SHA-256."""
    return hashlib.sha256(passphrase.encode()).digest()


def load_key(path: Path) -> bytes:
    """The key in a file: a line of 64 hexadecimal digits is the key itself, any other line a
    passphrase.

    Raises:
        KeyFileError: naming the file and what is wrong with it.
    """
    try:
        text = path.read_text(encoding="utf-8").strip()
    except (OSError, UnicodeDecodeError) as error:
        raise KeyFileError(f"{path}: {getattr(error, 'strerror', None) or 'no text'}") from None
    if not text or "\n" in text:
        raise KeyFileError(f"{path}: must hold one line, a passphrase or 64 hexadecimal digits")
    return bytes.fromhex(text) if _HEX_KEY.fullmatch(text) else key_from_passphrase(text)


def save_key(path: Path, key: bytes) -> None:
    """Put a key in place of the one in a file, readable by its owner alone. Raises OSError, and
    nothing has changed."""
    replace_file(path, key.hex() + "\n")


class Timestamp:
    """The timestamp that all signed links of a program share. ``path`` keeps it over restarts; None
    keeps nothing."""

    def __init__(self, path: Path | None = None, unix_s: Callable[[], float] = time.time) -> None:
        self._path, self._unix_s = path, unix_s
        self._last = max(_read_timestamp(path), self._clock() - 1)
        self._save = Every(SAVE_S)

    def next(self) -> int:
        """The timestamp of the next frame."""
        self._last = min(MAX_TIMESTAMP, max(self._last + 1, self._clock()))
        return self._last

    def hear(self, timestamp: int) -> None:
        """Somebody with the key is this far."""
        self._last = max(self._last, timestamp)

    def now(self) -> int:
        """What a stream that begins is compared with."""
        return max(self._last, self._clock())

    def save_when_due(self) -> None:
        """Keep it, once a minute. Raises OSError."""
        if self._path is not None and self._save.due():
            self.save()

    def save(self) -> None:
        """Keep it now: at the end of the program. Never takes back what another program has kept.
        Raises OSError."""
        if self._path is not None:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            replace_file(self._path, f"{max(self._last, _read_timestamp(self._path))}\n")

    def _clock(self) -> int:
        return int((max(self._unix_s(), EPOCH_UNIX_S) - EPOCH_UNIX_S) * UNITS_PER_S)


class Signing:
    """One link's key and streams."""

    def __init__(self, key: bytes, link_id: int, timestamp: Timestamp) -> None:
        assert len(key) == KEY_BYTES
        self._key, self._link_id, self._timestamp = key, link_id, timestamp
        self._streams: dict[tuple[int, int, int], int] = {}
        self.refused_frames = 0
        """Frames without a signature, with a wrong one, or with one that is too old."""

    def sign(self, frame: bytes) -> bytes:
        """A frame whose SIGNED_FLAG is set, with its signature."""
        signed = frame + bytes((self._link_id,)) + self._timestamp.next().to_bytes(6, "little")
        return signed + self._hash(signed)

    def accepts(self, frame: Frame) -> bool:
        """Whether a received frame counts: it was signed with the key, and is not said for the
        second time."""
        accepted = (frame.message_id == _RADIO_STATUS and not frame.signature) or self._proves(
            frame
        )
        self.refused_frames += not accepted
        return accepted

    def change_key(self, key: bytes) -> None:
        """From now on another key."""
        assert len(key) == KEY_BYTES
        self._key = key
        self._streams.clear()

    def _proves(self, frame: Frame) -> bool:
        signature = frame.signature
        if not hmac.compare_digest(self._hash(frame.raw[:-_HASH_BYTES]), signature[-_HASH_BYTES:]):
            return False
        timestamp = int.from_bytes(signature[_TIMESTAMP], "little")
        stream = frame.system, frame.component, signature[0]
        earliest = self._streams.get(stream, self._timestamp.now() - MAX_STREAM_AGE_UNITS - 1)
        if timestamp <= earliest:
            return False
        self._streams[stream] = timestamp
        self._timestamp.hear(timestamp)
        return True

    def _hash(self, signed: bytes) -> bytes:
        return hashlib.sha256(self._key + signed).digest()[:_HASH_BYTES]


def _read_timestamp(path: Path | None) -> int:
    """What was kept; 0 for nothing, or nothing that is a timestamp."""
    try:
        text = path.read_text(encoding="ascii").strip() if path else ""
    except (OSError, UnicodeDecodeError):
        return 0
    return int(text) if text.isdecimal() and int(text) <= MAX_TIMESTAMP else 0
