"""Bad stamps and new time bases of the sensors: effect on arming, mission, answers and log."""

from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader

from autopilot import app
from autopilot.app import App
from autopilot.comms import hil
from autopilot.control import modes, requests
from autopilot.onboard_log.recorder import OnboardLog
from mavlink_io import dialect
from mavlink_io.records import GpsFix
from mavlink_io.transport import MemoryTransport
from sitl.backends.hil import HilClient
from sitl.core.sensors import Sensors
from tests.helpers.fake_hil import TICK_US, Harness, sensors, texts
from tests.helpers.missions import leg

DEPTH_M = 5.0
BEGAN_US = 30_000_000
"""First stamp; a sensor clock that restarts decreases by this amount."""


Ends = tuple[MemoryTransport, MemoryTransport]
"""Both ends of the HIL link: simulator, autopilot."""


class Rig:
    """An autopilot in a mission, and the far end of its HIL link, in lockstep."""

    def __init__(self, ends: Ends, logs: Path) -> None:
        near, far = ends
        self.sea, self.harness = HilClient(near), Harness()
        self.onboard_log = OnboardLog(self.harness.vehicle, logs)
        self.hil = hil.HilLink(far, 1)
        self.app = App(self.harness.vehicle, self.hil, self.harness.server, self.onboard_log)
        self.wall_s = 100.0

    def send(self, stamp_us: int, fix: GpsFix | None = None) -> int | None:
        """Send a sample; return the stamp of the answer, None without one."""
        self.wall_s += 1e-6 * TICK_US
        self.sea.send(self.sea.datagram(Sensors(sensors(stamp_us, DEPTH_M), fix, None), None))
        self.app.step(0.0)
        answer = self.sea.newest()
        return None if answer is None else answer.time_us

    def send_samples(self, count: int, first_us: int) -> list[int | None]:
        return [self.send(first_us + n * TICK_US) for n in range(count)]

    def arm(self) -> None:
        items = leg(depth_m=DEPTH_M, heading_deg=0.0, duration_s=60.0)
        mode = requests.SetMode(modes.MISSION.number)
        for request in (requests.LoadMission(items), mode, requests.Arm()):
            assert self.harness.vehicle.handle_request(request).result == 0

    def received_texts(self) -> list[str]:
        self.harness.serve()
        return texts(self.harness.station.pop_received())

    @property
    def state(self) -> Any:
        return self.harness.vehicle.state


def started(rig: Rig) -> Rig:
    """Return the rig after 50 samples, arming in a mission and 100 more samples."""
    rig.send_samples(50, BEGAN_US)
    rig.arm()
    rig.send_samples(100, BEGAN_US + 50 * TICK_US)
    rig.received_texts()
    return rig


@pytest.fixture
def new_rig(ends: Ends, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Rig:
    """Return an autopilot without a sample yet."""
    rig = Rig(ends, tmp_path)
    monkeypatch.setattr(app, "wall_s", lambda: rig.wall_s)
    return rig


@pytest.fixture
def rig(new_rig: Rig) -> Rig:
    return started(new_rig)


NEXT_US = BEGAN_US + 150 * TICK_US
"""Stamp of the next regular sample."""


@pytest.mark.parametrize("bad_us", [NEXT_US + 1_000_000, NEXT_US - 2_000_000, 0])
def test_bad_stamp_does_not_affect_arming_and_answers(rig: Rig, bad_us: int) -> None:
    assert rig.send(bad_us) is None
    honest = [NEXT_US + n * TICK_US for n in range(100)]
    assert rig.send_samples(100, NEXT_US) == honest
    assert rig.state.armed
    assert rig.state.time_us == honest[-1]
    assert rig.received_texts() == []


@pytest.mark.parametrize("base_us", [0, 20_000_000, NEXT_US + 5_000_000, 1_800_000_000_000_000])
def test_new_time_base_does_not_affect_arming_and_mission(rig: Rig, base_us: int) -> None:
    """Backward, forward, and to UNIX time."""
    before = rig.state
    answers = rig.send_samples(50, base_us)
    assert answers == [None] * 4 + [base_us + n * TICK_US for n in range(4, 50)]
    after = rig.state
    assert after.armed
    assert after.mode == modes.MISSION.number
    assert after.mission == before.mission
    assert after.estimate.depth_m == pytest.approx(before.estimate.depth_m, abs=0.05)
    assert 0 < after.time_us - before.time_us <= 51 * TICK_US
    jump_s = (base_us - NEXT_US) / 1e6
    assert rig.received_texts() == [f"Sensor clock jumped {jump_s:+.1f} s: vehicle time goes on"]


def test_repeated_sample_on_new_time_base_keeps_its_stamp(rig: Rig) -> None:
    rig.send_samples(10, 0)
    assert rig.send(9 * TICK_US) == 9 * TICK_US


def test_telemetry_time_continues_over_new_time_bases(rig: Rig) -> None:
    rig.harness.station.pop_received()
    for base_us in (0, 10_000_000, 500_000):
        for answer_us in rig.send_samples(100, base_us)[5:]:
            assert answer_us is not None
        rig.send(base_us + 100 * TICK_US, fix(base_us + 99 * TICK_US))
        rig.send_samples(60, base_us + 101 * TICK_US)
    rig.harness.serve()
    received = rig.harness.station.pop_received()
    stamps = {"ATTITUDE": "time_boot_ms", "ALTITUDE": "time_usec", "GPS_RAW_INT": "time_usec"}
    for name, field in stamps.items():
        times = [getattr(message, field) for message in received if message.get_type() == name]
        assert len(times) > 2
        assert times == sorted(times), name


def fix(stamp_us: int) -> GpsFix:
    return GpsFix(stamp_us, 3, 42.35, -71.0, 0.0, 0.0, 0.0, 0.0, 10, 1.5, 3.0)


def test_disarmed_vehicle_restarts_when_time_decreases(new_rig: Rig) -> None:
    """A new run of a simulator: vehicle time is that of its samples."""
    new_rig.send_samples(50, BEGAN_US)
    assert new_rig.send_samples(10, 0)[4:] == [n * TICK_US for n in range(4, 10)]
    assert new_rig.state.time_us == 9 * TICK_US
    assert new_rig.received_texts() == ["Restarted: vehicle time fell back"]


@pytest.mark.parametrize("first_us", [0, 10**15, 2**64 - 1])
def test_bad_first_stamp_does_not_prevent_arming(new_rig: Rig, first_us: int) -> None:
    new_rig.send(first_us)
    answers = new_rig.send_samples(50, BEGAN_US)
    assert answers[4:] == [BEGAN_US + n * TICK_US for n in range(4, 50)]
    new_rig.arm()
    new_rig.send_samples(10, BEGAN_US + 50 * TICK_US)
    assert new_rig.state.armed


def test_log_time_increases_over_new_time_base(rig: Rig, tmp_path: Path) -> None:
    """One file; its times and the stamps in the sensor messages are vehicle time, in order."""
    rig.send_samples(50, 0)
    rig.onboard_log.close()
    (log,) = tmp_path.glob("*.mcap")
    sensor = dialect.by_name("HIL_SENSOR")
    with log.open("rb") as file:
        logged = [
            (message.log_time, sensor.unpack(message.data).time_usec)
            for _, channel, message in make_reader(file).iter_messages(log_time_order=False)
            if channel.topic.endswith("HIL_SENSOR")
        ]
    assert len(logged) == 100 + 46
    assert len({log_ns - 1000 * stamp_us for log_ns, stamp_us in logged}) == 1
    assert [stamp_us for _, stamp_us in logged] == sorted({stamp_us for _, stamp_us in logged})


def test_constant_stamps_on_serial_line_are_sensor_loss(rig: Rig) -> None:
    """Vehicle time stops with them."""
    rig.hil.lockstep = False
    for _ in range(60):
        rig.send(NEXT_US - TICK_US)
    assert rig.received_texts() == ["Sensor timeout"]
