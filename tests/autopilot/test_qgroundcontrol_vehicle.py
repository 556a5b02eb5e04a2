"""What QGroundControl shows of the vehicle once it is connected, and what its buttons send: as its
source has it."""

import math
from typing import Any

import pytest
from pymavlink.dialects.v20 import all as mavlink

from autopilot.control import modes
from mavlink_io.records import Altimeter, Battery, Leak
from tests.autopilot.qgroundcontrol import AUTOPILOT, FIX, Connection, write_mission
from tests.helpers.fake_hil import only

# Vehicle.cc: what it shows


def streams(qgc: Connection, seconds: int = 6) -> dict[str, Any]:
    """The latest of each message of some seconds."""
    qgc.deck.tick(50 * seconds, fix=FIX)
    qgc.deck.serve()
    return {m.get_type(): m for m in qgc.deck.station.heard()}


def test_it_finds_where_she_is_without_asking(qgc: Connection) -> None:
    """``_handleGlobalPositionInt``, ``_handleHomePosition``, ``_handleAltitude``,
    ``_handleGpsRawInt``."""
    heard = streams(qgc)
    assert heard["GLOBAL_POSITION_INT"].lat == pytest.approx(415_000_000, abs=100)
    home = heard["HOME_POSITION"]
    assert (home.latitude, home.longitude, home.altitude) == (415_000_000, -707_000_000, 0)
    assert home.get_srcComponent() == AUTOPILOT, (
        "_handleHomePosition takes it from the default component only"
    )
    assert "ALTITUDE" in heard
    assert heard["GPS_RAW_INT"].fix_type == mavlink.GPS_FIX_TYPE_3D_FIX


def test_nothing_that_is_switched_on_counts_as_unhealthy(qgc: Connection) -> None:
    """``_handleSysStatus``: unhealthy is ``enabled & ~health``; the arm button heeds
    MAV_SYS_STATUS_PREARM_CHECK."""
    status = streams(qgc)["SYS_STATUS"]
    assert not status.onboard_control_sensors_enabled & ~status.onboard_control_sensors_health
    assert status.onboard_control_sensors_health & mavlink.MAV_SYS_STATUS_PREARM_CHECK
    assert status.onboard_control_sensors_present & mavlink.MAV_SYS_STATUS_PREARM_CHECK


def test_flying_is_being_under_way(qgc: Connection) -> None:
    """``_handleExtendedSysState``: landed or flying decides which buttons there are."""
    assert streams(qgc)["EXTENDED_SYS_STATE"].landed_state == mavlink.MAV_LANDED_STATE_ON_GROUND
    qgc.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1)
    assert streams(qgc)["EXTENDED_SYS_STATE"].landed_state == mavlink.MAV_LANDED_STATE_IN_AIR


def test_the_mode_it_shows_is_the_one_that_was_asked_for(qgc: Connection) -> None:
    """``_handleCurrentMode``: an intended mode of 0 would be taken for unknown."""
    heard = streams(qgc)
    assert heard["CURRENT_MODE"].intended_custom_mode == modes.HOLD.number
    assert heard["CURRENT_MODE"].custom_mode == modes.HOLD.number


def test_a_battery_without_a_gauge_is_unknown_and_one_with_is_told(qgc: Connection) -> None:
    """``BatteryFactGroupListModel``: UINT16_MAX and -1 are "not available", charge_state decides
    the colour."""
    unknown = streams(qgc)["BATTERY_STATUS"]
    assert (set(unknown.voltages), unknown.current_battery, unknown.battery_remaining) == (
        {0xFFFF},
        -1,
        -1,
    )
    vehicle = qgc.deck.vehicle
    vehicle._battery, vehicle._leak, vehicle._altimeter = (
        Battery(29.6, 4.0, 1.0, 0.9),
        Leak(False),
        Altimeter(0, 9.0, 0.3, 30.0),
    )
    told = streams(qgc)["BATTERY_STATUS"]
    assert (told.voltages[0], told.battery_remaining) == (29_600, 90)
    assert told.charge_state == mavlink.MAV_BATTERY_CHARGE_STATE_OK


def test_the_mission_bar_has_its_numbers(qgc: Connection) -> None:
    """``MissionManager::_handleMissionCurrent`` and the progress that ``mission_state`` and
    ``total`` give."""
    assert streams(qgc)["MISSION_CURRENT"].total == 0xFFFF, "no mission, as common.xml has it"
    write_mission(qgc)
    current = streams(qgc)["MISSION_CURRENT"]
    assert (current.seq, current.total, current.mission_state) == (
        0,
        3,
        mavlink.MISSION_STATE_NOT_STARTED,
    )


# Vehicle.cc, PX4FirmwarePlugin.cc: what its buttons send


def test_arming_is_acknowledged_and_seen_in_the_heartbeat(qgc: Connection) -> None:
    """``Vehicle::setArmed``; ``MavCommandQueue`` repeats after 3 s and shows a refusal with its
    reason."""
    heard = qgc.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1)
    assert only(heard, "COMMAND_ACK").result == mavlink.MAV_RESULT_ACCEPTED
    assert only(heard, "HEARTBEAT").base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED


@pytest.mark.parametrize(
    "mode", [modes.MISSION, modes.RTL, modes.SURFACE, modes.MANUAL, modes.DEPTH]
)
def test_the_mode_menu_is_answered_by_a_heartbeat_alone(qgc: Connection, mode: modes.Mode) -> None:
    """``Vehicle::setFlightMode``: SET_MODE with PX4's numbers; ``_setFlightModeAndValidate``
    watches the heartbeat."""
    heard = qgc.ask(mavlink.MAVLink_set_mode_message(1, 1, mode.number))
    assert only(heard, "HEARTBEAT").custom_mode == mode.number
    assert not [m for m in heard if m.get_type() == "COMMAND_ACK"], "an ack that it never queued"


def test_the_pause_button_holds(qgc: Connection) -> None:
    """``PX4FirmwarePlugin::pauseVehicle``: DO_REPOSITION, change of mode, no place."""
    qgc.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1)
    qgc.ask(mavlink.MAVLink_set_mode_message(1, 1, modes.DEPTH.number))
    nan = math.nan
    heard = qgc.command(
        mavlink.MAV_CMD_DO_REPOSITION,
        -1,
        mavlink.MAV_DO_REPOSITION_FLAGS_CHANGE_MODE,
        0,
        nan,
        nan,
        nan,
        nan,
    )
    assert only(heard, "COMMAND_ACK").result == mavlink.MAV_RESULT_ACCEPTED
    assert only(heard, "HEARTBEAT").custom_mode == modes.HOLD.number


def test_setting_home_on_the_map_does_not_shift_the_depth(qgc: Connection) -> None:
    """``Vehicle::doSetHome``: the terrain's altitude comes with it."""
    message = mavlink.MAVLink_command_int_message(
        1, AUTOPILOT, 0, 179, 0, 0, 0, 0, 0, 0, 415_100_000, -707_100_000, 35.0
    )
    heard = qgc.ask(message)
    assert only(heard, "COMMAND_ACK").result == mavlink.MAV_RESULT_ACCEPTED
    assert only(heard, "HOME_POSITION").altitude == 0
    assert abs(streams(qgc)["GLOBAL_POSITION_INT"].relative_alt) < 50


def test_rates_and_reboot_are_acknowledged(qgc: Connection) -> None:
    """``Vehicle::_setMessageInterval`` (MAVLink inspector), ``Vehicle::rebootVehicle``."""
    assert only(qgc.command(511, 30, 20_000), "COMMAND_ACK").result == mavlink.MAV_RESULT_ACCEPTED
    interval = qgc.command(510, 30)
    assert only(interval, "MESSAGE_INTERVAL").interval_us == 20_000
    assert only(qgc.command(246, 1), "COMMAND_ACK").result == mavlink.MAV_RESULT_ACCEPTED


# LogDownloadController.cc, MAVLinkProtocol


def test_an_empty_list_of_logs_says_that_it_is_empty(qgc: Connection) -> None:
    """``LogDownloadController::_logEntry`` with num_logs 0; silence would be asked again for
    seconds."""
    entry = only(
        qgc.ask(mavlink.MAVLink_log_request_list_message(1, AUTOPILOT, 0, 0xFFFF)), "LOG_ENTRY"
    )
    assert entry.num_logs == 0


def test_its_clock_and_pings_are_answered(qgc: Connection) -> None:
    """``Vehicle::_sendQGCTimeToVehicle`` wants no answer; PING and TIMESYNC do."""
    assert qgc.ask(mavlink.MAVLink_system_time_message(1, 1)) == []
    assert only(qgc.ask(mavlink.MAVLink_ping_message(1, 2, 0, 0)), "PING").seq == 2
    assert only(qgc.ask(mavlink.MAVLink_timesync_message(0, 9)), "TIMESYNC").ts1 == 9
