"""Parameter files: one `NAME,VALUE` per line; `#` begins a comment.

Files of MAVProxy and QGroundControl are read too. In the file of a design, the comment of a value
is its reason, and the header holds the predicted performance (`sysid.monitor.performance_spec`).
"""

import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from mavlink_io.errors import InputError
from mavlink_io.text_files import read_text
from mavlink_io.user_data_dir import write_output
from sysid.monitor.performance_spec import BaselineError, PerformanceBaseline, decode, header_of

MAX_SHOWN = 60
"""Number of characters of a wrong line in an error message."""


class ParamLine(NamedTuple):
    """Value and comment of one parameter in a file."""

    value: float
    reason: str
    """Text of the comment; empty without one."""


def load(path: Path) -> dict[str, float]:
    """Return the values of a parameter file.

    Parameters
    ----------
    path : Path
        Parameter file, with one name and value per line.

    Returns
    -------
    dict of str to float
        Values by parameter name, in the units of the parameters.

    Raises
    ------
    InputError
        The file cannot be read, or a line is invalid; see `load_lines`.
    """
    return {name: line.value for name, line in load_lines(path).items()}


def load_lines(path: Path) -> dict[str, ParamLine]:
    """Return values and comments of a file by parameter name.

    Raises
    ------
    InputError
        The file cannot be read, a line is not a parameter, or a parameter is given twice; the
        message names file, line and text.
    """
    parameters: dict[str, ParamLine] = {}
    for number, line in enumerate(_text(path).splitlines(), start=1):
        text, _, comment = line.partition("#")
        if not text.strip():
            continue
        parsed = _parse(text)
        if parsed is None:
            raise InputError(
                f"{path}: line {number}: {_beginning(line)!r} is no parameter; expected NAME,VALUE"
            )
        name, value = parsed
        if name in parameters:
            raise InputError(f"{path}: line {number}: {name} is given twice; keep one line")
        parameters[name] = ParamLine(value, comment.strip())
    return parameters


def _beginning(line: str) -> str:
    """Return a line, cut off where it is too long for an error message."""
    text = line.strip()
    return text if len(text) <= MAX_SHOWN else f"{text[:MAX_SHOWN]}..."


def read_baseline(path: Path) -> PerformanceBaseline | None:
    """Return the performance that was predicted for the gains in a file.

    Parameters
    ----------
    path : Path
        Gains file of `ground redesign`, or another parameter file.

    Returns
    -------
    PerformanceBaseline or None
        Predicted performance; None if the file has none.

    Raises
    ------
    InputError
        The file cannot be read, or its values were changed after the design.
    """
    with _file_named(path):
        return decode(_text(path), load(path))


def read_header(path: Path) -> PerformanceBaseline | None:
    """Return the header of a gains file, whose values may have been changed after the design.

    Parameters
    ----------
    path : Path
        Gains file of `ground redesign`, or another parameter file.

    Returns
    -------
    PerformanceBaseline or None
        Header; None if the file has none.

    Raises
    ------
    InputError
        The file or its header cannot be read.
    """
    with _file_named(path):
        return header_of(_text(path))


@contextmanager
def _file_named(path: Path) -> Iterator[None]:
    """Add the file to the message of a BaselineError."""
    try:
        yield
    except BaselineError as error:
        raise BaselineError(f"{path}: {error}; `ground redesign` writes a new one") from None


def require_baseline(path: Path) -> PerformanceBaseline:
    """Return the performance predicted for the gains in a file. Raises InputError if none."""
    baseline = read_baseline(path)
    if baseline is None:
        raise InputError(
            f"{path}: holds no predicted performance; "
            "give a gains.param that `ground redesign` wrote"
        )
    return baseline


def model_sha256_of(path: Path) -> str:
    """Return the SHA-256 of the model that gains were designed on; empty if it is not known."""
    try:
        baseline = read_baseline(path)
    except InputError:
        return ""
    return baseline.model_sha256 if baseline else ""


def save(path: Path, values: Mapping[str, float]) -> None:
    """Write parameters sorted by name, so that equal values give equal files.

    Parameters
    ----------
    path : Path
        File to write; an existing one is overwritten.
    values : mapping
        Values by parameter name.
    """
    write_output(path, "".join(f"{name},{values[name]:.9g}\n" for name in sorted(values)))


def _text(path: Path) -> str:
    """Read a text file. Raises InputError."""
    try:
        return read_text(path)
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(
            f"{path}: {getattr(error, 'strerror', None) or 'not a text file'}"
        ) from None


def _parse(line: str) -> tuple[str, float] | None:
    """Parse `NAME,VALUE`, `NAME VALUE` or the five columns of QGroundControl; None otherwise."""
    columns = line.replace(",", " ").split()
    if len(columns) == 5:
        columns = columns[2:4]
    if len(columns) != 2 or "_" in columns[1]:  # float() reads 1_000
        return None
    try:
        value = float(columns[1])
    except ValueError:
        return None
    return (columns[0], value) if math.isfinite(value) else None
