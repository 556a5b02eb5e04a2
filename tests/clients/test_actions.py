"""Every method of MAVSDK's plugin `action` gives the result in docs/mavlink.md."""

import json

import pytest

from tests.clients.fixture import afloat
from tests.clients.mavsdk_actions import CALLS
from tests.helpers.subprocesses import free_port, process

pytestmark = [pytest.mark.process, pytest.mark.client, pytest.mark.timeout(500)]


def test_mavsdk_action_methods_give_documented_results(capsys: pytest.CaptureFixture[str]) -> None:
    port = free_port()
    with (
        afloat(f"udpout:127.0.0.1:{port}"),
        process("-m", "tests.clients.mavsdk_actions", f"udpin://127.0.0.1:{port}") as program,
    ):
        finished = program.finish(patience_s=300.0)
    assert finished.status == 0, finished.stderr[-3000:]
    results = json.loads(finished.stdout.splitlines()[-1])
    with capsys.disabled():
        print("", *(f"{name}: {outcome['result']}" for name, outcome in results.items()), sep="\n")
    assert {name: outcome for name, outcome in results.items() if outcome["why"]} == {}
    assert len(results) == len(CALLS)
