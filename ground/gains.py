"""Parameter files: one ``NAME,VALUE`` a line, ``#`` begins a comment. MAVProxy's and QGroundControl's are read too."""

import math
from collections.abc import Mapping
from pathlib import Path

from ground.errors import BadInputError


def load(path: Path) -> dict[str, float]:
    """Parameters by name.

    Raises:
        BadInputError: the file is unreadable, or a line of it is no parameter; names file, line and text.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise BadInputError(f"{path}: {getattr(error, 'strerror', None) or 'not a text file'}") from None
    values: dict[str, float] = {}
    for number, line in enumerate(text.splitlines(), start=1):
        if not line.partition("#")[0].strip():
            continue
        parsed = _parse(line.partition("#")[0])
        if parsed is None:
            raise BadInputError(f"{path}: line {number}: {line.strip()!r} is no parameter; expected NAME,VALUE")
        values[parsed[0]] = parsed[1]
    return values


def save(path: Path, values: Mapping[str, float]) -> None:
    """Write parameters, sorted by name, so that the same values give the same bytes."""
    path.write_text("".join(f"{name},{values[name]:.9g}\n" for name in sorted(values)), encoding="utf-8")


def _parse(line: str) -> tuple[str, float] | None:
    """Name and value of ``NAME,VALUE``, ``NAME VALUE`` or QGroundControl's five columns."""
    columns = line.replace(",", " ").split()
    if len(columns) == 5:
        columns = columns[2:4]
    if len(columns) != 2:
        return None
    try:
        value = float(columns[1])
    except ValueError:
        return None
    return (columns[0], value) if math.isfinite(value) else None
