"""Compilation of mission scripts to mission items; invalid scripts are named."""

import math
from collections.abc import Sequence
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ground.missions import plans, script
from ground.missions.script import ScriptError
from mavlink_io.mission_items import (
    FRAME_LOCAL_NED,
    FRAME_MISSION,
    GLOBAL_SCALE,
    LOCAL_SCALE,
    MavCmd,
    MissionItem,
)

END = "\n[[step]]\nsurface = true\n"
CHIRP = """[[step]]
[step.test]
signal = "chirp"
axis = "rudder"
magnitude_deg = 5.0
duration_s = 12
f_start_hz = 0.1
f_stop_hz = 2.0
"""
LEG = "[[step]]\ndepth_m = 4.0\nheading_deg = -80.0\nthrust_pct = 58.0\nduration_s = 30.0\n"


def write_wpl(items: Sequence[MissionItem]) -> str:
    """Return a mission in the text format; line 0 is the home position of MAVProxy."""
    rows = ["QGC WPL 110"]
    for number, item in enumerate((MissionItem(0, 0, 16), *items)):
        scale = {FRAME_MISSION: 1, FRAME_LOCAL_NED: LOCAL_SCALE}.get(item.frame, GLOBAL_SCALE)
        p1 = item.p1 + 1.0 if item.command == MavCmd.DO_JUMP else item.p1  # item 0 is the home
        parameters = p1, item.p2, item.p3, item.p4, item.x / scale, item.y / scale, item.z
        row = number, int(number == 0), item.frame, item.command, *parameters, item.autocontinue
        rows.append("\t".join(str(column) for column in row))
    return "\n".join(rows) + "\n"


def parse(steps: str) -> script.Script:
    return script.parse(f'name = "m"\n{steps}', "m.toml")


def test_a_leg_is_speed_depth_course_and_delay() -> None:
    items = script.compile_items(parse(LEG + END))
    assert [item.command for item in items] == [178, 186, 115, 93, 21]
    speed, depth, course, delay, _ = items
    assert (speed.p2, speed.p3) == (-1, 58)
    assert (depth.p1, depth.p2) == (-4, 3)
    assert (course.p1, course.p4) == (280, 0)
    assert delay.p1 == 30
    assert [item.sequence for item in items] == [0, 1, 2, 3, 4]
    assert [item.current for item in items] == [1, 0, 0, 0, 0]


def test_a_leg_that_waits_for_its_depth_asks_the_vehicle_to() -> None:
    items = script.compile_items(parse(LEG + "wait_depth = true\n" + END))
    assert [item.command for item in items] == [178, 186, 115, 113, 93, 21]
    assert items[3].z == -4.0


def test_a_test_carries_axis_size_length_and_wave() -> None:
    test = (
        'signal = "doublet", axis = "rudder", magnitude_deg = -5.0, duration_s = 12, fade_s = 1.0'
    )
    step = f"[[step]]\ntest = {{ {test} }}\n"
    item = script.compile_items(parse(LEG + step + END))[4]
    assert (item.command, item.p1, item.p2, item.x, item.y, item.z) == (31010, 12, -5.0, 12, 2, 1.0)


@pytest.mark.parametrize("name", script.shipped_names())
def test_shipped_missions_load_and_end_at_the_surface(name: str) -> None:
    loaded = script.load(name)
    assert loaded.name == name
    assert script.compile_items(loaded)[-1].command == MavCmd.NAV_LAND


def magnitudes_deg(name: str, signal: str = "") -> set[float]:
    """Return the magnitudes of the tests of a mission, or of those with one signal."""
    magnitudes = set()
    for step in script.load(name).step:
        if step.test and signal in ("", step.test.signal):
            assert step.test.magnitude_deg is not None
            magnitudes.add(step.test.magnitude_deg)
    return magnitudes


def test_the_papers_missions_are_shipped() -> None:
    combined = [
        (s.depth_m, s.heading_deg, s.duration_s) for s in script.load("combined").step if s.leg_keys
    ]
    assert combined == [(4.0, -80.0, 30.0), (7.0, -40.0, 60.0), (1.0, -100.0, 60.0)]
    elevator = magnitudes_deg("elevator_steps")
    assert min(elevator) > 0, "the paper's elevator steps never point at the bottom"
    rudder, held_out = magnitudes_deg("rudder_steps"), magnitudes_deg("rudder_heldout", "step")
    assert min(rudder) < 0 < max(rudder)
    assert not rudder & held_out


@pytest.mark.parametrize(
    ("steps", "message"),
    [
        (LEG, "step 1: the last step must be surface = true"),
        (LEG.replace("4.0", "-4.0") + END, "step 1: depth_m = -4: must be 0 to 6000"),
        (LEG.replace("58.0", "158.0") + END, "step 1: thrust_pct = 158: must be 0 to 100"),
        (LEG.replace("duration_s = 30.0", "") + END, "duration_s: is missing"),
        (LEG.replace("depth_m = 4.0", "") + END, "first leg must give depth_m"),
        (LEG + "speed_mps = 1.0\n" + END, "thrust_pct and speed_mps: give one"),
        (LEG + "depht_m = 1.0\n" + END, "step 1: depht_m = 1.0: unknown key; known here: depth_m"),
        (LEG + "depht_m = 1.0\n" + END, "; did you mean depth_m?"),
        (LEG.replace("4.0", '"four"') + END, "step 1: depth_m = 'four': expected float"),
        (
            LEG + CHIRP.replace('"chirp"', '"chrip"') + END,
            "step 2: test.signal = 'chrip': expected chirp or step",
        ),
        (LEG + CHIRP.replace('"rudder"', '"ruder"') + END, "; did you mean rudder?"),
        (LEG + END + LEG + END, "surface = true must be the last step"),
        ("step = []", "is empty"),
        (LEG + CHIRP.replace("2.0", "inf") + END, "f_stop_hz = inf: expected a finite number"),
        ("= 3", "not valid TOML"),
        (
            LEG + '[[step]]\ntest = { signal = "step", axis = "rudder", magnitude_deg = 50.0,'
            " duration_s = 9 }" + END,
            "step 2: test.magnitude_deg = 50: must be -45 to 45",
        ),
        (
            LEG
            + '[[step]]\ntest = { signal = "step", axis = "sail", magnitude_deg = 4.0, duration_s'
            " = 9 }" + END,
            "sail",
        ),
    ],
)
def test_parse_error_is_one_line(steps: str, message: str) -> None:
    with pytest.raises(ScriptError) as caught:
        parse(steps)
    said = str(caught.value)
    assert said.startswith("m.toml: ")
    assert message in said
    assert "\n" not in said


def test_load_unknown_mission_lists_shipped_ones() -> None:
    with pytest.raises(ScriptError, match="straight_run"):
        script.load("no_such_mission")


numbers = st.floats(-1e6, 1e6, width=32)
items_of_a_file = st.builds(
    MissionItem,
    sequence=st.just(0),
    frame=st.sampled_from([0, 2, 3]),
    command=st.integers(0, 40_000),
    current=st.just(0),
    autocontinue=st.integers(0, 1),
    p1=numbers,
    p2=numbers,
    p3=numbers,
    p4=numbers,
    x=st.integers(-(2**31), 2**31 - 1),
    y=st.integers(-(2**31), 2**31 - 1),
    z=numbers,
    mission_type=st.just(0),
)


@given(st.lists(items_of_a_file, min_size=1, max_size=5))
def test_both_file_formats_keep_every_item(items: list[MissionItem]) -> None:
    numbered = tuple(item._replace(sequence=n, current=int(n == 0)) for n, item in enumerate(items))
    assert plans.read_wpl(write_wpl(numbered), "m.waypoints") == numbered
    assert plans.read_plan(plans.write_plan(numbered), "m.plan") == numbered


def test_jump_of_a_waypoint_file_counts_the_home_position() -> None:
    rows = [
        "QGC WPL 110",
        "0\t1\t0\t16\t0\t0\t0\t0\t42\t-71\t0\t1",
        "1\t0\t3\t16\t0\t0\t0\t0\t42.001\t-71\t-3\t1",
        "2\t0\t3\t16\t0\t0\t0\t0\t42.002\t-71\t-3\t1",
        "3\t0\t3\t177\t1\t2\t0\t0\t0\t0\t0\t1",
    ]
    first, _, jump = plans.read_wpl("\n".join(rows), "m.waypoints")
    assert (jump.command, jump.p1, jump.p2) == (MavCmd.DO_JUMP, first.sequence, 2.0)
    rows[4] = rows[4].replace("177\t1", "177\t0")
    with pytest.raises(ScriptError, match=r"m\.waypoints: line 5: DO_JUMP to item 0, the home"):
        plans.read_wpl("\n".join(rows), "m.waypoints")


@pytest.mark.parametrize(
    ("first_row", "first_index"),
    [("0 1 3 16 0 0 0 0 42 -71 -3 1", 0), ("1 0 3 16 0 0 0 0 42 -71 -3 1", 1)],
)
def test_waypoint_file_without_home_keeps_all_items(first_row: str, first_index: int) -> None:
    second = f"{first_index + 1} 0 3 16 0 0 0 0 42.001 -71 -3 1"
    jump = f"{first_index + 2} 0 3 177 {first_index + 1} 2 0 0 0 0 0 1"
    items = plans.read_wpl(f"QGC WPL 110\n{first_row}\n{second}\n{jump}\n", "m.waypoints")
    assert [item.command for item in items] == [16, 16, 177]
    assert (items[0].x, items[2].p1) == (420_000_000, 1.0)


def test_a_plan_may_leave_numbers_out() -> None:
    item = MissionItem(0, 2, 93, 1, 1, 5.0, math.nan, math.nan, math.nan)
    (read,) = plans.read_plan(plans.write_plan([item]), "m.plan")
    assert read.p1 == 5.0
    assert math.isnan(read.p2)


_ONE_ITEM = (
    '{"items": [{"type": "SimpleItem", "command": 21, "frame": 3,'
    ' "params": [0, 0, 0, 0, 1, 1, 0]}]}'
)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        (
            "m.waypoints",
            "QGC WPL 110\n0 1 0 16 0 0 0 0 0 0 0 1\n1 0 3 16 x 0 0 0 0 0 0 1\n",
            "line 3",
        ),
        ("m.waypoints", "QGC WPL 110\n0 1 0\n", "line 2: has 3 columns"),
        (
            "m.waypoints",
            "QGC WPL 110\n0 1 0 16 0 0 0 0 0 0 0 1\n1 0 3 16 0 0 0 0 500 0 0 1\n",
            "line 3: place 500, 0",
        ),
        (
            "m.waypoints",
            "QGC WPL 110\n0 1 0 16 0 0 0 0 0 0 0 1\n1 0 3 16 0 0 0 0 inf 0 0 1\n",
            "line 3: place inf, 0",
        ),
        (
            "m.waypoints",
            "QGC WPL 110\n0 1 0 16 0 0 0 0 0 0 0 1\n1 0 999 16 0 0 0 0 0 0 0 1\n",
            "frame 999",
        ),
        ("m.plan", '{"mission": {"items": [{"type": "ComplexItem"}]}}', "without its items"),
        ("m.plan", "{broken", "not JSON"),
        ("m.plan", '{"mission": {}}', "mission.items: .* the key 'items' is missing"),
        (
            "m.plan",
            '{"mission": {"items": [{"command": 9999}]}}',
            r"m\.plan: mission\.items\[0\]: .* the key 'type' is missing",
        ),
        (
            "m.plan",
            '{"mission": {"items": [{"type": "SimpleItem", "params": [0, 1], "frame": 3}]}}',
            r"params = \[0, 1\]: must be 7 numbers or null",
        ),
        (
            "m.plan",
            '{"mission": {"items": [{"type": "SimpleItem", "params": [0, 0, 0, 0, 0, 0, 0],'
            ' "frame": "down"}]}}',
            "frame = 'down': must be an integer",
        ),
        ("m.plan", '{"mission": 3}', "not a QGroundControl plan"),
        ("m.txt", "hello", "neither"),
        ("m.plan", '{"mission": {"items": []}}', r"m\.plan: holds no mission item"),
        ("m.waypoints", "QGC WPL 110\n", r"m\.waypoints: holds no mission item"),
        ("m.waypoints", "QGC WPL 110\n0 1 0 16 0 0 0 0 42 -71 0 1\n", "holds no mission item"),
        (
            "m.waypoints",
            "QGC WPL 110\n0 1 3 16.0 0 0 0 0 42 -71 0 1\n",
            "line 2: command = '16.0': is no integer",
        ),
        (
            "m.plan",
            '{"mission": {"items": [{"type": "SimpleItem", "doJumpId": {"a": 1}}]}}',
            r"mission\.items\[0\]: .* doJumpId = {'a': 1}: must be an integer",
        ),
        (
            "m.plan",
            f'{{"mission": {_ONE_ITEM}, "geoFence": {{"circles": "x"}}}}',
            "geoFence: .* circles = 'x': must be a list of objects",
        ),
        (
            "m.plan",
            f'{{"mission": {_ONE_ITEM}, "rallyPoints": {{"points": [3]}}}}',
            "rallyPoints: .* a value has another type",
        ),
    ],
)
def test_a_wrong_file_is_named(
    name: str, content: str, message: str, tmp_path_factory: pytest.TempPathFactory
) -> None:
    path = tmp_path_factory.mktemp("plans") / name
    path.write_text(content)
    with pytest.raises(ScriptError, match=message):
        plans.load_items(str(path))


WAYS = """
name = "ways"
[[step]]
to = [120.0, -40.5]
depth_m = 4.0
thrust_pct = 58.0
[[step]]
lat_deg = 42.351
lon_deg = -71.0
accept_m = 8.0
duration_s = 60.0
[[step]]
surface = true
"""


def test_waypoints_take_the_last_depth() -> None:
    items = script.compile_items(script.parse(WAYS, "ways"))
    speed, first, second, end = items
    assert (speed.command, end.command) == (178, 21)
    assert (first.command, first.frame, first.x, first.y, first.z) == (
        16,
        1,
        1_200_000,
        -405_000,
        4.0,
    )
    assert (second.command, second.frame, second.x, second.y, second.z) == (
        16,
        3,
        423_510_000,
        -710_000_000,
        -4.0,
    )
    assert (second.p1, second.p2) == (60.0, 8.0)


@pytest.mark.parametrize(
    ("write", "read"), [(plans.write_plan, plans.read_plan), (write_wpl, plans.read_wpl)]
)
def test_waypoints_survive_other_file_formats(write: Any, read: Any) -> None:
    items = script.compile_items(script.parse(WAYS, "ways"))
    assert read(write(items), "file") == items


@pytest.mark.parametrize(
    ("wrong", "word"),
    [
        ("to = [1.0, 2.0]\nlat_deg = 1.0\nlon_deg = 1.0", "one of them"),
        ("lat_deg = 1.0", "both or none"),
        ("to = [1.0, 2.0]\nheading_deg = 3.0", "heading_deg"),
        ("to = [1.0, 2e6]", "to[1]"),
        ("to = [1.0]", "length 2"),
        ("heading_deg = 1.0\nduration_s = 1.0\naccept_m = 5.0", "accept_m"),
    ],
)
def test_impossible_waypoint_refused(wrong: str, word: str) -> None:
    text = (
        f'name = "w"\n[[step]]\ndepth_m = 3.0\nthrust_pct = 58.0\n{wrong}\n[[step]]\nsurface ='
        " true\n"
    )
    with pytest.raises(script.ScriptError) as caught:
        script.parse(text, "w.toml")
    assert word in str(caught.value)
    assert "step" in str(caught.value)
