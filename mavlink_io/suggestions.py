"""Suggestion for a misspelt name, at the end of an error message."""

import difflib
from collections.abc import Iterable


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Return the end of an error message that suggests a name.

    Parameters
    ----------
    name : str
        Name as it was given.
    known : iterable of str
        Names that exist; upper and lower case are equal.

    Returns
    -------
    str
        ``"; did you mean NAME?"``, or an empty text if no known name is similar.
    """
    by_lower_case = {each.casefold(): each for each in known}
    similar = difflib.get_close_matches(name.casefold(), by_lower_case, n=1)
    return f"; did you mean {by_lower_case[similar[0]]}?" if similar else ""
