"""Link of a command to its vehicle: every option of the link counts, a long wait is reported."""

from pathlib import Path
from typing import Any, NoReturn

import pytest
from typer.testing import CliRunner

from ground.cli.main import app
from ground.cli.options import remark
from mavlink_io.errors import OperationError

COMMANDS = (
    "params list",
    "params get HDG_P",
    "params set HDG_P 1",
    "params save new.param",
    "params load gains.param",
    "params rollback",
    "log list",
    "log download",
    "modes",
    "modes export-mavproxy",
    "surface",
    "hold",
    "stop",
    "arm",
    "mode",
)
OPTIONS = "--connect memory:none --sign radio.key --vehicle-id 2 --modem 30"


@pytest.mark.parametrize("command", COMMANDS)
def test_command_uses_every_option_of_its_link(
    command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    links: list[tuple[str, dict[str, Any]]] = []

    def connected(address: str, **options: Any) -> NoReturn:
        links.append((address, options))
        raise OperationError("recorded")

    monkeypatch.setattr("ground.client.vehicle.connected", connected)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "gains.param").write_text("HDG_P,0.5\n")
    with pytest.raises(OperationError, match="recorded"):
        CliRunner().invoke(app, f"{command} {OPTIONS}".split(), catch_exceptions=False)
    options = {"key_file": Path("radio.key"), "system": 2, "modem_s": 30.0, "on_remark": remark}
    assert links == [("memory:none", options)]
