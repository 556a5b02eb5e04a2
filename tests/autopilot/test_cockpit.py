"""Requirements of Cockpit, message by message, after its source of August 2026.

Source: github.com/bluerobotics/cockpit, commit aa40c07; files and lines below are of that commit,
``vehicle.ts`` is src/libs/vehicle/mavlink/vehicle.ts. Cockpit needs ``--autopilot-id ardupilot``:
vehicle-factory.ts:125 creates a vehicle for ArduPilot and PX4 only, and mainVehicle.ts:409 goes to
a place with ArduPilot only. It does not run here: the tests send its messages to the real server.
"""

from typing import Any

import pytest
from pymavlink.dialects.v20 import all as mavlink

from autopilot.comms import ground_server, services
from autopilot.control import modes
from autopilot.telemetry.autopilot_id import AutopilotId
from mavlink_io import dialect
from mavlink_io.codec import encode
from mavlink_io.records import GpsFix
from tests.helpers.fake_hil import Harness, only, texts

FIX = GpsFix(0, 3, 41.5, -70.7, 12.0, 0.0, 0.0, 0.0, 9)
X, Y = 415_010_000, -707_000_000
ACCEPTED, REJECTED = mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_TEMPORARILY_REJECTED
ALT_HOLD, AUTO, GUIDED, POSHOLD, MANUAL = 2, 3, 4, 16, 19
MODES = {0: modes.STABILIZE, 2: modes.DEPTH, 4: modes.HOLD, 9: modes.SURFACE, 16: modes.STATION}
"""Modes of types/modes.ts:26 (SubMode) that the vehicle has and that can be entered disarmed."""
REQUESTED_HZ = {
    "RAW_IMU": 2,
    "SCALED_IMU2": 2,
    "SCALED_PRESSURE2": 2,
    "SYS_STATUS": 2,
    "GPS_RAW_INT": 2,
    "NAV_CONTROLLER_OUTPUT": 2,
    "FENCE_STATUS": 2,
    "GLOBAL_POSITION_INT": 3,
    "SERVO_OUTPUT_RAW": 2,
    "RC_CHANNELS": 2,
    "ATTITUDE": 16,
    "AHRS2": 16,
    "VFR_HUD": 16,
    "SYSTEM_TIME": 3,
    "RANGEFINDER": 3,
    "DISTANCE_SENSOR": 3,
    "BATTERY_STATUS": 3,
    "EKF_STATUS_REPORT": 3,
}
"""Messages that Cockpit requests at the connection (defaults.ts:9) and this vehicle has."""
NOT_MEASURED = (
    *("SCALED_IMU3", "SCALED_PRESSURE", "SCALED_PRESSURE3", "POWER_STATUS", "MEMINFO", "GPS_RTK"),
    *("GPS2_RAW", "GPS2_RTK", "RC_CHANNELS_RAW", "SIMSTATE", "PID_TUNING", "AHRS"),
    *("GIMBAL_DEVICE_ATTITUDE_STATUS", "OPTICAL_FLOW", "MAG_CAL_REPORT", "MAG_CAL_PROGRESS"),
    *("VIBRATION", "PARAM_VALUE"),
)
"""Messages that Cockpit requests too, for which the vehicle has no measurement, or no interval.

It logs these refusals and works on (vehicle.ts:962)."""
TICKS_PER_S = 50


@pytest.fixture(autouse=True)
def stopped_clock(monkeypatch: pytest.MonkeyPatch) -> None:
    """Stop the wall clock of manual control, which ends after a time without messages."""
    for module in (ground_server, services):
        monkeypatch.setattr(module, "wall_s", lambda: 1000.0)


@pytest.fixture
def cockpit() -> Harness:
    """Return a vehicle at the surface with a position, disarmed, and Cockpit's first heartbeat."""
    harness = Harness(autopilot=AutopilotId.ARDUPILOT)
    beat = mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_GCS, 8, 192, 0, 4, 1)
    harness.station.transmit(beat)  # vehicle.ts:766
    harness.serve()
    harness.tick(100, fix=FIX)
    harness.serve()
    harness.station.pop_received()
    return harness


def command(harness: Harness, number: int, *parameters: float) -> list[Any]:
    """Send a COMMAND_LONG as ``sendCommandLong`` (vehicle.ts:207): other parameters are 0."""
    filled = [*parameters, *[0.0] * (7 - len(parameters))]
    return harness.ask(mavlink.MAVLink_command_long_message(1, 1, number, 0, *filled))


def result(received: list[Any]) -> int:
    """Return the result of the COMMAND_ACK that ``sendCommand`` (vehicle.ts:150) awaits for 5 s."""
    return int(only(received, "COMMAND_ACK").result)


def set_mode(harness: Harness, number: int) -> list[Any]:
    """``setMode`` (vehicle.ts:847): DO_SET_MODE."""
    return command(harness, 176, 1, number)


def displayed(harness: Harness, seconds: int = 3) -> dict[str, Any]:
    """Return the last message of each name, as ``onIncomingMessage`` (vehicle.ts:304) keeps it."""
    harness.tick(TICKS_PER_S * seconds, fix=FIX)
    harness.server._heartbeat.hasten()
    harness.serve()
    received = harness.station.pop_received()
    assert {m.get_srcComponent() for m in received} == {1}, "others are ignored (vehicle.ts:320)"
    return {m.get_type(): m for m in received}


def test_heartbeat_creates_an_ardusub(cockpit: Harness) -> None:
    """vehicle-factory.ts:146: submarine; ardusub.ts:60: base_mode; vehicle.ts:437: armed, active.

    mainVehicle.ts:224: the vehicle is lost 5 s after the last heartbeat.
    """
    beat = displayed(cockpit)["HEARTBEAT"]
    assert beat.autopilot == mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA
    assert beat.type == mavlink.MAV_TYPE_SUBMARINE
    assert beat.base_mode == mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
    assert beat.custom_mode == GUIDED
    assert result(command(cockpit, 400, 1)) == ACCEPTED
    beat = displayed(cockpit)["HEARTBEAT"]
    assert beat.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED
    assert beat.system_status == mavlink.MAV_STATE_ACTIVE, "flying"


def test_requested_messages_have_their_rates(cockpit: Harness) -> None:
    """``requestDefaultMessages`` (vehicle.ts:931) with the rates of defaults.ts."""
    for name, rate_hz in REQUESTED_HZ.items():
        received = command(cockpit, 511, dialect.by_name(name).message_id, round(1e6 / rate_hz))
        assert result(received) == ACCEPTED, name
    counts = dict.fromkeys(REQUESTED_HZ, 0)
    for _ in range(4 * TICKS_PER_S):
        cockpit.tick(fix=FIX)
        for message in cockpit.station.pop_received():
            if message.get_type() in counts:
                counts[message.get_type()] += 1
    rates = {name: count / 4.0 for name, count in counts.items()}
    assert rates == pytest.approx(REQUESTED_HZ, abs=0.76), "a period is a whole number of ticks"


def test_requested_messages_without_measurement_are_unsupported(cockpit: Harness) -> None:
    for name in NOT_MEASURED:
        received = command(cockpit, 511, dialect.by_name(name).message_id, 500_000)
        assert result(received) == mavlink.MAV_RESULT_UNSUPPORTED, name


def test_attitude_and_altitude_are_displayed(cockpit: Harness) -> None:
    """vehicle.ts:356 AHRS2.altitude (m), :362 ATTITUDE (rad), :400 GLOBAL_POSITION_INT."""
    cockpit.tick(300, depth_m=3.0)
    cockpit.station.pop_received()
    cockpit.tick(100, depth_m=3.0)
    latest = {m.get_type(): m for m in cockpit.station.pop_received()}
    assert latest["AHRS2"].altitude == pytest.approx(-3.0, abs=0.2)
    position = latest["GLOBAL_POSITION_INT"]
    assert position.relative_alt == pytest.approx(-3000, abs=200)
    assert (position.lat, position.lon) == pytest.approx((415_000_000, Y), abs=100)
    assert abs(latest["ATTITUDE"].roll) < 0.1


def test_gps_battery_and_power_are_displayed(cockpit: Harness) -> None:
    """vehicle.ts:370 BATTERY_STATUS, temperature 32767: unknown; :417 GPS_RAW_INT; :447 SYS_STATUS.

    An unknown current is -1.
    """
    latest = displayed(cockpit, 5)
    assert (latest["BATTERY_STATUS"].id, latest["BATTERY_STATUS"].temperature) == (0, 32_767)
    assert latest["GPS_RAW_INT"].fix_type == mavlink.GPS_FIX_TYPE_3D_FIX
    assert latest["GPS_RAW_INT"].satellites_visible == FIX.satellites
    assert latest["SYS_STATUS"].current_battery == -1


@pytest.mark.parametrize("number", MODES)
def test_mode_menu_selects_the_mode(cockpit: Harness, number: int) -> None:
    """``setMode``; ardusub.ts:72 shows ``HEARTBEAT.custom_mode``."""
    set_mode(cockpit, MANUAL)
    received = set_mode(cockpit, number)
    assert result(received) == ACCEPTED
    assert only(received, "HEARTBEAT").custom_mode == number
    assert cockpit.vehicle.state.mode == MODES[number].number


def test_takeoff_button_is_refused_with_reason(cockpit: Harness) -> None:
    """``takeoff`` (vehicle.ts:581): GUIDED, arm, NAV_TAKEOFF."""
    assert result(set_mode(cockpit, GUIDED)) == ACCEPTED
    assert result(command(cockpit, 400, 1)) == ACCEPTED
    received = command(cockpit, 22, 0, 0, 0, 0, 0, 0, 2.0)
    assert result(received) == mavlink.MAV_RESULT_UNSUPPORTED
    assert texts(received) == ["Takeoff refused: an underwater vehicle dives in a mission"]


@pytest.mark.parametrize("mode", [GUIDED, POSHOLD])
def test_change_of_altitude_is_kept(cockpit: Harness, mode: int) -> None:
    """``_changeAltitude`` (vehicle.ts:533): once, an offset in LOCAL_OFFSET_NED, z down."""
    set_mode(cockpit, mode)
    assert result(command(cockpit, 400, 1)) == ACCEPTED
    depth_m = cockpit.vehicle.state.estimate.depth_m
    message = mavlink.MAVLink_set_position_target_local_ned_message(
        0, 1, 1, 7, 0b1111_1111_1000, 0, 0, 2.0, 0, 0, 0, 0, 0, 0, 0, 0
    )
    assert texts(cockpit.ask(message)) == []
    cockpit.tick(5 * TICKS_PER_S, fix=FIX)
    assert cockpit.vehicle.state.setpoint.depth_m == pytest.approx(depth_m + 2.0, abs=0.05)
    assert cockpit.vehicle.state.mode == MODES[mode].number


@pytest.mark.parametrize(("mode", "wanted"), [(GUIDED, ACCEPTED), (ALT_HOLD, REJECTED)])
def test_click_on_map_goes_there(cockpit: Harness, mode: int, wanted: int) -> None:
    """Map.vue:543 and ``goTo`` (vehicle.ts:616): DO_REPOSITION in frame GLOBAL, all numbers 0.

    Its altitude is the present one. Without the change-mode flag other modes than GUIDED and
    POSHOLD refuse, with the reason.
    """
    assert result(command(cockpit, 400, 1)) == ACCEPTED
    set_mode(cockpit, mode)
    message = mavlink.MAVLink_command_int_message(
        1, 1, 0, 192, 0, 0, 0, 0, 0, 0, X, Y, -cockpit.vehicle.state.estimate.depth_m
    )
    received = cockpit.ask(message)
    assert result(received) == wanted
    if wanted == ACCEPTED:
        assert cockpit.vehicle.state.mode == modes.STATION.number
    else:
        assert "set the change-mode flag, or HOLD first" in texts(received)[-1]


def test_latency_is_measured_by_timesync(cockpit: Harness) -> None:
    """``measureLatency`` (vehicle.ts:797): TIMESYNC with a target, ts1 is sent back."""
    timesync = dialect.by_name("TIMESYNC")  # pymavlink's has no target
    request = encode(timesync, (0, 4711, 1, 1), 0, 255, 190)
    cockpit.station._outgoing.append(request)
    cockpit.serve()
    (answer,) = cockpit.station.pop_named("TIMESYNC")
    assert answer.ts1 == 4711
    assert answer.tc1 != 0


def test_parameters_are_listed_and_set(cockpit: Harness) -> None:
    """``requestParametersList`` and ``setParameter`` (vehicle.ts:858, :871): component 0, UINT8.

    The number is not encoded bytewise: ArduPilot's capability PARAM_ENCODE_C_CAST.
    """
    listed = cockpit.ask(mavlink.MAVLink_param_request_list_message(1, 0))
    values = [m for m in listed if m.get_type() == "PARAM_VALUE"]
    assert values[0].param_count > 100
    uint8 = mavlink.MAV_PARAM_TYPE_UINT8
    received = cockpit.ask(mavlink.MAVLink_param_set_message(1, 0, b"FS_GCS_ACT", 2.0, uint8))
    assert only(received, "PARAM_VALUE").param_value == 2.0


def upload(harness: Harness) -> list[Any]:
    """``uploadMission`` (vehicle.ts:1386) of MissionPlanningView.vue:1008: home, speed, waypoint.

    types.ts:29: all items in frame GLOBAL_RELATIVE_ALT_INT, ``current`` is 0.
    """
    rows = ((16, (0, 5, 0, 0), 0.0), (178, (1, 1, -1, 0), 0.0), (16, (0, 5, 0, 0), -3.0))
    received = harness.ask(mavlink.MAVLink_mission_count_message(1, 1, len(rows)))
    for number, (number_of_command, p, z) in enumerate(rows):
        assert only(received, "MISSION_REQUEST").seq == number
        received = harness.ask(
            mavlink.MAVLink_mission_item_int_message(
                1, 1, number, 6, number_of_command, 0, 1, *p, X, Y, z
            )
        )
    return received


def test_mission_is_uploaded_with_home_first(cockpit: Harness) -> None:
    """vehicle.ts:1423 prefers MISSION_REQUEST; :1439 repeats the last item until the ack."""
    received = upload(cockpit)
    assert only(received, "MISSION_ACK").type == mavlink.MAV_MISSION_ACCEPTED
    last = mavlink.MAVLink_mission_item_int_message(1, 1, 2, 6, 16, 0, 1, 0, 5, 0, 0, X, Y, -3.0)
    again = [m.type for m in cockpit.ask(last) if m.get_type() == "MISSION_ACK"]
    assert set(again) <= {mavlink.MAV_MISSION_ACCEPTED}
    assert len(cockpit.vehicle.state.mission.items) == 3


def test_mission_is_downloaded_and_cleared(cockpit: Harness) -> None:
    """``fetchMission`` (vehicle.ts:1098): requests and acknowledgement to component 0."""
    upload(cockpit)
    count = only(cockpit.ask(mavlink.MAVLink_mission_request_list_message(1, 1)), "MISSION_COUNT")
    assert count.count == 3
    for number, wanted in enumerate((16, 178, 16)):
        request = mavlink.MAVLink_mission_request_int_message(1, 0, number)
        item = only(cockpit.ask(request), "MISSION_ITEM_INT")
        assert (item.seq, item.command) == (number, wanted)
    assert cockpit.ask(mavlink.MAVLink_mission_ack_message(1, 0, 0)) == []
    cockpit.ask(mavlink.MAVLink_mission_clear_all_message(1, 1))  # vehicle.ts:1273
    assert len(cockpit.vehicle.state.mission.items) == 0


def test_mission_buttons_start_and_pause(cockpit: Harness) -> None:
    """``startMission`` (vehicle.ts:1318): ALT_HOLD, arm, MISSION_START; ``pauseMission`` (:1339).

    vehicle.ts:494 shows MISSION_CURRENT.
    """
    upload(cockpit)
    assert result(set_mode(cockpit, ALT_HOLD)) == ACCEPTED
    assert result(command(cockpit, 400, 1)) == ACCEPTED
    received = command(cockpit, 300, 0, 0)
    assert result(received) == ACCEPTED
    assert only(received, "HEARTBEAT").custom_mode == AUTO
    assert displayed(cockpit)["MISSION_CURRENT"].seq == 2, "home and speed are passed at once"
    assert result(set_mode(cockpit, POSHOLD)) == ACCEPTED


def test_mission_skips_and_restarts_and_its_speed_changes(cockpit: Harness) -> None:
    """``setMissionCurrent`` (vehicle.ts:1608), ``setCruiseSpeed`` (:1617), both during a mission.

    mission.ts:615 skips to an item, :627 restarts at item 1, :651 changes the speed.
    """
    upload(cockpit)
    assert result(command(cockpit, 400, 1)) == ACCEPTED
    assert result(command(cockpit, 300, 0, 0)) == ACCEPTED
    for sequence, shown in ((2, 2), (1, 2)):  # item 1 is a speed, which is passed at once
        assert result(command(cockpit, 224, sequence)) == ACCEPTED
        assert displayed(cockpit)["MISSION_CURRENT"].seq == shown
    assert result(command(cockpit, 178, 1, 1.2, -1, 0)) == ACCEPTED
    assert displayed(cockpit)["HEARTBEAT"].custom_mode == AUTO
    assert result(set_mode(cockpit, POSHOLD)) == ACCEPTED  # mission.ts:626, "stop mission"
    assert result(command(cockpit, 224, 1)) == ACCEPTED
    assert displayed(cockpit)["HEARTBEAT"].custom_mode == POSHOLD


def test_system_time_is_ignored_and_camera_refused(cockpit: Harness) -> None:
    """``sendSystemTime`` (vehicle.ts:783), every 10 s; predefined-resources.ts:102 and :128."""
    assert cockpit.ask(mavlink.MAVLink_system_time_message(1_770_000_000_000_000, 10_000)) == []
    for camera in (mavlink.MAV_CMD_SET_CAMERA_ZOOM, mavlink.MAV_CMD_SET_CAMERA_FOCUS):
        assert result(command(cockpit, camera, 1, 0.5)) == mavlink.MAV_RESULT_UNSUPPORTED


def test_refusal_is_shown_as_text(cockpit: Harness) -> None:
    """vehicle.ts:481 shows the text of each STATUSTEXT by itself, also the parts of a long one."""
    received = command(cockpit, 176, 1, 1)
    parts = [m.text for m in received if m.get_type() == "STATUSTEXT"]
    assert parts, "a mode that the vehicle does not have"
    assert all(parts)


def test_home_is_set_and_fetched(cockpit: Harness) -> None:
    """``setHomeWaypoint`` (vehicle.ts:1213), ``fetchHomeWaypoint`` (:1236)."""
    received = command(cockpit, 179, 0, 0, 0, 0, 41.51, -70.71, 10.0)
    assert result(received) == ACCEPTED
    home = only(command(cockpit, 512, 242), "HOME_POSITION")
    assert (home.latitude, home.longitude) == pytest.approx((415_100_000, -707_100_000), abs=100)
    assert home.altitude == 0


def test_joystick_moves_the_actuators(cockpit: Harness) -> None:
    """``sendManualControl`` (communication/mavlink.ts:39): z 500 is neutral, with extensions."""
    set_mode(cockpit, MANUAL)
    message = mavlink.MAVLink_manual_control_message(1, 600, 0, 500, -250, 0, 0, 0, 0, 0)
    cockpit.ask(message)
    assert cockpit.server.stick == (-0.25, 0.0, 0.6)
