"""Files from outside: limits of kind, size, nesting and digits, so that no file ends a program."""

import errno
import json
import tomllib
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any, BinaryIO, cast

MAX_TEXT_BYTES = 64_000_000
"""Largest text file that is read: parameters, missions, vehicles, models, CSV logs."""
MAX_LOG_BYTES = 1_000_000_000
"""Largest log that is read into memory at once: weeks of a tlog, hours of a .bin or .ulg."""
_PIECE_BYTES = 1 << 20
"""Number of bytes that are read at once."""
_BYTE_ORDER_MARK = "\ufeff"
"""First character of text files that some editors of Windows write."""
TOO_NESTED = "nested too deeply"
"""Text of an error."""
MAX_INTEGER_BITS = 1023
"""Largest integer in bits: that of the largest float."""


def open_regular(path: Path | Traversable) -> BinaryIO:
    """Open a file for reading; a pipe, which may wait for ever, a socket or a device is refused.

    Parameters
    ----------
    path : Path or Traversable
        The file.

    Returns
    -------
    file object
        The file, in binary mode.

    Raises
    ------
    OSError
        The file cannot be read, is no regular file, or its name has a NUL (EINVAL).
    """
    if "\0" in str(path):
        raise OSError(errno.EINVAL, "a name with a NUL character is no file name", str(path))
    if isinstance(path, Path) and path.exists() and not (path.is_file() or path.is_dir()):
        raise OSError(errno.EINVAL, "is no regular file (a pipe, socket or device)", str(path))
    return cast("BinaryIO", path.open("rb"))


def read_limited(path: Path | Traversable, max_bytes: int = MAX_LOG_BYTES) -> bytes:
    """Return the content of a file.

    Parameters
    ----------
    path : Path or Traversable
        The file.
    max_bytes : int
        Largest size that is accepted.

    Returns
    -------
    bytes
        The content.

    Raises
    ------
    OSError
        The file cannot be read, is no regular file (EINVAL), or is larger than the limit (EFBIG).
    """
    pieces, size = list[bytes](), 0
    with open_regular(path) as file:
        while piece := file.read(_PIECE_BYTES):
            pieces.append(piece)
            size += len(piece)
            if size > max_bytes:
                reason = f"is larger than {max_bytes / 1e6:.0f} MB, the limit of such a file"
                raise OSError(errno.EFBIG, reason, str(path))
    return b"".join(pieces)


def read_text(path: Path | Traversable, encoding: str = "utf-8", errors: str = "strict") -> str:
    """Return the content of a text file of at most `MAX_TEXT_BYTES`, with Unix line ends.

    A byte-order mark at its start, which editors of Windows write, is left out.

    Parameters
    ----------
    path : Path or Traversable
        The file.
    encoding, errors : str
        As of ``bytes.decode``.

    Returns
    -------
    str
        The text.

    Raises
    ------
    OSError
        The file cannot be read, or is too large.
    UnicodeDecodeError
        The file is no text in this encoding.
    """
    text = read_limited(path, MAX_TEXT_BYTES).decode(encoding, errors)
    return text.removeprefix(_BYTE_ORDER_MARK).replace("\r\n", "\n").replace("\r", "\n")


def parse_toml(text: str) -> dict[str, Any]:
    """Return the tables of a TOML text.

    Parameters
    ----------
    text : str
        TOML; a byte-order mark before it is ignored.

    Returns
    -------
    dict
        The tables.

    Raises
    ------
    tomllib.TOMLDecodeError
        The text is no TOML, is nested too deeply, or has a number of too many digits.
    """
    try:
        tables = tomllib.loads(text.removeprefix(_BYTE_ORDER_MARK))
        _refuse_large_integers(tables)
        return tables
    except RecursionError:
        raise tomllib.TOMLDecodeError(TOO_NESTED) from None
    except tomllib.TOMLDecodeError:
        raise
    except ValueError as error:  # an integer of too many digits
        raise tomllib.TOMLDecodeError(str(error)) from None


def parse_json(text: str | bytes) -> Any:
    """Return the value of a JSON text.

    Parameters
    ----------
    text : str or bytes
        JSON.

    Returns
    -------
    object
        The value.

    Raises
    ------
    json.JSONDecodeError
        The text is no JSON, is nested too deeply, or has a number of too many digits.
    """
    try:
        value = json.loads(text)
        _refuse_large_integers(value)
        return value
    except RecursionError:
        raise json.JSONDecodeError(TOO_NESTED, "", 0) from None
    except json.JSONDecodeError:
        raise
    except ValueError as error:  # too many digits, or bytes that are no text
        raise json.JSONDecodeError(str(error), "", 0) from None


def _refuse_large_integers(value: Any) -> None:
    """Raise ValueError for an integer that no float can hold."""
    waiting = [value]
    while waiting:
        value = waiting.pop()
        if isinstance(value, dict):
            waiting += value.values()
        elif isinstance(value, list):
            waiting += value
        elif isinstance(value, int) and value.bit_length() > MAX_INTEGER_BITS:
            raise ValueError("an integer has more than 308 digits")
