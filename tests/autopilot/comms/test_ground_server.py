"""Ground server seen by pymavlink: identity, commands, modes and small services."""

import math
import re
from typing import Any

import pytest
from pymavlink.dialects.v20 import all as mavlink

from autopilot.control import modes
from autopilot.control.params import PARAMETERS
from autopilot.onboard_log import channels
from autopilot.telemetry.autopilot_id import AutopilotId
from mavlink_io import codec, dialect
from mavlink_io.records import GpsFix
from tests.helpers.fake_hil import Harness, Station, only, texts

NAN = math.nan
FIX = GpsFix(0, 3, 41.5, -70.7, 12.0, 0.0, 0.0, 0.0, 9)


@pytest.fixture
def harness() -> Harness:
    """Return a connected vehicle after its first seconds at the surface."""
    harness = Harness()
    harness.station.transmit(mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 0, 3))
    harness.tick(3, fix=FIX)
    harness.serve()
    harness.station.pop_received()
    return harness


def result(messages: list[Any]) -> int:
    return int(only(messages, "COMMAND_ACK").result)


@pytest.mark.parametrize(
    ("personality", "number"), [(AutopilotId.GENERIC, 0), (AutopilotId.PX4, 12)]
)
def test_heartbeat_has_submarine_type(personality: AutopilotId, number: int) -> None:
    harness = Harness(autopilot=personality)
    harness.tick()
    harness.serve()
    beat = harness.station.pop_named("HEARTBEAT")[-1]
    assert (beat.get_srcSystem(), beat.get_srcComponent()) == (1, 1)
    assert (beat.type, beat.autopilot, beat.custom_mode) == (12, number, modes.HOLD.number)
    assert beat.base_mode & mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
    assert not beat.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED


def test_new_sender_receives_heartbeat_at_once() -> None:
    harness = Harness()
    harness.serve()
    harness.station.pop_received()
    beats = harness.ask(mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 0, 3))
    assert [m.get_type() for m in beats] == ["HEARTBEAT"]
    assert harness.ask(mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 0, 3)) == []


def test_autopilot_version_has_capabilities(harness: Harness) -> None:
    answers = harness.command(512, 148)
    assert [m.get_type() for m in answers] == ["COMMAND_ACK", "AUTOPILOT_VERSION"]
    capabilities = only(answers, "AUTOPILOT_VERSION").capabilities
    for name in ("MISSION_INT", "COMMAND_INT", "PARAM_ENCODE_BYTEWISE", "FTP", "MAVLINK2"):
        assert capabilities & getattr(mavlink, f"MAV_PROTOCOL_CAPABILITY_{name}")
    assert [m.get_type() for m in harness.command(520, 1)] == ["COMMAND_ACK", "AUTOPILOT_VERSION"]


def test_every_available_mode_can_be_selected(harness: Harness) -> None:
    listed = [m for m in harness.command(512, 435, 0) if m.get_type() == "AVAILABLE_MODES"]
    assert [m.mode_index for m in listed] == list(range(1, listed[0].number_modes + 1))
    assert {m.custom_mode: m.standard_mode for m in listed if m.standard_mode} == {
        84148224: 5,
        67371008: 6,
        100925440: 7,
    }
    assert all(bool(m.mode_name) == (m.standard_mode == 0) for m in listed)
    assert only(harness.command(512, 435, 2), "AVAILABLE_MODES").mode_index == 2
    refused = harness.command(512, 435, 99)
    assert result(refused) == mavlink.MAV_RESULT_DENIED
    assert texts(refused) == ["AVAILABLE_MODES: param2 is 99, must be 0 to 10"]
    for mode in listed:
        if mode.mode_name != "SYSID":
            assert result(harness.command(176, 1, mode.custom_mode)) == mavlink.MAV_RESULT_ACCEPTED
            assert harness.vehicle.state.mode == mode.custom_mode


@pytest.mark.parametrize(
    ("parameters", "mode"),
    [
        ((1, 4, 4), modes.MISSION),
        ((1, 4, 3), modes.HOLD),
        ((1, 4, 6), modes.SURFACE),
        ((1, 1), modes.MANUAL),
        ((1, 2, NAN), modes.DEPTH),
        ((129, 2, 0), modes.DEPTH),
        ((1, float(modes.MISSION.number)), modes.MISSION),
    ],
)
def test_do_set_mode_selects_mode_by_number(
    harness: Harness, parameters: tuple[float, ...], mode: modes.Mode
) -> None:
    start = modes.MANUAL if mode == modes.HOLD else modes.HOLD
    harness.command(176, 1, float(start.number))
    received = harness.command(176, *parameters)
    assert result(received) == mavlink.MAV_RESULT_ACCEPTED
    assert [m.custom_mode for m in received if m.get_type() == "HEARTBEAT"][:1] == [mode.number]
    assert only(received, "CURRENT_MODE").custom_mode == mode.number
    assert texts(received) == [f"Mode {mode.name}"]


def test_unknown_mode_is_refused_with_list_of_modes(harness: Harness) -> None:
    received = harness.command(176, 1, 9, 9)
    assert result(received) == mavlink.MAV_RESULT_UNSUPPORTED
    assert ", ".join(mode.name for mode in modes.MODES) in "".join(texts(received))
    assert result(harness.command(176, 0, 4, 4)) == mavlink.MAV_RESULT_DENIED
    assert harness.vehicle.state.mode == modes.HOLD.number


def test_set_mode_sends_heartbeat_but_no_acknowledgement(harness: Harness) -> None:
    received = harness.ask(mavlink.MAVLink_set_mode_message(1, 1, modes.SURFACE.number))
    assert {m.get_type() for m in received} == {"STATUSTEXT", "CURRENT_MODE", "HEARTBEAT"}
    assert only(received, "HEARTBEAT").custom_mode == modes.SURFACE.number
    again = harness.ask(mavlink.MAVLink_set_mode_message(1, 1, modes.SURFACE.number))
    assert {m.get_type() for m in again} == {"CURRENT_MODE", "HEARTBEAT"}


@pytest.mark.parametrize(
    ("number", "parameters", "mode"),
    [
        (20, (), modes.RTL),
        (21, (), modes.SURFACE),
        (189, (), modes.SURFACE),
        (17, (), modes.HOLD),
        (192, (-1, 1), modes.HOLD),
        (193, (0,), modes.HOLD),
        (193, (1,), modes.MISSION),
        (300, (0, 0), modes.MISSION),
        (262, (5,), modes.RTL),
        (262, (6,), modes.MISSION),
        (262, (7,), modes.SURFACE),
    ],
)
def test_commands_of_a_mode_select_it(
    harness: Harness, number: int, parameters: tuple[float, ...], mode: modes.Mode
) -> None:
    harness.command(176, 1, 1)
    assert result(harness.command(number, *parameters)) == mavlink.MAV_RESULT_ACCEPTED
    assert harness.vehicle.state.mode == mode.number


@pytest.mark.parametrize("standard", [1, 2, 3, 4, 8, NAN])
def test_unsupported_standard_mode_is_refused(harness: Harness, standard: float) -> None:
    assert result(harness.command(262, standard)) == mavlink.MAV_RESULT_FAILED


@pytest.mark.parametrize("component", [0, 1])
def test_arm_disarm_command_changes_arming(harness: Harness, component: int) -> None:
    armed = harness.command(400, 1, component=component)
    assert result(armed) == mavlink.MAV_RESULT_ACCEPTED
    assert only(armed, "HEARTBEAT").base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED
    assert result(harness.command(400, 1)) == mavlink.MAV_RESULT_ACCEPTED
    disarmed = harness.command(400, 0, component=component)
    assert result(disarmed) == mavlink.MAV_RESULT_ACCEPTED
    assert not only(disarmed, "HEARTBEAT").base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED


def test_arming_without_sensors_is_refused_with_reason() -> None:
    harness = Harness()
    received = harness.command(400, 1)
    assert result(received) == mavlink.MAV_RESULT_TEMPORARILY_REJECTED
    assert texts(received) == ["Not armed: no sensors"]
    kinds = [m.get_type() for m in received]
    assert kinds.index("STATUSTEXT") < kinds.index("COMMAND_ACK")


def test_disarming_under_water_requires_force(harness: Harness) -> None:
    harness.command(400, 1)
    harness.command(176, 1, 2)
    harness.tick(200, depth_m=5.0)
    assert result(harness.command(400, 0)) == mavlink.MAV_RESULT_TEMPORARILY_REJECTED
    assert harness.vehicle.state.armed
    assert result(harness.command(400, 0, 21196)) == mavlink.MAV_RESULT_ACCEPTED
    assert not harness.vehicle.state.armed


@pytest.mark.parametrize(
    ("param2", "is_armed"), [(0, False), (1, False), (2988, False), (2989, True), (21196, True)]
)
def test_arming_with_a_broken_rule_requires_force(
    harness: Harness, param2: int, is_armed: bool
) -> None:
    """MAVLink has 21196; MAVProxy, Mission Planner and QGroundControl send ArduPilot's 2989."""
    harness.tick(10)
    harness.ask(mavlink.MAVLink_param_set_message(1, 1, b"RTL_DEPTH_M", 2000.0, 9))
    harness.command(400, 1, param2)
    assert harness.vehicle.state.armed == is_armed


def test_disarming_under_water_ignores_force_of_arming(harness: Harness) -> None:
    harness.command(400, 1)
    harness.command(176, 1, 2)
    harness.tick(200, depth_m=5.0)
    assert result(harness.command(400, 0, 2989)) == mavlink.MAV_RESULT_TEMPORARILY_REJECTED


@pytest.mark.parametrize("value", [NAN, 2.0, -1.0])
def test_arm_disarm_other_parameter_is_denied(harness: Harness, value: float) -> None:
    assert result(harness.command(400, value)) == mavlink.MAV_RESULT_DENIED


@pytest.mark.parametrize("number", range(0, 33_000, 61))
def test_commands_with_only_nan_do_not_raise(harness: Harness, number: int) -> None:
    assert only(harness.command(number), "COMMAND_ACK").command == number


def test_known_commands_with_nan_and_infinity_do_not_raise(harness: Harness) -> None:
    known = (
        400,
        176,
        262,
        300,
        224,
        193,
        20,
        21,
        17,
        31010,
        115,
        186,
        178,
        179,
        511,
        510,
        512,
        520,
        410,
        246,
    )
    for fill in (NAN, math.inf, -math.inf, 3.4e38):
        for number in known:
            received = harness.command(number, *[fill] * 7)
            assert result(received) != mavlink.MAV_RESULT_UNSUPPORTED or number in (
                511,
                510,
                512,
                246,
            )
    harness.tick(10)


def test_unknown_command_is_unsupported(harness: Harness) -> None:
    acknowledgement = only(harness.command(22), "COMMAND_ACK")
    assert acknowledgement.result == mavlink.MAV_RESULT_UNSUPPORTED
    assert (acknowledgement.target_system, acknowledgement.target_component) == (255, 190)


def test_commands_for_other_systems_are_ignored(harness: Harness) -> None:
    for system, component in ((2, 1), (1, 100)):
        message = mavlink.MAVLink_command_long_message(
            system, component, 400, 0, 1, 0, 0, 0, 0, 0, 0
        )
        assert harness.ask(message) == []
    assert not harness.vehicle.state.armed


def test_command_int_is_executed(harness: Harness) -> None:
    message = mavlink.MAVLink_command_int_message(1, 1, 0, 400, 0, 0, 1, 0, NAN, NAN, 0, 0, NAN)
    assert result(harness.ask(message)) == mavlink.MAV_RESULT_ACCEPTED
    assert harness.vehicle.state.armed


@pytest.mark.parametrize(
    ("number", "parameters", "target"),
    [
        (186, (-4.0, 3), (4.0, 0.3, 0.58)),
        (115, (90.0, 0, 0, 0), (1.0, math.radians(90), 0.58)),
        (115, (30.0, 0, -1, 1), (1.0, 0.3 - math.radians(30), 0.58)),
        (178, (1, -1, 40), (1.0, 0.3, 0.4)),
        (178, (NAN, NAN, 40), (1.0, 0.3, 0.4)),
    ],
)
def test_setpoint_commands_change_setpoint(
    harness: Harness, number: int, parameters: tuple[float, ...], target: tuple[float, float, float]
) -> None:
    harness.command(400, 1)
    harness.command(176, 1, 2)
    state = harness.vehicle.state
    setpoint = state.setpoint._replace(depth_m=1.0, heading_rad=0.3, thrust=0.58)
    harness.vehicle.state = state._replace(setpoint=setpoint)
    assert result(harness.command(number, *parameters)) == mavlink.MAV_RESULT_ACCEPTED
    wanted = harness.vehicle.state.setpoint
    assert (wanted.depth_m, wanted.heading_rad, wanted.thrust) == pytest.approx(target)


def test_change_altitude_invalid_depth_is_denied(harness: Harness) -> None:
    harness.command(400, 1)
    for altitude in (3.0, NAN):
        received = harness.command(186, altitude, 3)
        assert result(received) == mavlink.MAV_RESULT_DENIED
        assert texts(received)


def test_user_1_starts_and_stops_excitation(harness: Harness) -> None:
    refused = harness.command(31010, 12, 5, 0, 0, 10, 1, 0)
    assert result(refused) == mavlink.MAV_RESULT_TEMPORARILY_REJECTED
    harness.command(400, 1)
    harness.command(176, 1, 2)
    harness.tick(200, depth_m=5.0)
    started = harness.command(31010, 12, 5, NAN, NAN, 10, 1, NAN)
    assert result(started) == mavlink.MAV_RESULT_IN_PROGRESS
    assert "SystemID Starting: axis=12 wave=step magnitude=5.00" in texts(started)
    assert harness.vehicle.state.test is not None
    harness.command(31010, 0)
    assert harness.vehicle.state.test is None


def test_home_altitude_is_always_zero(harness: Harness) -> None:
    home = only(harness.command(410), "HOME_POSITION")
    assert (home.latitude, home.longitude, home.altitude) == (415_000_000, -707_000_000, 0)
    message = mavlink.MAVLink_command_int_message(
        1, 1, 0, 179, 0, 0, 0, 0, 0, 0, 420_000_000, -700_000_000, 55.0
    )
    received = harness.ask(message)
    assert result(received) == mavlink.MAV_RESULT_ACCEPTED
    assert texts(received) == ["Home stays at the surface: altitude ignored"]
    home = only(harness.command(512, 242), "HOME_POSITION")
    assert (home.latitude, home.longitude, home.altitude) == (420_000_000, -700_000_000, 0)
    assert result(harness.command(179, 0, 0, 0, 0, 91.0, 0.0)) == mavlink.MAV_RESULT_DENIED


def test_reboot_disarmed_only_keeps_mission(harness: Harness) -> None:
    harness.ask(mavlink.MAVLink_param_set_message(1, 1, b"HDG_P", 0.5, 9))
    harness.command(400, 1)
    assert result(harness.command(246, 1)) == mavlink.MAV_RESULT_TEMPORARILY_REJECTED
    harness.command(400, 0)
    assert result(harness.command(246, 1)) == mavlink.MAV_RESULT_ACCEPTED
    assert not harness.vehicle.state.estimate.initialised
    assert harness.vehicle.params.config.heading_p == 0.5


def test_parameters_are_listed_set_and_sent_on_every_link() -> None:
    harness = Harness(Station(255, 190), Station(250, 190))
    listed = [
        m
        for m in harness.ask(mavlink.MAVLink_param_request_list_message(1, 1))
        if m.get_type() == "PARAM_VALUE"
    ]
    assert [m.param_id for m in listed] == [p.name for p in PARAMETERS]
    assert [m.param_index for m in listed] == list(range(len(PARAMETERS)))
    assert {m.param_type for m in listed} == {mavlink.MAV_PARAM_TYPE_REAL32}
    harness.stations[1].pop_received()
    harness.ask(mavlink.MAVLink_param_set_message(1, 1, b"HDG_P", 0.75, 9))
    reported = only(harness.stations[1].pop_received(), "PARAM_VALUE")
    assert (reported.param_id, reported.param_value) == ("HDG_P", 0.75)
    refused = harness.ask(mavlink.MAVLink_param_set_message(1, 1, b"HDG_P", 99.0, 9))
    assert only(refused, "PARAM_ERROR").error == mavlink.MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE
    assert texts(refused) == ["HDG_P = 99: must be 0 to 5 rad/rad"]
    assert harness.vehicle.params.config.heading_p == 0.75


def test_ping_and_timesync_are_answered(harness: Harness) -> None:
    ping = only(harness.ask(mavlink.MAVLink_ping_message(123, 9, 0, 0)), "PING")
    assert (ping.time_usec, ping.seq, ping.target_system, ping.target_component) == (
        123,
        9,
        255,
        190,
    )
    time = only(harness.ask(mavlink.MAVLink_timesync_message(0, 456)), "TIMESYNC")
    assert (time.ts1, time.tc1 > 0) == (456, True)
    assert time.get_msgbuf()[26:28] == bytes((255, 190)), "target, which pymavlink lacks"
    timesync = dialect.by_name("TIMESYNC")
    for target, answered in ((1, True), (9, False)):
        request = codec.encode(timesync, (0, 7, target, 1), sequence=0, system=255, component=190)
        harness.station._outgoing.append(request)
        harness.serve()
        assert bool(harness.station.pop_named("TIMESYNC")) == answered, target
    assert harness.ask(mavlink.MAVLink_timesync_message(5, 6)) == []
    entry = only(
        harness.ask(mavlink.MAVLink_log_request_list_message(1, 1, 0, 0xFFFF)), "LOG_ENTRY"
    )
    assert entry.num_logs == 0


def test_manual_control_moves_actuators_in_manual(harness: Harness) -> None:
    harness.ask(mavlink.MAVLink_manual_control_message(1, -500, 0, 1000, 250, 0))
    stick = harness.server.stick
    assert stick is not None
    assert (stick.rudder, stick.elevator, stick.thrust) == (0.25, 0.5, 1.0)
    harness.ask(mavlink.MAVLink_manual_control_message(2, 1000, 0, 0, 1000, 0))
    assert harness.server.stick == stick


def test_messages_that_change_behaviour_are_logged() -> None:
    ardupilot = Harness(autopilot=AutopilotId.ARDUPILOT)  # has the handlers of all identities
    served = {dialect.by_id(number) for number in ardupilot.server._services._table}
    harmless = re.compile(
        "HEARTBEAT|TIMESYNC|PING|SETUP_SIGNING|MISSION_ACK|(MISSION|PARAM|LOG)_REQUEST.*|FILE_.*|LOG_ERASE"
        "|REQUEST_DATA_STREAM"
    )
    names = {message.name for message in served if message and not harmless.fullmatch(message.name)}
    assert names == {
        message.name for number in channels.LOGGED_FROM_GROUND if (message := dialect.by_id(number))
    }


def test_system_id_change_applies_at_next_start(harness: Harness) -> None:
    harness.ask(mavlink.MAVLink_param_set_message(1, 1, b"MAV_SYS_ID", 7.0, 9))
    harness.ask(mavlink.MAVLink_manual_control_message(7, 0, 0, 0, 0, 0))
    assert harness.server.stick is None
    answers = harness.ask(
        mavlink.MAVLink_manual_control_message(1, 0, 0, 0, 0, 0)
    ) + harness.command(512, 148)
    assert harness.server.stick is not None
    version = only(answers, "AUTOPILOT_VERSION")
    assert (version.get_srcSystem(), version.uid) == (1, 1)


def test_long_text_is_sent_in_chunks(harness: Harness) -> None:
    harness.vehicle.send_statustext("depth " * 20)
    harness.serve()
    chunks = harness.station.pop_named("STATUSTEXT")
    assert [m.chunk_seq for m in chunks] == [0, 1, 2]
    assert len({m.id for m in chunks}) == 1
    assert chunks[0].id > 0
    assert "".join(m.text for m in chunks).strip() == ("depth " * 20).strip()


def test_mission_upload_and_download_are_equal(harness: Harness) -> None:
    (request, *_) = harness.ask(mavlink.MAVLink_mission_count_message(1, 1, 1, 0))
    assert request.get_type() == "MISSION_REQUEST_INT"
    item = mavlink.MAVLink_mission_item_int_message(
        1, 1, 0, 2, 93, 1, 1, 10, NAN, NAN, NAN, 0, 0, NAN, 0
    )
    assert only(harness.ask(item), "MISSION_ACK").type == mavlink.MAV_MISSION_ACCEPTED
    back = only(
        harness.ask(mavlink.MAVLink_mission_request_int_message(1, 1, 0, 0)), "MISSION_ITEM_INT"
    )
    assert (back.command, back.param1, back.frame, back.current) == (93, 10.0, 2, 1)
    assert math.isnan(back.z)
    progress = only(harness.command(512, 42), "MISSION_CURRENT")
    assert (progress.seq, progress.total) == (0, 1)
    unknown = mavlink.MAVLink_mission_item_int_message(1, 1, 0, 2, 22, 1, 1, 0, 0, 0, 0, 0, 0, 0, 0)
    harness.ask(mavlink.MAVLink_mission_count_message(1, 1, 1, 0))
    refused = harness.ask(unknown)
    assert only(refused, "MISSION_ACK").type == mavlink.MAV_MISSION_UNSUPPORTED
    assert texts(refused) == ["Mission item 0: command 22 is not one this vehicle flies"]
    assert only(harness.command(512, 42), "MISSION_CURRENT").total == 1
