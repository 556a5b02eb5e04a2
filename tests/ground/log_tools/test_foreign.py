"""Logs in other formats with ``ground log`` and ``ground refit``."""

import csv
import gzip
import json
import os
from collections.abc import Callable
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import all as mavlink
from typer.testing import CliRunner

from ground.campaign import refit
from ground.cli.main import app
from mavlink_io.errors import InputError
from tests.sysid.data.readers import files

WRITERS: dict[str, Callable[[Path], Path]] = {
    "a.tlog": files.tlog,
    "a.bin": files.dataflash,
    "a.ulg": files.ulog,
}


@pytest.mark.parametrize(
    ("name", "attitude"),
    [("a.tlog", "/mavlink/1/1/ATTITUDE"), ("a.bin", "ATT"), ("a.ulg", "vehicle_attitude")],
)
def test_other_log_is_inspected_and_exported(tmp_path: Path, name: str, attitude: str) -> None:
    path = WRITERS[name](tmp_path / name)
    info = json.loads(CliRunner().invoke(app, ["log", "info", str(path), "--json"]).stdout)
    assert info["topics"][attitude] == files.SECONDS * files.RATE_HZ
    assert info["lost_frames"] is None
    exported = CliRunner().invoke(
        app, ["log", "export", str(path), "--out", str(tmp_path / "csv"), "--json"]
    )
    (table,) = [
        f
        for f in json.loads(exported.stdout)["files"]
        if f.endswith(f"{attitude.rsplit('/', 1)[-1]}.csv")
    ]
    with Path(table).open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == files.SECONDS * files.RATE_HZ
    yaw = {"a.tlog": "yaw_rad", "a.bin": "Yaw", "a.ulg": "q[0]"}[name]
    assert float(rows[0]["time_s"]) in (files.BOOTED_S, 0.0)
    assert float(rows[0][yaw]) == pytest.approx(
        {"yaw_rad": 3.0, "Yaw": 171.89, "q[0]": 0.0707}[yaw], abs=0.01
    )


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--segment", "1..2:fin"], r"--segment 1\.\.2:fin: give \[LOG:\]START\.\.STOP:rudder"),
        (
            ["--segment", "b.ulg:1700000001..1700000002:rudder"],
            r"--segment 1700000001\.0\.\.1700000002\.0:rudder: b\.ulg is none of the logs a\.ulg",
        ),
        (
            ["--segment", "10..500:rudder"],
            r"a\.ulg: run 10\.\.500 must lie within the log, 100\.0\.\.140\.0 s",
        ),
        (["--segment", "-5..3:rudder"], r"a\.ulg: run -5\.\.3 must lie within the log, 100\.0\.\."),
        (["--segment", "0..1e9:rudder"], r"run 0\.\.1e\+09 must lie within the log, 100\.0\.\."),
        (
            ["--segment", "125..120.5:rudder"],
            r"--segment 125\.\.120\.5:rudder: the start, 125 s, must be before the stop, 120\.5 s",
        ),
        (["--servo-channels", "1,2"], "--servo-channels 1,2: give RUDDER,ELEVATOR,THRUST"),
        ([], r"a\.ulg: no test found"),
    ],
)
def test_invalid_option_gives_clear_error(tmp_path: Path, options: list[str], message: str) -> None:
    path = files.ulog(tmp_path / "a.ulg", texts=False)
    with pytest.raises(InputError, match=message):
        CliRunner().invoke(app, ["refit", str(path), *options], catch_exceptions=False)


def test_info_reports_truncated_log(tmp_path: Path) -> None:
    path = files.dataflash(tmp_path / "cut.bin")
    data = path.read_bytes()
    path.write_bytes(data[: len(data) * 3 // 4 + 5])
    lines = CliRunner().invoke(app, ["log", "info", str(path)]).stdout.splitlines()
    assert any("damaged" in line and "it ends within a message" in line for line in lines), lines


def test_info_reports_a_restart(tmp_path: Path) -> None:
    path = files.dataflash(tmp_path / "two.bin")
    path.write_bytes(2 * path.read_bytes())
    lines = CliRunner().invoke(app, ["log", "info", str(path)]).stdout.splitlines()
    assert any("went back by 40.0 s" in line and "a restart" in line for line in lines), lines


def test_info_reports_a_jump_of_the_clock_as_a_gap(tmp_path: Path) -> None:
    lines = ["time_s,heading_deg,rudder_deg,thrust_pct"]
    lines += [f"{100 + 0.1 * k + 1.7e9 * (k >= 300):.2f},10,0,50" for k in range(600)]
    path = tmp_path / "utc.csv"
    path.write_text("\n".join(lines))
    result = CliRunner().invoke(app, ["log", "info", str(path)])
    assert "gap       1700000000.1 s without data from 129.9 s" in result.stdout
    info = json.loads(CliRunner().invoke(app, ["log", "info", str(path), "--json"]).stdout)
    assert info["gaps"] == [{"start_s": 129.9, "length_s": pytest.approx(1.7e9 + 0.1)}]


@pytest.mark.parametrize("command", [["log", "info"], ["log", "segments"], ["refit"]])
def test_compressed_log_is_named(tmp_path: Path, command: list[str]) -> None:
    for name in ("dive.csv", "dive.csv.gz"):
        path = tmp_path / name
        path.write_bytes(gzip.compress(b"time_s,heading_deg\n"))
        with pytest.raises(InputError, match=rf"{name}: is compressed \(gzip\); unpack it"):
            CliRunner().invoke(app, [*command, str(path)], catch_exceptions=False)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="the system has no named pipes")
@pytest.mark.parametrize("command", [["log", "info"], ["refit"], ["redesign"], ["log", "recover"]])
def test_pipe_is_refused(tmp_path: Path, command: list[str]) -> None:
    path = tmp_path / "fifo.csv"
    os.mkfifo(path)
    with pytest.raises(InputError, match=r"fifo\.csv: is no regular file"):
        CliRunner().invoke(app, [*command, str(path)], catch_exceptions=False)


def test_refit_names_the_outputs_that_move(tmp_path: Path) -> None:
    """Rudder and thrust on outputs 5 and 8, without parameters that say so."""

    def commands(s: files.Sample) -> object:
        pulses = [1500, 1500, 1740, 1500, files.pulse(s.rudder), 1500, 1500, 1500]
        return mavlink.MAVLink_servo_output_raw_message(round(1e6 * s.time_s), 0, *pulses)

    path = files.tlog(tmp_path / "other.tlog", commands)
    with pytest.raises(InputError, match=r"no excitation.*not read: 5; give .* --servo-channels"):
        CliRunner().invoke(app, ["refit", str(path)], catch_exceptions=False)


@pytest.mark.parametrize(
    ("text", "start_s", "stop_s"),
    [("120.5..150:rudder", 120.5, 150.0), ("a:b.csv:1...2.5:elevator", 1.0, 2.5)],
)
def test_segment_is_parsed(text: str, start_s: float, stop_s: float) -> None:
    mark = refit.parse_segment(text)
    assert (mark.start_s, mark.stop_s) == (start_s, stop_s)
