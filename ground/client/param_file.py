"""Parameter files: one ``NAME,VALUE`` a line, ``#`` begins a comment. MAVProxy's and
QGroundControl's are read too.

In the files of a design each value has its reason as a comment, and the head says what the gains
promise (`sysid.monitor.performance_spec`)."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from ground.errors import InputError
from sysid.monitor.performance_spec import BaselineError, PerformanceBaseline, decode


class ParamLine(NamedTuple):
    """One parameter of a file."""

    value: float
    reason: str
    """What its comment says; empty without one."""


def load(path: Path) -> dict[str, float]:
    """Parameters by name. Raises BadInputError as ``load_lines``."""
    return {name: line.value for name, line in load_lines(path).items()}


def load_lines(path: Path) -> dict[str, ParamLine]:
    """Parameters by name, with what is said of each.

    Raises:
        BadInputError: the file is unreadable, or a line of it is no parameter; names file, line and
        text.
    """
    found: dict[str, ParamLine] = {}
    for number, line in enumerate(_text(path).splitlines(), start=1):
        text, _, comment = line.partition("#")
        if not text.strip():
            continue
        parsed = _parse(text)
        if parsed is None:
            raise InputError(
                f"{path}: line {number}: {line.strip()!r} is no parameter; expected NAME,VALUE"
            )
        found[parsed[0]] = ParamLine(parsed[1], comment.strip())
    return found


def read_baseline(path: Path) -> PerformanceBaseline | None:
    """What the gains in a file promise; None in files that nobody designed.

    Raises:
        BadInputError: the file cannot be read, or its values are no longer those that were
        designed.
    """
    try:
        return decode(_text(path), load(path))
    except BaselineError as error:
        raise InputError(f"{path}: {error}; `ground redesign` writes it anew") from None


def require_baseline(path: Path) -> PerformanceBaseline:
    """What the gains in a file promise. Raises BadInputError, also where they promise nothing."""
    found = read_baseline(path)
    if found is None:
        raise InputError(
            f"{path}: promises nothing; give a gains.param that `ground redesign` wrote"
        )
    return found


def model_sha256_of(path: Path) -> str:
    """The digest of the model that the gains in a file were designed on; empty where that is not
    known any more."""
    try:
        found = read_baseline(path)
    except InputError:
        return ""
    return found.model_sha256 if found else ""


def save(path: Path, values: Mapping[str, float]) -> None:
    """Write parameters, sorted by name, so that the same values give the same bytes."""
    path.write_text(
        "".join(f"{name},{values[name]:.9g}\n" for name in sorted(values)), encoding="utf-8"
    )


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(
            f"{path}: {getattr(error, 'strerror', None) or 'not a text file'}"
        ) from None


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
