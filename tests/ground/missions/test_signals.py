"""Identification tests in mission scripts: encoding, and error messages."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from autopilot.control import excitation, mission
from autopilot.control.params import Config
from autopilot.control.types import AutopilotState
from ground.missions import script, signals
from mavlink_io.mission_items import MavCmd, MissionItem

LEG = (
    'name = "m"\n[[step]]\ndepth_m = 4.0\nheading_deg = 0.0\nthrust_pct = 58.0\nduration_s = 30.0\n'
)
END = "[[step]]\nsurface = true\n"


def item_of(test: str) -> MissionItem:
    text = f"{LEG}[[step]]\ntest = {{ {test} }}\n{END}"
    (item,) = [
        i for i in script.compile_items(script.parse(text, "m.toml")) if i.command == MavCmd.USER_1
    ]
    return item


@pytest.mark.parametrize(
    ("test", "numbers"),
    [
        (
            'signal = "3211", axis = "elevator", magnitude_deg = -3, duration_s = 14',
            (11, -3, 0, 0, 14, 5, 0),
        ),
        (
            (
                'signal = "prbs", axis = "rudder", magnitude_deg = 3, duration_s = 31, clock_hz ='
                " 0.5, seed = 9"
            ),
            (12, 3, 9, 0.5, 31, 3, 0),
        ),
        (
            (
                'signal = "multisine", axis = "both", magnitude_deg = 3, duration_s = 60,'
                " f_start_hz = 0.1, f_stop_hz = 0.5"
            ),
            (23, 3, 0.1, 0.5, 60, 4, 0),
        ),
        (
            'signal = "step", axis = "thrust", magnitude_pct = -12, duration_s = 40, fade_s = 2',
            (13, -12, 0, 0, 40, 1, 2),
        ),
        (
            (
                'signal = "square", axis = "rudder", magnitude_deg = 3, duration_s = 40, runs = [9,'
                " 1, 2, 3, 4, 5, 6, 7, 8]"
            ),
            (12, 3, 9123456, 78, 40, 6, 0),
        ),
        (
            (
                'signal = "doublet", axis = "rudder", magnitude_deg = 3, duration_s = 40, loop_on ='
                " true"
            ),
            (112, 3, 0, 0, 40, 2, 0),
        ),
    ],
)
def test_a_test_becomes_the_numbers_of_its_item(test: str, numbers: tuple[float, ...]) -> None:
    item = item_of(test)
    assert (item.p1, item.p2, item.p3, item.p4, item.x, item.y, item.z) == numbers


def test_signal_names_match_the_autopilot() -> None:
    assert {name: excitation.WAVES[number] for name, number in signals.SIGNALS.items()} == {
        name: name for name in signals.SIGNALS
    }
    for name, number in (signals.AXES | {"thrust": 13, "both": 23}).items():
        assert excitation.AXES[number].name == name


@given(st.lists(st.integers(1, 9), min_size=1, max_size=14))
def test_square_wave_intervals_keep_their_order(runs: list[int]) -> None:
    item = item_of(
        f'signal = "square", axis = "rudder", magnitude_deg = 3, duration_s = 40, runs = {runs}'
    )
    assert mission.check((item,), Config()) == (-1, "")
    assert mission.excitation_of(item, AutopilotState(), Config()).switch_intervals == tuple(runs)


@pytest.mark.parametrize("name", script.shipped_names())
def test_shipped_missions_begin_each_leg_in_one_tick(name: str) -> None:
    """Items that are done as soon as they are begun stand between two that take time."""
    longest = at_once = 0
    for item in script.compile_items(script.load(name)):
        instant = item.command in (
            MavCmd.DO_CHANGE_ALTITUDE,
            MavCmd.DO_CHANGE_SPEED,
            MavCmd.CONDITION_YAW,
        )
        at_once = at_once + 1 if instant else 0
        longest = max(longest, at_once)
    assert longest < mission.ITEMS_PER_TICK


@pytest.mark.parametrize("name", script.shipped_names())
def test_the_vehicle_takes_every_shipped_mission(name: str) -> None:
    assert mission.check(script.compile_items(script.load(name)), Config()) == (-1, "")


@pytest.mark.parametrize(
    ("test", "message"),
    [
        ('signal = "step", axis = "rudder", duration_s = 9', "test.magnitude_deg: is missing"),
        (
            'signal = "step", axis = "thrust", magnitude_deg = 3, duration_s = 9',
            "test.magnitude_pct: is missing",
        ),
        (
            (
                'signal = "step", axis = "rudder", magnitude_deg = 3, magnitude_pct = 3,'
                " duration_s = 9"
            ),
            "test.magnitude_pct",
        ),
        (
            'signal = "step", axis = "thrust", magnitude_pct = 120, duration_s = 9',
            "must be -100 to 100",
        ),
        (
            'signal = "step", axis = "thrust", magnitude_pct = 9, duration_s = 9, loop_on = true',
            "test.loop_on",
        ),
        ('signal = "step", axis = "both", magnitude_deg = 3, duration_s = 9', "must be multisine"),
        (
            'signal = "step", axis = "rudder", magnitude_deg = 3, duration_s = 9, seed = 3',
            "test.seed: only prbs",
        ),
        (
            'signal = "3211", axis = "rudder", magnitude_deg = 3, duration_s = 9, runs = [3]',
            "test.runs: only square",
        ),
        (
            'signal = "prbs", axis = "rudder", magnitude_deg = 3, duration_s = 9',
            "test.clock_hz: is missing",
        ),
        (
            'signal = "prbs", axis = "rudder", magnitude_deg = 3, duration_s = 9, clock_hz = 20',
            "test.clock_hz = 20",
        ),
        (
            (
                'signal = "prbs", axis = "rudder", magnitude_deg = 3, duration_s = 9, clock_hz = 1,'
                " seed = -1"
            ),
            "test.seed",
        ),
        ('signal = "square", axis = "rudder", magnitude_deg = 3, duration_s = 9', "test.runs = []"),
        (
            'signal = "square", axis = "rudder", magnitude_deg = 3, duration_s = 9, runs = [3, 10]',
            "test.runs",
        ),
        (
            'signal = "multisine", axis = "rudder", magnitude_deg = 3, duration_s = 9',
            "test.f_start_hz = 0",
        ),
        ('signal = "sawtooth", axis = "rudder", magnitude_deg = 3, duration_s = 9', "sawtooth"),
    ],
)
def test_signal_error_is_one_line(test: str, message: str) -> None:
    with pytest.raises(script.ScriptError) as caught:
        item_of(test)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)
