"""Evaluation of a sweep: pass probability, distributions, worst dives, influence of each input."""

import csv
import math
from collections import Counter
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.stats import beta, f, rankdata

from sysid.models.parameters import NAMES
from sysid.sweep.dives import COLUMNS, Conditions

Array = NDArray[np.float64]
Texts = NDArray[np.str_]

TEXTS = ("vehicle", "gains", "mission", "diverged", "failsafe", "not_redesigned", "key", "command")
"""Columns of texts; all others hold numbers, NaN where a cell is empty."""
ERRORS = ("heading_deg", "pitch_deg", "depth_m", "settling_s")
"""Columns whose distributions are shown."""
QUANTILES = (0.05, 0.5, 0.95)
CONFIDENCE = 0.95
BINS = 8
"""Number of bins of an input that has more values than this."""
SIGNIFICANCE = 0.01
"""Probability of naming any input that has no influence."""
_OUTSIDE_LIMITS = "outside the limits"
"""Reason of a dive that was held to its end."""
_NOT_REDESIGNED = "; gains not redesigned"
"""End of the reason of a dive whose gains could not be redesigned."""


class ConfidenceInterval(NamedTuple):
    """Probability with its confidence interval."""

    estimate: float
    low: float
    high: float


class Distribution(NamedTuple):
    """Quantiles of a quantity over the dives that have a value."""

    q05: float
    median: float
    q95: float
    worst: float


class CellSummary(NamedTuple):
    """Dives of one combination of vehicle, gains, mission and listed values."""

    inputs: dict[str, str]
    """Value of each input of the combination, as text."""
    dives: int
    passed: int
    probability: ConfidenceInterval
    failures: dict[str, int]
    """Number of dives that did not pass, by reason."""
    errors: dict[str, Distribution]
    """By the names in `ERRORS`; one without any value is missing."""


class Influence(NamedTuple):
    """Influence of one input on one result."""

    input: str
    share: float
    """Share of the variance of the result's ranks that this input explains, 0 to 1."""
    direction: float
    """Rank correlation, -1 to 1; NaN for an input that is not a number."""


class Table(NamedTuple):
    """The rows of a sweep by column."""

    numbers: dict[str, Array]
    texts: dict[str, Texts]

    def __len__(self) -> int:
        """Return the number of dives."""
        return len(self.numbers["dive"])


def read(parts: Iterable[str]) -> Table:
    """Return the rows of parts.

    Parameters
    ----------
    parts : iterable of str
        Lines of CSV without a header.

    Returns
    -------
    Table
        Columns.
    """
    numbers: dict[str, list[Array]] = {name: [] for name in COLUMNS if name not in TEXTS}
    texts: dict[str, list[str]] = {name: [] for name in TEXTS}
    for part in parts:
        columns = zip(*csv.reader(part.splitlines()), strict=True)
        for name, cells in zip(COLUMNS, columns, strict=True):
            if name in TEXTS:
                texts[name] += cells
            else:
                numbers[name].append(np.array([float(cell or "nan") for cell in cells]))
    return Table(
        {name: np.concatenate([np.empty(0), *values]) for name, values in numbers.items()},
        {name: np.array(values, dtype=np.str_) for name, values in texts.items()},
    )


def pass_probability(passed: int, count: int) -> ConfidenceInterval:
    """Return the probability of passing with its Clopper-Pearson interval.

    Parameters
    ----------
    passed, count : int
        Number of dives that passed, and of all.

    Returns
    -------
    ConfidenceInterval
        Estimate and limits of the 95 % interval.

    Notes
    -----
    The limits are quantiles of the beta distribution (Clopper and Pearson 1934, Biometrika 26,
    404-413). The interval holds at least 95 % for independent dives; quasi-random samples are more
    even than independent ones, so that it is rather too wide for them.
    """
    tail, failed = 0.5 * (1.0 - CONFIDENCE), count - passed
    low = float(beta.ppf(tail, passed, failed + 1)) if passed else 0.0
    high = float(beta.ppf(1.0 - tail, passed + 1, failed)) if failed else 1.0
    return ConfidenceInterval(passed / count, low, high)


def cells(table: Table, listed: Sequence[str]) -> list[CellSummary]:
    """Return the summary of each combination.

    Parameters
    ----------
    table : Table
        Rows.
    listed : sequence of str
        Conditions whose values are combined with each other, not sampled.

    Returns
    -------
    list of CellSummary
        In the order of the first dive of each.
    """
    names = ("vehicle", "gains", "mission", *listed)
    keys = list(
        zip(*(_as_text((table.texts | table.numbers)[name]) for name in names), strict=True)
    )
    numbers = {key: number for number, key in enumerate(dict.fromkeys(keys))}
    cell_of_row = np.array([numbers[key] for key in keys])
    reasons = np.array(failures(table))
    return [
        _cell(table, dict(zip(names, key, strict=True)), np.flatnonzero(cell_of_row == n), reasons)
        for key, n in numbers.items()
    ]


def _as_text(column: Array | Texts) -> list[str]:
    """Return the values of a column as short texts."""
    return [value if isinstance(value, str) else f"{value:g}" for value in column.tolist()]


def _cell(
    table: Table, inputs: dict[str, str], rows: NDArray[np.intp], reasons: Texts
) -> CellSummary:
    """Return the summary of the selected rows."""
    passed, count = int(np.sum(table.numbers["passed"][rows])), len(rows)
    found = Counter(reasons[rows].tolist())
    return CellSummary(
        inputs=inputs,
        dives=count,
        passed=passed,
        probability=pass_probability(passed, count),
        failures={name: found[name] for name in sorted(found) if name},
        errors={
            name: _distribution(values)
            for name in ERRORS
            if (values := _finite(table.numbers[name][rows])).size
        },
    )


def _distribution(values: Array) -> Distribution:
    """Return the quantiles of some values."""
    q05, median, q95 = np.quantile(values, QUANTILES).tolist()
    return Distribution(q05, median, q95, worst=float(np.max(values)))


def _finite(values: Array) -> Array:
    """Return the values that are numbers."""
    return values[np.isfinite(values)]


def failures(table: Table) -> list[str]:
    """Return why each dive did not pass.

    Parameters
    ----------
    table : Table
        Rows.

    Returns
    -------
    list of str
        Text of each row; empty for a dive that passed.
    """
    columns = zip(
        table.texts["failsafe"].tolist(),
        table.texts["diverged"].tolist(),
        table.texts["not_redesigned"].tolist(),
        table.numbers["broached"].tolist(),
        table.numbers["passed"].tolist(),
        strict=True,
    )
    return [
        ""
        if passed
        else (
            (failsafe and f"surfaced: {failsafe}")
            or (diverged and f"did not hold {diverged}")
            or ("broached" if broached else _OUTSIDE_LIMITS)
        )
        + (_NOT_REDESIGNED if unchanged else "")
        for failsafe, diverged, unchanged, broached, passed in columns
    ]


def worst(table: Table, count: int) -> list[int]:
    """Return the rows of the worst dives, worst first.

    Parameters
    ----------
    table : Table
        Rows.
    count : int
        Number of rows.

    Returns
    -------
    list of int
        Rows: first dives that were not held to the end, then by the largest error relative to the
        median of its quantity.
    """
    ratios = [np.zeros(len(table))]
    for name in ERRORS:
        values = table.numbers[name]
        if (known := _finite(values)).size and (median := float(np.median(known))) > 0.0:
            ratios.append(np.nan_to_num(values / median))
    reasons = failures(table)
    held = ("", _OUTSIDE_LIMITS, f"{_OUTSIDE_LIMITS}{_NOT_REDESIGNED}")
    lost = np.array([reason not in held for reason in reasons])
    order = np.lexsort((np.arange(len(table)), -np.max(ratios, axis=0), ~lost))
    return [int(row) for row in order[:count]]


def influences(table: Table, result: str) -> list[Influence]:
    """Return the inputs that influence a result, largest influence first.

    Parameters
    ----------
    table : Table
        Rows.
    result : str
        Column of the result.

    Returns
    -------
    list of Influence
        Inputs whose share differs from zero; `SIGNIFICANCE` is the probability that the list names
        one without influence.

    Notes
    -----
    The share is the first-order sensitivity index estimated from given data (Plischke, Borgonovo
    and Smith 2013, Eur. J. Oper. Res. 226, 536-550): variance of the means within classes of the
    input over the total variance. It is computed on ranks, so that a single lost dive does not
    decide, and without the bias of the number of classes (Kelley 1935, epsilon squared). The inputs
    are selected one after the other, each on what the ones before leave unexplained: few samples of
    many inputs are correlated, and the second of two correlated inputs explains nothing more.
    Combinations are flown with the same samples, as in blocks: the share of a sampled input is
    computed on the means of the samples, that of another input on the differences from these means.
    Inputs that act only together have no share.
    """
    known = np.isfinite(table.numbers[result])
    if np.sum(known) < 2 or np.ptp(table.numbers[result][known]) == 0.0:
        return []
    ranks = rankdata(table.numbers[result][known])
    inputs = [entry for entry in _inputs(table, known) if len(np.unique(entry.values)) > 1]
    limit = SIGNIFICANCE / max(1, len(inputs))
    sample = np.unique(table.numbers["sample"][known], return_inverse=True)[1]
    sampled = [
        entry._replace(values=_means(np.asarray(entry.values, dtype=np.float64), sample))
        for entry in inputs
        if entry.sampled
    ]
    others = [entry for entry in inputs if not entry.sampled]
    means, total = _means(ranks, sample), float(np.var(ranks))
    within = ranks - means[sample]
    found = [
        entry._replace(share=entry.share * float(np.var(rest)) / total)
        for selected, rest in (
            (_select(sampled, means, 0, limit), means),
            (_select(others, within, len(means) - 1, limit), within),
        )
        for entry in selected
    ]
    return sorted(found, key=lambda entry: -entry.share)


class _Input(NamedTuple):
    """Values of one input."""

    name: str
    values: Array | Texts
    sampled: bool
    """Whether the value is the same in a whole sample."""


def _means(values: Array, sample: NDArray[np.intp]) -> Array:
    """Return the mean of the values of each sample."""
    return np.asarray(np.bincount(sample, weights=values) / np.bincount(sample))


def _select(inputs: Sequence[_Input], result: Array, used: int, limit: float) -> list[Influence]:
    """Return the inputs that explain a result, each what the ones before leave unexplained.

    ``used`` is the number of degrees of freedom that are taken from the result, ``limit`` the
    largest accepted probability that a share is due to chance.
    """
    rest, total = result.copy(), float(np.var(result))
    classes = {entry.name: _classes(entry.values) for entry in inputs}
    values = {entry.name: entry.values for entry in inputs}
    selected: list[Influence] = []
    while classes and total > 0.0:
        explained = {name: _explained(rest, of_name, used) for name, of_name in classes.items()}
        best = max(explained, key=lambda name: explained[name][0])
        share, chance = explained[best]
        if chance >= limit:
            break
        share *= float(np.var(rest)) / total
        selected.append(Influence(best, share, _direction(values[best], result)))
        of_best = classes.pop(best)
        used += int(of_best.max())
        rest -= (np.bincount(of_best, weights=rest) / np.bincount(of_best))[of_best]
    return selected


def _inputs(table: Table, rows: NDArray[np.bool_]) -> list[_Input]:
    """Return all inputs of the selected dives."""
    sample, vehicle = table.numbers["sample"][rows], table.texts["vehicle"][rows]
    inputs = [_Input(name, table.texts[name][rows], False) for name in TEXTS[:3]]
    for name in Conditions._fields:
        column = table.numbers[name][rows]
        inputs.append(_Input(name, column, _constant(column, sample)))
    for name in NAMES:
        column = table.numbers[f"z_{name}"][rows].copy()
        for one in np.unique(vehicle):  # vehicles have means of their own
            column[vehicle == one] -= np.mean(column[vehicle == one])
        inputs.append(_Input(f"z_{name}", column, True))
    return inputs


def _constant(column: Array, sample: Array) -> bool:
    """Return whether a column has one value in each sample."""
    return len(np.unique(np.column_stack([sample, column]), axis=0)) == len(np.unique(sample))


def _classes(column: Array | Texts) -> NDArray[np.intp]:
    """Return the class of each value: the value, or one of `BINS` classes of equal size."""
    values, classes = np.unique(column, return_inverse=True)
    if len(values) <= BINS:
        return np.asarray(classes)
    order = rankdata(column, method="ordinal") - 1
    return np.asarray(order * BINS // len(column), dtype=np.intp)


def _explained(values: Array, classes: NDArray[np.intp], used: int) -> tuple[float, float]:
    """Return the explained share of the variance and the probability of it by chance.

    ``used`` is the number of degrees of freedom that are taken from the values.
    """
    counts = np.bincount(classes)
    means = np.bincount(classes, weights=values) / counts
    freedom, k = len(values) - len(counts) - used, len(counts)
    between = float(np.sum(counts * (means - np.mean(values)) ** 2))
    within = float(np.sum((values - means[classes]) ** 2))
    if freedom < 1 or k < 2 or between + within == 0.0:
        return 0.0, 1.0
    if within == 0.0:
        return 1.0, 0.0
    noise = within / freedom
    share = max(0.0, (between - (k - 1) * noise) / (between + within))
    return share, float(f.sf(between / (k - 1) / noise, k - 1, freedom))


def _direction(column: Array | Texts, result: Array) -> float:
    """Return the rank correlation with a result; NaN for texts and constants."""
    if column.dtype.kind != "f" or np.ptp(column) == 0.0 or np.ptp(result) == 0.0:
        return math.nan
    return float(np.corrcoef(rankdata(column), rankdata(result))[0, 1])
