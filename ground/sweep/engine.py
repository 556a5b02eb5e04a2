"""Engines of a sweep: processes of this machine, or a cluster of dask.distributed."""

import logging
from collections.abc import Iterator
from concurrent.futures import CancelledError, Executor
from contextlib import contextmanager
from functools import partial
from importlib import import_module
from typing import Any

from mavlink_io.errors import InputError
from sysid.trials import Engine, TrialsError

CONNECT_TIMEOUT_S = 30.0
"""Time to wait for the scheduler of a cluster."""

CLUSTER_LOGGERS = ("distributed", "distributed.client", "tornado.application", "asyncio")
"""Loggers that print a stack where a scheduler dies, each from a thread of its own."""


def parse(text: str) -> Engine | None:
    """Return the engine of the option `--engine`.

    Parameters
    ----------
    text : str
        `local`, or `dask=ADDRESS` with the address of a scheduler.

    Returns
    -------
    Engine or None
        None for processes of this machine.

    Raises
    ------
    InputError
        There is no such engine, or dask.distributed is not installed.
    """
    kind, _, address = text.partition("=")
    if text == "local":
        return None
    if kind != "dask" or not address:
        raise InputError(f"--engine {text}: must be local, or dask=ADDRESS as dask=tcp://HOST:8786")
    try:
        distributed = import_module("distributed")
    except ImportError:
        raise InputError(
            f"--engine {text}: dask.distributed is not installed; pip install 'caribou-auv[dask]'"
        ) from None
    return partial(_cluster, distributed, address)


@contextmanager
def _cluster(distributed: Any, address: str, jobs: int) -> Iterator[Executor]:
    """Connect to a cluster, which decides on the number of processes.

    A dead worker is replaced by the scheduler, which sends its trials to another one. A dead
    scheduler cancels all trials, which is reported here and not by dask, with its stack.
    """
    for name in CLUSTER_LOGGERS:
        logging.getLogger(name).setLevel(logging.CRITICAL)
    try:
        client = distributed.Client(address, timeout=CONNECT_TIMEOUT_S, set_as_default=False)
    except (OSError, TimeoutError, ValueError) as error:
        raise InputError(f"--engine dask={address}: no scheduler answers: {error}") from None
    with client:  # whose end cancels what it has not received
        try:
            yield client.get_executor(pure=False)
        except (CancelledError, distributed.CancelledError, distributed.KilledWorker) as error:
            raise TrialsError(
                f"--engine dask={address}: the cluster ended the sweep:"
                f" {type(error).__name__}; what was computed is kept, run the command again"
            ) from None
