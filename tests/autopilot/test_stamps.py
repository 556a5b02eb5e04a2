"""Bad stamps and new time bases of the sensors: an autopilot's arming, mission, answers, log."""

from collections.abc import Iterator
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
from mavlink_io.transport import MemoryTransport, open_transport
from sitl.backends.hil import HilClient
from sitl.core.sensors import Sensors
from tests.helpers.fake_hil import TICK_US, Deck, sensors, texts
from tests.helpers.missions import leg

DEPTH_M = 5.0
BEGAN_US = 30_000_000
"""Vehicle time at the start: a sensor clock that begins again falls back by so much."""


Ends = tuple[MemoryTransport, MemoryTransport]
"""The HIL link: the simulator's end, and the autopilot's."""


class Aboard:
    """An autopilot under way in a mission, and the far end of its HIL link, in lockstep."""

    def __init__(self, ends: Ends, logs: Path) -> None:
        near, far = ends
        self.sea, self.deck = HilClient(near), Deck()
        self.logbook = OnboardLog(self.deck.vehicle, logs)
        self.hil = hil.HilLink(far, 1)
        self.app = App(self.deck.vehicle, self.hil, self.deck.server, self.logbook)
        self.wall_s = 100.0

    def send(self, stamp_us: int, fix: GpsFix | None = None) -> int | None:
        """Send a sample; the stamp of the answer, None where there is none."""
        self.wall_s += 1e-6 * TICK_US
        self.sea.send(self.sea.datagram(Sensors(sensors(stamp_us, DEPTH_M), fix, None), None))
        self.app.step(0.0)
        answer = self.sea.newest()
        return None if answer is None else answer.time_us

    def sail(self, count: int, first_us: int) -> list[int | None]:
        return [self.send(first_us + n * TICK_US) for n in range(count)]

    def arm(self) -> None:
        items = leg(depth_m=DEPTH_M, heading_deg=0.0, duration_s=60.0)
        mode = requests.SetMode(modes.MISSION.number)
        for wish in (requests.LoadMission(items), mode, requests.Arm()):
            assert self.deck.vehicle.request(wish).result == 0

    def said(self) -> list[str]:
        self.deck.serve()
        return texts(self.deck.station.heard())

    @property
    def state(self) -> Any:
        return self.deck.vehicle.state


@pytest.fixture
def ends() -> Iterator[Ends]:
    near, far = open_transport("memory:stamps"), open_transport("memory:stamps")
    assert isinstance(near, MemoryTransport)
    assert isinstance(far, MemoryTransport)
    yield near, far
    near.close()
    far.close()


def started(aboard: Aboard) -> Aboard:
    """50 samples, then armed in a mission and 100 more."""
    aboard.sail(50, BEGAN_US)
    aboard.arm()
    aboard.sail(100, BEGAN_US + 50 * TICK_US)
    aboard.said()
    return aboard


@pytest.fixture
def switched_on(ends: Ends, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Aboard:
    """An autopilot that has had no sample yet."""
    aboard = Aboard(ends, tmp_path)
    monkeypatch.setattr(app, "wall_s", lambda: aboard.wall_s)
    return aboard


@pytest.fixture
def aboard(switched_on: Aboard) -> Aboard:
    return started(switched_on)


NEXT_US = BEGAN_US + 150 * TICK_US
"""Stamp of the next honest sample."""


@pytest.mark.parametrize("bad_us", [NEXT_US + 1_000_000, NEXT_US - 2_000_000, 0, 2**63])
def test_one_bad_stamp_leaves_arming_and_answers_alone(aboard: Aboard, bad_us: int) -> None:
    assert aboard.send(bad_us) is None
    honest = [NEXT_US + n * TICK_US for n in range(100)]
    assert aboard.sail(100, NEXT_US) == honest
    assert aboard.state.armed
    assert aboard.state.time_us == honest[-1]
    assert aboard.said() == []


@pytest.mark.parametrize("base_us", [0, 20_000_000, NEXT_US + 5_000_000, 1_800_000_000_000_000])
def test_new_time_base_leaves_arming_and_mission_alone(aboard: Aboard, base_us: int) -> None:
    """Backward, forward, and to UNIX time."""
    before = aboard.state
    answers = aboard.sail(50, base_us)
    assert answers == [None] * 4 + [base_us + n * TICK_US for n in range(4, 50)]
    after = aboard.state
    assert after.armed
    assert after.mode == modes.MISSION.number
    assert after.mission == before.mission
    assert after.estimate.depth_m == pytest.approx(before.estimate.depth_m, abs=0.05)
    assert 0 < after.time_us - before.time_us <= 51 * TICK_US
    jump_s = (base_us - NEXT_US) / 1e6
    assert aboard.said() == [f"Sensor clock jumped {jump_s:+.1f} s: vehicle time goes on"]


def test_repeated_sample_after_new_time_base_is_answered_with_its_stamp(aboard: Aboard) -> None:
    aboard.sail(10, 0)
    assert aboard.send(9 * TICK_US) == 9 * TICK_US


def test_telemetry_time_goes_on_over_new_time_bases(aboard: Aboard) -> None:
    aboard.deck.station.heard()
    for base_us in (0, 10_000_000, 500_000):
        for answer_us in aboard.sail(100, base_us)[5:]:
            assert answer_us is not None
        aboard.send(base_us + 100 * TICK_US, fix(base_us + 99 * TICK_US))
        aboard.sail(60, base_us + 101 * TICK_US)
    aboard.deck.serve()
    heard = aboard.deck.station.heard()
    stamps = {"ATTITUDE": "time_boot_ms", "ALTITUDE": "time_usec", "GPS_RAW_INT": "time_usec"}
    for name, field in stamps.items():
        times = [getattr(message, field) for message in heard if message.get_type() == name]
        assert len(times) > 2
        assert times == sorted(times), name


def fix(stamp_us: int) -> GpsFix:
    return GpsFix(stamp_us, 3, 42.35, -71.0, 0.0, 0.0, 0.0, 0.0, 10, 1.5, 3.0)


def test_disarmed_vehicle_whose_time_falls_back_begins_anew(switched_on: Aboard) -> None:
    """A new run of a simulator: time is that of its samples."""
    switched_on.sail(50, BEGAN_US)
    assert switched_on.sail(10, 0)[4:] == [n * TICK_US for n in range(4, 10)]
    assert switched_on.state.time_us == 9 * TICK_US
    assert switched_on.said() == ["Restarted: vehicle time fell back"]


@pytest.mark.parametrize("first_us", [0, 10**15, 2**64 - 1])
def test_bad_first_stamp_does_not_keep_from_arming(switched_on: Aboard, first_us: int) -> None:
    switched_on.send(first_us)
    answers = switched_on.sail(50, BEGAN_US)
    assert answers[4:] == [BEGAN_US + n * TICK_US for n in range(4, 50)]
    switched_on.arm()
    switched_on.sail(10, BEGAN_US + 50 * TICK_US)
    assert switched_on.state.armed


def test_onboard_log_has_one_time_over_a_new_time_base(aboard: Aboard, tmp_path: Path) -> None:
    """One file; its times and the stamps of what the sensors sent are vehicle time, in order."""
    aboard.sail(50, 0)
    aboard.logbook.close()
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


def test_stamps_that_stand_still_on_a_serial_line_are_silence(aboard: Aboard) -> None:
    """Vehicle time stands still with them."""
    aboard.hil.lockstep = False
    for _ in range(60):
        aboard.send(NEXT_US - TICK_US)
    assert aboard.said() == ["Sensor timeout"]
