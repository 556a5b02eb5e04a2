"""Displays and buttons of QGroundControl for a connected vehicle, after its source.

Commits of the files that were read: docs/ground_stations.md.
"""

import math
from typing import Any

import pytest
from pymavlink.dialects.v20 import all as mavlink

from autopilot.control import modes
from mavlink_io.records import Altimeter, Battery, Leak
from tests.autopilot.qgroundcontrol import AUTOPILOT, FIX, Connection, write_mission
from tests.helpers.fake_hil import only

# What QGroundControl displays (Vehicle.cc)


def streams(qgc: Connection, seconds: int = 6) -> dict[str, Any]:
    """Return the latest of each message over some seconds."""
    qgc.harness.tick(50 * seconds, fix=FIX)
    qgc.harness.serve()
    return {m.get_type(): m for m in qgc.harness.station.pop_received()}


def test_position_messages_are_sent_by_default(qgc: Connection) -> None:
    """``_handleGlobalPositionInt``, ``_handleHomePosition``, ``_handleGpsRawInt``."""
    received = streams(qgc)
    assert received["GLOBAL_POSITION_INT"].lat == pytest.approx(415_000_000, abs=100)
    home = received["HOME_POSITION"]
    assert (home.latitude, home.longitude, home.altitude) == (415_000_000, -707_000_000, 0)
    assert home.get_srcComponent() == AUTOPILOT, (
        "_handleHomePosition takes it from the default component only"
    )
    assert "ALTITUDE" in received
    assert received["GPS_RAW_INT"].fix_type == mavlink.GPS_FIX_TYPE_3D_FIX


def test_enabled_sensors_are_healthy(qgc: Connection) -> None:
    """``_handleSysStatus``: unhealthy is ``enabled & ~health``.

    The arm button needs MAV_SYS_STATUS_PREARM_CHECK.
    """
    status = streams(qgc)["SYS_STATUS"]
    assert not status.onboard_control_sensors_enabled & ~status.onboard_control_sensors_health
    assert status.onboard_control_sensors_health & mavlink.MAV_SYS_STATUS_PREARM_CHECK
    assert status.onboard_control_sensors_present & mavlink.MAV_SYS_STATUS_PREARM_CHECK


def test_flying_state_is_submerged_or_armed(qgc: Connection) -> None:
    """``_handleExtendedSysState``: landed or flying selects the buttons."""
    assert streams(qgc)["EXTENDED_SYS_STATE"].landed_state == mavlink.MAV_LANDED_STATE_ON_GROUND
    qgc.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1)
    assert streams(qgc)["EXTENDED_SYS_STATE"].landed_state == mavlink.MAV_LANDED_STATE_IN_AIR


def test_current_mode_reports_intended_mode(qgc: Connection) -> None:
    """``_handleCurrentMode``: an intended mode of 0 means unknown."""
    received = streams(qgc)
    assert received["CURRENT_MODE"].intended_custom_mode == modes.HOLD.number
    assert received["CURRENT_MODE"].custom_mode == modes.HOLD.number


def test_battery_is_unknown_without_gauge(qgc: Connection) -> None:
    """``BatteryFactGroupListModel``: UINT16_MAX and -1 are "not available"."""
    unknown = streams(qgc)["BATTERY_STATUS"]
    assert (set(unknown.voltages), unknown.current_battery, unknown.battery_remaining) == (
        {0xFFFF},
        -1,
        -1,
    )
    vehicle = qgc.harness.vehicle
    vehicle._battery = Battery(29.6, 4.0, 1.0, 0.9)
    vehicle._leak = Leak(False)
    vehicle._altimeter = Altimeter(0, 9.0, 0.3, 30.0)
    reported = streams(qgc)["BATTERY_STATUS"]
    assert (reported.voltages[0], reported.battery_remaining) == (29_600, 90)
    assert reported.charge_state == mavlink.MAV_BATTERY_CHARGE_STATE_OK


def test_mission_current_has_progress(qgc: Connection) -> None:
    """``MissionManager::_handleMissionCurrent``: progress by ``mission_state`` and ``total``."""
    assert streams(qgc)["MISSION_CURRENT"].total == 0xFFFF, "no mission, as common.xml has it"
    write_mission(qgc)
    current = streams(qgc)["MISSION_CURRENT"]
    assert (current.seq, current.total, current.mission_state) == (
        0,
        3,
        mavlink.MISSION_STATE_NOT_STARTED,
    )


# Vehicle.cc, PX4FirmwarePlugin.cc: buttons


def test_arming_is_acknowledged_and_in_heartbeat(qgc: Connection) -> None:
    """``Vehicle::setArmed``; ``MavCommandQueue`` repeats after 3 s and shows a refusal."""
    received = qgc.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1)
    assert only(received, "COMMAND_ACK").result == mavlink.MAV_RESULT_ACCEPTED
    assert only(received, "HEARTBEAT").base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED


def test_force_arm_overrides_a_refusal(qgc: Connection) -> None:
    """``Vehicle::forceArm``: param2 is 2989, also to PX4."""
    qgc.ask(mavlink.MAVLink_param_set_message(1, 1, b"RTL_DEPTH_M", 2000.0, 9))
    refused = only(qgc.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1), "COMMAND_ACK")
    assert refused.result != mavlink.MAV_RESULT_ACCEPTED
    received = qgc.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1, 2989)
    assert only(received, "HEARTBEAT").base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED


@pytest.mark.parametrize(
    "mode", [modes.MISSION, modes.RTL, modes.SURFACE, modes.MANUAL, modes.DEPTH]
)
def test_mode_menu_is_answered_by_heartbeat(qgc: Connection, mode: modes.Mode) -> None:
    """``Vehicle::setFlightMode``: SET_MODE; ``_setFlightModeAndValidate`` needs a heartbeat."""
    received = qgc.ask(mavlink.MAVLink_set_mode_message(1, 1, mode.number))
    assert only(received, "HEARTBEAT").custom_mode == mode.number
    assert not [m for m in received if m.get_type() == "COMMAND_ACK"], "an ack that it never queued"


def test_pause_button_selects_hold(qgc: Connection) -> None:
    """``PX4FirmwarePlugin::pauseVehicle``: DO_REPOSITION, change of mode, no position."""
    qgc.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1)
    qgc.ask(mavlink.MAVLink_set_mode_message(1, 1, modes.DEPTH.number))
    nan = math.nan
    received = qgc.command(
        mavlink.MAV_CMD_DO_REPOSITION,
        -1,
        mavlink.MAV_DO_REPOSITION_FLAGS_CHANGE_MODE,
        0,
        nan,
        nan,
        nan,
        nan,
    )
    assert only(received, "COMMAND_ACK").result == mavlink.MAV_RESULT_ACCEPTED
    assert only(received, "HEARTBEAT").custom_mode == modes.HOLD.number


NAN = math.nan
LAT, LON = 41.501, -70.7


def under_way(qgc: Connection) -> None:
    """Arm in HOLD."""
    assert only(qgc.command(400, 1), "COMMAND_ACK").result == mavlink.MAV_RESULT_ACCEPTED
    streams(qgc, 1)


def reposition(qgc: Connection, *parameters: float) -> Any:
    """Send DO_REPOSITION with the change-mode flag; return the COMMAND_ACK's result."""
    received = qgc.command(mavlink.MAV_CMD_DO_REPOSITION, -1, 1, 0, *parameters)
    return only(received, "COMMAND_ACK").result


def test_go_to_location_circles_the_place(qgc: Connection) -> None:
    """``PX4FirmwarePlugin::guidedModeGotoLocation``: COMMAND_INT in frame GLOBAL.

    The altitude is that of GLOBAL_POSITION_INT, the present one.
    """
    under_way(qgc)
    message = mavlink.MAVLink_command_int_message(
        *(1, AUTOPILOT, 0, mavlink.MAV_CMD_DO_REPOSITION, 0, 0, -1, 1, 0, NAN),
        *(round(LAT * 1e7), round(LON * 1e7), streams(qgc, 1)["GLOBAL_POSITION_INT"].alt / 1e3),
    )
    assert only(qgc.ask(message), "COMMAND_ACK").result == mavlink.MAV_RESULT_ACCEPTED
    assert qgc.harness.vehicle.state.mode == modes.STATION.number
    assert qgc.harness.vehicle.state.path is not None


def test_change_of_altitude_pauses_first(qgc: Connection) -> None:
    """``guidedModeChangeAltitude``, ``_changeAltAfterPause``: DO_REPOSITION twice."""
    under_way(qgc)
    assert reposition(qgc, NAN, NAN, NAN, NAN) == mavlink.MAV_RESULT_ACCEPTED
    assert reposition(qgc, NAN, NAN, NAN, -3.5) == mavlink.MAV_RESULT_ACCEPTED
    state = qgc.harness.vehicle.state
    assert (state.mode, state.setpoint.depth_m) == (modes.HOLD.number, 3.5)


def test_change_of_heading_is_held(qgc: Connection) -> None:
    """``guidedModeChangeHeading``: DO_REPOSITION with a heading (rad) only."""
    under_way(qgc)
    assert reposition(qgc, 1.2, NAN, NAN, NAN) == mavlink.MAV_RESULT_ACCEPTED
    state = qgc.harness.vehicle.state
    assert state.mode == modes.HOLD.number
    assert state.setpoint.heading_rad == pytest.approx(1.2)


@pytest.mark.parametrize("kind", [0, 1])
def test_change_of_speed_is_accepted(qgc: Connection, kind: int) -> None:
    """``guidedModeChangeGroundSpeedMetersSecond``, ``...EquivalentAirspeed...``."""
    under_way(qgc)
    received = qgc.command(mavlink.MAV_CMD_DO_CHANGE_SPEED, kind, 1.0, -1, 0, NAN, NAN, NAN)
    assert only(received, "COMMAND_ACK").result == mavlink.MAV_RESULT_ACCEPTED
    assert qgc.harness.vehicle.state.setpoint.thrust == pytest.approx(0.58 / 1.3)


def test_start_of_mission_selects_mode_before_arming(qgc: Connection) -> None:
    """``startMission``: ``_setFlightModeAndValidate``, then ``_armVehicleAndValidate``."""
    write_mission(qgc)
    received = qgc.ask(mavlink.MAVLink_set_mode_message(1, 1, modes.MISSION.number))
    assert only(received, "HEARTBEAT").custom_mode == modes.MISSION.number
    received = qgc.command(400, 1)
    assert only(received, "COMMAND_ACK").result == mavlink.MAV_RESULT_ACCEPTED
    beat = only(received, "HEARTBEAT")
    assert beat.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED
    assert beat.custom_mode == modes.MISSION.number


def test_home_set_on_map_keeps_depth(qgc: Connection) -> None:
    """``Vehicle::doSetHome`` sends the altitude of the terrain too."""
    message = mavlink.MAVLink_command_int_message(
        1, AUTOPILOT, 0, 179, 0, 0, 0, 0, 0, 0, 415_100_000, -707_100_000, 35.0
    )
    received = qgc.ask(message)
    assert only(received, "COMMAND_ACK").result == mavlink.MAV_RESULT_ACCEPTED
    assert only(received, "HOME_POSITION").altitude == 0
    assert abs(streams(qgc)["GLOBAL_POSITION_INT"].relative_alt) < 50


def test_rates_and_reboot_are_acknowledged(qgc: Connection) -> None:
    """``Vehicle::_setMessageInterval`` (MAVLink inspector), ``Vehicle::rebootVehicle``."""
    assert only(qgc.command(511, 30, 20_000), "COMMAND_ACK").result == mavlink.MAV_RESULT_ACCEPTED
    interval = qgc.command(510, 30)
    assert only(interval, "MESSAGE_INTERVAL").interval_us == 20_000
    assert only(qgc.command(246, 1), "COMMAND_ACK").result == mavlink.MAV_RESULT_ACCEPTED


# LogDownloadController.cc, MAVLinkProtocol


def test_empty_log_list_is_answered(qgc: Connection) -> None:
    """``LogDownloadController::_logEntry`` with num_logs 0; without it requests repeat."""
    entry = only(
        qgc.ask(mavlink.MAVLink_log_request_list_message(1, AUTOPILOT, 0, 0xFFFF)), "LOG_ENTRY"
    )
    assert entry.num_logs == 0


def test_ping_and_timesync_of_qgc_are_answered(qgc: Connection) -> None:
    """``Vehicle::_sendQGCTimeToVehicle`` needs no reply; PING and TIMESYNC do."""
    assert qgc.ask(mavlink.MAVLink_system_time_message(1, 1)) == []
    assert only(qgc.ask(mavlink.MAVLink_ping_message(1, 2, 0, 0)), "PING").seq == 2
    assert only(qgc.ask(mavlink.MAVLink_timesync_message(0, 9)), "TIMESYNC").ts1 == 9
