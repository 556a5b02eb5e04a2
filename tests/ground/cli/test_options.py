"""Options of several commands."""

import pytest
from typer.testing import CliRunner

from ground.__main__ import app
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
