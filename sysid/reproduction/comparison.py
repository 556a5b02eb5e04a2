"""Published value, own value, difference and verdict of one quantity of the paper."""

from enum import StrEnum
from typing import NamedTuple

Value = float | str


class Verdict(StrEnum):
    """Result of a comparison."""

    REPRODUCED = "reproduced"
    NOT_REPRODUCED = "not reproduced"
    NOT_REPRODUCIBLE = "not reproducible"
    """The paper lacks a necessary number, or contradicts itself; the reason gives the evidence."""


class PublishedComparison(NamedTuple):
    """One quantity of a table or a figure."""

    item: str
    """Table or figure by its number, as "Table 1"."""
    quantity: str
    unit: str
    published: Value
    """Printed value, or the statement of the text."""
    ours: Value
    difference: Value
    """Own minus published value in the unit of both; a text where it is not a number."""
    criterion: str
    """Criterion of the verdict, in words."""
    verdict: Verdict
    reason: str = ""
    """How the value was obtained, and why it cannot be reproduced if it cannot."""


def judge(holds: bool, impossible: str = "") -> Verdict:
    """Return the verdict of a criterion.

    Parameters
    ----------
    holds : bool
        Whether the criterion is met.
    impossible : str
        Evidence that the quantity cannot be reproduced; empty if it can.

    Returns
    -------
    Verdict
        Evidence counts only where the criterion is not met.
    """
    if holds:
        return Verdict.REPRODUCED
    return Verdict.NOT_REPRODUCIBLE if impossible else Verdict.NOT_REPRODUCED


def within(
    item: str,
    quantity: str,
    unit: str,
    published: float,
    ours: float,
    *,
    share: float,
    reason: str = "",
    impossible: str = "",
) -> PublishedComparison:
    """Compare two numbers with a relative tolerance.

    Parameters
    ----------
    item, quantity, unit : str
        As in `PublishedComparison`.
    published, ours : float
        Values in `unit`.
    share : float
        Largest difference as a share of the published value.
    reason : str
        How the own value was obtained.
    impossible : str
        Evidence that the number cannot be reproduced; it replaces `reason` where it applies.

    Returns
    -------
    PublishedComparison
        Numbers with the verdict.
    """
    holds = abs(ours - published) <= share * abs(published)
    row = PublishedComparison(
        item=item,
        quantity=quantity,
        unit=unit,
        published=published,
        ours=ours,
        difference=ours - published,
        criterion=f"within {100 * share:g} %",
        verdict=judge(holds, impossible),
        reason=reason,
    )
    return _with_evidence(row, impossible)


def at_most(
    item: str,
    quantity: str,
    unit: str,
    published: float,
    ours: float,
    *,
    reason: str = "",
    impossible: str = "",
) -> PublishedComparison:
    """Compare two numbers of which the own one must not exceed the published one.

    Parameters
    ----------
    item, quantity, unit : str
        As in `PublishedComparison`.
    published, ours : float
        Values in `unit`.
    reason : str
        How the own value was obtained.
    impossible : str
        Evidence that the number cannot be reproduced; it replaces `reason` where it applies.

    Returns
    -------
    PublishedComparison
        Numbers with the verdict.
    """
    row = within(item, quantity, unit, published, ours, share=0.0, reason=reason)
    row = row._replace(
        criterion="at most the published value", verdict=judge(ours <= published, impossible)
    )
    return _with_evidence(row, impossible)


def statement(
    item: str,
    quantity: str,
    published: str,
    ours: str,
    holds: bool,
    *,
    reason: str = "",
    impossible: str = "",
) -> PublishedComparison:
    """Compare a statement of the paper's text with what was found.

    Parameters
    ----------
    item, quantity : str
        As in `PublishedComparison`.
    published, ours : str
        Statement of the paper, and the finding with its numbers.
    holds : bool
        Whether the finding supports the statement.
    reason : str
        How it was found.
    impossible : str
        Evidence that the statement cannot be reproduced; it replaces `reason` where it applies.

    Returns
    -------
    PublishedComparison
        Statements with the verdict.
    """
    row = PublishedComparison(
        item=item,
        quantity=quantity,
        unit="",
        published=published,
        ours=ours,
        difference="",
        criterion="the statement holds",
        verdict=judge(holds, impossible),
        reason=reason,
    )
    return _with_evidence(row, impossible)


def _with_evidence(row: PublishedComparison, impossible: str) -> PublishedComparison:
    """Return a comparison with the evidence as reason if it cannot be reproduced."""
    return row._replace(reason=impossible) if row.verdict is Verdict.NOT_REPRODUCIBLE else row
