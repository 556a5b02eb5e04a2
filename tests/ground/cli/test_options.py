"""Options of several commands."""

import json
import math
import os
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from ground.cli.main import app
from ground.cli.options import to_json
from mavlink_io.errors import InputError


@pytest.mark.parametrize(
    "arguments",
    [
        "refit a.csv --servo-channels",
        "report a.csv --servo-channels",
        "log segments a.csv --servo-channels",
        "redesign a.json --prior",
        "redesign a.json --upload",
        "simulate a.json --gains a.param --prior",
        "replay a.mcap --params a.param --prior",
        "replay a.mcap --params a.param --mission",
        "design-test --prior",
        "params load a.param --prior",
        "campaign --truth",
        "live --prior",
        "watch --prior",
        "fly square --prior",
    ],
)
def test_empty_option_is_refused(
    arguments: str, tmp_path: object, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(str(tmp_path))
    option = arguments.split()[-1]
    with pytest.raises(InputError, match=f"^{option} '': "):
        CliRunner().invoke(app, [*arguments.split(), ""], catch_exceptions=False)


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        ("fly square --vehicle remus100", "is for a simulated vehicle; add --sitl"),
        ("fly square --scenario calm", "is for a simulated vehicle; add --sitl"),
        ("fly square --seed 3", "is for a simulated vehicle; add --sitl"),
        ("fly square --speed 2", "is for a simulated vehicle; add --sitl"),
        ("fly square --truth t.mcap", "is for a simulated vehicle; add --sitl"),
        ("fly square --sitl --sign k", "is for the link to a real vehicle"),
        ("fly square --sitl --vehicle-id 2", "is for the link to a real vehicle"),
        ("fly square --sitl --connect udpin:0.0.0.0:14550", "is for the link to a real vehicle"),
        ("fly straight_run --sitl --prior caribou_nominal", "is for the live estimate"),
        ("bench-test --sign k", "is for the link of --connect"),
        ("inclining-test --vehicle-id 2", "is for the link of --connect"),
        ("bench-test --connect tcp:localhost:1 --seed 2", "is for a simulated vehicle"),
        ("inclining-test --connect tcp:localhost:1 --vehicle remus100", "is for a simulated"),
        ("watch --once --prior caribou_nominal", "is for the live display"),
        ("watch --json --gains g.param", "is for the live display"),
        ("report a.mcap --of model", "is for --picture"),
        ("paper --no-flights --campaign c", "cannot be combined with --no-flights"),
        ("paper --no-flights --seed 2", "cannot be combined with --no-flights"),
        ("paper --no-flights --jobs 2", "cannot be combined with --no-flights"),
        ("vehicle new g.toml --out v.toml --tail x", "is for --hull"),
        ("design-test --min-altitude 5", "needs --water-depth"),
        ("redesign m.json --sign k", "is for the link of --upload"),
        ("redesign m.json --vehicle-id 2", "is for the link of --upload"),
        ("redesign m.json --modem 30", "is for the link of --upload"),
    ],
)
def test_option_without_effect_is_refused(
    arguments: str, reason: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """`ground fly MISSION --vehicle remus100` flew the vehicle on the link."""
    monkeypatch.chdir(tmp_path)
    option = arguments.split()[-2]
    with pytest.raises(InputError, match=f"^{option}: {reason}"):
        CliRunner().invoke(app, arguments.split(), catch_exceptions=False)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("option", ["--connect tcp:localhost:1", "--vehicle-id 2", "--json"])
@pytest.mark.parametrize("command", ["install", "export-mavproxy"])
def test_option_before_a_subcommand_is_refused(option: str, command: str) -> None:
    """`ground modes --connect ADDRESS install` ignored the address."""
    reason = f"^{option.split()[0]}: stands before `{command}` and has no effect"
    with pytest.raises(InputError, match=reason):
        CliRunner().invoke(app, ["modes", *option.split(), command], catch_exceptions=False)


@pytest.mark.parametrize("option", ["--min-depth", "--water-depth", "--min-altitude"])
def test_option_without_limits_refuses_nan(option: str) -> None:
    with pytest.raises(InputError, match=f"^{option} nan: give a number"):
        CliRunner().invoke(app, ["design-test", option, "nan"], catch_exceptions=False)


@pytest.mark.parametrize("arguments", ["design-test --depth", "surface --modem"])
def test_option_with_limits_refuses_nan(arguments: str) -> None:
    done = CliRunner().invoke(app, [*arguments.split(), "nan"])
    assert done.exit_code == 2
    assert f"Invalid value for '{arguments.split()[-1]}'" in done.output


def test_json_of_values_that_are_no_numbers_is_null() -> None:
    """NaN and Infinity are no JSON (RFC 8259): jq and browsers refuse them."""
    values = {"a": math.nan, "b": [-math.inf, 1.5], "c": "NaN\x7f\x1b"}
    text = to_json(values)
    assert text.isascii()
    assert "\x7f" not in text
    assert json.loads(text, parse_constant=pytest.fail) == {
        "a": None,
        "b": [None, 1.5],
        "c": "NaN\x7f\x1b",
    }


@pytest.mark.process
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="the system has no /dev/full")
@pytest.mark.parametrize("arguments", ["missions", "log info missing.mcap --json"])
def test_full_stdout_is_one_line(arguments: str) -> None:
    """With --json the error itself is also printed on stdout."""
    with Path("/dev/full").open("wb") as full:
        done = _run_ground(arguments, stdout=full.fileno())
    assert done.stderr == "ground: stdout: No space left on device\n"
    assert done.returncode == 1


@pytest.mark.process
@pytest.mark.parametrize("arguments", ["missions", "log info missing.mcap --json"])
def test_closed_pipe_on_stdout_is_quiet(arguments: str) -> None:
    reader, writer = os.pipe()
    os.close(reader)
    done = _run_ground(arguments, stdout=writer)
    os.close(writer)
    assert done.stderr == ""
    assert done.returncode == 1


def _run_ground(arguments: str, stdout: int) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "ground", *arguments.split()]
    return subprocess.run(
        command, stdout=stdout, stderr=subprocess.PIPE, text=True, check=False, timeout=60.0
    )
