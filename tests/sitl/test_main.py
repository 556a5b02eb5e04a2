"""Options of the command ``sitl`` that need no autopilot."""

import os
import sys
from importlib.metadata import version

import pytest

from mavlink_io.errors import BAD_INPUT
from sitl import cli as command


def run(monkeypatch: pytest.MonkeyPatch, *arguments: str) -> int | str | None:
    """Run the command in this process and return its exit status."""
    monkeypatch.setattr(sys, "argv", ["sitl", *arguments])
    with pytest.raises(SystemExit) as exit_info:
        command.main()
    return exit_info.value.code


def test_version_option_prints_package_version(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(monkeypatch, "--version") == 0
    assert capsys.readouterr().out == f"sitl {version('caribou-auv')}\n"


def test_help_option_lists_every_option(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(monkeypatch, "--help") == 0
    text = capsys.readouterr().out
    for option in ("--vehicle", "--scenario", "--hil", "--speed", "--truth", "--version"):
        assert option in text


def test_speed_outside_range_is_bad_input(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(monkeypatch, "--speed", "0") == BAD_INPUT
    assert "--speed 0: expected a number from 0.01 to 10000, or max" in capsys.readouterr().err


def test_no_compile_without_machine_code_starts_again_in_python(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def restart(program: str, arguments: list[str]) -> None:
        assert arguments == [program, "-m", "sitl", "--no-compile"]
        assert os.environ["NUMBA_DISABLE_JIT"] == "1"
        sys.exit("started again")

    monkeypatch.setattr("sitl.app.needs_compiler", lambda: True)
    monkeypatch.setattr(os, "execv", restart)
    monkeypatch.setenv("NUMBA_DISABLE_JIT", "0")
    assert run(monkeypatch, "--no-compile") == "started again"
