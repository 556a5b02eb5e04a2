"""The soak rows run: a few cases of each, and results that continue."""

import math
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from types import SimpleNamespace

import pytest

from benchmarks.safety import cases, flight
from mavlink_io.frames import quaternion_from_euler
from tests.soak import dives
from tests.soak.__main__ import ROWS
from tests.soak.row import Batch, Result, Row

CASES = {"faults": 1, "deflection": 4, "frames": 300, "files": 2, "protocols": 4}


@pytest.mark.parametrize("name", CASES)
def test_row_holds_over_its_first_cases(name: str) -> None:
    row = ROWS[name]
    # in a process of its own, whose peak of memory is that of the row
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        batch = pool.submit(row.run, 0, CASES[name]).result()
    assert row.holds(batch.counts), batch.failures
    assert row.describe(batch.counts)


def test_flips_of_formats_with_checksum_are_never_silent() -> None:
    counts = ROWS["flips"].run(0, 8).counts
    assert counts["flips"] == 32
    for name in ("mcap", "tlog"):
        assert not counts.get(f"silent {name}")
        assert not counts.get(f"hidden {name}")


def count_cases(first: int, count: int) -> Batch:
    batch = Batch()
    for case in range(first, first + count):
        batch.add("cases")
        batch.add("max case", case)
        if case == 3:
            batch.fail(case, "three")
    return batch


def test_result_continues_where_it_was_interrupted(tmp_path: Path) -> None:
    row = Row("t", 100, 2, count_cases, lambda c: "", lambda c: True, "")
    Result(tmp_path / "r.json").extend(row, 3)
    result = Result(tmp_path / "r.json")
    result.extend(row, 7)
    assert result.cases == 7
    assert result.batch.counts == {"cases": 7, "max case": 6, "failures": 1}
    assert result.batch.failures == ["case 3: three"]


def test_faults_row_has_each_fault_vehicle_and_seed_once() -> None:
    drawn = {
        (case.name, case.vehicle, case.seed)
        for case in map(dives.fault_case, range(dives.FAULTS.full_size))
    }
    assert len(drawn) == dives.FAULTS.full_size
    assert {seed for _, _, seed in drawn} == set(range(dives.SEEDS))


@pytest.mark.parametrize(
    "case",
    [
        dives.fault_case(1000),
        cases.pair(3),
        cases.random_mission(5),
        cases.parameter_dives()[7],
    ],
)
def test_printed_command_gives_the_same_dive(case: cases.Case) -> None:
    name, *options = cases.command(case).split()[3:]
    given = dict(zip(options[::2], options[1::2], strict=True))
    vehicle, seed = given.get("--vehicle", "caribou_truth"), int(given.get("--seed", 0))
    assert cases.find_case(name, vehicle, seed) == case


@pytest.mark.parametrize(
    ("pitch_deg", "depth_m", "is_out"),
    [(0.0, 0.26, True), (0.0, 0.28, False), (-50.0, 1.4, True), (50.0, 1.5, False)],
)
def test_hull_on_end_breaks_surface(pitch_deg: float, depth_m: float, is_out: bool) -> None:
    """Caribou: radius 0.27 m; at 50 deg its end reaches 1.15 m + 0.27 m above the origin."""
    hull = SimpleNamespace(half_length_m=1.7715, radius_m=0.2667)
    attitude = quaternion_from_euler(0.0, math.radians(pitch_deg), 0.0)
    truth = SimpleNamespace(position_ned_m=(0.0, 0.0, depth_m), attitude_q=attitude)
    assert flight.breaks_surface(truth, hull) is is_out
