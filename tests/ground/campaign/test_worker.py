"""Worker process: results, exceptions and stopping."""

import math
import os
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from ground.campaign.refit import read_log
from ground.campaign.worker import Worker
from mavlink_io.errors import InputError, OperationError


@pytest.fixture
def worker() -> Iterator[Worker]:
    with Worker() as one:
        yield one


def test_worker_runs_functions_in_other_process(worker: Worker) -> None:
    first, second = worker.call(os.getpid), worker.call(os.getpid)
    assert first == second != os.getpid()


def test_worker_exception_is_raised_in_caller(worker: Worker, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"none\.mcap") as refused:
        worker.call(read_log, tmp_path / "none.mcap")
    assert not hasattr(refused.value, "__notes__")  # each is a line of the error
    assert worker.call(math.sqrt, 4.0) == 2.0


def test_worker_defect_has_the_traceback_of_its_process(worker: Worker) -> None:
    with pytest.raises(ValueError, match="math domain error") as failed:
        worker.call(math.sqrt, -1.0)
    assert "in _call" in failed.value.__notes__[0]


def test_worker_end_of_process_is_an_error(worker: Worker) -> None:
    with pytest.raises(OperationError, match="process of _exit ended"):
        worker.call(os._exit, 3)


def test_worker_stop_during_call() -> None:
    worker = Worker()
    with ThreadPoolExecutor(1) as pool:
        asked = pool.submit(worker.call, time.sleep, 600.0)
        time.sleep(0.1)
        worker.stop()
        with pytest.raises(OperationError):
            asked.result(timeout=60.0)


def test_worker_calls_of_threads_take_turns(worker: Worker) -> None:
    with ThreadPoolExecutor(4) as pool:
        results = list(pool.map(lambda number: worker.call(math.sqrt, number), range(40)))
    assert results == [math.sqrt(number) for number in range(40)]
