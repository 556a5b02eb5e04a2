"""Module that loads the autopilot before processes are forked."""

import importlib

import pytest

from autopilot import preload, steady_ticks
from mavlink_io import jit


@pytest.mark.slow
@pytest.mark.parametrize(("stored", "lines"), [(False, 1), (True, 0)])
def test_preload_reports_compilation(
    stored: bool, lines: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(jit, "COMPILED", True)
    monkeypatch.setattr(steady_ticks, "is_compiled", lambda: stored)
    importlib.reload(preload)
    printed = capsys.readouterr().err.splitlines()
    assert len(printed) == lines
    assert all(line.startswith("autopilot: compiling") for line in printed)
