"""The map of every study: one function over many inputs, on local processes, resumable.

Each result is written to a file as it comes. A study that was killed continues where it was: a
result is used again if the function, the input and the source code of the project are the same.
Results do not depend on the number of processes, nor on interruptions.
"""

import hashlib
import importlib.util
import io
import json
import os
import pickle
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import AbstractContextManager, contextmanager
from functools import cache, partial
from itertools import islice
from pathlib import Path
from queue import SimpleQueue
from typing import Any, Generic, Protocol, TypeVar, runtime_checkable

import msgspec
import numpy as np

from mavlink_io.errors import ErrorCode, InputError, OperationError
from mavlink_io.parent_watch import end_with_parent, start_fork_server
from mavlink_io.text_files import open_regular
from mavlink_io.user_data_dir import errors_named

T = TypeVar("T")
R = TypeVar("R")

SOURCES = ("mavlink_io", "autopilot", "sitl", "sysid", "ground", "benchmarks")
"""Packages whose files decide a result, where they are installed."""
SUFFIXES = (".py", ".toml", ".json", ".param")
HEADER = b'"results of trials, one [key, result] a line"\n'
"""First line of a file of results."""
MAX_RESTARTS = 3
"""Number of times that dead processes are replaced without a new result in between."""
MAX_IN_FLIGHT = 512
"""Maximum number of trials that an engine holds: bounds the memory of a long study."""

Engine = Callable[[int], AbstractContextManager[Executor]]
"""Return an executor for a number of processes; at its exit no trial of it runs or waits."""


@runtime_checkable
class HasIdentity(Protocol):
    """Input of a trial that contains its own key, without what many inputs share."""

    def identity(self) -> object:
        """Return a value that is equal for equal inputs only."""


class TrialsError(OperationError):
    """The processes of a study die; the message gives the number of kept results."""

    code = ErrorCode.STUDY_STOPPED


class Store(Protocol[R]):
    """Place where the results of a study are kept, by key."""

    def prepare(self, keys: Sequence[str]) -> None:
        """Receive the keys of all inputs before the first trial."""

    def get(self, key: str) -> R | None:
        """Return a kept result, or None."""

    def add(self, key: str, result: R) -> R:
        """Keep a result, and return it as ``get`` will return it."""


def usable_cores() -> int:
    """Return the number of cores that this process may use: the default number of processes."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def map_trials(
    trial: Callable[[T], R],
    inputs: Sequence[T],
    result_type: type[R],
    *,
    jobs: int = 1,
    keep: Path | Store[R] | None = None,
    on_result: Callable[[int], None] | None = None,
    engine: Engine | None = None,
) -> list[R]:
    """Return the result of a trial for each input.

    Parameters
    ----------
    trial : callable
        Function of a module, or a ``partial`` of one: it is sent to other processes.
    inputs : sequence
        Inputs, each with everything that the result depends on, seeds included. It may make an
        input at each access.
    result_type : type
        Type of a result: numbers, texts, lists and named tuples of them.
    jobs : int
        Number of processes; 1 runs the trials in this one.
    keep : Path or Store, optional
        File or other place of results. Those that it holds are used, and new ones are added.
    on_result : callable, optional
        Receive the number of results so far, kept ones included.
    engine : Engine, optional
        What runs the trials; without it processes of this machine do.

    Returns
    -------
    list
        Results in the order of the inputs.

    Raises
    ------
    TrialsError
        The processes die again and again.
    InputError
        The file holds something else, or cannot be read.
    OSError
        The file cannot be written.
    """
    store: Store[R] | None = KeptResults(keep, result_type) if isinstance(keep, Path) else keep
    keys = [key_of(trial, value) for value in inputs] if store else []
    results: dict[int, R] = {}
    if store:
        store.prepare(keys)
        kept = ((number, store.get(key)) for number, key in enumerate(keys))
        results = {number: result for number, result in kept if result is not None}
    missing = [number for number in range(len(inputs)) if number not in results]
    if on_result and results:
        on_result(len(results))
    for number, result in _run(trial, inputs, missing, jobs, engine):
        results[number] = store.add(keys[number], result) if store else result
        if on_result:
            on_result(len(results))
    return [results[n] for n in range(len(inputs))]


def key_of(trial: Callable[[T], R], value: T) -> str:
    """Return the key of a result: a hash of source code, function and input.

    Parameters
    ----------
    trial : callable
        Function of a module, or a ``partial`` of one.
    value : object
        Input. Its method ``identity``, if it has one, returns something shorter that is equal for
        equal inputs only.

    Returns
    -------
    str
        64 hexadecimal digits.
    """
    return hash_of((trial, value.identity() if isinstance(value, HasIdentity) else value))


def hash_of(value: object) -> str:
    """Return a hash of source code and value.

    Parameters
    ----------
    value : object
        What can be pickled; equal values have equal hashes.

    Returns
    -------
    str
        64 hexadecimal digits.
    """
    digest = hashlib.sha256(source_hash().encode())
    digest.update(_pickled(value))
    return digest.hexdigest()


@cache
def source_hash() -> str:
    """Return a hash of the versions and files that decide a result."""
    digest = hashlib.sha256(f"{sys.version} numpy {np.__version__}".encode())
    for package in SOURCES:
        found = importlib.util.find_spec(package)
        for folder in (found.submodule_search_locations or ()) if found else ():
            for path in sorted(Path(folder).rglob("*")):
                if path.suffix in SUFFIXES:
                    digest.update(path.relative_to(folder).as_posix().encode())
                    digest.update(path.read_bytes())
    return digest.hexdigest()


def _pickled(value: object) -> bytes:
    """Return the pickle of a value, which is the same for equal values wherever they were made."""
    buffer = io.BytesIO()
    pickler = pickle.Pickler(buffer, protocol=5)
    pickler.fast = True  # without references between equal parts, which depend on their history
    pickler.dump(value)
    return buffer.getvalue()


class KeptResults(Generic[R]):
    """Results in a file of JSON lines, each a key and a result; damaged lines are ignored.

    The file and its folder are created with the first result: an input that a trial refuses leaves
    neither. Raises InputError if the file holds something else.
    """

    def __init__(self, path: Path, result_type: type[R]) -> None:
        self._path, self._type = path, result_type
        self._results: dict[str, R] = {}
        text = _read(path) if path.exists() else b""
        self._is_empty = not text
        if not text:
            return
        if not text.startswith(HEADER):
            raise InputError(f"{path}: holds no results of trials; give a new file")
        for line in text[len(HEADER) :].splitlines():
            try:
                key, result = json.loads(line)
                self._results[str(key)] = msgspec.convert(result, result_type)
            except (ValueError, TypeError):  # the last line of a process that was killed
                continue
        if text and not text.endswith(b"\n"):
            self._append(b"\n")

    def prepare(self, keys: Sequence[str]) -> None:
        """Do nothing: results of other studies may stay in the file."""

    def get(self, key: str) -> R | None:
        """Return a result of the file, or None."""
        return self._results.get(key)

    def add(self, key: str, result: R) -> R:
        """Append a result, and return it as a later run reads it."""
        line = json.dumps([key, result], default=_builtin)
        self._append(line.encode() + b"\n")
        return msgspec.convert(json.loads(line)[1], self._type)

    def _append(self, data: bytes) -> None:
        """Append bytes in one write, to an empty file after the header."""
        if self._is_empty:
            data, self._is_empty = HEADER + data, False
        self._path.parent.mkdir(parents=True, exist_ok=True)
        with errors_named(self._path), self._path.open("ab", buffering=0) as file:
            file.write(data)


def _read(path: Path) -> bytes:
    """Return the content of a file. Raises InputError."""
    try:
        with open_regular(path) as file:
            return file.read()
    except OSError as error:
        raise InputError(f"{path}: {error.strerror}; give a file") from None


def _builtin(value: Any) -> Any:
    """Return a numpy array or number as lists and numbers."""
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} is no result of a trial")


def _run(
    trial: Callable[[T], R],
    inputs: Sequence[T],
    missing: Sequence[int],
    jobs: int,
    engine: Engine | None,
) -> Iterator[tuple[int, R]]:
    """Yield number and result of each missing input as they come; replace processes that die."""
    if engine is None and jobs == 1:
        yield from ((number, trial(inputs[number])) for number in missing)
        return
    engine = engine or partial(_local_processes, _module_of(trial))
    waiting, restarts = dict.fromkeys(missing), 0
    while waiting:
        try:
            with engine(min(jobs, len(waiting))) as executor:
                for number, result in _run_on(executor, trial, inputs, list(waiting)):
                    del waiting[number]
                    restarts = 0
                    yield number, result
        except BrokenProcessPool:
            restarts += 1
            if restarts > MAX_RESTARTS:
                raise TrialsError(
                    f"the processes of the study were killed {restarts} times;"
                    f" {len(missing) - len(waiting)} of {len(missing)} results were computed:"
                    " is there enough memory? fewer --jobs need less"
                ) from None


def _run_on(
    executor: Executor, trial: Callable[[T], R], inputs: Sequence[T], numbers: Sequence[int]
) -> Iterator[tuple[int, R]]:
    """Yield number and result of each input on an executor, as they come."""
    done = SimpleQueue[Future[R]]()
    waiting, in_flight = iter(numbers), dict[Future[R], int]()

    def submit(count: int) -> None:
        """Hand the next inputs to the executor."""
        for number in islice(waiting, count):
            future = executor.submit(trial, inputs[number])
            in_flight[future] = number
            future.add_done_callback(done.put)

    submit(MAX_IN_FLIGHT)
    while in_flight:
        future = done.get()
        yield in_flight.pop(future), future.result()
        submit(1)


def _module_of(trial: Callable[..., object]) -> str:
    """Return the name of the module of a function, or of the function of a ``partial``."""
    return _module_of(trial.func) if isinstance(trial, partial) else trial.__module__


@contextmanager
def _local_processes(module: str, jobs: int) -> Iterator[Executor]:
    """Start processes of this machine that have loaded a module, and end them.

    They are forked from a process that imports the module once: the imports of a dive take as long
    as forty dives, and their memory is shared.
    """
    context = start_fork_server([module])
    executor = ProcessPoolExecutor(jobs, mp_context=context, initializer=_begin)
    try:
        yield executor
    except BaseException:
        # After an interruption the executor would wait for the trials that run. After the death of
        # a process it does not end one that it started meanwhile, and would wait for it forever
        # (seen with Python 3.11).
        for process in list((executor._processes or {}).values()):
            process.kill()
        raise
    finally:
        executor.shutdown(cancel_futures=True)


def _begin() -> None:
    """Prepare a process: Ctrl-C is the parent's, and the end of the parent ends this one."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    end_with_parent()
