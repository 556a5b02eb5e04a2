"""DroneKit and MAVProxy, with their own ArduSub tables, use ``--autopilot-id ardupilot``."""

import json
from pathlib import Path

import pytest

from tests.clients.checklist import failed, score
from tests.clients.dronekit_checks import EVERY
from tests.clients.fixture import afloat
from tests.clients.mavproxy_checks import ARDUSUB
from tests.helpers.subprocesses import free_port, process

pytestmark = [pytest.mark.process, pytest.mark.client, pytest.mark.timeout(500)]
OPTIONS = ("--autopilot-id", "ardupilot")


def test_ardupilot_tools_pass_every_check(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    ports = free_port(), free_port()
    links = [f"127.0.0.1:{port}" for port in ports]
    with (
        afloat(f"udpout:{links[0]}", options=OPTIONS),
        afloat(f"udpout:{links[1]}", options=OPTIONS),
        process("-m", "tests.clients.dronekit_checks", links[0]) as dronekit,
        process(
            *("-m", "tests.clients.mavproxy_checks", str(tmp_path), f"udpin:{links[1]}"),
            "--ardusub",
        ) as mavproxy,
    ):
        clients = ("DroneKit", dronekit, EVERY), ("MAVProxy", mavproxy, ARDUSUB)
        for name, program, checks in clients:
            finished = program.finish(patience_s=400.0)
            assert finished.status == 0, finished.stderr[-3000:]
            verdicts = json.loads(finished.stdout.splitlines()[-1])
            with capsys.disabled():
                print(f"\n{name}: {score(verdicts)}", end=" ")
            assert failed(verdicts) == {}
            assert len(verdicts) == len(checks)
