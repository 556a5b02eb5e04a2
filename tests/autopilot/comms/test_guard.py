"""Unexpected exceptions outside the tick are reported once, and the vehicle continues."""

from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import NoReturn

import pytest
from pymavlink.dialects.v20 import all as mavlink

from autopilot.comms.ground_server import MAX_FRAMES_PER_POLL, GroundServer
from autopilot.comms.guard import MAX_TEXT, Guard
from autopilot.comms.hil import MAX_TIME_US
from autopilot.comms.services import Services
from autopilot.control.types import Severity
from autopilot.onboard_log.session import LogSession
from autopilot.telemetry.streams import TelemetryStream, stream_group
from autopilot.telemetry.tick_messages import system_time
from mavlink_io import dialect
from tests.helpers.fake_hil import TICK_US, sensors
from tests.helpers.rig import SENSOR, Rig

BOOT_TIME_WRAP_US = (1 << 32) * 1000
"""Vehicle time at which ``time_boot_ms``, a uint32, wraps: 49.7 days."""


@pytest.fixture
def rig() -> Iterator[Rig]:
    with closing(Rig()) as rig:
        yield rig


def fail(*_: object, **__: object) -> NoReturn:
    raise ValueError("broken on purpose")


def test_guard_reports_each_source_line_once() -> None:
    sent_texts: list[tuple[str, Severity]] = []
    guard = Guard(lambda text, severity: sent_texts.append((text, severity)))
    assert [guard.run("logs", fail) for _ in range(3)] == [False] * 3
    assert guard.run("logs", lambda: None)
    assert not guard.run("telemetry", lambda: 1 / 0)
    assert [severity for _, severity in sent_texts] == [Severity.CRITICAL] * 2
    assert sent_texts[0][0].startswith(
        "Internal error in logs: ValueError broken on purpose (test_guard.py:"
    )
    assert "ZeroDivisionError" in sent_texts[1][0]
    assert all(len(text) <= MAX_TEXT for text, _ in sent_texts)


@pytest.mark.parametrize(
    ("part", "owner", "name"),
    [
        ("telemetry", GroundServer, "publish_telemetry"),
        ("relay of devices", GroundServer, "relay"),
        ("ground service", Services, "feed"),
        ("ground services", Services, "poll"),
        ("bulk services", Services, "poll_bulk"),
        ("heartbeat", GroundServer, "_send_heartbeat"),
    ],
)
def test_ticks_continue_when_another_part_raises(
    rig: Rig,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    part: str,
    owner: type,
    name: str,
) -> None:
    monkeypatch.setattr(owner, name, fail)
    for tick in range(5):
        rig.server._heartbeat.hasten()
        rig.simulator.send_values(dialect.by_name("STATUSTEXT"), (6, b"device", 0, 0))
        rig.step()
        rig.send(mavlink.MAVLink_param_request_read_message(1, 1, b"HDG_P", -1))
        assert rig.tick(tick * TICK_US).time_usec == tick * TICK_US
    (report,) = rig.reports()
    assert report.text.startswith(f"Internal error in {part}: ValueError")
    sent_texts = capsys.readouterr().err
    assert sent_texts.count("\n") == 1
    assert sent_texts.startswith(
        f"autopilot: Internal error in {part}: ValueError broken on purpose (test_guard.py:"
    )


@pytest.fixture
def logging(tmp_path: Path) -> Iterator[Rig]:
    with closing(Rig(tmp_path)) as rig:
        yield rig


def test_ticks_continue_when_log_raises(
    logging: Rig, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rig = logging
    rig.tick(0)
    rig.send(mavlink.MAVLink_command_long_message(1, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0))
    rig.tick(TICK_US)
    assert rig.vehicle.state.armed
    monkeypatch.setattr(LogSession, "tick", fail)
    for tick in range(2, 10):
        assert rig.tick(tick * TICK_US).time_usec == tick * TICK_US
    (report,) = rig.reports()
    assert report.text.startswith("Internal error in onboard log: ValueError")
    rig.onboard_log.close()  # returns at once: the writer thread has ended
    assert [path.suffix for path in tmp_path.iterdir()] == [".mcap"]


def test_command_backlog_is_processed_in_order_between_ticks(
    rig: Rig,
) -> None:
    rig.tick(0)
    count = 20 * MAX_FRAMES_PER_POLL
    intervals = range(1_000_000, 1_000_000 + count)
    rig.receive()
    rig.send(
        *(
            mavlink.MAVLink_command_long_message(1, 1, 511, 0, 30, us, 0, 0, 0, 0, 0)
            for us in intervals
        )
    )
    (link,) = rig.server.links
    acknowledged, ticks = 0, 0
    while acknowledged < count:
        ticks += 1
        assert ticks <= count
        assert rig.tick(ticks * TICK_US).time_usec == ticks * TICK_US
        served = [frame for frame in rig.receive() if frame.name == "COMMAND_ACK"]
        assert len(served) <= MAX_FRAMES_PER_POLL
        acknowledged += len(served)
        interval_us = link.schedule.interval_us(30)
        assert interval_us == intervals[acknowledged - 1]  # of the last processed command, in order
    assert ticks >= 20
    assert not link.backlog


@pytest.mark.parametrize("time_us", [MAX_TIME_US + 1, 1 << 63, (1 << 64) - 1])
def test_sample_beyond_latest_time_is_ignored_and_reported_once(rig: Rig, time_us: int) -> None:
    rig.tick(0)
    for _ in range(3):
        rig.simulator.send_values(SENSOR, sensors(0)._replace(time_us=time_us))
        rig.step()
    assert rig.simulator.receive() == []
    assert rig.tick(TICK_US).time_usec == TICK_US
    texts = "".join(text.text for text in rig.texts())
    assert texts.count(f"sample time {time_us} us ignored") == 1


@pytest.mark.parametrize(
    "times_us",
    [
        [BOOT_TIME_WRAP_US - TICK_US, BOOT_TIME_WRAP_US, BOOT_TIME_WRAP_US + TICK_US],
        [MAX_TIME_US - TICK_US, MAX_TIME_US],
    ],
)
def test_latest_time_and_wrap_of_boot_time_are_answered(rig: Rig, times_us: list[int]) -> None:
    for time_us in times_us:
        assert rig.tick(time_us).time_usec == time_us
    assert rig.reports() == []


@pytest.mark.parametrize("of_tick", [True, False])
def test_failing_stream_does_not_stop_the_others(
    rig: Rig, monkeypatch: pytest.MonkeyPatch, of_tick: bool
) -> None:
    (link,) = rig.server.links
    broken = TelemetryStream(dialect.by_name("ATTITUDE"), 50, fail, of_tick=of_tick)
    sound = TelemetryStream(dialect.by_name("SYSTEM_TIME"), 50, system_time, of_tick=of_tick)
    group = stream_group([broken, sound])
    monkeypatch.setattr(link.schedule, "due", lambda _: [group])
    rig.tick(0)
    received = rig.receive()
    rig.server.poll()
    received += rig.receive()
    assert "SYSTEM_TIME" in [frame.name for frame in received]
    (report, *_) = [frame.decode() for frame in received if frame.name == "STATUSTEXT"]
    assert report.severity == Severity.CRITICAL
    assert report.text.startswith("Internal error in telemetry: ValueError")


def test_services_start_again_after_an_exception(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    rig.tick(0)
    services = rig.server._services
    services.ground_received_s = 5.0
    missions = services._missions
    monkeypatch.setattr(missions, "feed", fail)
    rig.send(mavlink.MAVLink_mission_request_list_message(1, 1, 0))
    rig.tick(TICK_US)
    assert services._missions is not missions
    assert services.ground_received_s == 5.0
    rig.send(mavlink.MAVLink_mission_request_list_message(1, 1, 0))
    rig.tick(2 * TICK_US)
    assert "MISSION_COUNT" in [frame.name for frame in rig.receive()]


def test_log_starts_again_after_an_exception(
    logging: Rig, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rig = logging
    rig.tick(0)
    rig.send(mavlink.MAVLink_command_long_message(1, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0))
    rig.tick(TICK_US)
    with monkeypatch.context() as patch:
        patch.setattr(LogSession, "tick", fail)
        rig.tick(2 * TICK_US)
    rig.onboard_log._retry_s = 0.0
    for tick in range(3, 20):
        rig.tick(tick * TICK_US)
    rig.onboard_log.close()
    assert len(list(tmp_path.glob("*.mcap"))) == 2
