"""Write `docs/performance.md` from the figures of `python -m benchmarks`.

python -m benchmarks.page
"""

import sys
import textwrap
from collections.abc import Iterator
from pathlib import Path

from benchmarks.speed import results
from benchmarks.speed.results import Figure, Results
from benchmarks.speed.rows import ROWS, Mode, Row
from mavlink_io.errors import CaribouError, exit_with_error

PAGE = Path(__file__).parents[1] / "docs" / "performance.md"
RESULTS = PAGE.with_suffix("")
"""Folder of the committed figures. It is in no package: files of packages decide whether a study
continues (`sysid.trials`)."""
WIDTH = 125
"""Columns of a line of text."""
OTHERS_SHARE = 0.1
"""Share of the cores above which the page warns that other programs were running."""
INTRODUCTION = """\
# Performance

<!-- Written by `python -m benchmarks.page` from docs/performance/*.json; edit benchmarks/page.py or
benchmarks/speed/rows.py instead. -->

How fast is each part, and how far is it from what is possible?

```
make bench                              # all figures on an otherwise idle machine, then this page
make bench BUSY=1                       # the same with one computing process on each core
make bench ROWS=dive-tick,refit         # only some rows
python -m benchmarks --json other.json  # keep the figures elsewhere; prints the table
```

Times differ by a factor of two between machines and between runs, ratios do not. Each figure is
therefore measured together with a *floor* (the least time that the operating system or the
processor needs for the same work) or a *peer* (another program that does the same work). The ratio
is value over floor or peer. Values are medians of the repetitions. Where the target is a ratio, the
ratio decides, otherwise the value.
"""


def write(page: Path = PAGE, folder: Path = RESULTS) -> None:
    """Write the page. Raises InputError, OSError."""
    page.write_text(text(read(folder)), encoding="utf-8")


def read(folder: Path = RESULTS) -> dict[Mode, Results]:
    """Return the results of each mode that was measured. Raises InputError."""
    paths = {mode: folder / f"{mode}.json" for mode in Mode}
    return {mode: results.read(path) for mode, path in paths.items() if path.exists()}


def text(measured: dict[Mode, Results]) -> str:
    """Return the page."""
    blocks = [INTRODUCTION, *_machines(measured)]
    for mode in Mode:
        blocks += _table(mode, measured[mode]) if mode in measured else _not_measured(mode)
    return "\n".join([*blocks, *_methods(measured)])


def _machines(measured: dict[Mode, Results]) -> Iterator[str]:
    """Yield a paragraph on the machine of each mode."""
    for mode, run in measured.items():
        machine = run.machine
        conditions = [figure.conditions for figure in run.figures]
        loads = [load for each in conditions for load in (each.load_before, each.load_after)]
        others = [each.other_cores for each in conditions if each.other_cores is not None]
        dates = sorted({each.date[:10] for each in conditions})
        revisions = sorted({each.revision for each in conditions if each.revision})
        yield _paragraph(
            f"Machine, {mode}: {machine.cores} cores, {machine.cpu}, {machine.system}, Python"
            f" {machine.python}, numpy {machine.numpy}, numba {machine.numba}; "
            f"{' and '.join(dates)}, revision {', '.join(revisions) or 'unknown'}; load average of"
            f" the last minute {min(loads, default=0):.1f} to {max(loads, default=0):.1f}, cores in"
            f" use by other programs {min(others, default=0):.1f} to {max(others, default=0):.1f}."
        )
        if max(others, default=0.0) > OTHERS_SHARE * machine.cores:
            yield _paragraph(
                f"**Other programs used the machine during the measurement, {mode}**: wall times"
                " and speeds of this table are those of a loaded machine."
            )


def _not_measured(mode: Mode) -> list[str]:
    """Return the section of a mode without results."""
    return [f"## {_HEADINGS[mode]}\n", "Not measured yet.\n"]


_HEADINGS = {Mode.IDLE: "Idle machine", Mode.BUSY: "Busy machine"}
_CIRCUMSTANCES = {
    Mode.IDLE: "The benchmark starts no other programs.",
    Mode.BUSY: "Meanwhile one process per core computes all the time, with ordinary priority.",
}


def _table(mode: Mode, run: Results) -> list[str]:
    """Return the section of a mode: one line per figure."""
    judged = [figure.met for figure in run.figures if figure.met is not None]
    lines = [line for row in ROWS.values() for line in _lines(row, mode, run.of_row(row.name))]
    return [
        f"## {_HEADINGS[mode]}\n",
        f"{_CIRCUMSTANCES[mode]} {sum(judged)} of {len(judged)} targets are met.\n",
        _line("row", "figure", "value", "floor or peer", "ratio", "target", "met"),
        "|---" * 7 + "|",
        *lines,
        "",
    ]


def _lines(row: Row, mode: Mode, figures: tuple[Figure, ...]) -> Iterator[str]:
    """Yield the table lines of a row."""
    if not figures:
        target = _target_in_words(results.format_target(row, mode))
        yield _line(f"`{row.name}`", row.title, "not measured", "", "", target, "")
    for figure in figures:
        title = row.title + (f": {figure.case}" if figure.case else "")
        met = "" if figure.met is None else "yes" if figure.met else "**no**"
        yield _line(
            f"`{row.name}`",
            title,
            results.format_value(figure),
            results.format_reference(figure),
            "" if figure.ratio is None else f"{figure.ratio:g}",
            _target_in_words(figure.target),
            met,
        )


def _target_in_words(target: str) -> str:
    """Return a target without signs, which a table of Markdown may show as marks."""
    return target.replace("<=", "at most").replace(">=", "at least")


def _line(*cells: str) -> str:
    """Return a line of a table."""
    return f"| {' | '.join(cell.replace('|', '/') for cell in cells)} |"


def _methods(measured: dict[Mode, Results]) -> Iterator[str]:
    """Yield how each row is measured, with the parts of its value."""
    yield "## How each row is measured\n"
    for row in ROWS.values():
        yield f"### {row.name}\n"
        yield _paragraph(f"{row.title}, in {row.unit}. {row.method}")
        figures = [figure for run in measured.values() for figure in run.of_row(row.name)]
        yield from _notes(figures)
        if any(figure.details for figure in figures):
            yield from _details(row, measured)


def _paragraph(text: str) -> str:
    """Return a text as lines of a page, with a capital letter and a blank line at the end."""
    capital = text[0].upper() + text[1:]
    return textwrap.fill(capital, WIDTH, break_long_words=False, break_on_hyphens=False) + "\n"


def _notes(figures: list[Figure]) -> Iterator[str]:
    """Yield the remarks on the figures of a row, each once."""
    for note in dict.fromkeys(f.note for f in figures if f.note and f.value is not None):
        yield _paragraph(f"{note}.")


def _details(row: Row, measured: dict[Mode, Results]) -> Iterator[str]:
    """Yield the table of the parts of a row, with a column per mode."""
    parts: dict[str, dict[Mode, float]] = {}
    for mode, run in measured.items():
        for figure in run.of_row(row.name):
            for name, value in figure.details.items():
                whole = f"{figure.case}: {name}" if figure.case else name
                parts.setdefault(whole, {})[mode] = value
    yield _line("part", *measured) + "\n" + "|---" * (1 + len(measured)) + "|"
    for name, values in parts.items():
        cells = (f"{values[mode]:g}" if mode in values else "" for mode in measured)
        yield _line(name, *cells)
    yield ""


def main() -> None:
    """Write the page."""
    try:
        write()
    except (CaribouError, OSError) as error:
        exit_with_error("python -m benchmarks.page", error)
    sys.stdout.write(f"{PAGE}\n")


if __name__ == "__main__":
    main()
