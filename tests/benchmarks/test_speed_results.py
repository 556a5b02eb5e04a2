"""The record of a speed run: medians, ratios, targets, and the file that keeps them."""

from pathlib import Path

import msgspec
import pytest

from benchmarks.speed import results
from benchmarks.speed.results import Conditions, Figure, Machine, Measurement, Reference, Results
from benchmarks.speed.rows import ROWS, Mode
from mavlink_io.errors import InputError

CONDITIONS = Conditions("2026-01-02T03:04:05Z", "abc1234", 0.5, 1.5, 0.0)
MACHINE = Machine(2, "a processor", "Linux x86_64", "3.11.7", "2.0", "0.68")


def figure(measured: Measurement, mode: Mode = Mode.IDLE) -> Figure:
    return results.to_figure(measured, mode, CONDITIONS)


def of_rows(*names: str, value: float = 1.0) -> Results:
    figures = tuple(figure(Measurement(name, (value,))) for name in names)
    return Results(Mode.IDLE, MACHINE, figures)


def test_figure_has_median_and_range_of_samples() -> None:
    made = figure(Measurement("campaign", (30.0, 20.0, 24.0)))
    assert (made.value, made.lowest, made.highest, made.repetitions) == (24.0, 20.0, 30.0, 3)


def test_ratio_of_pairs_is_median_of_ratios() -> None:
    # the machine was half as fast in the second repetition: both sides of the pair saw it
    assert results.ratio_of((10.0, 20.0, 12.0), (5.0, 10.0, 6.0)) == 2.0


def test_ratio_of_unequal_counts_is_ratio_of_medians() -> None:
    assert results.ratio_of((1.0, 2.0, 9.0), (4.0,)) == 0.5


def test_ratio_target_judges_ratio_not_value() -> None:
    floor = Reference("floor", (13.0,))
    assert figure(Measurement("dive-tick", (60.0,), floor)).met is True
    assert figure(Measurement("dive-tick", (70.0,), floor)).met is False


def test_busy_target_differs_from_idle_target() -> None:
    measured = Measurement("dive-tick", (70.0,), Reference("floor", (10.0,)))
    assert figure(measured, Mode.BUSY).met is True
    assert figure(measured, Mode.BUSY).target == "ratio <= 8"


def test_minimum_target_is_met_at_limit_and_above() -> None:
    limit = ROWS["dive-speed"].limit
    assert limit is not None
    assert figure(Measurement("dive-speed", (limit,))).met is True
    assert figure(Measurement("dive-speed", (limit - 1.0,))).met is False


def test_figure_without_samples_has_reason_and_no_verdict() -> None:
    made = figure(Measurement("closed-loop-20ms", (), note="not built"))
    assert (made.value, made.ratio, made.met) == (None, None, None)
    assert results.format_value(made) == "not built"


def test_figure_without_target_has_no_verdict() -> None:
    made = figure(Measurement("recorder", (2.0,), Reference("append", (0.5,))))
    assert (made.ratio, made.target, made.met) == (4.0, "", None)


def test_case_that_is_not_judged_has_value_alone() -> None:
    made = figure(Measurement("campaign", (99.0,), is_judged=False))
    assert (made.value, made.target, made.met) == (99.0, "", None)


def test_verdict_is_of_exact_number_not_of_rounded_one() -> None:
    limit = ROWS["campaign"].limit
    assert limit is not None
    made = figure(Measurement("campaign", (limit * 1.00001,)))
    assert (made.value, made.met) == (limit, False)


def test_file_keeps_results(tmp_path: Path) -> None:
    path = tmp_path / "new" / "idle.json"
    kept = Results(
        Mode.BUSY,
        MACHINE,
        (
            figure(Measurement("help", (0.2,), Reference("bare", (0.1,)), case="sitl")),
            figure(Measurement("closed-loop-20ms", (), note="not built")),
        ),
    )
    results.write(kept, path)
    assert results.read(path) == kept


def test_file_of_another_kind_is_refused_in_one_line(tmp_path: Path) -> None:
    path = tmp_path / "idle.json"
    path.write_text("{}", encoding="utf-8")
    with pytest.raises(InputError, match=r"idle\.json: is no file of .python -m benchmarks.") as e:
        results.read(path)
    assert "\n" not in str(e.value)


def test_file_of_other_format_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "idle.json"
    results.write(msgspec.structs.replace(of_rows("help"), format=99), path)
    with pytest.raises(InputError, match="format = 99; this version reads format 1"):
        results.read(path)


def test_missing_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"none\.json: No such file"):
        results.read(tmp_path / "none.json")


def test_merge_replaces_measured_rows_in_table_order() -> None:
    merged = results.merge(of_rows("campaign", "help", value=1.0), of_rows("dive-tick", "help"))
    assert [each.row for each in merged.figures] == ["dive-tick", "campaign", "help"]
    newer = results.merge(of_rows("help", value=1.0), of_rows("help", value=2.0))
    assert [each.value for each in newer.figures] == [2.0]


def test_table_has_a_line_per_figure_and_marks_misses() -> None:
    missed = figure(Measurement("campaign", (99.0,), Reference("floor", (3.0,))))
    head, line = results.as_table([missed]).splitlines()
    assert head.split() == ["figure", "case", "value", "floor", "or", "peer", "ratio", "target"]
    assert line.split() == ["campaign", "99", "s", "floor:", "3", "s", "33", "<=", "25", "MISSED"]
