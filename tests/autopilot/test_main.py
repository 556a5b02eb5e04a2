"""Command line of the autopilot."""

import sys
from importlib import metadata

import pytest

from autopilot.cli import main


def test_version_option_prints_package_version_and_exits(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["autopilot", "--version"])
    with pytest.raises(SystemExit) as exit_info:
        main()
    assert exit_info.value.code in (None, 0)
    assert capsys.readouterr().out == f"autopilot {metadata.version('caribou-auv')}\n"


@pytest.mark.parametrize("accept", ["", "255,abc"])
def test_bad_accept_option_is_refused(
    accept: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    options = ["--accept", accept, "--logs", "off", "--state", "off"]
    monkeypatch.setattr(sys, "argv", ["autopilot", *options])
    with pytest.raises(SystemExit) as exit_info:
        main()
    assert exit_info.value.code == 2
    assert f"--accept {accept!r}: " in capsys.readouterr().err
