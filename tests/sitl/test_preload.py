"""Module that loads the simulator before processes are forked."""

import importlib

import pytest

from sitl import app, preload


@pytest.mark.slow
@pytest.mark.parametrize(("missing", "lines"), [(True, 1), (False, 0)])
def test_preload_reports_compilation(
    missing: bool, lines: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(app, "needs_compiler", lambda: missing)
    importlib.reload(preload)
    printed = capsys.readouterr().err.splitlines()
    assert len(printed) == lines
    assert all(line.startswith("sitl: compiling") for line in printed)
