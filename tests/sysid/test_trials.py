"""The map of studies: the same results for any number of processes and after any interruption."""

import json
import math
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

from mavlink_io.errors import InputError
from sysid import trials
from sysid.trials import TrialsError, key_of, map_trials
from tests.helpers.subprocesses import TIMEOUT_S

ROOT = Path(__file__).parents[2]


class Point(NamedTuple):
    """A result with parts of several types."""

    place: tuple[float, ...]
    name: str
    depth_m: float | None


def point(value: int) -> Point:
    """Return a result that depends on the input."""
    return Point((value / 3.0, math.nan), f"trial {value}", None if value % 2 else 0.1 * value)


def counted(folder: Path, value: int) -> list[float]:
    """Return a result, and leave a file that tells that the trial was run."""
    (folder / f"{value}-{time.monotonic_ns()}").touch()
    return [value / 7.0]


def slow(folder: Path, value: int) -> list[float]:
    """Return a result after a while."""
    time.sleep(0.05)
    return counted(folder, value)


def deadly(folder: Path, value: int) -> list[float]:
    """Kill this process in the first trial with 3, and every time with 13."""
    first = not any(folder.glob("3-*"))
    result = counted(folder, value)
    if value == 13 or (value == 3 and first):
        os.kill(os.getpid(), signal.SIGKILL)
    return result


IMPORTED_BY = os.getpid()
"""Process that imported this module."""


def imported_here(value: int) -> list[float]:
    """Return 1 if this process imported the module itself, 0 if it was forked with it."""
    return [float(os.getpid() == IMPORTED_BY)]


def times_run(folder: Path) -> list[int]:
    """Return the inputs that were run, sorted, each as often as it was run."""
    return sorted(int(path.name.split("-")[0]) for path in folder.iterdir())


@pytest.fixture
def runs(tmp_path: Path) -> Path:
    folder = tmp_path / "runs"
    folder.mkdir()
    return folder


def test_results_do_not_depend_on_processes_or_file(tmp_path: Path) -> None:
    inputs, keep = range(9), tmp_path / "new" / "points.jsonl"
    alone = map_trials(point, inputs, Point)
    parallel = map_trials(point, inputs, Point, jobs=2)
    written = map_trials(point, inputs, Point, jobs=2, keep=keep)
    again = map_trials(point, inputs, Point, keep=keep)
    assert repr(alone) == repr(parallel) == repr(written) == repr(again)


def test_kept_results_are_not_computed_again(tmp_path: Path, runs: Path) -> None:
    trial, keep = partial(counted, runs), tmp_path / "kept"
    seen: list[int] = []
    assert map_trials(trial, [1, 2], list[float], keep=keep) == [[1 / 7.0], [2 / 7.0]]
    map_trials(trial, [2, 1, 3], list[float], keep=keep, on_result=seen.append)
    assert times_run(runs) == [1, 2, 3]
    assert seen == [2, 3]


@pytest.mark.parametrize("line", ["5", "null", "[1]", '{"a": 1}', "[1, 2"])
def test_damaged_line_is_ignored(tmp_path: Path, runs: Path, line: str) -> None:
    trial, keep = partial(counted, runs), tmp_path / "kept"
    first = map_trials(trial, [1], list[float], keep=keep)
    with keep.open("a") as file:
        file.write(f"{line}\n")
    assert map_trials(trial, [1], list[float], keep=keep) == first
    assert times_run(runs) == [1]


def test_torn_last_line_is_computed_again(tmp_path: Path, runs: Path) -> None:
    trial, keep = partial(counted, runs), tmp_path / "kept"
    whole = map_trials(trial, [1, 2, 3], list[float], keep=keep)
    keep.write_bytes(keep.read_bytes()[:-4])
    assert map_trials(trial, [1, 2, 3], list[float], keep=keep) == whole
    assert times_run(runs) == [1, 2, 3, 3]
    assert map_trials(trial, [1, 2, 3], list[float], keep=keep) == whole
    assert times_run(runs) == [1, 2, 3, 3], "the line after the torn one was read"


def test_other_function_input_or_source_is_another_key(monkeypatch: pytest.MonkeyPatch) -> None:
    array = np.arange(3.0)
    same = key_of(partial(counted, Path("a")), 1)
    assert same == key_of(partial(counted, Path("a")), 1)
    others = {
        key_of(partial(slow, Path("a")), 1),
        key_of(partial(counted, Path("b")), 1),
        key_of(partial(counted, Path("a")), 2),
    }
    assert len(others | {same}) == 4
    assert key_of(point, [array, array]) == key_of(point, [array, array.copy()])  # type: ignore[arg-type]
    monkeypatch.setattr(trials, "source_hash", lambda: "changed")
    assert key_of(partial(counted, Path("a")), 1) != same


def test_other_file_is_refused_and_unchanged(tmp_path: Path) -> None:
    gains = tmp_path / "gains.param"
    gains.write_text("HDG_P,1.0\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"gains\.param: holds no results of trials"):
        map_trials(point, [1], Point, keep=gains)
    assert gains.read_text(encoding="utf-8") == "HDG_P,1.0\n"


def test_pipe_is_no_file_to_keep_results_in(tmp_path: Path) -> None:
    """It is not read: a pipe may wait for ever, and /dev/full has no end."""
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with pytest.raises(InputError, match=r"pipe: is no regular file .*; give a file"):
        map_trials(point, [1], Point, keep=pipe)


def test_dead_process_is_replaced(tmp_path: Path, runs: Path) -> None:
    trial = partial(deadly, runs)
    found = map_trials(trial, range(6), list[float], jobs=2, keep=tmp_path / "kept")
    assert found == [[value / 7.0] for value in range(6)]


def test_processes_that_always_die_end_the_study(tmp_path: Path, runs: Path) -> None:
    keep = tmp_path / "kept"
    with pytest.raises(TrialsError, match="killed 4 times"):
        map_trials(partial(deadly, runs), [13, 1], list[float], jobs=2, keep=keep)


@pytest.mark.slow
def test_refused_input_creates_no_file(tmp_path: Path) -> None:
    keep = tmp_path / "new" / "kept"
    with pytest.raises(ValueError, match="domain"):
        map_trials(math.sqrt, [-1.0], float, keep=keep)
    assert not keep.parent.exists()


def test_processes_are_forked_with_the_module_loaded() -> None:
    program = (
        "from sysid.trials import map_trials\n"
        "from tests.sysid.test_trials import imported_here\n"
        "assert map_trials(imported_here, [1, 2], list[float], jobs=2) == [[0.0], [0.0]]\n"
    )
    subprocess.run([sys.executable, "-c", program], check=True, cwd=ROOT)


class PlainThreads(ThreadPoolExecutor):
    """An executor whose `shutdown` knows no `cancel_futures`, as that of dask.distributed."""

    submitted = 0

    def submit(self, *given: Any, **named: Any) -> Any:
        PlainThreads.submitted += 1
        return super().submit(*given, **named)

    def shutdown(self, wait: bool = True) -> None:  # type: ignore[override]
        super().shutdown(wait)


@contextmanager
def plain_threads(jobs: int) -> Iterator[Executor]:
    """Return an engine of threads."""
    with PlainThreads(jobs) as executor:
        yield executor


def test_other_engine_gives_same_results(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(trials, "MAX_IN_FLIGHT", 2)
    inputs = range(9)
    threads = map_trials(point, inputs, Point, jobs=3, engine=plain_threads)
    assert repr(threads) == repr(map_trials(point, inputs, Point))
    assert PlainThreads.submitted == len(inputs)


class Held:
    """A store in memory, which knows the results of even inputs."""

    def __init__(self) -> None:
        self.expected: list[str] = []
        self.added: list[str] = []

    def prepare(self, keys: Sequence[str]) -> None:
        self.expected = list(keys)

    def get(self, key: str) -> list[float] | None:
        return None if self.expected.index(key) % 2 else [-1.0]

    def add(self, key: str, result: list[float]) -> list[float]:
        self.added.append(key)
        return [*result, 0.0]


def test_store_gets_keys_first_and_replaces_results(runs: Path) -> None:
    store = Held()
    found = map_trials(partial(counted, runs), range(4), list[float], keep=store)
    assert found == [[-1.0], [1 / 7.0, 0.0], [-1.0], [3 / 7.0, 0.0]]
    assert times_run(runs) == [1, 3]
    assert store.added == store.expected[1::2]


@pytest.mark.process
@pytest.mark.timeout(60)
def test_interrupted_study_ends_running_trials() -> None:
    def interrupt() -> None:
        """Interrupt this process while a trial runs in another one."""
        with trials._local_processes(__name__, 1) as executor:
            running = executor.submit(time.sleep, 600.0)
            while not running.running():
                time.sleep(0.01)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupt()


@pytest.mark.process
def test_killed_study_continues_and_leaves_no_process(tmp_path: Path, runs: Path) -> None:
    keep, count = tmp_path / "kept", 40
    program = (
        "import sys; from functools import partial; from pathlib import Path\n"
        "from sysid.trials import map_trials; from tests.sysid import test_trials\n"
        "if __name__ == '__main__':\n"
        f"    map_trials(partial(test_trials.slow, Path({str(runs)!r})), range({count}),"
        f" list[float], jobs=2, keep=Path({str(keep)!r}))\n"
    )
    script = tmp_path / "study.py"
    script.write_text(program, encoding="utf-8")
    source = str(Path(__file__).parents[2])
    study = subprocess.Popen([sys.executable, str(script)], env=os.environ | {"PYTHONPATH": source})
    deadline_s = time.monotonic() + TIMEOUT_S
    while not (keep.exists() and keep.read_bytes().count(b"\n") > 5):
        assert time.monotonic() < deadline_s
        time.sleep(0.01)
    study.kill()
    study.wait()
    settled = -1
    while settled != len(times_run(runs)):  # workers may finish the trial they are in
        settled = len(times_run(runs))
        time.sleep(0.5)
    kept = keep.read_bytes().count(b"\n")
    assert kept < count, "the study was to be killed before its end"
    assert settled < count, "the workers have ended too"
    found = map_trials(partial(slow, runs), range(count), list[float], jobs=2, keep=keep)
    assert found == [[value / 7.0] for value in range(count)]
    assert len(times_run(runs)) <= count + 2 + 2, "only unfinished trials were run again"
    lines = keep.read_text(encoding="utf-8").splitlines()[1:]
    keys = [json.loads(line)[0] for line in lines]
    assert len(keys) == len(set(keys)) == count
