"""Choice of one processor core for both processes of a simulated dive."""

import os
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest

from ground.simulation import affinity
from ground.simulation.processes import SimulatedVehicle, Simulation
from ground.simulation.subprocesses import ForkedProcess, ProcessFactory, SpawnedProcess

STATISTICS = """\
cpu  110 0 20 {sum} 0 0 0 0 0 0
cpu0 80 0 10 {first} 5 0 0 0 0 0
cpu1 30 0 10 {second} 0 0 0 0 0 0
intr 12 0 1
"""
"""The head of /proc/stat (proc_stat(5)): user, nice, system, idle, iowait, ..."""


@pytest.fixture
def two_cores(monkeypatch: pytest.MonkeyPatch) -> None:
    """Cores 0 and 1, on which no dive runs yet."""
    monkeypatch.setattr(affinity, "_dives_on", Counter())
    monkeypatch.setattr(affinity, "cores", lambda: [0, 1])


@pytest.fixture
def statistics(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Replace the CPU statistics of the system; they change when `sleep` is called."""
    path = tmp_path / "stat"
    path.write_text(STATISTICS.format(sum=200, first=100, second=100))
    monkeypatch.setattr(affinity, "STATISTICS", path)
    return path


def loads(monkeypatch: pytest.MonkeyPatch, path: Path, first: int, second: int) -> None:
    """Let both cores be idle for so many ticks during the sample."""
    text = STATISTICS.format(sum=200 + first + second, first=100 + first, second=100 + second)
    monkeypatch.setattr(time, "sleep", lambda _: path.write_text(text))


def test_idle_ticks_are_read_for_each_core() -> None:
    assert affinity.idle_ticks(STATISTICS.format(sum=7, first=3, second=4)) == {0: 3 + 5, 1: 4}


@pytest.mark.usefixtures("two_cores")
@pytest.mark.parametrize(("first", "second", "chosen"), [(5, 0, 0), (0, 5, 1)])
def test_take_core_chooses_the_least_loaded(
    first: int, second: int, chosen: int, statistics: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    loads(monkeypatch, statistics, first, second)
    assert affinity.take_core() == chosen


@pytest.mark.usefixtures("two_cores")
def test_take_core_with_a_dive_on_the_idle_core_takes_the_other(
    statistics: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    loads(monkeypatch, statistics, 5, 0)
    assert [affinity.take_core() for _ in range(2)] == [0, 1]
    affinity.release_core(1)
    assert affinity.take_core() == 1


@pytest.mark.usefixtures("two_cores")
def test_take_core_without_statistics_takes_any(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(affinity, "STATISTICS", Path("/absent"))
    assert {affinity.take_core(), affinity.take_core()} == {0, 1}


def test_take_core_where_cores_are_unknown_takes_none(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(affinity, "cores", list)
    assert affinity.take_core() is None


def test_pin_of_a_process_that_has_ended_does_nothing() -> None:
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()
    affinity.pin(ended.pid, 0)


@pytest.fixture(params=[SpawnedProcess, ForkedProcess])
def simulated(request: pytest.FixtureRequest) -> Iterator[SimulatedVehicle]:
    start: ProcessFactory = request.param
    with SimulatedVehicle(Simulation(), start=start) as vehicle:
        yield vehicle


@pytest.mark.process
@pytest.mark.skipif(not affinity.cores(), reason="the system does not list its cores")
def test_simulated_vehicle_runs_on_one_core(simulated: SimulatedVehicle) -> None:
    ours = affinity.cores()
    simulated.connect().close()
    programs = (simulated._sitl, simulated._autopilot)
    pids = [program._child._process.pid for program in programs]  # type: ignore[attr-defined]
    sitl, autopilot = (os.sched_getaffinity(pid) for pid in pids)
    assert sitl == autopilot
    assert len(sitl) == 1
    assert sitl <= set(ours)
    assert affinity.cores() == ours, "the process that records stays free to run anywhere"


@pytest.mark.process
@pytest.mark.skipif(len(affinity.cores()) < 2, reason="needs two cores")
def test_two_simulated_vehicles_run_on_different_cores() -> None:
    with SimulatedVehicle(Simulation()) as one, SimulatedVehicle(Simulation()) as other:
        taken = {one._core, other._core}
        assert len(taken) == 2
    assert not any(affinity._dives_on[core] for core in affinity.cores()), "given back"


@pytest.mark.skipif(len(affinity.cores()) < 2, reason="needs two cores")
def test_recorder_keeps_to_cores_without_dive(monkeypatch: pytest.MonkeyPatch) -> None:
    usable = affinity.cores()
    monkeypatch.setattr(affinity, "_dives_on", Counter({usable[0]: 1}))
    with affinity.restrict_to_free_cores():
        assert affinity.cores() == usable[1:]
    assert affinity.cores() == usable


def test_recorder_uses_all_cores_if_each_has_a_dive(monkeypatch: pytest.MonkeyPatch) -> None:
    usable = affinity.cores()
    monkeypatch.setattr(affinity, "_dives_on", Counter(usable))
    with affinity.restrict_to_free_cores():
        assert affinity.cores() == usable
