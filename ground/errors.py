"""The two ways to end badly, each with one line for the person: what was given is wrong, or the
work failed."""

FAILED, BAD_INPUT = 1, 2
"""Exit status; the simulator and the autopilot end with the same."""
INTERRUPTED = 130
"""Exit status after Ctrl-C, as shells have it: 128 and the number of SIGINT."""


class InputError(ValueError):
    """What was given cannot be used: names the file or option, the value, and what would be right.
    Exit status 2."""


class OperationError(RuntimeError):
    """The input was fine and the work failed: the vehicle refused, a process died, a fit did not
    converge. Exit 1."""


class Interrupted(BaseException):
    """The user ends the program: unwinds everything, so that logs are closed and processes stopped.

    Its notes (`add_note`) say what is left behind.
    """

    def __init__(self, status: int) -> None:
        super().__init__()
        self.status = status


def out_of_range(key: str, value: float | None, low: float, high: float) -> str:
    """What to say of a value that is given and not within bounds; empty for all others."""
    if value is None or low <= value <= high:
        return ""
    return f"{key} = {value:g}: must be {low:g} to {high:g}"
