"""The pure parts of the speed benchmark, and its processes."""

import io
import subprocess
import sys
from pathlib import Path

import pytest
from msgspec.structs import replace

from benchmarks.__main__ import known_results
from benchmarks.identification import vehicles
from benchmarks.identification.convergence import CONVERGENCE
from benchmarks.identification.outside import OUTSIDE, PRIORS
from benchmarks.speed import fleet, machine, ping_pong, results, studies
from benchmarks.speed.campaigns import Stages
from benchmarks.speed.fleet import Window
from benchmarks.speed.machine import ProcessEntry, ProcessorTimes
from benchmarks.speed.measures import MEASURES
from benchmarks.speed.results import Results
from benchmarks.speed.rows import ROWS, Mode
from benchmarks.speed.session import Session
from benchmarks.study import Cell
from ground.client.flight import FlightProgress
from mavlink_io.errors import InputError, OperationError
from tests.helpers.display import shown_on


def test_every_row_is_measured_by_one_function() -> None:
    measured = [name for names in MEASURES for name in names]
    assert sorted(measured) == sorted(ROWS)


def test_study_time_is_that_of_all_trials_on_all_cores() -> None:
    # 10 trials of 1 s on two cores: 5 s; each core computes for 2 s what is needed once
    assert studies.study_s([(3.0, 1.0, 10)], cores=2) == 7.0
    assert studies.study_s([(0.9, 1.0, 10), (1.0, 1.0, 4)], cores=2) == 7.0


def test_study_of_identification_measures_own_cases_of_cells(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kinds = list[tuple[Cell, str]]()

    def measure(session: Session, row: str, found: list[tuple[Cell, str]], first_s: float) -> None:
        kinds.extend(found)

    monkeypatch.setattr(studies, "measure_kinds", measure)
    studies.measure_sysid(Session(tmp_path))
    assert [case for cell, case in kinds if cell is OUTSIDE] == list(PRIORS)
    own = [case.name for case in vehicles.cases()]
    assert [case for cell, case in kinds if cell is CONVERGENCE] == own


def test_study_is_computed_from_two_trials_of_each_kind(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    seeds: list[tuple[str, int]] = []

    def trial(case: str, seed: int) -> list[float]:
        seeds.append((case, seed))
        return [0.0]

    cell = Cell("cell", "about", trial, lambda case, rows: [], runs=50)
    measured = studies.measure_kinds(
        Session(tmp_path), "study-sysid", [(cell, "a"), (cell, "b")], first_s=60.0
    )
    assert seeds == [("a", 1), ("a", 2), ("b", 1), ("b", 2)]
    (sample,) = measured.samples
    assert sample == pytest.approx(1.0, abs=0.01)  # minutes before the trials
    assert measured.note == "computed from two trials of each of 2 kinds; the study has 100"
    assert list(measured.details) == ["cell: processor time, min"]
    assert "2 of 2: cell, b: 0.00 s a trial, 50 trials" in capsys.readouterr().err


def test_possible_speed_is_linear_until_cores_are_full() -> None:
    alone = Window(speed=100.0, cpu_s=1.25)
    speeds = [fleet.possible_speed(count, alone, cores=4) for count in (1, 2, 3, 4, 8)]
    # 12.5 ms of processor time per vehicle second: four cores carry 320 vehicle seconds a second
    assert speeds == pytest.approx([100.0, 200.0, 300.0, 320.0, 320.0])


def test_possible_speed_in_real_time_is_number_of_vehicles() -> None:
    alone = Window(speed=0.98, cpu_s=0.098)
    assert fleet.possible_speed(8, alone, cores=2, wanted=1.0) == pytest.approx(8.0)
    assert fleet.possible_speed(40, alone, cores=2, wanted=1.0) == pytest.approx(20.0)


def test_stages_end_at_first_result() -> None:
    stages = Stages()
    for line in ("flying", "writing the report", "steady error, 95 %", "heading"):
        stages.mark(line)
    walls = [name for name in stages.times_s() if name.endswith("wall time, s")]
    assert walls == [
        f"{name}: wall time, s" for name in ("starting", "flying", "writing the report")
    ]


def test_progress_of_a_dive_is_no_stage() -> None:
    page, stages = io.StringIO(), Stages()
    shown = shown_on(page)
    shown.watch_named("prototype/trim", FlightProgress(3, 5, 10.0, 0.1, 0.3, 351.0))
    shown.show_fraction("8 of 16 dives", 0.5)
    for line in ("prototype flight: measuring the trims", *page.getvalue().splitlines()):
        stages.mark(line)
    stages.mark("steady error, 95 %")
    assert len(page.getvalue().splitlines()) == 2
    assert {name.rpartition(": ")[0] for name in stages.times_s()} == {
        "starting",
        "prototype flight: measuring the trims",
    }


def test_descendants_are_processes_below_one() -> None:
    parents = {1: 0, 10: 1, 11: 10, 12: 11, 20: 1}
    table = {pid: ProcessEntry(parent, "", 0.0) for pid, parent in parents.items()}
    assert sorted(machine.descendants(table, 10)) == [10, 11, 12]
    assert machine.descendants(table, 99) == {}


def test_peak_memory_is_read_from_process_status() -> None:
    # proc_pid_status(5) counts in KiB
    status = "Name:\tsitl\nVmHWM:\t  125000 kB\nVmRSS:\t  1 kB\n"
    assert machine.peak_mb(status) == pytest.approx(128.0)
    assert machine.peak_mb("Name:\tzombie\n") is None


def test_other_cores_are_all_less_own() -> None:
    began = ProcessorTimes(wall_s=0.0, all_s=100.0, own_s=1.0)
    assert machine.other_cores(began, ProcessorTimes(10.0, 118.0, 11.0)) == pytest.approx(0.8)
    # the clocks of both counts tick at different moments: never negative
    assert machine.other_cores(began, ProcessorTimes(10.0, 110.0, 11.1)) == 0.0
    assert machine.other_cores(began, ProcessorTimes(10.0, None, 11.0)) is None
    assert machine.other_cores(began, ProcessorTimes(0.01, 100.03, 1.0)) is None


def test_some_rows_on_another_machine_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "idle.json"
    other = replace(machine.describe(), cores=64)
    results.write(Results(Mode.IDLE, other, ()), path)
    with pytest.raises(InputError, match="was measured with another machine, version or mode"):
        known_results(path, Mode.IDLE, whole=False)
    assert known_results(path, Mode.IDLE, whole=True).machine == machine.describe()


def test_known_results_are_those_of_this_machine(tmp_path: Path) -> None:
    path = tmp_path / "idle.json"
    assert known_results(path, Mode.BUSY, whole=False).figures == ()
    kept = Results(Mode.IDLE, machine.describe(), ())
    results.write(kept, path)
    assert known_results(path, Mode.IDLE, whole=False) == kept


def test_vehicles_are_judged_until_they_fill_more_cores_than_there_are() -> None:
    alone = Window(speed=100.0, cpu_s=1.25)
    judged = [fleet.is_within_cores(count, alone, cores=2) for count in (1, 2, 4, 8)]
    assert judged == [True, True, False, False]
    slow = [fleet.is_within_cores(count, alone, cores=2, wanted=1.0) for count in (1, 2, 4, 8)]
    assert slow == [True, True, True, True]


@pytest.mark.process
def test_busy_loops_run_until_the_context_ends() -> None:
    with machine.busy_loops(2) as loops:
        assert [loop.poll() for loop in loops] == [None, None]
    assert all(loop.poll() is not None for loop in loops)


@pytest.mark.process
def test_run_returns_processor_time_and_lines() -> None:
    lines: list[str] = []
    cost = machine.run(["-c", "print('a'); print('b'); sum(range(10**6))"], on_line=lines.append)
    assert lines == ["a", "b"]
    assert cost.cpu_s > 0.0


@pytest.mark.process
def test_run_failure_is_one_line_with_last_output() -> None:
    with pytest.raises(OperationError, match=r"ended with status 3: no such thing$") as caught:
        machine.run(["-c", "import sys; print('no such thing'); sys.exit(3)"])
    assert "\n" not in str(caught.value)


@pytest.mark.process
def test_ping_pong_returns_a_round_trip() -> None:
    assert ping_pong.round_trip_us() > 0.0


@pytest.mark.process
@pytest.mark.parametrize(
    ("option", "message"),
    [
        (["--rows", "nothing"], "argument --rows: 'nothing' is no row; rows: dive-tick,"),
        (["--repetitions", "0"], "argument --repetitions: '0' is no number of 1 or more"),
    ],
)
def test_bad_option_is_refused(option: list[str], message: str) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "benchmarks", *option], capture_output=True, text=True, check=False
    )
    assert done.returncode == 2
    assert message in done.stderr.splitlines()[-1]


def test_number_of_vehicles_that_fails_is_noted_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def output_of(arguments: list[str]) -> str:
        count = int(arguments[2])
        if count == 8:
            raise OperationError("the vehicle is gone")
        return f"[{90.0 * min(count, 2)}, {1.0 * min(count, 2)}]"

    monkeypatch.setattr(machine, "output_of", output_of)
    monkeypatch.setattr(fleet, "usable_cores", lambda: 2)
    measured = fleet.measure_max(Session(tmp_path, repetitions=2))
    assert [each.case for each in measured] == [
        "1 vehicle",
        "2 vehicles",
        "4 vehicles",
        "8 vehicles",
    ]
    assert measured[1].samples == pytest.approx((100.0, 100.0))
    assert (measured[3].samples, measured[3].note) == ((), "not measured: the vehicle is gone")
