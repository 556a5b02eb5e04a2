"""Record of a run: figures with their references, as JSON and as a table."""

import math
import statistics
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import msgspec

from benchmarks.speed.rows import ROWS, Mode, Row
from mavlink_io.errors import InputError

FORMAT = 1
"""Version of the JSON file."""


class Reference(NamedTuple):
    """Floor or peer of a figure, measured in the same run."""

    name: str
    samples: tuple[float, ...]
    """One value per repetition, in the unit of the figure."""


class Measurement(NamedTuple):
    """Samples of one figure."""

    row: str
    samples: tuple[float, ...]
    """One value per repetition; empty if the figure could not be measured."""
    reference: Reference | None = None
    case: str = ""
    note: str = ""
    """Remark, or the reason why the figure was not measured."""
    details: Mapping[str, float] = {}
    """Parts of the value by name."""
    is_judged: bool = True
    """Whether the target of the row applies to this case."""


class Machine(msgspec.Struct, frozen=True):
    """Machine and versions of a run."""

    cores: int
    cpu: str
    system: str
    python: str
    numpy: str
    numba: str


class Conditions(msgspec.Struct, frozen=True):
    """When a figure was measured, and the load of the machine."""

    date: str
    """UTC, ISO 8601."""
    revision: str
    """`git describe` of the sources; empty outside a repository."""
    load_before: float
    load_after: float
    """Load average of the last minute: mean number of runnable processes (getloadavg(3))."""
    other_cores: float | None
    """Mean number of cores that other programs used meanwhile; None if it is unknown."""


class ReferenceResult(msgspec.Struct, frozen=True):
    """Median of the reference."""

    name: str
    value: float
    unit: str


class Figure(msgspec.Struct, frozen=True):
    """One figure of a run."""

    row: str
    case: str
    figure: str
    """Title of the row."""
    value: float | None
    """Median of the repetitions; None if not measured."""
    lowest: float | None
    highest: float | None
    repetitions: int
    unit: str
    reference: ReferenceResult | None
    ratio: float | None
    """Value over reference."""
    target: str
    """Such as `ratio <= 5`; empty without a target."""
    met: bool | None
    """None without a target or a value."""
    note: str
    details: dict[str, float]
    conditions: Conditions


class Results(msgspec.Struct, frozen=True):
    """Content of a results file."""

    mode: Mode
    machine: Machine
    figures: tuple[Figure, ...]
    format: int = FORMAT

    def of_row(self, name: str) -> tuple[Figure, ...]:
        """Return the figures of a row, one per case."""
        return tuple(figure for figure in self.figures if figure.row == name)


def to_figure(measured: Measurement, mode: Mode, conditions: Conditions) -> Figure:
    """Return the medians of a measurement, and whether they meet the target."""
    row, samples, reference = ROWS[measured.row], measured.samples, measured.reference
    value = statistics.median(samples) if samples else None
    ratio = ratio_of(samples, reference.samples) if reference and samples else None
    judged = ratio if row.is_ratio else value
    return Figure(
        row=row.name,
        case=measured.case,
        figure=row.title,
        value=rounded(value),
        lowest=rounded(min(samples, default=None)),
        highest=rounded(max(samples, default=None)),
        repetitions=len(samples),
        unit=row.unit,
        reference=ReferenceResult(
            reference.name, _significant(statistics.median(reference.samples)), row.unit
        )
        if reference and reference.samples
        else None,
        ratio=rounded(ratio),
        target=format_target(row, mode) if measured.is_judged else "",
        met=is_met(row, mode, judged) if measured.is_judged else None,
        note=measured.note,
        details={name: _significant(part) for name, part in measured.details.items()},
        conditions=conditions,
    )


def ratio_of(samples: Sequence[float], references: Sequence[float]) -> float:
    """Return the ratio of two series: the median of pairs, or of medians if the counts differ."""
    if len(samples) == len(references):
        return statistics.median(a / b for a, b in zip(samples, references, strict=True))
    return statistics.median(samples) / statistics.median(references)


def is_met(row: Row, mode: Mode, judged: float | None) -> bool | None:
    """Return whether a number meets the target of a row; None without a target or a number."""
    limit = row.target(mode)
    if limit is None or judged is None:
        return None
    return judged >= limit if row.is_minimum else judged <= limit


def format_target(row: Row, mode: Mode) -> str:
    """Return the target as a text; empty without one."""
    limit = row.target(mode)
    if limit is None:
        return ""
    sign = ">=" if row.is_minimum else "<="
    return f"{'ratio ' if row.is_ratio else ''}{sign} {limit:g}"


def rounded(value: float | None) -> float | None:
    """Return a number with four significant digits."""
    return None if value is None else _significant(value)


def _significant(value: float) -> float:
    """Return a number with four significant digits."""
    return float(f"{value:.4g}") if math.isfinite(value) else value


def merge(known: Results | None, new: Results) -> Results:
    """Return the results with the rows of `new` replaced, in the order of the table."""
    replaced = {figure.row for figure in new.figures}
    kept = [figure for figure in (known.figures if known else ()) if figure.row not in replaced]
    figures = [*kept, *new.figures]
    ordered = [figure for name in ROWS for figure in figures if figure.row == name]
    return msgspec.structs.replace(new, figures=tuple(ordered))


def read(path: Path) -> Results:
    """Return the content of a results file. Raises InputError."""
    try:
        results = msgspec.json.decode(path.read_bytes(), type=Results)
    except OSError as error:
        raise InputError(f"{path}: {error.strerror}") from None
    except msgspec.MsgspecError as error:
        raise InputError(f"{path}: is no file of `python -m benchmarks`: {error}") from None
    if results.format != FORMAT:
        raise InputError(f"{path}: format = {results.format}; this version reads format {FORMAT}")
    return results


def write(results: Results, path: Path) -> None:
    """Write a results file."""
    text = msgspec.json.format(msgspec.json.encode(results), indent=1).decode()
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text + "\n", encoding="utf-8")


def as_table(figures: Iterable[Figure]) -> str:
    """Return the figures as a table of plain text, one line each."""
    lines = [
        (
            figure.row,
            figure.case,
            format_value(figure).partition(":")[0],  # an error was printed during the run
            format_reference(figure),
            "" if figure.ratio is None else f"{figure.ratio:g}",
            figure.target,
            format_verdict(figure),
        )
        for figure in figures
    ]
    head = ("figure", "case", "value", "floor or peer", "ratio", "target", "")
    widths = [max(len(line[k]) for line in [head, *lines]) for k in range(len(head))]
    return "\n".join(
        "  ".join(text.ljust(width) for text, width in zip(line, widths, strict=True)).rstrip()
        for line in [head, *lines]
    )


def format_value(figure: Figure) -> str:
    """Return value and unit, or why there is none."""
    return figure.note if figure.value is None else f"{figure.value:g} {figure.unit}"


def format_reference(figure: Figure) -> str:
    """Return name and value of the reference; empty without one."""
    reference = figure.reference
    return f"{reference.name}: {reference.value:g} {reference.unit}" if reference else ""


def format_verdict(figure: Figure) -> str:
    """Return whether the target is met."""
    return "" if figure.met is None else "met" if figure.met else "MISSED"
