"""The keys of signed links: which file holds which, and what changes them."""

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


class Keys:
    """The key files by the address of their link."""

    def __init__(
        self, files: Mapping[str, Path] | None = None, timestamp: Timestamp | None = None
    ) -> None:
        """Raises KeyFileError."""
        self._files = dict(files or {})
        self._timestamp = timestamp or Timestamp()
        self._signing = {
            address: Signing(load_key(file), number, self._timestamp)
            for number, (address, file) in enumerate(self._files.items())
        }

    @classmethod
    def from_options(cls, words: Sequence[str], addresses: Sequence[str]) -> "Keys":
        """The keys that ``--sign ADDRESS=KEYFILE`` names, each for one of the links' addresses.
        Raises KeyFileError."""
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
        """How a link signs; None for one that does not."""
        return self._signing.get(address)

    def change(self, message: Any, arrival: Signing | None, trusted: bool, armed: bool) -> str:
        """Do as SETUP_SIGNING says, and put what became of it in words, without the key.

        A key that comes by a signed link replaces that link's, in all that share its file; one that
        comes by a wire replaces every key. The file is written first: a key that is not kept would
        lock out whoever sent it at the next start."""
        key = bytes(message.secret_key)
        if not trusted:
            return "Signing key refused: not over a link that others can hear"
        if armed:
            return "Signing key refused: armed"
        if not self._signing:
            return "Signing key refused: no link is signed; start with --sign"
        if key == NO_KEY:
            return "Signing stays: what is signed is decided at the start, by --sign"
        files = {
            self._files[a] for a, signing in self._signing.items() if arrival in (None, signing)
        }
        try:
            for file in files:
                save_key(file, key)
        except OSError as error:
            return f"Signing key refused: it cannot be kept: {error.strerror}"
        changed = [address for address, file in self._files.items() if file in files]
        for address in changed:
            self._signing[address].change_key(key)
        self._timestamp.advance_to(message.initial_timestamp)
        return f"Signing key changed on {len(changed)} link{'s' if len(changed) > 1 else ''}"

    def save_when_due(self) -> str:
        """Keep the timestamp, once a minute where anything is signed; what went wrong, "" for
        nothing."""
        return self._kept(self._timestamp.save_when_due)

    def save(self) -> str:
        """Keep the timestamp now; what went wrong, "" for nothing."""
        return self._kept(self._timestamp.save)

    def _kept(self, save: Callable[[], None]) -> str:
        """A disk that is full ends no dive."""
        try:
            if self._signing:
                save()
        except OSError as error:
            return f"Signing timestamp cannot be kept: {error.strerror}"
        return ""
