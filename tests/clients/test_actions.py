"""Methods of MAVSDK's plugin `action` and commands of MAVProxy: results of docs/mavlink.md."""

from pathlib import Path

import pytest

from tests.clients import documented
from tests.clients.fixture import mavproxy_command_results, mavsdk_action_results
from tests.clients.mavsdk_actions import CALLS

pytestmark = [pytest.mark.process, pytest.mark.client, pytest.mark.timeout(500)]


def test_mavsdk_action_methods_give_documented_results(capsys: pytest.CaptureFixture[str]) -> None:
    results = mavsdk_action_results()
    with capsys.disabled():
        print("", *(f"{name}: {outcome['result']}" for name, outcome in results.items()), sep="\n")
    assert {name: outcome for name, outcome in results.items() if outcome["why"]} == {}
    assert len(results) == len(CALLS)
    documented_results = documented.load()["mavsdk action"]
    works = {name for name, outcome in results.items() if outcome["result"] == "SUCCESS"}
    assert works == {name for name, result in documented_results.items() if result == "SUCCESS"}


def test_mavproxy_commands_give_documented_results(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    results = mavproxy_command_results(tmp_path)
    with capsys.disabled():
        print("", *(f"{name}: {outcome['result']}" for name, outcome in results.items()), sep="\n")
    assert {name: outcome for name, outcome in results.items() if outcome["why"]} == {}
    documented_results = documented.load()["mavproxy command"]
    assert {name: outcome["result"] for name, outcome in results.items()} == documented_results
