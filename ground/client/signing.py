"""Signing of the link to a vehicle (MAVLink 2 message signing, `mavlink_io.signing`)."""

import contextlib
from collections.abc import Iterator
from pathlib import Path

from mavlink_io.signing import (
    TIMESTAMP_FILE,
    KeyFileError,
    Signing,
    Timestamp,
    load_key,
)
from mavlink_io.user_data_dir import user_data_dir

LINK_ID = 0
"""Link id in signatures: a process has one link to one vehicle."""


@contextlib.contextmanager
def open_signing(key_file: Path | None) -> Iterator[Signing | None]:
    """Yield the signing state of one link, None without a key; store its timestamp at the end.

    Raises
    ------
    InputError
        The file holds no key.
    """
    if key_file is None:
        yield None
        return
    try:
        key = load_key(key_file)
    except KeyFileError as error:
        raise KeyFileError(f"--sign {error}") from None
    timestamp = Timestamp(user_data_dir() / TIMESTAMP_FILE)
    try:
        yield Signing(key, LINK_ID, timestamp)
    finally:
        with contextlib.suppress(OSError):  # the next start then uses the system clock
            timestamp.save()
