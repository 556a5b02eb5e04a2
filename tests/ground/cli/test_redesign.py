"""Options of `ground redesign`."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from typer.testing import CliRunner

from ground.cli import redesign
from ground.cli.main import app
from ground.cli.redesign import DEFAULT_OUT, DesignMethod
from mavlink_io.errors import InputError


def test_lqg_upload_is_refused() -> None:
    done = CliRunner().invoke(
        app, ["redesign", "model.json", "--method", "lqg", "--upload", "tcp:127.0.0.1:1"]
    )
    assert isinstance(done.exception, InputError)
    assert "autopilot --controller" in str(done.exception)


def test_upload_sets_the_gains_of_the_named_vehicle(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without --vehicle-id the gains went to the first vehicle on the link."""
    uploads: list[tuple[Any, Any]] = []

    def upload(*arguments: Any, **options: Any) -> tuple[()]:
        uploads.append((arguments, options))
        return ()

    design = SimpleNamespace(gains={"HDG_P": 0.7}, model_sha256="ab")
    monkeypatch.setattr("ground.campaign.refit.read_model", lambda path: None)
    monkeypatch.setattr("ground.campaign.refit.specification", lambda *arguments: None)
    monkeypatch.setattr("ground.campaign.specification.read", lambda *arguments: None)
    monkeypatch.setattr(redesign, "_redesign_pid", lambda *arguments, **options: (design, ""))
    monkeypatch.setattr(redesign, "print_result", lambda *arguments: None)
    monkeypatch.setattr("ground.cli.params.upload", upload)
    options = "--upload tcp:localhost:1 --vehicle-id 7 --modem 30"
    done = CliRunner().invoke(app, ["redesign", "model.json", *options.split()])
    assert done.exception is None
    assert uploads == [
        (
            ("tcp:localhost:1", None, {"HDG_P": 0.7}),
            {"source": "gains.param", "model_sha256": "ab", "system": 7, "modem_s": 30.0},
        )
    ]


def test_default_file_of_each_method() -> None:
    assert {method.value: DEFAULT_OUT[method] for method in DesignMethod} == {
        "pid": Path("gains.param"),
        "lqg": Path("controller.json"),
    }
