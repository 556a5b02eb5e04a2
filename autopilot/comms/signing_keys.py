"""Signing keys of the ground links: their files, and their change by SETUP_SIGNING."""

import json
from collections.abc import Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

from mavlink_io.clock import Interval
from mavlink_io.signing import (
    TIMESTAMP_FILE,
    UNITS_PER_S,
    KeyFileError,
    Signing,
    Stream,
    Timestamp,
    load_key,
    save_key,
)
from mavlink_io.text_files import parse_json, read_text
from mavlink_io.user_data_dir import replace_file, user_data_dir

STREAMS_FILE = "signing_streams"
"""File in the state directory with the last timestamp of each sender."""
STREAMS_SAVE_S = 1.0
"""Wall time between two saves of these timestamps."""
STREAMS_MARGIN_UNITS = round(1.5 * STREAMS_SAVE_S * UNITS_PER_S)
"""Time by which stored timestamps are moved ahead: frames accepted after the last save."""
NO_KEY = bytes(32)
"""Key in a SETUP_SIGNING message that turns signing off."""


class SigningKeys:
    """Signing keys and their files by link address."""

    def __init__(
        self,
        files: Mapping[str, Path] | None = None,
        timestamp: Timestamp | None = None,
        streams: Path | None = None,
    ) -> None:
        """Load all keys, and the timestamps of an earlier run. Raises KeyFileError."""
        self._files = dict(files or {})
        self._timestamp = timestamp or Timestamp()
        self._streams_path, self._stored = streams, ""
        earlier = _read_streams(streams)
        self._signing = {
            address: Signing(load_key(file), number, self._timestamp, earlier.get(address))
            for number, (address, file) in enumerate(self._files.items())
        }
        self._due = Interval(STREAMS_SAVE_S)
        self._writer = ThreadPoolExecutor(max_workers=1)
        self._writing: Future[None] | None = None

    @classmethod
    def from_options(cls, words: Sequence[str], addresses: Sequence[str]) -> "SigningKeys":
        """Load the keys of ``--sign ADDRESS=KEYFILE`` options.

        Each address must be one of the ground links. Raises KeyFileError.
        """
        files = {}
        for word in words:
            address, _, file = word.partition("=")
            if not file or address not in addresses:
                links = ", ".join(addresses)
                raise KeyFileError(
                    f"--sign {word}: expected ADDRESS=KEYFILE, where ADDRESS is one of {links}"
                )
            files[address] = Path(file)
        if not files:
            return cls()
        folder = user_data_dir()
        return cls(files, Timestamp(folder / TIMESTAMP_FILE), folder / STREAMS_FILE)

    def signing(self, address: str) -> Signing | None:
        """Return the signing state of a link; None for a link that is not signed."""
        return self._signing.get(address)

    def change(self, message: Any, link_signing: Signing | None, trusted: bool, armed: bool) -> str:
        """Apply SETUP_SIGNING and return the result as a text without the key.

        A key received on a signed link replaces the key of that link and of all links with the same
        file; a key received on an unsigned serial line replaces every key. The file is written
        first: with a key that is not stored, the next start would reject its sender.

        Parameters
        ----------
        message : SETUP_SIGNING message
            Decoded message with ``secret_key`` and ``initial_timestamp``.
        link_signing : Signing or None
            Signing state of the link on which it arrived.
        trusted : bool
            Whether that link may carry a key.
        armed : bool
            Whether the vehicle is armed; the change is then refused.
        """
        key = bytes(message.secret_key)
        if not trusted:
            return "Signing key refused: the link is neither signed nor serial"
        if armed:
            return "Signing key refused: armed"
        if not self._signing:
            return "Signing key refused: no link is signed; start with --sign"
        if key == NO_KEY:
            return "Signing unchanged: it is configured at the start, by --sign"
        files = {
            self._files[address]
            for address, signing in self._signing.items()
            if link_signing in (None, signing)
        }
        try:
            for file in files:
                save_key(file, key)
        except OSError as error:
            return f"Signing key refused: it cannot be stored: {error.strerror}"
        changed = [address for address, file in self._files.items() if file in files]
        for address in changed:
            self._signing[address].change_key(key)
        self._timestamp.advance_to(message.initial_timestamp)
        return f"Signing key changed on {len(changed)} link{'s' if len(changed) > 1 else ''}"

    def save_when_due(self) -> str:
        """Store the timestamps every second when a link is signed; return an error or "".

        A thread writes, so that a slow disk never delays a tick.
        """
        error = ""
        if self._writing is not None and self._writing.done():
            error = _error_text(self._writing.exception())
            self._writing = None
        if self._signing and self._writing is None and self._due.due():
            self._writing = self._writer.submit(self._save, self._streams_text())
        return error

    def save(self) -> str:
        """Store the timestamps now; return the error text, "" for success."""
        self._writer.shutdown()
        if not self._signing:
            return ""
        try:
            self._timestamp.save()
            self._save(self._streams_text())
        except OSError as error:
            return _error_text(error)
        return ""

    def _streams_text(self) -> str:
        """Return the recent timestamps of all links as JSON."""
        rows = [
            [address, *stream, last]
            for address, signing in self._signing.items()
            for stream, last in signing.recent_streams().items()
        ]
        return json.dumps(rows) + "\n"

    def _save(self, streams: str) -> None:
        """Write the timestamps that have changed. Raises OSError."""
        self._timestamp.save_when_due()
        if self._streams_path is not None and streams != self._stored:
            self._streams_path.parent.mkdir(parents=True, exist_ok=True)
            replace_file(self._streams_path, streams)
            self._stored = streams


def _error_text(error: BaseException | None) -> str:
    """Return the text of a failed write, "" without one."""
    if error is None:
        return ""
    return f"Signing time cannot be stored: {getattr(error, 'strerror', None) or error}"


def _read_streams(path: Path | None) -> dict[str, dict[Stream, int]]:
    """Return the stored timestamps by link, moved ahead by what a crash may have lost.

    Without a file, or with one that cannot be read, frames of the last minute can be replayed once.
    """
    streams: dict[str, dict[Stream, int]] = {}
    try:
        rows = parse_json(read_text(path)) if path else []
        for address, system, component, link, last in rows:
            numbers = int(system), int(component), int(link)
            streams.setdefault(str(address), {})[numbers] = int(last) + STREAMS_MARGIN_UNITS
    except (OSError, ValueError, TypeError):
        return {}
    return streams
