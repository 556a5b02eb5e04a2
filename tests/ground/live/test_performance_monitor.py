"""Live performance monitor: its reports from frames equal those from the log."""

import math
from collections.abc import Iterator
from io import StringIO
from pathlib import Path

import pytest
from rich.console import Console

from ground.client import param_file
from ground.client.vehicle import StatusText
from ground.live.listeners import Listeners
from ground.live.performance_monitor import PerformanceMonitor
from mavlink_io.codec import Frame
from mavlink_io.errors import InputError
from sysid import monitor
from sysid.data.dataset import Log
from tests.ground.live.test_estimate import TRAVEL_RAD, frame
from tests.sysid.monitor import made

BENT = made.flight(300.0, seed=2, shifts={"rudder_deg": 3.0}, from_s=150.0)


def frames(log: Log, shift_s: float = 0.0) -> Iterator[Frame]:
    """Return the frames of the vehicle at the rate of the log."""
    half = made.HEADING_RAD / 2.0
    for k, time_s in enumerate(log.attitude.time_s):
        ms = round((time_s + shift_s) * 1000)
        actuators = log.actuators
        outputs = [
            actuators.rudder_rad[k] / TRAVEL_RAD,
            actuators.elevator_rad[k] / TRAVEL_RAD,
            actuators.thrust[k],
        ]
        yield frame(
            "ATTITUDE_TARGET", time_boot_ms=ms, q=[math.cos(half), 0.0, 0.0, math.sin(half)]
        )
        yield frame("POSITION_TARGET_LOCAL_NED", time_boot_ms=ms, z=made.DEPTH_M)
        yield frame(
            "ACTUATOR_OUTPUT_STATUS", time_usec=ms * 1000, active=7, actuator=outputs + [0.0] * 29
        )
        yield frame("LOCAL_POSITION_NED", time_boot_ms=ms, z=log.depth.depth_m[k])
        yaw = math.remainder(log.attitude.yaw_rad[k], 2.0 * math.pi)
        yield frame("ATTITUDE", time_boot_ms=ms, pitch=log.attitude.pitch_rad[k], yaw=yaw)


def monitored(
    log: Log, announced: list[str] | None = None, shift_s: float = 0.0
) -> PerformanceMonitor:
    performance = PerformanceMonitor(
        made.baseline(), None if announced is None else announced.append
    )
    performance.begin({})
    feed(performance, log, shift_s)
    return performance


def feed(performance: PerformanceMonitor, log: Log, shift_s: float = 0.0) -> None:
    for count, received in enumerate(frames(log, shift_s)):
        performance.on_frame(received)
        if count % 700 == 699:
            performance.poll(last=True)
    performance.poll(last=True)


def test_live_report_equals_log_report_and_is_sent_once() -> None:
    announced: list[str] = []
    live = monitored(BENT, announced).report()
    after = monitor.monitor_log(BENT, made.baseline())
    assert [cause.name for cause in live.causes] == ["rudder"]
    assert live.detected_at_s == pytest.approx(after.detected_at_s)
    assert live.rms["rudder_deg"].measured == pytest.approx(
        after.rms["rudder_deg"].measured, rel=1e-3
    )
    assert len(announced) == 1
    assert announced[0].startswith("REFIT RECOMMENDED: bent duct")


def test_restarted_clock_keeps_earlier_windows() -> None:
    performance = monitored(made.flight(200.0, seed=1), shift_s=1000.0)
    seen = performance.report().windows
    feed(performance, made.flight(200.0, seed=3))
    assert seen > 5
    assert performance.report().windows == 2 * seen


def test_flight_during_identification_test_is_ignored() -> None:
    performance = PerformanceMonitor(made.baseline())
    performance.begin({})
    performance.on_text(StatusText(6, "SystemID Starting: axis=12"))
    feed(performance, made.flight(200.0, seed=1))
    assert performance.report().windows == 0


def test_table_shows_measured_and_predicted_rms() -> None:
    shown: list[object] = []
    listeners = Listeners([monitored(BENT)], shown.append)
    listeners.poll(last=True)
    console = Console(width=120, record=True, file=StringIO())
    console.print(shown[-1])
    text = console.export_text()
    assert "REFIT RECOMMENDED" in text
    assert "0.700" in text


def test_no_steady_flight_gives_no_comparison() -> None:
    performance = monitored(made.flight(20.0, seed=1))
    assert performance.format_text() == "no steady flight to compare with the predicted performance"


def test_gains_file_without_prediction_is_refused(tmp_path: Path) -> None:
    (tmp_path / "mine.param").write_text("HDG_P,0.5\n")
    with pytest.raises(
        InputError, match=r"mine\.param: holds no predicted performance; give a gains\.param"
    ):
        param_file.require_baseline(tmp_path / "mine.param")
