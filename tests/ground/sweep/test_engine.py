"""Engines of a sweep: option, a cluster that is missing or ends, and a real cluster of dask."""

import re
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError, Executor, Future
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from ground.sweep import engine, plan_file, run
from mavlink_io.errors import InputError
from sysid.trials import TrialsError, map_trials
from tests.helpers.subprocesses import TIMEOUT_S, Process, process


def half(value: int) -> float:
    return value / 2.0


class Inline(Executor):
    """An executor that runs each function at once, and is cut off after two."""

    def __init__(self, until: int) -> None:
        self._until = until

    def submit(self, function: Callable[..., Any], /, *given: Any, **named: Any) -> Future[Any]:
        future: Future[Any] = Future()
        if self._until:
            self._until -= 1
            future.set_result(function(*given, **named))
        else:
            future.cancel()
            future.set_running_or_notify_cancel()
        return future


@pytest.fixture
def cluster(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """Return a stand-in for dask.distributed whose cluster runs two trials."""

    class Client:
        def __init__(self, address: str, **options: Any) -> None:
            if "nowhere" in address:
                raise OSError("Timed out trying to connect")

        def __enter__(self) -> "Client":
            return self

        def __exit__(self, *error: object) -> None: ...

        def get_executor(self, *, pure: bool) -> Executor:
            return Inline(until=2)

    module = ModuleType("distributed")
    module.Client = Client  # type: ignore[attr-defined]
    module.CancelledError = CancelledError  # type: ignore[attr-defined]
    module.KilledWorker = RuntimeError  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "distributed", module)
    return module


def test_parse_local_is_no_other_engine() -> None:
    assert engine.parse("local") is None


@pytest.mark.parametrize("text", ["dask", "dask=", "ray=auto", ""])
def test_parse_unknown_engine_is_refused(text: str) -> None:
    with pytest.raises(InputError, match="must be local, or dask=ADDRESS"):
        engine.parse(text)


def test_parse_without_dask_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(InputError, match=r"pip install 'caribou-auv\[dask\]'"):
        engine.parse("dask=tcp://host:8786")


def test_trials_run_on_the_cluster(cluster: ModuleType) -> None:
    chosen = engine.parse("dask=tcp://host:8786")
    assert map_trials(half, [1, 2], float, engine=chosen) == [0.5, 1.0]


def test_cluster_that_ends_keeps_what_was_computed(cluster: ModuleType, tmp_path: Path) -> None:
    chosen, keep = engine.parse("dask=tcp://host:8786"), tmp_path / "kept"
    with pytest.raises(TrialsError, match="the cluster ended the sweep: CancelledError"):
        map_trials(half, range(4), float, engine=chosen, keep=keep)
    assert map_trials(half, range(4), float, engine=chosen, keep=keep) == [0.0, 0.5, 1.0, 1.5]


def test_scheduler_that_does_not_answer_is_one_line(cluster: ModuleType) -> None:
    with pytest.raises(InputError, match="dask=tcp://nowhere:1: no scheduler answers"):
        map_trials(half, [1], float, engine=engine.parse("dask=tcp://nowhere:1"))


@pytest.mark.process
def test_dask_cluster_gives_the_same_digest(folder: Path) -> None:
    distributed = pytest.importorskip("distributed")
    request = plan_file.load(folder / "plan.toml")
    local = run.run(request, folder / "local", jobs=1)
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=None
    ) as workers:
        chosen = engine.parse(f"dask={workers.scheduler_address}")
        on_cluster = run.run(request, folder / "cluster", jobs=1, engine=chosen)
    assert on_cluster["digest"] == local["digest"]


@contextmanager
def started_cluster() -> Iterator[tuple[str, Process]]:
    """Start a scheduler and a worker as programs; yield the address and the scheduler."""
    options = ("--host", "127.0.0.1", "--no-dashboard")
    with process("-m", "dask", "scheduler", "--port", "0", *options) as scheduler:
        while not (match := re.search(r"Scheduler at: +(\S+)", scheduler.wait_for_line())):
            assert scheduler.running
        with process("-m", "dask", "worker", match[1], "--nthreads", "1", "--no-nanny", *options):
            yield match[1], scheduler


@pytest.mark.process
@pytest.mark.timeout(4.0 * TIMEOUT_S)
def test_killed_scheduler_is_one_line_and_the_sweep_continues(folder: Path) -> None:
    pytest.importorskip("distributed")
    plan = folder / "plan.toml"
    plan.write_text(plan.read_text().replace("samples = 6", "samples = 80"))  # 160 dives
    request = plan_file.load(plan)
    undisturbed = run.run(request, folder / "undisturbed", jobs=1)
    parts = folder / "killed" / "parts"
    words = ["-m", "ground", "sweep", str(plan), "--out", str(folder / "killed"), "--json"]
    with (
        started_cluster() as (address, scheduler),
        process(*words, "--engine", f"dask={address}") as study,
    ):
        while not any(parts.glob("*.csv")):
            assert study.running
            time.sleep(0.01)
        scheduler.kill()
        ended = study.finish()
    assert ended.status == 1
    assert re.fullmatch(
        r"(sweep: .* dives\n)*ground: --engine dask=\S+: the cluster ended .*\n", ended.stderr
    )
    assert len(list(parts.glob("*.csv"))) < 160, "it was to be killed before its end"
    with started_cluster() as (address, _):
        chosen = engine.parse(f"dask={address}")
        continued = run.run(request, folder / "killed", jobs=1, engine=chosen)
    assert continued["digest"] == undisturbed["digest"]
