"""A worker computes in a process of its own, tells what failed, and is gone when it is told to."""

import math
import os
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import pytest

from ground.campaign.refit import read_log
from ground.campaign.worker import Worker
from ground.errors import InputError, OperationError


@pytest.fixture
def worker() -> Iterator[Worker]:
    with Worker() as one:
        yield one


def test_it_computes_elsewhere_and_can_be_asked_again(worker: Worker) -> None:
    first, second = worker.call(os.getpid), worker.call(os.getpid)
    assert first == second != os.getpid()


def test_what_it_raises_is_raised_here(worker: Worker, tmp_path) -> None:
    with pytest.raises(InputError, match=r"none\.mcap"):
        worker.call(read_log, tmp_path / "none.mcap")
    assert worker.call(math.sqrt, 4.0) == 2.0


def test_its_death_is_a_failure_that_names_what_it_did(worker: Worker) -> None:
    with pytest.raises(OperationError, match="process of _exit ended"):
        worker.call(os._exit, 3)


def test_it_can_be_stopped_at_work() -> None:
    worker = Worker()
    with ThreadPoolExecutor(1) as pool:
        asked = pool.submit(worker.call, time.sleep, 600.0)
        time.sleep(0.1)
        worker.stop()
        with pytest.raises(OperationError):
            asked.result(timeout=60.0)
