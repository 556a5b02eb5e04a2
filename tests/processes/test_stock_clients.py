"""Programs that nobody here wrote find the vehicle, read it, set it and fly it: MAVSDK and MAVProxy."""

import json
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from autopilot.params import PARAMETERS
from link.params import as_real32
from tests.processes.fleet import Process, free_port, process, vehicle

pytestmark = pytest.mark.process

CLIENT = Path(__file__).with_name("mavsdk_client.py")
DEFAULTS = {p.name: as_real32(p.default) for p in PARAMETERS}


def test_mavsdk_discovers_reads_sets_and_flies() -> None:
    port = free_port()
    with vehicle(f"udpout:127.0.0.1:{port}"), process(str(CLIENT), f"udpin://127.0.0.1:{port}") as client:
        finished = client.finish()
    assert finished.status == 0, finished.stderr
    seen = json.loads(finished.stdout.splitlines()[-1])
    assert (seen["discovered"], seen["system_id"], seen["version"]) == (True, 1, True)
    assert (seen["parameters"], seen["integer_parameters"]) == (DEFAULTS, 0)
    assert seen["set"] == 0.75
    roll, pitch, yaw = seen["attitude_deg"]
    assert abs(roll) < 20
    assert abs(pitch) < 20
    assert -180 <= yaw <= 180
    assert -2.0 < seen["altitude_m"] < 0.5
    assert seen["actuators"] == 32
    assert seen["healthy"]
    assert seen["mission"] == [[178, 1, -1, 58], [186, -3, 3, 0], [115, 40, 0, 0], [93, 10, -1, -1]]
    assert (seen["mode"], seen["armed"], seen["mode_after"], seen["disarmed"]) == ("MISSION", True, "HOLD", True)
    assert seen["progress"] == [3, 4]


@pytest.fixture
def mavproxy(tmp_path: Path) -> Iterator[Process]:
    """MAVProxy at its prompt, with the vehicle's parameters received."""
    port = free_port()
    program = str(Path(sys.executable).with_name("mavproxy.py"))
    arguments = ["--master", f"udpin:127.0.0.1:{port}", "--state-basedir", str(tmp_path), "--aircraft", "test"]
    with vehicle(f"udpout:127.0.0.1:{port}"), process(program, *arguments) as client:
        client.hear("Detected vehicle 1:1 on link 0")
        client.hear(f"Received {len(PARAMETERS)} parameters")
        yield client


def test_mavproxy_reads_and_sets_parameters(mavproxy: Process) -> None:
    mavproxy.say("param show HDG_P")
    assert float(mavproxy.hear(r"HDG_P +([\d.]+)")[1]) == as_real32(0.65)
    mavproxy.say("param set HDG_P 0.75")
    for _ in range(100):  # MAVProxy sets in the background, in its own time
        mavproxy.say("param fetch HDG_P")
        if float(mavproxy.hear(r"HDG_P = ([\d.]+)")[1]) == 0.75:
            return
    pytest.fail("HDG_P was never set")


def test_mavproxy_reads_attitude(mavproxy: Process) -> None:
    mavproxy.say("status ATTITUDE")
    pitch_rad = float(mavproxy.hear(r"ATTITUDE {time_boot_ms : \d+, roll : \S+, pitch : (\S+),")[1])
    assert abs(pitch_rad) < 0.5


def test_mavproxy_carries_a_mission_and_flies_it(mavproxy: Process, tmp_path: Path) -> None:
    plan = tmp_path / "leg.txt"
    plan.write_text(
        "QGC WPL 110\n"
        "0\t1\t0\t178\t1\t-1\t58\t0\t0\t0\t0\t1\n"
        "1\t0\t3\t186\t-3\t3\t0\t0\t0\t0\t0\t1\n"
        "2\t0\t3\t93\t60\t-1\t-1\t-1\t0\t0\t0\t1\n"
    )
    mavproxy.say(f"wp load {plan}")
    mavproxy.hear("Flight plan received|Sent all 3 waypoints|Loaded 3 waypoints")
    mavproxy.hear("Sent all 3 waypoints")
    mavproxy.say("long MISSION_START 0 0")
    mavproxy.hear("MISSION_START: ACCEPTED")
    mavproxy.say("arm throttle")
    mavproxy.hear("ARMED")
    mavproxy.say("status MISSION_CURRENT")
    assert mavproxy.hear(r"MISSION_CURRENT {seq : (\d)")[1] in "012"
    mavproxy.say("disarm force")
    mavproxy.hear("DISARMED")
