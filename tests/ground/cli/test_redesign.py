"""Options of `ground redesign`."""

from pathlib import Path

from typer.testing import CliRunner

from ground.cli.main import app
from ground.cli.redesign import DEFAULT_OUT, DesignMethod
from mavlink_io.errors import InputError


def test_lqg_upload_is_refused() -> None:
    done = CliRunner().invoke(
        app, ["redesign", "model.json", "--method", "lqg", "--upload", "tcp:127.0.0.1:1"]
    )
    assert isinstance(done.exception, InputError)
    assert "autopilot --controller" in str(done.exception)


def test_default_file_of_each_method() -> None:
    assert {method.value: DEFAULT_OUT[method] for method in DesignMethod} == {
        "pid": Path("gains.param"),
        "lqg": Path("controller.json"),
    }
