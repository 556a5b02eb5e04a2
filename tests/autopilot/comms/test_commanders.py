"""Only the listed systems change what the vehicle does; all may read."""

import pytest
from pymavlink.dialects.v20 import all as mavlink

from autopilot.comms.commanders import AllowListError, Commanders, systems_of
from autopilot.comms.ground_server import GroundServer
from autopilot.control.types import ACCEPTED, DENIED
from autopilot.telemetry.autopilot_id import AutopilotId
from tests.helpers.fake_hil import Harness, Station, only, texts

ARM, REQUEST_MESSAGE, VERSION = 400, 512, 148


@pytest.fixture
def harness() -> Harness:
    harness = Harness(Station(255), Station(66))
    harness.server = GroundServer(
        harness.vehicle,
        harness.stations,
        AutopilotId.GENERIC,
        commanders=Commanders(systems_of("255, 250")),
    )
    harness.tick(3)
    return harness


def arm(harness: Harness, station: Station) -> list[object]:
    message = mavlink.MAVLink_command_long_message(1, 1, ARM, 0, 1, 21196, 0, 0, 0, 0, 0)
    return harness.ask(message, station)


def test_listed_system_commands_and_other_is_denied(harness: Harness) -> None:
    listed, other = harness.stations
    answers = arm(harness, other)
    assert only(answers, "COMMAND_ACK").result == DENIED
    assert texts(answers) == ["System 66 may not command: COMMAND_LONG refused"]
    assert not harness.vehicle.state.armed
    assert texts(arm(harness, other)) == []
    assert only(arm(harness, listed), "COMMAND_ACK").result == ACCEPTED
    assert harness.vehicle.state.armed


def test_other_system_may_read(harness: Harness) -> None:
    other = harness.stations[1]
    message = mavlink.MAVLink_command_long_message(
        1, 1, REQUEST_MESSAGE, 0, VERSION, 0, 0, 0, 0, 0, 0
    )
    answers = harness.ask(message, other)
    assert only(answers, "COMMAND_ACK").result == ACCEPTED
    read = harness.ask(mavlink.MAVLink_param_request_read_message(1, 1, b"HDG_P", -1), other)
    assert only(read, "PARAM_VALUE").param_id == "HDG_P"


def test_other_system_sets_no_parameter_and_no_heartbeat(harness: Harness) -> None:
    other = harness.stations[1]
    before = harness.vehicle.params.get("HDG_P")
    harness.ask(mavlink.MAVLink_param_set_message(1, 1, b"HDG_P", 0.1, 9), other)
    assert harness.vehicle.params.get("HDG_P") == before
    harness.ask(mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 0, 3), other)
    assert harness.server.ground_silent_s is None
    harness.ask(mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 0, 3))
    assert harness.server.ground_silent_s is not None


@pytest.mark.parametrize("text", ["", "0", "256", "255,,1", "all", "1e2", "²"])
def test_bad_list_is_refused(text: str) -> None:
    with pytest.raises(AllowListError, match="system id"):
        systems_of(text)
