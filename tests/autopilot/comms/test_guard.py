"""An unexpected exception beside the tick: reported once, and the vehicle flies on."""

from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import all as mavlink

from autopilot.app import App
from autopilot.comms.ground_server import FRAMES_PER_POLL, GroundServer
from autopilot.comms.guard import MAX_TEXT, Guard
from autopilot.comms.hil import MAX_TIME_US, HilLink
from autopilot.comms.services import Services
from autopilot.control.params import ParamTable
from autopilot.control.types import Severity
from autopilot.onboard_log.recorder import OnboardLog
from autopilot.onboard_log.session import LogSession
from autopilot.telemetry.identity import AutopilotId
from autopilot.vehicle import Vehicle
from mavlink_io import dialect
from mavlink_io.codec import Frame, Framer
from mavlink_io.endpoint import Endpoint
from mavlink_io.transport import open_transport
from tests.helpers.fake_hil import TICK_US, sensors

SENSOR = dialect.by_name("HIL_SENSOR")


class Aboard:
    """The autopilot's loop between a simulator and one ground station, in this process."""

    def __init__(self, folder: Path | None = None) -> None:
        self._ends = [open_transport(f"memory:{name}") for name in ("hil", "hil", "gcs", "gcs")]
        near, far, self.line, gcs = self._ends
        self.simulator = Endpoint(near, 2, 1)
        self._station = mavlink.MAVLink(None, srcSystem=255, srcComponent=190)
        self._framer = Framer()
        self.vehicle = Vehicle(ParamTable())
        self.logbook = OnboardLog(self.vehicle, folder)
        self.server = GroundServer(self.vehicle, [gcs], AutopilotId.GENERIC, logbook=self.logbook)
        self.app = App(self.vehicle, HilLink(far, 1), self.server, self.logbook)

    def close(self) -> None:
        for end in self._ends:
            end.close()

    def say(self, *messages: Any) -> None:
        """What the ground station sends, in one datagram."""
        self.line.send(b"".join(message.pack(self._station) for message in messages))

    def heard(self) -> list[Frame]:
        """What the ground station has received since the last call."""
        self.server.flush()
        frames: list[Frame] = []
        while data := self.line.receive():
            frames += self._framer.feed(data)
        return frames

    def texts(self) -> list[Any]:
        self.server.poll()
        return [frame.decode() for frame in self.heard() if frame.name == "STATUSTEXT"]

    def step(self) -> None:
        self.app.step(min(self.server.poll(), 0.0))

    def tick(self, time_us: int) -> Any:
        """The answer to one sample."""
        self.simulator.send_values(SENSOR, sensors(time_us))
        self.step()
        (frame,) = self.simulator.receive()
        return frame.decode()

    def reports(self) -> list[Any]:
        """STATUSTEXTs of severity CRITICAL; only the first chunk of each."""
        return [m for m in self.texts() if m.severity == Severity.CRITICAL and m.chunk_seq == 0]


@pytest.fixture
def aboard() -> Iterator[Aboard]:
    with closing(Aboard()) as aboard:
        yield aboard


def fail(*_: object, **__: object) -> None:
    raise ValueError("broken on purpose")


def test_guard_reports_each_place_once_and_says_whether_it_was_done() -> None:
    said: list[tuple[str, Severity]] = []
    guard = Guard(lambda text, severity: said.append((text, severity)))
    assert [guard.run("logs", fail) for _ in range(3)] == [False] * 3
    assert guard.run("logs", lambda: None)
    assert not guard.run("telemetry", lambda: 1 / 0)
    assert [severity for _, severity in said] == [Severity.CRITICAL] * 2
    assert said[0][0].startswith(
        "Internal error in logs: ValueError broken on purpose (test_guard.py:"
    )
    assert "ZeroDivisionError" in said[1][0]
    assert all(len(text) <= MAX_TEXT for text, _ in said)


@pytest.mark.parametrize(
    ("part", "owner", "name"),
    [
        ("telemetry", GroundServer, "tell"),
        ("relay of devices", GroundServer, "relay"),
        ("ground service", Services, "feed"),
        ("ground services", Services, "poll"),
        ("bulk services", Services, "poll_bulk"),
        ("heartbeat", GroundServer, "_beat"),
    ],
)
def test_ticks_go_on_where_a_part_beside_them_fails(
    aboard: Aboard,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    part: str,
    owner: type,
    name: str,
) -> None:
    monkeypatch.setattr(owner, name, fail)
    for tick in range(5):
        aboard.server._heartbeat.hasten()
        aboard.say(mavlink.MAVLink_param_request_read_message(1, 1, b"HDG_P", -1))
        assert aboard.tick(tick * TICK_US).time_usec == tick * TICK_US
    (report,) = aboard.reports()
    assert report.text.startswith(f"Internal error in {part}: ValueError")
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert said.startswith(
        f"autopilot: Internal error in {part}: ValueError broken on purpose (test_guard.py:"
    )


@pytest.fixture
def logging(tmp_path: Path) -> Iterator[Aboard]:
    with closing(Aboard(tmp_path)) as aboard:
        yield aboard


def test_a_log_that_fails_is_given_up_and_the_flight_goes_on(
    logging: Aboard, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    aboard = logging
    aboard.tick(0)
    aboard.say(mavlink.MAVLink_command_long_message(1, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0))
    aboard.tick(TICK_US)
    assert aboard.vehicle.state.armed
    monkeypatch.setattr(LogSession, "tick", fail)
    for tick in range(2, 10):
        assert aboard.tick(tick * TICK_US).time_usec == tick * TICK_US
    (report,) = aboard.reports()
    assert report.text.startswith("Internal error in onboard log: ValueError")
    aboard.logbook.close()  # returns at once: the thread that writes has ended
    assert [path.suffix for path in tmp_path.iterdir()] == [".mcap"]


def test_more_commands_than_a_poll_serves_wait_in_order_while_samples_are_answered(
    aboard: Aboard,
) -> None:
    aboard.tick(0)
    count = 20 * FRAMES_PER_POLL
    intervals = range(1_000_000, 1_000_000 + count)
    aboard.heard()
    aboard.say(
        *(
            mavlink.MAVLink_command_long_message(1, 1, 511, 0, 30, us, 0, 0, 0, 0, 0)
            for us in intervals
        )
    )
    (link,) = aboard.server.links
    acknowledged, ticks = 0, 0
    while acknowledged < count:
        ticks += 1
        assert ticks <= count
        assert aboard.tick(ticks * TICK_US).time_usec == ticks * TICK_US
        served = [frame for frame in aboard.heard() if frame.name == "COMMAND_ACK"]
        assert len(served) <= FRAMES_PER_POLL
        acknowledged += len(served)
        interval_us = link.schedule.interval_us(30)
        assert interval_us == intervals[acknowledged - 1]  # the newest served, in order
    assert ticks >= 20
    assert not link.backlog


@pytest.mark.parametrize("time_us", [MAX_TIME_US + 1, 1 << 63, (1 << 64) - 1])
def test_a_sample_beyond_the_latest_time_is_not_flown_and_reported_once(
    aboard: Aboard, time_us: int
) -> None:
    aboard.tick(0)
    for _ in range(3):
        aboard.simulator.send_values(SENSOR, sensors(0)._replace(time_us=time_us))
        aboard.step()
    assert aboard.simulator.receive() == []
    assert aboard.tick(TICK_US).time_usec == TICK_US
    texts = "".join(text.text for text in aboard.texts())
    assert texts.count(f"sample time {time_us} us ignored") == 1


WRAP_US = (1 << 32) * 1000
"""time_boot_ms is a uint32: it wraps after 49.7 days."""


@pytest.mark.parametrize(
    "times_us",
    [(WRAP_US - TICK_US, WRAP_US, WRAP_US + TICK_US), (MAX_TIME_US - TICK_US, MAX_TIME_US)],
)
def test_time_at_wrap_and_at_maximum_is_answered(aboard: Aboard, times_us: tuple[int, ...]) -> None:
    for time_us in times_us:
        assert aboard.tick(time_us).time_usec == time_us
    assert aboard.reports() == []
