"""Missions for other vehicles: sizes, frequencies and durations; the text that is flown."""

import pytest
from msgspec.structs import replace

from ground.campaign.request import ALL_MISSIONS
from ground.missions import scaling, script, signals
from ground.missions.scaling import AxisScaling, MissionScaling
from mavlink_io.mission_items import MavCmd

UNCHANGED = AxisScaling(step_size=1.0, sweep_size=1.0, frequency=1.0, max_size_deg=15.0)
CARIBOU = MissionScaling(
    thrust_pct=58.0,
    time=1.0,
    leg=1.0,
    min_depth_m=1.0,
    axes={"rudder": UNCHANGED, "elevator": UNCHANGED},
)
QUICK = AxisScaling(step_size=1.5, sweep_size=0.5, frequency=2.0, max_size_deg=8.16)
SMALL = CARIBOU._replace(thrust_pct=60.0, time=0.4, axes={"rudder": QUICK, "elevator": QUICK})


def signals_of(mission: script.Script) -> list[signals.TestSignal]:
    return [step.test for step in mission.step if step.test is not None]


@pytest.mark.parametrize("name", script.shipped_names())
def test_encode_shipped_mission_parses_back(name: str) -> None:
    mission = script.load(name)
    assert script.parse(scaling.encode(mission), name) == mission


@pytest.mark.parametrize("name", ["rudder_steps", "elevator_sweeps", "combined", "rudder_heldout"])
def test_scale_script_unit_ratios_keeps_mission(name: str) -> None:
    mission = script.load(name)
    assert scaling.scale_script(mission, CARIBOU) == mission


def test_scale_script_quick_vehicle_short_steps_within_travel() -> None:
    scaled = signals_of(scaling.scale_script(script.load("rudder_steps"), SMALL))
    # 3, -3, 5, -5, 7, -7 and larger, times 1.5, at most 8.1 of 8.16 deg; 20 s times 0.4
    assert [test.magnitude_deg for test in scaled[:6]] == [4.5, -4.5, 7.5, -7.5, 8.1, -8.1]
    assert {test.duration_s for test in scaled} == {8}


def test_scale_script_quick_vehicle_sweeps_keep_duration() -> None:
    first = signals_of(script.load("elevator_sweeps"))[0]
    scaled = signals_of(scaling.scale_script(script.load("elevator_sweeps"), SMALL))[0]
    expected = replace(first, magnitude_deg=1.5, f_start_hz=0.16, f_stop_hz=0.8)
    assert scaled == expected


def test_scale_script_slow_vehicle_longer_legs_and_sweeps() -> None:
    slow = UNCHANGED._replace(frequency=0.5)
    scaling_of_slow = CARIBOU._replace(time=0.4, leg=2.0, axes={"rudder": slow, "elevator": slow})
    mission = script.load("rudder_sweeps")
    scaled = scaling.scale_script(mission, scaling_of_slow)
    assert scaled.step[0].duration_s == 2.0 * (mission.step[0].duration_s or 0.0)
    assert signals_of(scaled)[0].duration_s == 2 * signals_of(mission)[0].duration_s


def test_scale_script_keeps_the_loop_on_for_one_surface() -> None:
    held = {**CARIBOU.axes, "rudder": UNCHANGED._replace(loop_on=True)}
    for name, loop_on in (("rudder_steps", True), ("elevator_steps", False)):
        scaled = scaling.scale_script(script.load(name), CARIBOU._replace(axes=held))
        assert {test.loop_on for test in signals_of(scaled)} == {loop_on}


def test_scale_script_long_hull_is_not_shallower_than_limit() -> None:
    scaled = scaling.scale_script(script.load("shallow_1m"), CARIBOU._replace(min_depth_m=1.4))
    assert {step.depth_m for step in scaled.step if step.depth_m is not None} == {1.4}


def test_scale_tests_changes_numbered_tests_alone() -> None:
    mission = script.load("rudder_sweeps")
    sizes = [test.magnitude_deg for test in signals_of(mission)]
    changed = scaling.scale_tests(mission, {1: 0.5}, {"rudder": 9.0, "elevator": 9.0})
    resized = [test.magnitude_deg for test in signals_of(changed)]
    assert resized == [sizes[0], 0.5 * (sizes[1] or 0.0), *sizes[2:]]


def test_lengthen_legs_keeps_tests() -> None:
    mission = script.load("rudder_sweeps")
    longer = scaling.lengthen_legs(mission, 1.5)
    assert signals_of(longer) == signals_of(mission)
    assert longer.step[0].duration_s == 1.5 * (mission.step[0].duration_s or 0.0)


@pytest.mark.parametrize(("size", "expected"), [(0.1, 0.5), (-0.1, -0.5), (20.0, 8.1), (3.14, 3.1)])
def test_limited_deg_is_within_limits_with_sign(size: float, expected: float) -> None:
    assert scaling.limited_deg(size, 8.16) == expected


@pytest.mark.parametrize("name", ALL_MISSIONS)
def test_descent_at_full_thrust_ends_at_depth_before_the_first_leg(name: str) -> None:
    mission = script.load(name)
    faster = script.parse(scaling.encode(scaling.descend_at_full_thrust(mission)), name)
    assert faster.step[1:] == mission.step
    assert scaling.descends_at_full_thrust(faster)
    assert not scaling.descends_at_full_thrust(mission)
    items = script.compile_items(faster)
    commands = [item.command for item in items[:4]]
    assert commands == [
        MavCmd.DO_CHANGE_SPEED,
        MavCmd.DO_CHANGE_ALTITUDE,
        MavCmd.CONDITION_YAW,
        MavCmd.CONDITION_CHANGE_ALT,
    ]
    assert items[0].p3 == 100.0
    assert script.duration_s(faster) == script.duration_s(mission)
