"""Errors and the interruption that only ground has; `mavlink_io.errors` has the base classes."""

from mavlink_io.errors import ErrorCode, OperationError

INTERRUPTED = 130
"""Exit status after Ctrl-C, by the convention of shells: 128 plus the number of SIGINT."""


class UnsuccessfulError(OperationError):
    """The command has printed its result, and the result is a failure."""

    code = ErrorCode.UNSUCCESSFUL


class Interrupted(BaseException):
    """The user ended the program. Logs are closed and processes stopped while it propagates.

    Its notes (`add_note`) describe the vehicle that is left behind.
    """

    def __init__(self, status: int) -> None:
        super().__init__()
        self.status = status
        self.under_way = False
        """Whether a vehicle is left behind under way."""


def out_of_range(key: str, value: float | None, low: float, high: float) -> str:
    """Return an error text if a value is given and outside its bounds; otherwise an empty text."""
    if value is None or low <= value <= high:
        return ""
    return f"{key} = {value:g}: must be {low:g} to {high:g}"
