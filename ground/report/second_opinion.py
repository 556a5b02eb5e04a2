"""Second opinion on a model as a table: its response about crossover beside other methods."""

from collections.abc import Iterator
from html import escape

from rich import box
from rich.table import Table

from ground.rendered import Rendered
from ground.report import tables
from ground.report.verdict_words import as_sentence
from ground.terminal import heading, render
from sysid.models.model_file import IdentifiedModel
from sysid.validation.results import Opinion, SecondOpinion

HEAD = ("plane", "rad/s", "quantity", "model ± 1 sd")
METHODS = ("frequency response", "ARX", "python-control")
CONFIRMED = "no method differs from the model by more than their common 95 % interval"


def format_text(model: IdentifiedModel) -> Rendered:
    """Return the table as text; empty without a second opinion.

    Parameters
    ----------
    model : IdentifiedModel
        Validated model.

    Returns
    -------
    Rendered
        Text for a terminal.
    """
    rows = list(_rows(model))
    if not rows:
        return Rendered("")
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    for number, name in enumerate((*HEAD, *METHODS, "coherence")):
        table.add_column(name, justify="left" if number in (0, 2) else "right")
    for row in rows:
        table.add_row(*row)
    page = render([heading("second opinion: rate over command"), table, *differences(model)])
    return Rendered("\n".join(line.rstrip() for line in page.split("\n") if line.strip()))


def html(model: IdentifiedModel) -> str:
    """Return the table and the differences as HTML.

    Parameters
    ----------
    model : IdentifiedModel
        Validated model.

    Returns
    -------
    str
        HTML; empty without a second opinion.
    """
    rows = [[escape(cell) for cell in row] for row in _rows(model)]
    if not rows:
        return ""
    notes = "".join(f'<p class="note">{as_sentence(line)}</p>' for line in differences(model))
    return tables.table([*HEAD, *METHODS, "coherence"], rows, "named") + notes


def differences(model: IdentifiedModel) -> list[str]:
    """Return the differences of all planes, or one line that there are none.

    Parameters
    ----------
    model : IdentifiedModel
        Validated model.

    Returns
    -------
    list of str
        One line per difference, with its plane.
    """
    lines = [
        f"{plane}, {difference}"
        for plane, opinion in _opinions(model)
        for difference in opinion.differences
    ]
    return lines or [CONFIRMED]


def _opinions(model: IdentifiedModel) -> Iterator[tuple[str, SecondOpinion]]:
    """Yield the second opinion of each plane that has one."""
    for plane, validation in model.validation.items():
        if validation.second_opinion is not None:
            yield plane, validation.second_opinion


def _rows(model: IdentifiedModel) -> Iterator[list[str]]:
    """Yield two rows per plane and frequency: gain and phase."""
    for plane, opinion in _opinions(model):
        by_method: dict[str, Opinion] = {other.method: other for other in opinion.opinions}
        for k, frequency in enumerate(opinion.frequency_radps):
            yield [
                plane if k == 0 else "",
                f"{frequency:.2f}",
                "gain, dB",
                _value(opinion.gain_db[k], _at(opinion.gain_sd_db, k), 2),
                *(_gain(by_method.get(method), k) for method in METHODS),
                _coherence(by_method.get("frequency response"), k),
            ]
            yield [
                "",
                "",
                "phase, deg",
                _value(opinion.phase_deg[k], _at(opinion.phase_sd_deg, k), 1),
                *(_phase(by_method.get(method), k) for method in METHODS),
                "",
            ]


def _gain(opinion: Opinion | None, k: int) -> str:
    """Return the gain of an opinion as a cell."""
    return "" if opinion is None else _value(opinion.gain_db[k], _at(opinion.gain_sd_db, k), 2)


def _phase(opinion: Opinion | None, k: int) -> str:
    """Return the phase of an opinion as a cell."""
    return "" if opinion is None else _value(opinion.phase_deg[k], _at(opinion.phase_sd_deg, k), 1)


def _coherence(opinion: Opinion | None, k: int) -> str:
    """Return the coherence as a cell."""
    return "" if opinion is None or opinion.coherence is None else f"{opinion.coherence[k]:.2f}"


def _at(values: tuple[float, ...] | None, k: int) -> float | None:
    """Return one value of a list that may be unknown."""
    return None if values is None else values[k]


def _value(value: float, sd: float | None, digits: int) -> str:
    """Return a value with its standard deviation, if there is one."""
    return f"{value:.{digits}f}" + ("" if sd is None else f" ± {sd:.{digits}f}")
