"""DO_SET_MISSION_CURRENT: item, current item and reset (MAVLink common.xml, MAV_CMD 224)."""

from typing import Any

import pytest
from pymavlink.dialects.v20 import all as mavlink

from autopilot.control import mission, modes, requests
from autopilot.control.setpoints import TrackLine
from mavlink_io.mission_items import MavCmd, MissionItem
from tests.helpers.commands import ACCEPTED, DENIED, FAILED, FIX, NAN, results
from tests.helpers.fake_hil import Harness, only, texts

SET_CURRENT = 224
DELAY_S = 60.0
MISSION_STATE_PAUSED, MISSION_STATE_COMPLETE = 4, 5
ITEMS = (
    MissionItem(0, 2, MavCmd.CONDITION_CHANGE_ALT, z=-3.0),
    MissionItem(1, 2, MavCmd.NAV_DELAY, p1=DELAY_S),
    MissionItem(2, 2, MavCmd.DO_JUMP, p1=0.0, p2=1.0),
)


@pytest.fixture
def harness(harness: Harness) -> Harness:
    """Return a vehicle whose mission waits in its item 1."""
    harness.vehicle.params.set("FS_DIVE_S", 0.0)  # the depth does not follow the elevator
    assert harness.vehicle.handle_request(requests.LoadMission(ITEMS)).result == ACCEPTED
    harness.command(400, 1)
    harness.command(176, 1, float(modes.MISSION.number))
    harness.tick(100, depth_m=3.0)
    assert harness.vehicle.state.mission.current == 1
    return harness


def set_progress(harness: Harness, current: int, **fields: Any) -> None:
    vehicle = harness.vehicle
    plan = vehicle.state.mission._replace(current=current, **fields)
    vehicle.state = vehicle.state._replace(mission=plan)


@pytest.mark.parametrize("reset", [0.0, NAN])
def test_current_item_is_not_started_again(harness: Harness, reset: float) -> None:
    before = harness.vehicle.state.mission
    assert before.entered_us is not None
    received = harness.command(SET_CURRENT, -1, reset)
    assert results(received) == [ACCEPTED]
    assert only(received, "MISSION_CURRENT").seq == 1
    assert harness.vehicle.state.mission == before


def test_reset_of_the_current_item_clears_the_jumps(harness: Harness) -> None:
    set_progress(harness, 1, jumps=((2, 1),))
    before = harness.vehicle.state.mission
    assert results(harness.command(SET_CURRENT, -1, 1)) == [ACCEPTED]
    assert harness.vehicle.state.mission == before._replace(jumps=())


@pytest.mark.parametrize(("reset", "jumps"), [(0.0, ((2, 1),)), (1.0, ())])
def test_item_is_started_and_jumps_stay_without_reset(
    harness: Harness, reset: float, jumps: tuple[tuple[int, int], ...]
) -> None:
    set_progress(harness, 1, jumps=((2, 1),))
    received = harness.command(SET_CURRENT, 0, reset)
    assert results(received) == [ACCEPTED]
    assert only(received, "MISSION_CURRENT").seq == 0
    plan = harness.vehicle.state.mission
    assert (plan.current, plan.entered_us, plan.jumps) == (0, None, jumps)


@pytest.mark.parametrize(
    ("reset", "current", "stage"), [(0, 3, MISSION_STATE_COMPLETE), (1, 0, MISSION_STATE_PAUSED)]
)
def test_completed_mission_begins_again_after_a_reset(
    harness: Harness, reset: int, current: int, stage: int
) -> None:
    """In HOLD, which the command must not leave."""
    harness.command(176, 1, float(modes.HOLD.number))
    set_progress(harness, len(ITEMS))
    received = harness.command(SET_CURRENT, -1, reset)
    assert results(received) == [ACCEPTED]
    assert only(received, "MISSION_CURRENT").mission_state == stage
    assert harness.vehicle.state.mission.current == current
    assert harness.vehicle.state.mode == modes.HOLD.number


def test_refusal_of_the_message_is_one_text(harness: Harness) -> None:
    received = harness.ask(mavlink.MAVLink_mission_set_current_message(1, 1, 7))
    assert texts(received) == ["No mission item 7: the mission has 3"]
    assert only(received, "MISSION_CURRENT").seq == 1


@pytest.mark.parametrize("mode", [modes.RTL, modes.STATION])
def test_item_changes_no_path_of_another_mode(harness: Harness, mode: modes.Mode) -> None:
    """Before, RTL took itself for home and surfaced, and STATION went straight on."""
    harness.tick(3, depth_m=3.0, fix=FIX)
    assert results(harness.command(176, 1, float(mode.number))) == [ACCEPTED]
    path = harness.vehicle.state.path
    if mode == modes.RTL:
        path = TrackLine(0j, 500.0 + 0j)
        harness.vehicle.state = harness.vehicle.state._replace(path=path)
    assert path is not None
    assert results(harness.command(SET_CURRENT, 0, 0)) == [ACCEPTED]
    assert harness.vehicle.state.path == path
    harness.tick(3, depth_m=3.0)
    assert harness.vehicle.state.mode == mode.number


def test_test_of_the_mission_that_an_item_ends_is_reported(harness: Harness) -> None:
    """Before, the log had no end of the test."""
    vehicle = harness.vehicle
    excitation_item = MissionItem(0, 2, MavCmd.USER_1, p1=12.0, p2=2.0, x=30, y=1)
    config = vehicle.params.config
    vehicle.state = mission.begin_item(excitation_item, vehicle.state, config)[0]
    assert vehicle.state.test is not None
    received = harness.command(SET_CURRENT, 0, 0)
    assert "SystemID Stopped: by ground" in texts(received)
    assert vehicle.state.test is None


@pytest.mark.parametrize(
    ("parameters", "result"),
    [((3, 0), FAILED), ((-2, 0), FAILED), ((NAN, 0), FAILED), ((1, 2), DENIED)],
)
def test_impossible_item_or_reset_changes_nothing(
    harness: Harness, parameters: tuple[float, float], result: int
) -> None:
    before = harness.vehicle.state.mission
    assert results(harness.command(SET_CURRENT, *parameters)) == [result]
    assert harness.vehicle.state.mission == before
