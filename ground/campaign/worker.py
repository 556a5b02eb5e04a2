"""A process of its own for what is computed while dives fly.

Fits and designs compute in Python: in a thread of this process they would hold up the threads that
listen to vehicles."""

import importlib
import signal
import traceback
from collections.abc import Callable, Sequence
from multiprocessing import get_context
from multiprocessing.connection import Connection
from types import TracebackType
from typing import Any, ParamSpec, Self, TypeVar

from ground.errors import OperationError

P = ParamSpec("P")
T = TypeVar("T")


class Worker:
    """Does one thing at a time, in a process that knows nothing of this one but what it is
    given."""

    def __init__(self, modules: Sequence[str] = ()) -> None:
        """``modules`` are loaded at once, before the first thing there is to do."""
        context = get_context("spawn")
        self._connection, theirs = context.Pipe()
        self._process = context.Process(target=_serve, args=(theirs, tuple(modules)), daemon=True)
        self._process.start()
        theirs.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        tb: TracebackType | None,
    ) -> None:
        self.stop()

    def call(self, function: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> T:
        """What ``function`` gives there, or raises. Raises FailedError when the process died of
        it."""
        try:
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
        """End the process, whatever it does."""
        self._process.terminate()
        self._process.join()


def _serve(connection: Connection, modules: Sequence[str]) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # who asked is interrupted too, and stops us
    for name in modules:
        importlib.import_module(name)
    while True:
        try:
            function, args, kwargs = connection.recv()
        except EOFError:
            return
        connection.send(_outcome(function, args, kwargs))


def _outcome(
    function: Callable[..., Any], args: Sequence[Any], kwargs: dict[str, Any]
) -> tuple[Any, Exception | None]:
    try:
        return function(*args, **kwargs), None
    except Exception as error:
        error.add_note(traceback.format_exc())
        return None, error
