"""Options of `ground` before the name of a command, and exit status and output of errors."""

import json
import signal
import sys
from importlib import metadata
from typing import Any

import pytest
from typer.testing import CliRunner

from ground.cli import main as command
from ground.cli.main import app
from ground.errors import INTERRUPTED, UnsuccessfulError
from mavlink_io.errors import BAD_INPUT, FAILED, InputError, OperationError
from mavlink_io.transport import AddressError, LinkLostError


def run_failing(error: Exception, monkeypatch: pytest.MonkeyPatch, *options: str) -> object:
    """Run `ground` with a command that raises an error, and return the exit status."""

    def fail() -> None:
        raise error

    monkeypatch.setattr(command, "_run", fail)
    monkeypatch.setattr(command, "on_end_signals", lambda handler: None)
    monkeypatch.setattr(sys, "argv", ["ground", "fly", *options])
    with pytest.raises(SystemExit) as end:
        command.main()
    return end.value.code


def test_version_option_prints_version_and_exits() -> None:
    done = CliRunner().invoke(app, ["--version"])
    assert done.exit_code == 0, done.output
    assert done.stdout == f"ground {metadata.version('caribou-auv')}\n"


def test_version_option_skips_the_command() -> None:
    done = CliRunner().invoke(app, ["--version", "no-such-command"])
    assert done.exit_code == 0, done.output


def test_help_lists_shell_completion() -> None:
    done = CliRunner().invoke(app, ["--help"], env={"COLUMNS": "200"})
    assert done.exit_code == 0, done.output
    assert "--install-completion" in done.stdout


@pytest.mark.parametrize(
    ("error", "status", "message"),
    [
        (InputError("no"), BAD_INPUT, "no"),
        (AddressError("no"), BAD_INPUT, "no"),
        (OperationError("no"), FAILED, "no"),
        (LinkLostError("gone"), FAILED, "gone"),
        (
            FileExistsError(17, "File exists", "a.mcap"),
            BAD_INPUT,
            "a.mcap: exists; give a new name",
        ),
        (FileNotFoundError(2, "No such file", "a.toml"), BAD_INPUT, "a.toml: No such file"),
        (OSError(28, "No space left"), FAILED, "[Errno 28] No space left"),
        (
            OSError(28, "No space left", "a.json"),
            FAILED,
            "a.json: No space left; free space, or give a file on another disk",
        ),
        (OSError(5, "Input/output error", "a.json"), FAILED, "a.json: Input/output error"),
        (OSError(36, "Name too long", "x"), BAD_INPUT, "x: Name too long; give another name"),
    ],
)
def test_error_gives_one_line_and_its_exit_status(
    error: Exception,
    status: int,
    message: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert run_failing(error, monkeypatch) == status
    assert capsys.readouterr() == ("", f"ground: {message}\n")


def test_json_option_prints_code_and_message_of_an_error(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run_failing(LinkLostError("gone"), monkeypatch, "--json") == FAILED
    printed = capsys.readouterr()
    assert json.loads(printed.out) == {"error": {"code": "link_lost", "message": "gone"}}
    assert printed.err == "ground: gone\n"


def test_json_option_prints_no_second_object_after_a_result(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run_failing(UnsuccessfulError("failsafe"), monkeypatch, "--json") == FAILED
    assert capsys.readouterr() == ("", "ground: failsafe\n")


def test_interrupt_that_an_extension_turns_into_import_error(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """matplotlib's and scipy's extensions raise ImportError for any exception while they load."""
    handlers: list[Any] = []

    def load() -> None:
        try:
            handlers[0](signal.SIGINT, None)
        except BaseException as error:
            raise ImportError("initialization failed") from error

    monkeypatch.setattr(command, "_run", load)
    monkeypatch.setattr(command, "on_end_signals", handlers.append)
    with pytest.raises(SystemExit) as end:
        command.main()
    assert end.value.code == INTERRUPTED
    assert capsys.readouterr() == ("", "ground: interrupted; what was written is kept\n")
