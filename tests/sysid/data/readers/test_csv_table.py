"""CSV files: columns and units, tests marked by a column, and errors that name line and column."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sysid.data import readers, segments
from sysid.data.dataset import LogError, VelocitySource
from sysid.data.readers.servo_channels import OutputOptions, ServoChannels
from sysid.data.runs import RATE_HZ, Run
from sysid.data.segments import MarkedInterval
from sysid.planes import Plane
from sysid.screening import proposals, screen
from tests.sysid.data.readers import files

COLUMNS = (
    "time_s,heading_deg,pitch_deg,r_degps,q_degps,rudder_deg,elevator_deg,thrust_pct,depth_m,test"
)


def rows(travel_deg: float = 12.0) -> list[str]:
    """Return the dive of the other formats as rows; depth in every fifth."""
    table = []
    for k, s in enumerate(files.samples()):
        inside = files.TEST[0] <= k / files.RATE_HZ < files.TEST[1]
        cells = [
            f"{s.time_s:.3f}",
            f"{math.degrees(s.yaw_rad) % 360.0:.5f}",
            f"{math.degrees(s.pitch_rad):.5f}",
            f"{math.degrees(s.yaw_rate_radps):.5f}",
            "0",
            f"{s.rudder * travel_deg:.4f}",
            f"{s.elevator * travel_deg:.4f}",
            f"{100.0 * s.thrust:.2f}",
            f"{s.depth_m:.4f}" if k % 5 == 0 else "",
            "rudder" if inside else "",
        ]
        table.append(",".join(cells))
    return table


def write(path: Path, header: str = COLUMNS, lines: list[str] | None = None) -> Path:
    text = ["# dive of a test", "# ACT_TRAVEL_DEG = 12", header, *(lines or rows())]
    path.write_text("\n".join(text) + "\n", encoding="utf-8")
    return path


def the_run(path: Path, options: OutputOptions | None = None) -> Run:
    log = readers.read(path, options or OutputOptions())
    known = replace(log, parameters={**log.parameters, segments.LOOP_RATE: RATE_HZ})
    (run,) = segments.cut_runs(known)
    return run


def test_csv_gives_the_run_of_the_other_formats(tmp_path: Path) -> None:
    run = the_run(write(tmp_path / "dive.csv"))
    testing = (run.time_s >= 0.0) & (run.time_s < 9.99)
    assert (run.plane, run.wave) == (Plane.YAW, "marked")
    assert run.magnitude_deg == pytest.approx(4.0, abs=1e-3)
    assert run.time_s[-1] == pytest.approx(10.0, abs=0.03)
    np.testing.assert_allclose(np.degrees(run.rudder_rad[testing]), 4.0, atol=1e-3)
    np.testing.assert_allclose(np.degrees(run.elevator_rad), 1.2, atol=1e-3)
    np.testing.assert_allclose(run.thrust, 0.58, atol=1e-6)
    np.testing.assert_allclose(np.degrees(run.r_radps[testing]), 3.0, atol=1e-4)
    turned = np.degrees(run.heading_rad - run.heading_rad[0])
    np.testing.assert_allclose(turned[testing], 3.0 * run.time_s[testing], atol=0.03)
    np.testing.assert_allclose(run.depth_m, 4.0 + 0.05 * (20.0 + run.time_s), atol=1e-3)
    assert math.degrees(run.travel_rad) == pytest.approx(12.0)
    (screening,) = screen([run])
    assert screening.reasons == ()


def test_csv_of_one_plane_in_radians_without_rates(tmp_path: Path) -> None:
    """A ship: heading and rudder only. The rate is the derivative of the heading."""
    lines = [
        f"{s.time_s},{s.yaw_rad},{s.rudder * 0.2},58,{'rudder' if s.rudder else ''}"
        for s in files.samples()
    ]
    path = write(tmp_path / "ship.csv", "time_s,heading_rad,rudder_rad,thrust_pct,test", lines)
    run = the_run(path)
    testing = (run.time_s >= 0.05) & (run.time_s < 9.9)
    np.testing.assert_allclose(np.degrees(run.r_radps[testing]), 3.0, atol=1e-6)
    np.testing.assert_array_equal(run.pitch_rad, 0.0)
    np.testing.assert_array_equal(run.depth_m, 0.0)
    (screening,) = screen([run])
    assert screening.reasons == ()


def test_csv_channels_reorder_and_reverse(tmp_path: Path) -> None:
    path = write(tmp_path / "dive.csv")
    run = the_run(path, OutputOptions(ServoChannels(-2, 1, 3)))
    np.testing.assert_allclose(np.degrees(run.rudder_rad), -1.2, atol=1e-3)
    with pytest.raises(LogError, match=r"dive\.csv: --servo-channels: a CSV file has the outputs"):
        readers.read(path, OutputOptions(ServoChannels(4, 1, 3)))


@pytest.mark.parametrize(
    ("header", "line", "said"),
    [
        (COLUMNS.replace("time_s", "t"), "", "line 3: no column time_s"),
        (COLUMNS.replace("thrust_pct", "thrust"), "", "no column thrust_pct"),
        (
            COLUMNS.replace("rudder_deg", "rudder").replace("depth_m", "depth"),
            "",
            "needs time_s, thrust_pct and the columns of a plane: heading_deg and rudder_deg, or",
        ),
        (COLUMNS.replace("q_degps", "r_radps"), "", "r is given in two units"),
        (COLUMNS.replace("q_degps", "r_degps"), "", "line 3: two columns 'r_degps'"),
        (COLUMNS, "101.0,1,x,0,0,0,0,58,4,", "line 4, column pitch_deg: 'x' is no number"),
        (COLUMNS, "101.0,1,2", "line 4: has 3 cells; column r_degps is missing"),
        (COLUMNS, ",1,2,0,0,0,0,58,4,", "line 4: no time_s; every row needs its time"),
        (COLUMNS, "1,1,2,0,0,0,0,58,4,fin", "column test: 'fin'; give rudder, elevator, both"),
    ],
)
def test_csv_errors_name_line_and_column(tmp_path: Path, header: str, line: str, said: str) -> None:
    path = write(tmp_path / "bad.csv", header, [line, *rows()[1:]] if line else None)
    with pytest.raises(LogError) as refused:
        readers.read(path)
    assert str(refused.value).startswith(f"{path}: {said}")
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("value", ["0", "-15", "nan", "inf", "150"])
def test_impossible_travel_is_refused(tmp_path: Path, value: str) -> None:
    path = write(tmp_path / "dive.csv")
    path.write_text(path.read_text().replace("DEG = 12", f"DEG = {value}"))
    with pytest.raises(LogError, match=rf"dive\.csv: ACT_TRAVEL_DEG = {value}; .* 0 and 90"):
        readers.read(path)


def test_parameter_that_is_no_number_is_refused_and_a_remark_is_not(tmp_path: Path) -> None:
    path = write(tmp_path / "dive.csv")
    path.write_text("# PILOT = Anna\n" + path.read_text())
    assert readers.read(path).parameters == {"ACT_TRAVEL_DEG": 12.0}
    path.write_text(path.read_text().replace("DEG = 12", "DEG = many"))
    with pytest.raises(LogError, match=r"line 3, ACT_TRAVEL_DEG: 'many' is no number"):
        readers.read(path)


def test_time_in_milliseconds_is_refused(tmp_path: Path) -> None:
    def in_ms(line: str) -> str:
        time_s, rest = line.split(",", 1)
        return f"{1000 * float(time_s):.0f},{rest}"

    path = write(tmp_path / "dive.csv", lines=[in_ms(line) for line in rows()])
    with pytest.raises(LogError, match=r"column time_s: rows are 20 s apart; give seconds"):
        readers.read(path)


def test_csv_without_rows_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "empty.csv"
    path.write_text(COLUMNS + "\n")
    with pytest.raises(LogError, match=r"empty\.csv: has no rows"):
        readers.read(path)


def test_csv_example_of_the_docs_is_read(tmp_path: Path) -> None:
    docs = Path(__file__).parents[4] / "docs" / "logs.md"
    blocks = docs.read_text(encoding="utf-8").split("```")[1::2]
    (example,) = [block for block in blocks if "time_s," in block]
    path = tmp_path / "docs.csv"
    path.write_text(example.strip() + "\n")
    log = readers.read(path)
    assert log.parameters == {"ACT_TRAVEL_DEG": 20.0}
    assert math.degrees(log.actuators.rudder_rad[-1]) == pytest.approx(4.0)


@pytest.mark.parametrize(
    ("source", "thrust_pct", "relative"),
    [
        (VelocitySource.COLUMN, 58, 0.8),
        (VelocitySource.COLUMN, 70, 1.0),
        (VelocitySource.BOTTOM_TRACK, 58, 1.0),
    ],
)
def test_speed_after_a_turn_is_relative_to_straight_flight(
    source: VelocitySource, thrust_pct: float, relative: float, tmp_path: Path
) -> None:
    """1.5 m/s until the first test ends and 1.2 m/s after it, until the second test ends.

    Other thrust, or a speed over ground: relative to the speed before the second test.
    """
    lines = [
        f"{0.04 * k:.2f},0,0,0,0,{3 * testing},0,{thrust_pct if k > 1000 else 58},4.0,"
        f"{'rudder' if testing else ''},{1.2 if k > 1000 else 1.5}"
        for k in range(2000)
        for testing in [750 <= k < 1000 or 1500 <= k < 1750]
    ]
    log = readers.read(write(tmp_path / "dive.csv", f"{COLUMNS},u_mps", lines))
    _, second = segments.cut_runs(replace(log, velocity=replace(log.velocity, source=source)))
    assert second.relative_speed is not None
    np.testing.assert_allclose(second.relative_speed, relative, atol=1e-6)


def test_speed_is_relative_to_that_before_the_test(tmp_path: Path) -> None:
    """1.5 m/s before the test and 1.2 m/s in it; every fifth row has a value."""
    lines = []
    for k, line in enumerate(rows()):
        speed = 1.2 if line.endswith("rudder") else 1.5
        lines.append(f"{line},{speed if k % 5 == 0 else ''}")
    run = the_run(write(tmp_path / "dive.csv", f"{COLUMNS},u_mps", lines))
    assert run.relative_speed is not None
    inside = (run.time_s > 2.0) & (run.time_s < 8.0)
    np.testing.assert_allclose(run.relative_speed[inside], 0.8, atol=1e-6)
    assert the_run(write(tmp_path / "without.csv")).relative_speed is None


@pytest.mark.parametrize("late_s", [0.0, 0.02])
def test_sampled_command_has_no_mean_delay(tmp_path: Path, late_s: float) -> None:
    """Commands of 50 Hz recorded at 25 Hz: a step lies within half a sample of its true time.

    A held command would be late by 0 and 20 ms, 10 ms in the mean.
    """
    step_s = 20.0 + late_s  # at a recorded sample, or between two of them
    lines = []
    for k in range(1000):
        t = 0.04 * k
        inside = step_s <= t < 30.0
        rudder = 4.0 if step_s <= t < 30.0 else 0.0
        lines.append(f"{t:.3f},0,0,0,0,{rudder},0,58,4,{'rudder' if inside else ''}")
    run = the_run(write(tmp_path / "slow.csv", lines=lines))
    rising = np.degrees(run.rudder_rad[run.time_s < 5.0]) / 4.0
    # Time of a step of the same area under the curve, on the grid of held samples.
    first_s = float(run.time_s[0]) + np.sum(1.0 - rising) / RATE_HZ
    start_s = 20.0 if late_s == 0.0 else 20.04  # first recorded row of the test
    assert first_s + start_s - step_s == pytest.approx(-0.01 + late_s, abs=1e-6)


def test_csv_other_separator_is_named(tmp_path: Path) -> None:
    """A spreadsheet in German or French writes semicolons and decimal commas."""
    lines = [line.replace(",", ";").replace(".", ",") for line in rows()]
    path = write(tmp_path / "dive.csv", COLUMNS.replace(",", ";"), lines)
    with pytest.raises(LogError, match=r"dive\.csv: line 3: cells are separated by semicolons"):
        readers.read(path, OutputOptions())


def test_csv_tabs_are_named(tmp_path: Path) -> None:
    path = write(tmp_path / "dive.csv", COLUMNS.replace(",", "\t"))
    with pytest.raises(LogError, match=r"line 3: cells are separated by tabs"):
        readers.read(path, OutputOptions())


def test_csv_time_in_another_unit_is_named(tmp_path: Path) -> None:
    path = write(tmp_path / "dive.csv", COLUMNS.replace("time_s", "time_ms"))
    with pytest.raises(LogError, match=r"no column time_s \(time in seconds\), but 'time_ms'"):
        readers.read(path, OutputOptions())


def test_csv_decimal_commas_do_not_shift_columns(tmp_path: Path) -> None:
    lines = rows()
    lines[4] = lines[4].replace(".", ",")
    with pytest.raises(LogError, match=r"line 8: has 1\d cells, the header 10; separate"):
        readers.read(write(tmp_path / "dive.csv", lines=lines), OutputOptions())


def test_csv_columns_without_a_name_are_ignored(tmp_path: Path) -> None:
    """As a spreadsheet writes columns that were emptied."""
    expected = the_run(write(tmp_path / "dive.csv"))
    run = the_run(write(tmp_path / "wide.csv", f"{COLUMNS},,", [f"{row},," for row in rows()]))
    np.testing.assert_array_equal(run.heading_rad, expected.heading_rad)


def test_csv_empty_cells_after_the_last_column_are_ignored(tmp_path: Path) -> None:
    path = write(tmp_path / "dive.csv", lines=[f"{line},," for line in rows()])
    assert the_run(path).plane == Plane.YAW


@pytest.mark.parametrize(
    ("column", "factor", "text"),
    [
        (7, 0.01, "column thrust_pct: values of 0.58; give percent of full thrust, not a fraction"),
        (7, 20.0, "column thrust_pct: values of 1160; at most 100 is possible in this unit"),
        (5, 50.0, "column rudder_deg: values of 200; at most 90 is possible in this unit"),
    ],
)
def test_csv_values_in_another_unit_are_refused(
    tmp_path: Path, column: int, factor: float, text: str
) -> None:
    lines = [line.split(",") for line in rows()]
    for cells in lines:
        cells[column] = f"{factor * float(cells[column]):.4f}"
    path = write(tmp_path / "dive.csv", lines=[",".join(cells) for cells in lines])
    with pytest.raises(LogError) as refused:
        readers.read(path, OutputOptions())
    assert str(refused.value) == f"{path}: {text}"


@pytest.mark.parametrize("sign", [-1.0, 0.0])
def test_csv_time_that_never_increases_is_named(tmp_path: Path, sign: float) -> None:
    lines = [line.split(",", 1) for line in rows()]
    text = [f"{sign * float(time_s):.3f},{rest}" for time_s, rest in lines]
    with pytest.raises(LogError, match=r"column time_s: never increases; give rows in the order"):
        readers.read(write(tmp_path / "dive.csv", lines=text), OutputOptions())


@pytest.mark.parametrize("value", ["999.0", "1e300", "-3"])
def test_single_wrong_time_leaves_out_its_row_only(tmp_path: Path, value: str) -> None:
    good = the_run(write(tmp_path / "good.csv"))
    lines = rows()
    lines[500] = f"{value},{lines[500].split(',', 1)[1]}"
    path = write(tmp_path / "bad.csv", lines=lines)
    log, content = readers.read(path), readers.load(path)
    assert log.attitude.time_s.size == len(lines) - 1
    text = "1 row is left out because time_s does not fit the rows around: line 504"
    assert log.damage == content.damage == f"{text} ({float(value):g})"
    (table,) = content.tables.values()
    assert table.time_s[-1] - table.time_s[0] == pytest.approx(files.SECONDS, abs=0.03)
    run = the_run(path)
    np.testing.assert_allclose(run.time_s, good.time_s)
    np.testing.assert_allclose(run.heading_rad, good.heading_rad, atol=1e-3)


def test_wrong_times_are_counted_and_three_lines_named(tmp_path: Path) -> None:
    lines = rows()
    for k in (100, 200, 300, 400):
        lines[k] = f"{999 + k},{lines[k].split(',', 1)[1]}"
    damage = readers.read(write(tmp_path / "bad.csv", lines=lines)).damage
    assert damage.startswith("4 rows are left out because time_s does not fit the rows around: ")
    assert damage.endswith(": line 104 (1099), line 204 (1199), line 304 (1299), ...")


@pytest.mark.parametrize("end", ["", "\0" * 512])
def test_last_line_that_is_cut_off_is_left_out(tmp_path: Path, end: str) -> None:
    """A logger that lost its power refused 330 s of good rows."""
    path = write(tmp_path / "dive.csv")
    whole = readers.read(path)
    text = path.read_text().rstrip("\n")
    path.write_text(text[: text.rindex(",", 0, text.rindex(","))] + end)
    log = readers.read(path)
    last_line = text.count("\n") + 1
    assert log.damage == f"line {last_line}, the last one, is cut off and left out"
    np.testing.assert_array_equal(log.attitude.time_s, whole.attitude.time_s[:-1])
    path.write_text(text)
    assert readers.read(path).damage == ""


def test_line_that_is_no_text_is_named(tmp_path: Path) -> None:
    path = write(tmp_path / "dive.csv")
    lines = path.read_bytes().split(b"\n")
    lines[41] += b"\xff"
    path.write_bytes(b"\n".join(lines))
    with pytest.raises(LogError, match=r"dive.csv: line 42: is no text in UTF-8"):
        readers.read(path)


def test_clock_that_jumps_to_utc_in_a_test_is_a_gap(tmp_path: Path) -> None:
    """The grid of a run, and that of the proposals, end at the jump."""
    lines = rows()
    jump = round((files.TEST[0] + 8.0) * files.RATE_HZ)
    for k in range(jump, len(lines)):
        time_s, rest = lines[k].split(",", 1)
        lines[k] = f"{float(time_s) + 1.7e9:.3f},{rest}"
    log = readers.read(write(tmp_path / "utc.csv", lines=lines))
    (run,) = segments.cut_runs(log)
    assert run.time_s[-1] == pytest.approx(8.0, abs=0.03)
    assert run.longest_gap_s == pytest.approx(1.7e9)
    (screening,) = screen([run])
    assert screening.reasons[0].startswith("gap: 1700000000")
    assert all(mark.stop_s - mark.start_s < 60.0 for mark in proposals.propose(log))
    (mark,) = segments.cut_runs(
        segments.without_tests(log), [MarkedInterval(120.0, 1.7e9 + 130.0, Plane.YAW)]
    )
    assert mark.longest_gap_s == pytest.approx(1.7e9)


def test_run_with_a_short_gap_keeps_its_grid(tmp_path: Path) -> None:
    lines = rows()
    first = round((files.TEST[0] + 1.0) * files.RATE_HZ)
    del lines[first : first + 8 * files.RATE_HZ]
    run = the_run(write(tmp_path / "gap.csv", lines=lines))
    assert run.time_s[-1] == pytest.approx(10.0, abs=0.03)
    assert run.longest_gap_s == pytest.approx(8.02, abs=1e-3)


def with_cells(column: int, value: str, every: int = 1) -> list[str]:
    """Return the rows with another value in a column, from the first on."""
    lines = [line.split(",") for line in rows()]
    for cells in lines[::every]:
        cells[column] = value
    return [",".join(cells) for cells in lines]


@pytest.mark.parametrize(
    ("column", "value", "every", "text"),
    [
        (
            1,
            "1e300",
            9999,
            "line 4, column heading_deg: 1e+300 is impossible; give -1e+06 to 1e+06",
        ),
        (3, "1e200", 9999, "line 4, column r_degps: 1e+200 is impossible; give -4000 to 4000, or"),
        (2, "inf", 9999, "line 4, column pitch_deg: 'inf' is impossible; leave a cell without a"),
        (7, "1e9", 9999, "line 4, column thrust_pct: 1e+09 is impossible; give -1000 to 1000"),
        (8, "-30", 50, "line 4, column depth_m: -30 is impossible; give -10 to 12000, or leave"),
        (8, "-3", 1, "column depth_m: values of -3; depth is positive down, and at least -1"),
    ],
)
def test_impossible_value_names_line_column_and_range(
    tmp_path: Path, column: int, value: str, every: int, text: str
) -> None:
    path = write(tmp_path / "bad.csv", lines=with_cells(column, value, every))
    with pytest.raises(LogError) as refused:
        readers.read(path)
    assert str(refused.value).startswith(f"{path}: {text}")


@pytest.mark.parametrize(
    ("value", "text"),
    [
        ("1500", r"line 4, column u_mps: 1500 is impossible; give -60 to 60"),
        ("0", r"column u_mps: no value above 0; give the speed forward as positive"),
        ("-1.5", r"column u_mps: no value above 0; give the speed forward as positive"),
    ],
)
def test_impossible_speed_is_refused(tmp_path: Path, value: str, text: str) -> None:
    path = write(tmp_path / "dive.csv", f"{COLUMNS},u_mps", [f"{line},{value}" for line in rows()])
    with pytest.raises(LogError, match=text):
        readers.read(path)


@pytest.mark.parametrize("value", ["nan", "1e9", "-91"])
def test_impossible_trim_is_refused(tmp_path: Path, value: str) -> None:
    path = write(tmp_path / "dive.csv")
    path.write_text(f"# TRIM_RUD_DEG = {value}\n{path.read_text()}")
    with pytest.raises(LogError, match=r"TRIM_RUD_DEG = .*; a trim lies between -90 and 90 deg"):
        readers.read(path)


@pytest.mark.parametrize("cell", ["", "nan"])
def test_column_without_values_counts_as_missing(tmp_path: Path, cell: str) -> None:
    """As in state.csv of a log without a velocity."""
    lines = [f"{line},{cell},{cell}" for line in rows()]
    path = write(tmp_path / "dive.csv", f"{COLUMNS},u_mps,roll_deg", lines)
    log, expected = readers.read(path), readers.read(write(tmp_path / "without.csv"))
    assert log.sha256 == expected.sha256
    assert log.velocity.source == VelocitySource.NONE


@pytest.mark.parametrize("value", ["0", "-58"])
def test_thrust_that_is_never_positive_is_named(tmp_path: Path, value: str) -> None:
    path = write(tmp_path / "dive.csv", lines=with_cells(7, value))
    with pytest.raises(
        LogError, match=r"column thrust_pct: no value above 0; give percent of full"
    ):
        readers.read(path)
    readers.read(write(tmp_path / "reversed.csv", lines=with_cells(7, "-58")), REVERSED_THRUST)


REVERSED_THRUST = OutputOptions(ServoChannels(1, 2, -3))


def test_depth_in_millimetres_is_named(tmp_path: Path) -> None:
    lines = [line.split(",") for line in rows()]
    for k, cells in enumerate(lines):
        cells[8] = f"{1000.0 * (4.0 + 0.005 * (k % 3)):.0f}"
    path = write(tmp_path / "mm.csv", lines=[",".join(cells) for cells in lines])
    with pytest.raises(LogError, match=r"column depth_m: changes by .* give metres, not millim"):
        readers.read(path)


def test_tested_surface_in_radians_or_too_small_is_named(tmp_path: Path) -> None:
    lines = [line.split(",") for line in rows()]
    for k, cells in enumerate(lines):
        cells[5] = f"{math.radians(float(cells[5]) * (-1) ** (k // 50)):.5f}"
    path = write(tmp_path / "rad.csv", lines=[",".join(cells) for cells in lines])
    expected = (
        r"the rudder changes by 0\.14 deg in its tests, at least 0\.5 needed: fly larger tests, or,"
        r" if these are rad \(8 deg\), name the column rudder_rad"
    )
    with pytest.raises(LogError, match=expected):
        readers.read(path)


def with_headings(path: Path, unit: str, values: np.ndarray) -> Path:
    """Write the dive with these headings, and without rates."""
    lines = [line.split(",") for line in rows()]
    for cells, value in zip(lines, values, strict=True):
        cells[1] = f"{value:.5f}"
    header = COLUMNS.replace("heading_deg", f"heading_{unit}").replace("r_degps", "x")
    return write(path, header, [",".join(cells) for cells in lines])


TURNING_RAD = 4.0 * np.sin(np.arange(len(rows())) / 300.0)
"""Heading that passes north and south several times, at up to 38 deg/s."""


@pytest.mark.parametrize("start_rad", [0.0, np.pi])
@pytest.mark.parametrize(
    ("unit", "other", "turn"), [("deg", "rad", 2.0 * math.pi), ("rad", "deg", 360.0)]
)
def test_heading_that_wraps_in_another_unit_is_named(
    tmp_path: Path, unit: str, other: str, turn: float, start_rad: float
) -> None:
    values = turn * ((TURNING_RAD / (2.0 * math.pi)) % 1.0)
    values = np.where(values > 0.5 * turn, values - start_rad / math.pi * turn, values)
    path = with_headings(tmp_path / "wrong.csv", unit, values)
    with pytest.raises(LogError, match=rf"column heading_{unit}: wraps .* name it heading_{other}"):
        readers.read(path)


@pytest.mark.parametrize(
    ("unit", "values"),
    [
        ("deg", np.degrees(TURNING_RAD) % 360.0),
        ("rad", TURNING_RAD % (2.0 * math.pi)),
        ("deg", np.where(np.arange(len(rows())) < 50, 0.0, 6.28)),  # no estimate at first
        ("deg", 3.0 + 3.14 * np.random.default_rng(1).uniform(-1.0, 1.0, len(rows()))),
        ("deg", 6.0 * (np.arange(len(rows())) // 50 % 2)),  # resolution of 6 deg
    ],
)
def test_heading_in_its_unit_is_read(tmp_path: Path, unit: str, values: np.ndarray) -> None:
    assert readers.read(with_headings(tmp_path / "right.csv", unit, values)).attitude.time_s.size


def test_tested_surface_without_a_column_is_named(tmp_path: Path) -> None:
    path = write(tmp_path / "dive.csv", COLUMNS.replace("rudder_deg", "rud"))
    with pytest.raises(LogError, match=r"tests of the rudder, and there is no column rudder_deg"):
        readers.read(path)


def test_rate_in_another_unit_is_the_first_reason(tmp_path: Path) -> None:
    path = write(tmp_path / "dive.csv", COLUMNS.replace("r_degps", "r_radps"))
    (screening,) = screen([the_run(path)])
    assert "name a CSV column of a rate in deg/s _degps" in screening.reasons[0]


def test_parameter_without_equals_sign_is_refused(tmp_path: Path) -> None:
    path = write(tmp_path / "dive.csv")
    path.write_text("# ACT_TRAVEL_DEG: 20\n" + path.read_text())
    with pytest.raises(LogError, match=r"line 1: .* has no '='; write .*# ACT_TRAVEL_DEG = VALUE"):
        readers.read(path)


def test_times_that_are_rounded_to_several_rows_are_refused(tmp_path: Path) -> None:
    cells = [line.split(",") for line in rows()]
    lines = [",".join([f"{float(row[0]):.1f}", *row[1:]]) for row in cells]
    path = write(tmp_path / "rounded.csv", lines=lines)
    with pytest.raises(LogError, match=r"column time_s: \d+ of \d+ rows .* give times to 1 ms"):
        readers.read(path)


def test_test_after_a_restart_is_refused_by_its_clock(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = rows()
    monkeypatch.setattr(files, "BOOTED_S", 3.0)
    log = readers.read(write(tmp_path / "dive.csv", lines=[*first, *rows()]))
    known = replace(log, parameters={**log.parameters, segments.LOOP_RATE: RATE_HZ})
    before, after = segments.cut_runs(known)
    assert before.clock_back == ""
    assert "went back by 137.0 s (a restart?)" in after.clock_back
