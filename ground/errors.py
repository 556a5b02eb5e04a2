"""Errors of ground, each with a message of one line: the input is wrong, or the work failed."""

FAILED, BAD_INPUT = 1, 2
"""Exit status, the same for the simulator and the autopilot."""
INTERRUPTED = 130
"""Exit status after Ctrl-C, by the convention of shells: 128 plus the number of SIGINT."""


class InputError(ValueError):
    """The input cannot be used; the message names file or option, value and what is expected.

    Exit status 2.
    """


class OperationError(RuntimeError):
    """The work failed: the vehicle refused, a process ended, a fit did not converge.

    Exit status 1.
    """


class Interrupted(BaseException):
    """The user ended the program. Logs are closed and processes stopped while it propagates.

    Its notes (`add_note`) describe the vehicle that is left behind.
    """

    def __init__(self, status: int) -> None:
        super().__init__()
        self.status = status


def out_of_range(key: str, value: float | None, low: float, high: float) -> str:
    """Return an error text if a value is given and outside its bounds; otherwise an empty text."""
    if value is None or low <= value <= high:
        return ""
    return f"{key} = {value:g}: must be {low:g} to {high:g}"
