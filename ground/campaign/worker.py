"""Process for computations that run during dives.

Fits and designs hold Python's interpreter lock: in a thread of this process they would delay the
threads that receive telemetry.
"""

import importlib
import signal
import traceback
from collections.abc import Callable, Sequence
from multiprocessing import get_context
from multiprocessing.connection import Connection
from threading import Lock
from types import TracebackType
from typing import Any, ParamSpec, Self, TypeVar

from mavlink_io.errors import CaribouError, OperationError
from mavlink_io.parent_watch import end_with_parent

P = ParamSpec("P")
T = TypeVar("T")


class Worker:
    """A separate process that runs one function at a time; threads wait for their turn."""

    def __init__(self, modules: Sequence[str] = ()) -> None:
        """Start the process, which imports `modules` at once."""
        context = get_context("spawn")
        self._turn = Lock()
        self._connection, child_end = context.Pipe()
        self._process = context.Process(
            target=_serve, args=(child_end, tuple(modules)), daemon=True
        )
        self._process.start()
        child_end.close()

    def __enter__(self) -> Self:
        """Return the worker."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        tb: TracebackType | None,
    ) -> None:
        """Stop the process."""
        self.stop()

    def call(self, function: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> T:
        """Run a function in the process; return its result or raise its exception.

        Raises OperationError if the process ended.
        """
        try:
            with self._turn:
                self._connection.send((function, args, kwargs))
                result, error = self._connection.recv()
        except (EOFError, OSError):
            raise OperationError(
                f"the process of {function.__name__} ended before it was done"
            ) from None
        if error is not None:
            raise error
        return result  # type: ignore[no-any-return]

    def stop(self) -> None:
        """Terminate the process."""
        self._process.terminate()
        self._process.join()


def _serve(connection: Connection, modules: Sequence[str]) -> None:
    """Run the functions that the parent sends, until it closes the connection."""
    signal.signal(
        signal.SIGINT, signal.SIG_IGN
    )  # the parent is interrupted too, and stops this process
    end_with_parent()
    for name in modules:
        importlib.import_module(name)
    while True:
        try:
            function, args, kwargs = connection.recv()
        except EOFError:
            return
        connection.send(_call(function, args, kwargs))


def _call(
    function: Callable[..., Any], args: Sequence[Any], kwargs: dict[str, Any]
) -> tuple[Any, Exception | None]:
    """Return the result of a function, or its exception.

    One that is a defect of the program has its traceback as a note.
    """
    try:
        return function(*args, **kwargs), None
    except CaribouError as error:
        return None, error
    except Exception as error:
        error.add_note(traceback.format_exc())
        return None, error
