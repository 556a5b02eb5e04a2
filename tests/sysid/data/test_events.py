"""The texts that the autopilot sends become typed values; no other module interprets texts."""

import math
import re
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from autopilot.control import core, excitation, failsafe, modes
from autopilot.control.params import Config
from autopilot.control.sensor_health import monitor
from autopilot.control.sensor_health.sensor_checks import BATTERY
from autopilot.control.types import AutopilotState, Event, Excitation, VehicleEstimate
from mavlink_io.vehicle_modes import VehicleMode, mode_of_heartbeat
from sysid.data import events
from sysid.data.events import Armed, FailsafeCause, ModeChanged, PlainText, StopReason, parse_text

INFO = 6
TEST = Excitation(
    axis=excitation.RUDDER_AXIS,
    rudder_rad=0.1,
    elevator_rad=0.0,
    thrust=0.0,
    start_hz=0.0,
    stop_hz=0.0,
    duration_s=20.0,
    wave=excitation.Wave.STEP,
    fade_s=0.0,
    started_us=0,
    heading_rad=0.0,
    depth_m=5.0,
)
CONFIG = Config(sid_heading_max_deg=60.0)
PARSER = Path("sysid/data/events.py")
MATCHED_TEXT = re.compile(
    r"""(?<!"")["'](SystemID|Mode [A-Z]|Failsafe|Armed|Trim learned)"""
    r"""|\.text\.(startswith|endswith|find|removeprefix)|\.text [!=]= |" in \w+\.text\b"""
)


def parsed(event: object) -> events.VehicleEvent:
    assert isinstance(event, Event)
    return parse_text(event.severity, event.text)


@given(
    axis=st.sampled_from(sorted(excitation.AXES)),
    wave=st.sampled_from(excitation.Wave),
    sizes=st.tuples(*[st.floats(-15.0, 15.0)] * 3),
)
def test_started_test_is_parsed_as_sent(
    axis: int, wave: excitation.Wave, sizes: tuple[float, float, float]
) -> None:
    """Tolerance: the text has two decimals."""
    rudder_deg, elevator_deg, thrust_pct = sizes
    kind = excitation.AXES[axis]
    test = TEST._replace(
        axis=axis,
        wave=wave,
        rudder_rad=math.radians(rudder_deg),
        elevator_rad=math.radians(elevator_deg),
        thrust=0.01 * thrust_pct,
    )
    event = parse_text(INFO, f"SystemID Starting: {excitation.describe(test)}")
    assert isinstance(event, events.TestStarted)
    assert (event.axis.value, event.wave.value) == (axis, excitation.WAVES[wave])
    sent = thrust_pct if kind.thrust else rudder_deg if kind.rudder else elevator_deg
    assert event.magnitude == pytest.approx(sent, abs=0.00501)
    both = elevator_deg if kind.rudder and kind.elevator else 0.0
    assert event.elevator_deg == pytest.approx(both, abs=0.00501)


@pytest.mark.parametrize(
    ("estimate", "reason"),
    [
        ({"depth_m": 0.5}, StopReason.DEPTH),
        ({"depth_m": 500.0}, StopReason.DEPTH),
        ({"altitude_m": 0.1}, StopReason.ALTITUDE),
        ({"pitch_rad": 1.5}, StopReason.PITCH),
        ({"heading_rad": 3.1}, StopReason.HEADING),
        ({"r_radps": 3.0}, StopReason.RATE),
    ],
)
def test_envelope_violation_gives_its_stop_reason(
    estimate: dict[str, Any], reason: StopReason
) -> None:
    state = core.initial_state()._replace(
        test=TEST, estimate=VehicleEstimate(depth_m=5.0)._replace(**estimate)
    )
    _, (sent,) = core.end_test_if_due(state, CONFIG)
    assert parsed(sent) == (reason, failsafe.envelope_violation(TEST, state, CONFIG))


def test_end_of_test_gives_its_stop_reason() -> None:
    state = core.initial_state()._replace(test=TEST, estimate=VehicleEstimate(depth_m=5.0))
    _, (sent,) = core.end_test_if_due(state._replace(time_us=20_000_000), Config())
    assert parsed(sent) == events.TestEnded(StopReason.COMPLETE)
    late = state._replace(time_us=900_000_000, test=TEST._replace(duration_s=9e3))
    _, (sent,) = core.end_test_if_due(late, CONFIG)
    ended_late = parsed(sent)
    assert isinstance(ended_late, events.TestEnded)
    assert ended_late.reason == StopReason.TIME
    _, (sent, _) = modes.enter(state, modes.SURFACE)
    assert parsed(sent) == events.TestEnded(StopReason.MODE, "mode SURFACE")
    ended = parse_text(INFO, "SystemID Stopped: by ground")
    assert ended == events.TestEnded(StopReason.GROUND, "by ground")
    assert parse_text(INFO, "SystemID Stopped: ") == events.TestEnded(StopReason.OTHER, "other")


@pytest.mark.parametrize("mode", modes.MODES, ids=lambda mode: mode.name)
def test_mode_is_parsed_as_its_number(mode: modes.Mode) -> None:
    _, (sent,) = modes.enter(AutopilotState(mode=0), mode)
    assert parsed(sent) == ModeChanged(VehicleMode(mode.number))
    assert mode_of_heartbeat(0, mode.number) is VehicleMode[mode.name]


@pytest.mark.parametrize(
    ("text", "cause"),
    [
        ("depth unknown -> SURFACE", FailsafeCause.DEPTH_UNKNOWN),
        ("depth 18.2 m -> SURFACE", FailsafeCause.DEPTH),
        ("altitude 0.8 m -> SURFACE", FailsafeCause.ALTITUDE),
        ("pitch 80 deg -> SURFACE", FailsafeCause.PITCH),
        ("armed 7200 s -> SURFACE", FailsafeCause.ARMED_TIME),
        (f"{failsafe.GCS_LOST} -> RTL", FailsafeCause.GROUND_LOST),
        ("Leak detected -> SURFACE", FailsafeCause.LEAK),
        (f"{BATTERY} {monitor.LOW} -> SURFACE", FailsafeCause.BATTERY),
        ("no rise for 20 s -> propeller stopped", FailsafeCause.NO_RISE),
        ("surface not reached, no rise for 30 s", FailsafeCause.SURFACE_NOT_REACHED),
        ("of a later version", FailsafeCause.OTHER),
    ],
)
def test_failsafe_is_parsed_with_its_cause(text: str, cause: FailsafeCause) -> None:
    assert parse_text(2, f"Failsafe: {text}") == events.Failsafe(cause, f"Failsafe: {text}")


def test_ardupilot_start_has_no_magnitude() -> None:
    assert parse_text(INFO, "SystemID Starting: axis=12") == events.TestStarted(
        events.TestAxis.RUDDER
    )
    other = parse_text(INFO, "SystemID Starting: axis=10 wave=new magnitude=1.50")
    assert other == events.TestStarted(events.TestAxis.OTHER, events.TestWave.OTHER, 1.5)


def test_other_texts_are_kept() -> None:
    assert parse_text(INFO, "Armed: HOLD") == Armed()
    learned = parse_text(5, "Trim learned: TRIM_RUD_DEG 6.05, TRIM_ELE_DEG 0.4")
    assert learned == events.TrimLearned("TRIM_RUD_DEG 6.05, TRIM_ELE_DEG 0.4")
    assert parse_text(4, "Fault: rudder stuck") == events.InjectedFault("rudder stuck")
    assert parse_text(4, "Mode 7 refused") == PlainText(4, "Mode 7 refused")


@given(st.text() | st.from_regex(r"SystemID (Starting: axis=|Stopped:|Failsafe:)[\w=. -]*"))
def test_any_text_gives_a_value(text: str) -> None:
    assert isinstance(parse_text(INFO, text), events.VehicleEvent)


def test_no_other_module_matches_texts() -> None:
    found = [
        f"{path}: {line.strip()}"
        for package in ("sysid", "ground", "mavlink_io", "benchmarks", "examples")
        for path in sorted(Path(package).rglob("*.py"))
        if path != PARSER
        for line in path.read_text(encoding="utf-8").splitlines()
        if MATCHED_TEXT.search(line)
    ]
    assert found == []
