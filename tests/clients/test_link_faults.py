"""Real clients with link faults: competing and killed clients, power failures, unplugged cables.

Two MAVSDK programs on UDP and MAVProxy on a noisy serial line use one vehicle.
"""

import contextlib
import json
import time
from collections.abc import Iterator
from typing import Any, NamedTuple

import pytest

from autopilot.control.params import PARAMETERS
from tests.clients.fixture import BAUD, NOISE, Afloat, afloat, install_modes
from tests.clients.mavproxy_console import Console
from tests.helpers.pty_pair import Line, line
from tests.helpers.subprocesses import Process, free_port, process

pytestmark = [pytest.mark.process, pytest.mark.client, pytest.mark.timeout(300)]

UNDER_WAY_BYTES = 2000
"""Bytes of a client after which its upload of 500 items, about 25 kB, is certainly under way."""


class MavsdkClient:
    """MAVSDK program that executes commands."""

    def __init__(self, program: Process) -> None:
        self.program = program

    def begin(self, *command: object) -> None:
        self.program.write_line(" ".join(str(word) for word in command))

    def result(self) -> Any:
        return json.loads(self.program.read_until(r'^\{"result"').string)["result"]

    def do(self, *command: object) -> Any:
        self.begin(*command)
        return self.result()


class Scene(NamedTuple):
    """Vehicle with two MAVSDK clients and MAVProxy."""

    vehicle: Afloat
    first: MavsdkClient
    second: MavsdkClient
    mavproxy: Console
    cable: Line
    spare: Line
    """A second serial line, which has no noise and no client."""


@contextlib.contextmanager
def mavsdk_client(address: str) -> Iterator[MavsdkClient]:
    with process("-m", "tests.clients.client_process", address) as program:
        yield MavsdkClient(program)


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Scene]:
    folder, first_port, second_port = tmp_path_factory.mktemp("scene"), free_port(), free_port()
    with (
        line(folder, BAUD, NOISE) as cable,
        line(tmp_path_factory.mktemp("spare"), BAUD) as spare,
        afloat(
            f"udpout:127.0.0.1:{first_port}",
            f"udpout:127.0.0.1:{second_port}",
            *(f"serial:{cable_.device['vehicle']}:{BAUD}" for cable_ in (cable, spare)),
        ) as vehicle,
        mavsdk_client(f"udpin://127.0.0.1:{first_port}") as first,
        mavsdk_client(f"udpin://127.0.0.1:{second_port}") as second,
    ):
        install_modes(folder, vehicle)
        with contextlib.closing(Console(folder, cable.device["ground"], BAUD)) as mavproxy:
            mavproxy.wait_for("Detected vehicle 1:1", 30.0)
            assert [first.result(), second.result()] == ["connected", "connected"]
            yield Scene(vehicle, first, second, mavproxy, cable, spare)


def ask(mavproxy: Console, line_typed: str, pattern: str) -> str:
    return mavproxy.ask(line_typed, pattern, attempts=4, within_s=30.0)[0]


def test_three_clients_read_every_parameter_at_once(scene: Scene) -> None:
    scene.mavproxy.type_line("param fetch")
    scene.first.begin("count")
    scene.second.begin("count")
    assert scene.first.result() == scene.second.result() == len(PARAMETERS)
    scene.mavproxy.wait_for(f"Received {len(PARAMETERS)} parameters", 60.0)


def test_parameter_set_by_one_client_reaches_all(scene: Scene) -> None:
    assert scene.first.do("write", "HDG_P", 0.75) == "SUCCESS"
    assert scene.second.do("await_parameter", "HDG_P", 0.75)
    scene.mavproxy.type_line("param set HDG_P 0.5")
    assert scene.first.do("await_parameter", "HDG_P", 0.5)
    assert scene.second.do("read", "HDG_P") == 0.5


def test_two_uploads_at_once_give_complete_missions(scene: Scene) -> None:
    scene.first.begin("upload", 300, 1000)
    scene.second.begin("upload", 300, 5000)
    results = {1000: scene.first.result(), 5000: scene.second.result()}
    assert "SUCCESS" in results.values()
    assert set(results.values()) <= {"SUCCESS", "DENIED"}
    mission = scene.first.do("download")
    assert results[mission[0]] == "SUCCESS"
    assert mission == [mission[0] + n for n in range(300)]
    assert scene.second.do("download") == mission
    for client, base in ((scene.first, 1000), (scene.second, 5000)):
        assert client.do("upload", 5, base) == "SUCCESS"
        assert scene.first.do("download") == [base + n for n in range(5)]


def test_killed_upload_keeps_old_mission_and_allows_next(scene: Scene) -> None:
    """The client is killed on the slow line, where 500 items take many seconds."""
    assert scene.first.do("upload", 4, 70) == "SUCCESS"
    with mavsdk_client(f"serial://{scene.spare.device['ground']}:{BAUD}") as killed_client:
        assert killed_client.result() == "connected"
        before = scene.spare.carried("ground")
        killed_client.begin("upload", 500, 2000)
        deadline_s = time.monotonic() + 60.0
        while scene.spare.carried("ground") < before + UNDER_WAY_BYTES:
            assert time.monotonic() < deadline_s, "the upload does not begin"
            time.sleep(0.05)
        assert scene.second.do("upload", 4, 80) == "DENIED", "no upload was in progress"
        killed_client.program.kill()
    assert scene.first.do("download") == [70, 71, 72, 73]
    deadline_s = time.monotonic() + 20.0
    while (result := scene.second.do("upload", 4, 80)) == "DENIED":
        assert time.monotonic() < deadline_s, "the upload of the killed client did not time out"
        time.sleep(0.5)
    assert result == "SUCCESS"
    assert scene.first.do("download") == [80, 81, 82, 83]


def test_vehicle_cable_replugged_link_continues(scene: Scene) -> None:
    scene.cable.unplug("vehicle")
    scene.mavproxy.wait_for("link 1 down|no link", 30.0)
    scene.cable.plug("vehicle")
    scene.mavproxy.wait_for("link 1 OK|heartbeat OK", 30.0)
    ask(scene.mavproxy, "mode DEPTH", "Mode DEPTH")


def test_client_cable_replugged_link_continues(scene: Scene) -> None:
    scene.cable.unplug("ground")
    scene.mavproxy.wait_for("is dead", 30.0)
    scene.cable.plug("ground")
    scene.mavproxy.wait_for("reopened OK", 30.0)
    ask(scene.mavproxy, "mode MANUAL", "Mode MANUAL")


def test_clients_reconnect_after_power_failure(scene: Scene) -> None:
    scene.vehicle.kill()
    assert scene.first.do("await_connection", "lost")
    assert scene.second.do("await_connection", "lost")
    scene.mavproxy.wait_for("link 1 down|no link", 30.0)
    scene.vehicle.start()
    assert scene.first.do("await_connection", "connected")
    assert scene.second.do("await_connection", "connected")
    scene.mavproxy.wait_for("link 1 OK|heartbeat OK", 30.0)
    assert scene.first.do("upload", 3, 40) == "SUCCESS"
    assert scene.second.do("download") == [40, 41, 42]
    ask(scene.mavproxy, "mode DEPTH", "Mode DEPTH")
