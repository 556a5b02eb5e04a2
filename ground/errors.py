"""The two ways to end badly, each with one line for the person: what was given is wrong, or the
work failed."""

FAILED, BAD_INPUT = 1, 2
"""Exit status; the simulator and the autopilot end with the same."""


class InputError(ValueError):
    """What was given cannot be used: names the file or option, the value, and what would be right.
    Exit status 2."""


class OperationError(RuntimeError):
    """The input was fine and the work failed: the vehicle refused, a process died, a fit did not
    converge. Exit 1."""


def out_of_range(key: str, value: float | None, low: float, high: float) -> str:
    """What to say of a value that is given and not within bounds; empty for all others."""
    if value is None or low <= value <= high:
        return ""
    return f"{key} = {value:g}: must be {low:g} to {high:g}"
