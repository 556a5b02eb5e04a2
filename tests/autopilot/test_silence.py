"""Loss of the sensors on a serial line: detected by the wall clock, as vehicle time stops."""

import pytest

from autopilot import app
from autopilot.app import SENSOR_SILENCE_S, App
from autopilot.comms import hil
from autopilot.control.sensor_health.monitor import RECOVERY_US
from autopilot.onboard_log.recorder import OnboardLog
from mavlink_io.records import LOCKSTEP_FLAG, SensorFrame
from mavlink_io.transport import MemoryTransport
from sitl.backends.hil import HilClient
from sitl.core.sensors import Sensors
from tests.helpers.fake_hil import TICK_US, Harness, only, sensors, texts

ARM = 400
ACCEPTED, REJECTED = 0, 1


def noisy(time_us: int) -> SensorFrame:
    """Return a sample of a vehicle at rest with sensor noise."""
    frame, noise = sensors(time_us), 1e-8 * (time_us % 1_000_000)
    return SensorFrame._make((time_us, *(reading + noise for reading in frame[1:11]), *frame[11:]))


class Rig:
    """An autopilot with a wall clock of the test, and the far end of its HIL link."""

    def __init__(self, near: MemoryTransport, far: MemoryTransport) -> None:
        self.near, self.sea = near, HilClient(near)
        self.harness = Harness()
        self.app = App(
            self.harness.vehicle,
            hil.HilLink(far, 1),
            self.harness.server,
            OnboardLog(self.harness.vehicle, None),
        )
        self.time_us, self.wall_s = 0, 100.0

    def sample(self, count: int = 1) -> int:
        """Send samples one tick apart; return the flags of the last answer."""
        for _ in range(count):
            self.time_us += TICK_US
            self.wall_s += 1e-6 * TICK_US
            self.sea.send(self.sea.datagram(Sensors(noisy(self.time_us), None, None), None))
            self.app.step(0.0)
        answer = self.sea.newest()
        assert answer is not None
        return answer.flags

    def silence(self, seconds: float) -> list[str]:
        """Return the texts sent during a pause of the sensors, whose clock continues."""
        self.harness.station.pop_received()
        for _ in range(10):
            self.wall_s += seconds / 10.0
            self.app.step(0.0)
        self.time_us += round(1e6 * seconds / TICK_US) * TICK_US
        return self.received_texts()

    def received_texts(self) -> list[str]:
        self.harness.serve()
        return texts(self.harness.station.pop_received())

    def arm(self) -> int:
        return int(only(self.harness.command(ARM, 1.0), "COMMAND_ACK").result)


@pytest.fixture
def cable(ends: tuple[MemoryTransport, MemoryTransport], monkeypatch: pytest.MonkeyPatch) -> Rig:
    ends[1].address = "serial:/dev/ttyS0:115200"
    rig = Rig(*ends)
    monkeypatch.setattr(app, "wall_s", lambda: rig.wall_s)
    return rig


def test_sensor_loss_is_reported_once_and_blocks_arming(cable: Rig) -> None:
    cable.sample(50)
    assert cable.silence(0.9 * SENSOR_SILENCE_S) == []
    cable.sample(50)
    assert cable.silence(3.0 * SENSOR_SILENCE_S) == ["Sensor timeout"]
    assert cable.silence(3.0 * SENSOR_SILENCE_S) == []
    assert cable.arm() == REJECTED
    cable.sample(50)
    assert cable.received_texts() == ["Sensors recovered"]
    assert cable.arm() == ACCEPTED


def test_arming_after_short_sensor_loss_needs_new_samples(cable: Rig) -> None:
    cable.sample(50)
    assert cable.silence(2.0 * SENSOR_SILENCE_S) == ["Sensor timeout"]
    cable.sample(50)
    assert cable.received_texts() == []
    assert cable.arm() == REJECTED
    cable.sample(RECOVERY_US // TICK_US)
    assert "Sensors recovered" in cable.received_texts()
    assert cable.arm() == ACCEPTED


def test_sensors_that_never_sent_are_not_reported(cable: Rig) -> None:
    assert cable.silence(60.0) == []


def test_wrong_baud_rate_is_reported_every_10_s_but_noise_is_not(cable: Rig) -> None:
    cable.near.send(b"noise" * 20)
    assert cable.silence(SENSOR_SILENCE_S) == []
    for _ in range(2):
        for _ in range(2):
            cable.near.send(bytes(range(256)) * 8)
            cable.app.step(0.0)
        assert cable.received_texts() == ["HIL: no MAVLink in received bytes: check baud rate"]
        assert cable.silence(SENSOR_SILENCE_S) == []
        cable.wall_s += app.WRONG_BAUD_PERIOD_S


def test_lockstep_pause_is_not_reported(
    ends: tuple[MemoryTransport, MemoryTransport], monkeypatch: pytest.MonkeyPatch
) -> None:
    rig = Rig(*ends)
    monkeypatch.setattr(app, "wall_s", lambda: rig.wall_s)
    assert rig.sample(50) == LOCKSTEP_FLAG
    assert rig.silence(60.0) == []


def test_answers_on_serial_line_have_no_lockstep_flag(cable: Rig) -> None:
    assert cable.sample() == 0
