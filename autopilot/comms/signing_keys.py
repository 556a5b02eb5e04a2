"""Signing keys of the ground links: their files, and their change by SETUP_SIGNING."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from mavlink_io.signing import (
    TIMESTAMP_FILE,
    KeyFileError,
    Signing,
    Timestamp,
    load_key,
    save_key,
)
from mavlink_io.user_data_dir import user_data_dir

NO_KEY = bytes(32)
"""Key in a SETUP_SIGNING message that turns signing off."""


class SigningKeys:
    """Signing keys and their files by link address."""

    def __init__(
        self, files: Mapping[str, Path] | None = None, timestamp: Timestamp | None = None
    ) -> None:
        """Load all keys. Raises KeyFileError."""
        self._files = dict(files or {})
        self._timestamp = timestamp or Timestamp()
        self._signing = {
            address: Signing(load_key(file), number, self._timestamp)
            for number, (address, file) in enumerate(self._files.items())
        }

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
        return cls(files, Timestamp(user_data_dir() / TIMESTAMP_FILE) if files else None)

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
        """Store the signing time once a minute when a link is signed; return the error or ""."""
        return self._try_save(self._timestamp.save_when_due)

    def save(self) -> str:
        """Store the signing time now; return the error text, "" for success."""
        return self._try_save(self._timestamp.save)

    def _try_save(self, save: Callable[[], None]) -> str:
        """Call ``save`` when a link is signed; return the error text instead of raising."""
        try:
            if self._signing:
                save()
        except OSError as error:
            return f"Signing time cannot be stored: {error.strerror}"
        return ""
