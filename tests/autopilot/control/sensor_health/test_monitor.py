"""What the vehicle makes of what her devices say, and what she does about it."""

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
    """Ticks with the same devices' word once a second; the state and what was said."""
    state, said = state or AutopilotState(), []
    for tick in range(round(seconds * 50)):
        time_us = state.time_us + TICK_US
        inputs = Inputs(sensors(time_us), None, None, None)
        if tick % 50 == 0:
            inputs = inputs._replace(**devices)  # type: ignore[arg-type]
        state, _, _, events = core.tick(state, inputs, config or Config())
        said += [event.text for event in events if isinstance(event, Event)]
    return state, said


def test_a_low_battery_is_told_refuses_arming_and_under_way_brings_her_up() -> None:
    low = Battery(28.0, 3.0, 1.0, 0.1)
    state, said = live(5.0, battery=low)
    assert said == ["Battery low"]
    assert monitor.prearm_failure(state.health) == "Battery low"
    _, said = live(1.0, state=state._replace(armed=True), battery=low)
    assert said[0] == "Failsafe: Battery low -> SURFACE"


def test_voltage_may_say_so_too_and_either_can_be_switched_off() -> None:
    weak = Battery(24.0, 3.0, 1.0, 0.9)
    assert live(5.0, battery=weak)[1] == []
    assert live(5.0, Config(fs_battery_v=25.0), battery=weak)[1] == ["Battery low"]
    assert live(5.0, Config(fs_battery_pct=0.0), battery=Battery(28.0, 3.0, 1.0, 0.1))[1] == []


def test_a_leak_is_told_once_however_often_it_is_heard() -> None:
    state, said = live(10.0, leak=Leak(True))
    assert said == ["Leak detected"]
    _, said = live(10.0, state=state, leak=Leak(False))
    assert said == ["Leak recovered"]


@pytest.mark.parametrize("nonsense", [math.nan, math.inf, -math.inf, 1e30])
@pytest.mark.parametrize("field", SensorFrame._fields[1:11])
def test_no_nonsense_reaches_the_estimate(field: str, nonsense: float) -> None:
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


def hear_battery(intervals_s: list[float]) -> list[tuple[float, str]]:
    """When what was said, with the gauge's words so far apart."""
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
def test_a_device_is_silent_by_its_own_pace(interval_s: float) -> None:
    """A steady one never; one that stops, after three of its intervals or ten seconds, the
    longer."""
    steady = [interval_s] * 8
    assert hear_battery(steady) == []
    stopped_s = 7 * interval_s
    ((lost_s, lost), (_, back)) = hear_battery(
        [*steady[1:], 90.0, *[interval_s] * max(3, round(8.0 / interval_s))]
    )
    assert (lost, back) == ("Battery silent", "Battery recovered")
    assert lost_s - stopped_s == pytest.approx(max(10.0, 3.0 * interval_s), abs=0.5)


def test_a_device_that_turns_slow_is_told_so_and_never_flaps() -> None:
    said = [text for _, text in hear_battery([*[1.0] * 5, *[12.0] * 9, *[1.0] * 8])]
    assert said == ["Battery silent", "Battery recovered"]


def test_a_device_that_speaks_only_once_is_told_silent_in_the_end() -> None:
    ((lost_s, lost),) = hear_battery([40.0, 0.0])
    assert lost == "Battery silent"
    assert lost_s == pytest.approx(30.0, abs=0.5)


def test_a_single_spike_is_passed_over_in_silence() -> None:
    state, _ = live(2.0)
    spike = sensors(state.time_us + TICK_US)._replace(pressure_hpa=3000.0)
    state, _, _, events = core.tick(state, Inputs(spike, None, None, None), Config())
    state, said = live(5.0, state=state)
    assert (events, said) == ((), [])
    assert state.estimate.depth_m == pytest.approx(5.0, abs=0.01)
