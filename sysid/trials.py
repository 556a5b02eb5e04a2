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
from concurrent.futures import Executor, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from functools import cache
from multiprocessing import get_context, parent_process
from pathlib import Path
from threading import Thread
from typing import Any, Generic, TypeVar

import msgspec
import numpy as np

from mavlink_io.errors import ErrorCode, InputError, OperationError

T = TypeVar("T")
R = TypeVar("R")

SOURCES = ("mavlink_io", "autopilot", "sitl", "sysid", "ground", "benchmarks")
"""Packages whose files decide a result, where they are installed."""
SUFFIXES = (".py", ".toml", ".json", ".param")
HEADER = b'"results of trials, one [key, result] a line"\n'
"""First line of a file of results."""
MAX_RESTARTS = 3
"""Number of times that dead processes are replaced without a new result in between."""


class TrialsError(OperationError):
    """The processes of a study die; the message says how many results are kept."""

    code = ErrorCode.STUDY_STOPPED


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
    keep: Path | None = None,
    on_result: Callable[[int], None] | None = None,
) -> list[R]:
    """Return the result of a trial for each input.

    Parameters
    ----------
    trial : callable
        Function of a module, or a ``partial`` of one: it is sent to other processes.
    inputs : sequence
        Inputs, each with everything that the result depends on, seeds included.
    result_type : type
        Type of a result: numbers, texts, lists and named tuples of them.
    jobs : int
        Number of processes; 1 runs the trials in this one.
    keep : Path, optional
        File of results. Those that it holds are used, and new ones are appended.
    on_result : callable, optional
        Receive the number of results so far, kept ones included.

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
    kept = KeptResults(keep, result_type)
    keys = [key_of(trial, value) for value in inputs] if keep else [""] * len(inputs)
    results = {n: kept.results[key] for n, key in enumerate(keys) if key in kept.results}
    missing = {n: value for n, value in enumerate(inputs) if n not in results}
    if on_result and results:
        on_result(len(results))
    for number, result in _run(trial, missing, jobs):
        results[number] = kept.add(keys[number], result)
        if on_result:
            on_result(len(results))
    return [results[n] for n in range(len(inputs))]


def key_of(trial: Callable[[T], R], value: T) -> str:
    """Return the key of a result: a hash of source code, function and input."""
    digest = hashlib.sha256(source_hash().encode())
    digest.update(_pickled((trial, value)))
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

    Raises InputError if the file holds something else.
    """

    def __init__(self, path: Path | None, result_type: type[R]) -> None:
        self._path, self._type = path, result_type
        self.results: dict[str, R] = {}
        """Results by key."""
        if path is None:
            return
        text = _read(path) if path.exists() else b""
        if not text:
            self._append(HEADER)
            return
        if not text.startswith(HEADER):
            raise InputError(f"{path}: holds no results of trials; give a new file")
        for line in text[len(HEADER) :].splitlines():
            try:
                key, result = json.loads(line)
                self.results[str(key)] = msgspec.convert(result, result_type)
            except ValueError:  # the last line of a process that was killed
                continue
        if text and not text.endswith(b"\n"):
            self._append(b"\n")

    def add(self, key: str, result: R) -> R:
        """Append a result, and return it as a later run reads it."""
        if self._path is None:
            return result
        line = json.dumps([key, result], default=_builtin)
        self._append(line.encode() + b"\n")
        return msgspec.convert(json.loads(line)[1], self._type)

    def _append(self, data: bytes) -> None:
        """Append bytes in one write."""
        assert self._path is not None, "only a kept result is written"
        self._path.parent.mkdir(parents=True, exist_ok=True)
        with self._path.open("ab", buffering=0) as file:
            file.write(data)


def _read(path: Path) -> bytes:
    """Return the content of a file. Raises InputError."""
    try:
        return path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: {error.strerror}; give a file") from None


def _builtin(value: Any) -> Any:
    """Return a numpy array or number as lists and numbers."""
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} is no result of a trial")


def _run(trial: Callable[[T], R], inputs: dict[int, T], jobs: int) -> Iterator[tuple[int, R]]:
    """Yield number and result of each input as they come; replace processes that die."""
    if jobs == 1:
        yield from ((number, trial(value)) for number, value in inputs.items())
        return
    missing, restarts = dict(inputs), 0
    while missing:
        try:
            with _local_processes(min(jobs, len(missing))) as engine:
                for number, result in _run_on(engine, trial, missing):
                    del missing[number]
                    restarts = 0
                    yield number, result
        except BrokenProcessPool:
            restarts += 1
            if restarts > MAX_RESTARTS:
                raise TrialsError(
                    f"the processes of the study were killed {restarts} times;"
                    f" {len(inputs) - len(missing)} of {len(inputs)} results were computed:"
                    " is there enough memory? fewer --jobs need less"
                ) from None


def _run_on(
    engine: Executor, trial: Callable[[T], R], inputs: dict[int, T]
) -> Iterator[tuple[int, R]]:
    """Yield number and result of each input on an engine, as they come."""
    futures = {engine.submit(trial, value): number for number, value in inputs.items()}
    try:
        for future in as_completed(futures):
            yield futures[future], future.result()
    finally:
        engine.shutdown(cancel_futures=True)


def _local_processes(jobs: int) -> ProcessPoolExecutor:
    """Return an engine of processes of this machine."""
    return ProcessPoolExecutor(jobs, mp_context=get_context("forkserver"), initializer=_begin)


def _begin() -> None:
    """Prepare a process: Ctrl-C is the parent's, and the end of the parent ends this one."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    Thread(target=_end_with_parent, name="parent-watch", daemon=True).start()


def _end_with_parent() -> None:
    """End this process when its parent has ended."""
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
