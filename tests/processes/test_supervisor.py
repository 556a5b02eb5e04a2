"""A supervised autopilot that is killed or hangs continues its dive within 2 s."""

import math
import os
import signal
import socket
import time
from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path

import pytest

from autopilot.control import modes
from mavlink_io.mission_items import MissionItem
from mavlink_io.services.missions import MissionClient
from tests.helpers.exchange import run
from tests.helpers.fake_hil import TICK_US
from tests.helpers.subprocesses import Process, autopilot, free_port, process
from tests.processes.test_autopilot import ARMED, GROUND, VEHICLE, Ground, Simulator

pytestmark = pytest.mark.process

RESTART_S = 2.0
"""Requirement: time from the fault to the first answer of the new process."""
LOCAL_NED, DELAY, THRUST = 1, 93, 178
MISSION = (
    MissionItem(0, LOCAL_NED, THRUST, p1=1.0, p2=-1.0, p3=58.0),
    MissionItem(1, 2, DELAY, p1=1000.0),
)


def children(pid: int) -> list[int]:
    """Return the process ids of the children of a process."""
    text = Path(f"/proc/{pid}/task/{pid}/children").read_text()
    return [int(word) for word in text.split()]


class Dive:
    """A supervised autopilot in a mission, with its simulator."""

    def __init__(self, folder: Path) -> None:
        self.hil, self.port = free_port(), free_port(socket.SOCK_STREAM)
        self.folder, self.tick = folder, 0
        self.simulator = Simulator(self.hil)

    @contextmanager
    def start(self, *more: str) -> Iterator[Process]:
        """Start the autopilot on the same links and state folder."""
        options = ("--state", str(self.folder), "--supervised", *more)
        links = f"udpin:127.0.0.1:{self.hil}", f"tcpin:127.0.0.1:{self.port}"
        with autopilot(*links, options=options) as child:
            yield child

    def fly(self, duration_s: float, pause_s: float = 0.04) -> None:
        """Exchange samples for a wall time."""
        until_s = time.monotonic() + duration_s
        while time.monotonic() < until_s:
            self.tick += 1
            self.answer = self.simulator.ask(self.tick * TICK_US)
            time.sleep(pause_s)

    def begin_mission(self) -> None:
        """Upload the mission and fly it until a checkpoint was written."""
        self.simulator.ask(0)
        with closing(Ground(self.port)) as ground:
            client = MissionClient(ground.endpoint.send, GROUND, VEHICLE)
            run(client.upload(MISSION), ground.endpoint)
            self.fly(0.2)
            assert ground.command(400, 1, 21196) == 0
            assert ground.command(300, 0, 0) == 0
            self.fly(1.0, pause_s=0.0)
            self.fly(0.5)
        assert (self.folder / "checkpoint-1.json").exists()

    def time_to_answer_s(self) -> float:
        """Send the next samples until one is answered; return the wall time."""
        began_s = time.monotonic()
        while time.monotonic() < began_s + 20.0:
            self.tick += 1
            self.simulator.send(self.tick * TICK_US)
            time.sleep(0.02)
            if frames := self.simulator._endpoint.receive():
                self.answer = frames[-1].decode()
                return time.monotonic() - began_s
        raise AssertionError("no answer")


@pytest.fixture
def dive(tmp_path: Path) -> Iterator[Dive]:
    dive = Dive(tmp_path)
    with closing(dive.simulator):
        yield dive


def assert_continued(dive: Dive) -> None:
    """Check that the vehicle is armed and flies the mission of before."""
    assert dive.answer.mode & ARMED
    assert dive.answer.controls[2] == pytest.approx(0.58)
    with ExitStack() as stack:
        ground = stack.enter_context(closing(Ground(dive.port)))
        heartbeat = ground.wait_for("HEARTBEAT")
        assert heartbeat.custom_mode == modes.MISSION.number
        assert heartbeat.base_mode & ARMED
        client = MissionClient(ground.endpoint.send, GROUND, VEHICLE)
        assert run(client.download(), ground.endpoint) == MISSION
        dive.fly(0.5)
        position = ground.wait_for("LOCAL_POSITION_NED")
        assert position.z == pytest.approx(2.0, abs=0.1)
        assert math.hypot(position.x, position.y) > 1.0  # m, travelled before the fault


@pytest.mark.parametrize("fault", [signal.SIGKILL, signal.SIGSTOP, signal.SIGSEGV])
def test_supervised_autopilot_continues_its_dive(dive: Dive, fault: signal.Signals) -> None:
    with dive.start() as supervisor:
        dive.begin_mission()
        (child,) = children(supervisor.pid)
        os.kill(child, fault)
        assert dive.time_to_answer_s() < RESTART_S
        assert_continued(dive)
        supervisor.signal(signal.SIGTERM)
        end = supervisor.finish()
    assert end.status == 0
    assert "started again" in end.stderr
    assert "dive continued in MISSION" in end.stderr
    assert not (dive.folder / "checkpoint-1.json").exists()


def test_killed_supervisor_leaves_no_orphan_and_dive_continues(dive: Dive) -> None:
    with dive.start() as supervisor:
        dive.begin_mission()
        (child,) = children(supervisor.pid)
        supervisor.signal(signal.SIGKILL)
        supervisor.kill()
        deadline_s = time.monotonic() + RESTART_S
        while Path(f"/proc/{child}").exists():
            assert time.monotonic() < deadline_s
            time.sleep(0.02)
    with dive.start() as supervisor:
        dive.time_to_answer_s()
        assert_continued(dive)


def test_start_by_hand_after_crash_is_disarmed_with_mission(dive: Dive) -> None:
    with dive.start() as supervisor:
        dive.begin_mission()
        (child,) = children(supervisor.pid)
        supervisor.signal(signal.SIGSTOP)
        os.kill(child, signal.SIGKILL)
        supervisor.kill()
    links = f"udpin:127.0.0.1:{dive.hil}", f"tcpin:127.0.0.1:{dive.port}"
    with autopilot(*links, options=("--state", str(dive.folder))):
        dive.time_to_answer_s()
        assert not dive.answer.mode & ARMED
        with closing(Ground(dive.port)) as ground:
            client = MissionClient(ground.endpoint.send, GROUND, VEHICLE)
            assert run(client.download(), ground.endpoint) == MISSION


FAILING = """
import os, sys
from autopilot.supervisor import FAILED_STARTS, supervise
def run(start):
    print(start.restarts, start.may_continue, flush=True)
    if start.may_continue:
        os.abort()
supervise(run)
"""


def test_state_that_ends_each_start_is_given_up() -> None:
    with process("-c", FAILING) as child:
        end = child.finish()
    assert end.status == 0
    assert end.stdout.split() == ["0", "True", "1", "True", "2", "True", "3", "False"]


def test_supervised_bad_option_ends_with_status_2() -> None:
    with process("-m", "autopilot", "--supervised", "--hil", "nowhere", "--state", "off") as child:
        end = child.finish()
    assert end.status == 2
    assert end.stderr.count("\n") == 1


def test_hanging_autopilot_is_killed_and_started_again() -> None:
    code = (
        "import time\nfrom autopilot.supervisor import supervise\n"
        "def run(start):\n    start.beat()\n    time.sleep(0 if start.restarts else 100)\n"
        "supervise(run)"
    )
    began_s = time.monotonic()
    with process("-c", code) as child:
        end = child.finish()
    assert end.status == 0
    assert "did not respond" in end.stderr
    assert time.monotonic() - began_s < RESTART_S + 1.0
