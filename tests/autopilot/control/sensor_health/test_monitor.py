"""Sensor monitor: detection, confirmation, reports and reactions, through the pure tick."""

import math

import pytest

from autopilot.control import core
from autopilot.control.params import Config
from autopilot.control.sensor_health import monitor
from autopilot.control.types import AutopilotState, Event, Inputs
from mavlink_io.records import Battery, Leak, SensorFrame
from tests.helpers.missions import TICK_US, sensors


def live(
    seconds: float,
    config: Config | None = None,
    state: AutopilotState | None = None,
    **devices: object,
) -> tuple[AutopilotState, list[str]]:
    """Run ticks with the same records once a second; return the state and the texts."""
    state, said = state or AutopilotState(), []
    for tick in range(round(seconds * 50)):
        time_us = state.time_us + TICK_US
        inputs = Inputs(sensors(time_us), None, None, None)
        if tick % 50 == 0:
            inputs = inputs._replace(**devices)  # type: ignore[arg-type]
        state, _, _, events = core.tick(state, inputs, config or Config())
        said += [event.text for event in events if isinstance(event, Event)]
    return state, said


def test_battery_low_is_reported_prevents_arming_and_surfaces() -> None:
    low = Battery(28.0, 3.0, 1.0, 0.1)
    state, said = live(5.0, battery=low)
    assert said == ["Battery low"]
    assert monitor.prearm_failure(state.health) == "Battery low"
    _, said = live(1.0, state=state._replace(armed=True), battery=low)
    assert said[0] == "Failsafe: Battery low -> SURFACE"


def test_battery_low_voltage_is_reported_and_can_be_disabled() -> None:
    weak = Battery(24.0, 3.0, 1.0, 0.9)
    assert live(5.0, battery=weak)[1] == []
    assert live(5.0, Config(fs_battery_v=25.0), battery=weak)[1] == ["Battery low"]
    assert live(5.0, Config(fs_battery_pct=0.0), battery=Battery(28.0, 3.0, 1.0, 0.1))[1] == []


def test_leak_repeated_is_reported_once() -> None:
    state, said = live(10.0, leak=Leak(True))
    assert said == ["Leak detected"]
    _, said = live(10.0, state=state, leak=Leak(False))
    assert said == ["Leak recovered"]


@pytest.mark.parametrize("nonsense", [math.nan, math.inf, -math.inf, 1e30])
@pytest.mark.parametrize("field", SensorFrame._fields[1:11])
def test_sensors_implausible_reading_is_not_used(field: str, nonsense: float) -> None:
    state, _ = live(2.0)
    for tick in range(100):
        frame = sensors(state.time_us + TICK_US)
        if tick % 10 < 5:
            frame = frame._replace(**{field: nonsense})  # type: ignore[arg-type]
        state, _, _, _ = core.tick(state, Inputs(frame, None, None, None), Config())
    at = state.estimate
    assert all(
        map(
            math.isfinite,
            (*at.attitude, at.depth_m, at.depth_rate_mps, at.p_radps, *at.gyro_bias_radps),
        )
    )
    assert at.depth_m == pytest.approx(5.0, abs=0.1)
    assert abs(at.roll_rad) + abs(at.pitch_rad) + abs(at.heading_rad) < 0.02
    assert len(monitor.active_faults(state.health)) == 1


def battery_events(intervals_s: list[float]) -> list[tuple[float, str]]:
    """Return (time, text) of the events for battery records at the given intervals."""
    due_us, words, state, said = TICK_US, list(intervals_s), AutopilotState(), []
    while words:
        time_us = state.time_us + TICK_US
        inputs = Inputs(sensors(time_us), None, None, None)
        if time_us >= due_us:
            due_us += round(words.pop(0) * 1e6)
            inputs = inputs._replace(battery=Battery(28.0, 3.0, 0.001 * len(words), 0.9))
        state, _, _, events = core.tick(state, inputs, Config())
        said += [(time_us / 1e6, event.text) for event in events if isinstance(event, Event)]
    return said


@pytest.mark.parametrize("interval_s", [0.1, 9.0, 25.0])
def test_device_silence_limit_follows_its_interval(interval_s: float) -> None:
    """A steady device is not reported; one that stops is, after three intervals, at least 10 s."""
    steady = [interval_s] * 8
    assert battery_events(steady) == []
    stopped_s = 7 * interval_s
    ((lost_s, lost), (_, back)) = battery_events(
        [*steady[1:], 90.0, *[interval_s] * max(3, round(8.0 / interval_s))]
    )
    assert (lost, back) == ("Battery silent", "Battery recovered")
    assert lost_s - stopped_s == pytest.approx(max(10.0, 3.0 * interval_s), abs=0.5)


def test_device_slowing_down_is_reported_once() -> None:
    said = [text for _, text in battery_events([*[1.0] * 5, *[12.0] * 9, *[1.0] * 8])]
    assert said == ["Battery silent", "Battery recovered"]


def test_device_single_record_is_reported_silent() -> None:
    ((lost_s, lost),) = battery_events([40.0, 0.0])
    assert lost == "Battery silent"
    assert lost_s == pytest.approx(30.0, abs=0.5)


def test_device_single_spike_is_not_reported() -> None:
    state, _ = live(2.0)
    spike = sensors(state.time_us + TICK_US)._replace(pressure_hpa=3000.0)
    state, _, _, events = core.tick(state, Inputs(spike, None, None, None), Config())
    state, said = live(5.0, state=state)
    assert (events, said) == ((), [])
    assert state.estimate.depth_m == pytest.approx(5.0, abs=0.01)
