"""The options that `ground` takes before the name of a command."""

from importlib import metadata

from typer.testing import CliRunner

from ground.__main__ import app


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
