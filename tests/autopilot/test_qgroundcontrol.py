"""What QGroundControl needs, message by message, as its source of 2026 has it (github.com/mavlink/qgroundcontrol).

QGroundControl itself does not run here: its questions are put to the real server one after the other, as the files and
functions named in each test put them, and the answers judged as those judge them. The order is that of
``InitialConnectStateMachine``: version, standard modes, component information, parameters, mission, geofence, rally
points.

Three things it cannot do with this vehicle, whatever she answers, for its ``FirmwarePlugin`` decides them by
HEARTBEAT.autopilot: with ``generic`` no mode buttons (``FirmwarePlugin::setFlightMode`` returns false) and no "start
mission"; with ``px4`` both work, but the setup pages complain of PX4 parameters that she does not have.
"""

import json
import math
import struct
import zlib
from typing import Any, NamedTuple

import pytest
from pymavlink.dialects.v20 import all as mavlink

from autopilot import modes
from autopilot.identity import AutopilotId
from autopilot.params import PARAMETERS
from link.records import Altimeter, Battery, GpsFix, Leak
from tests.autopilot.deck import Deck, only, texts

FIX = GpsFix(0, 3, 41.5, -70.7, 12.0, 0.0, 0.0, 0.0, 9)
REQUEST_MESSAGE, AUTOPILOT, ALL_COMPONENTS = 512, 1, 0
COMPONENT_METADATA, COMPONENT_INFORMATION, AVAILABLE_MODES = 397, 395, 435
MISSION, FENCE, RALLY, ALL_PLANS = 0, 1, 2, 255
SAFE_RECOVERY, STANDARD_MISSION, LAND = 5, 6, 7


class Connection(NamedTuple):
    """A vehicle afloat and a QGroundControl that has heard of her."""

    deck: Deck
    autopilot: AutopilotId

    def ask(self, message: Any) -> list[Any]:
        return self.deck.ask(message)

    def command(self, number: int, *parameters: float) -> list[Any]:
        """Vehicle::sendMavCommand: parameters that it does not mean are zero."""
        filled = [*parameters, *[0.0] * (7 - len(parameters))]
        return self.ask(mavlink.MAVLink_command_long_message(1, AUTOPILOT, number, 0, *filled))

    def message(self, number: int, parameter: float = 0.0) -> Any:
        """Vehicle::requestMessage: an acknowledgement that accepts, and the message."""
        heard = self.command(REQUEST_MESSAGE, number, parameter)
        acknowledgement = only(heard, "COMMAND_ACK")
        assert (acknowledgement.command, acknowledgement.result) == (REQUEST_MESSAGE, mavlink.MAV_RESULT_ACCEPTED)
        (answer,) = [m for m in heard if m.get_msgId() == number or m.get_type() == f"UNKNOWN_{number}"]
        return answer


@pytest.fixture(params=list(AutopilotId))
def qgc(request: pytest.FixtureRequest) -> Connection:
    deck = Deck(autopilot=request.param)
    deck.station.say(mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_GCS, 8, 0, 0, 0, 3))
    deck.serve()
    deck.tick(100, fix=FIX)
    deck.serve()
    deck.station.heard()
    return Connection(deck, request.param)


# MultiVehicleManager.cc, VehicleLinkManager.h: there she is


def test_a_vehicle_is_made_of_a_heartbeat_of_component_1(qgc: Connection) -> None:
    """``MultiVehicleManager::_vehicleHeartbeatInfo`` ignores every component but MAV_COMP_ID_AUTOPILOT1.

    ``VehicleLinkManager``: 3500 ms without one is a lost link.
    """
    qgc.deck.server._heartbeat.hasten()
    qgc.deck.serve()
    beat = only(qgc.deck.station.heard(), "HEARTBEAT")
    assert beat.get_srcComponent() == mavlink.MAV_COMP_ID_AUTOPILOT1
    assert beat.type == mavlink.MAV_TYPE_SUBMARINE, "its vehicle class, and the toolbar that goes with it"
    assert beat.autopilot == {AutopilotId.GENERIC: 0, AutopilotId.PX4: 12}[qgc.autopilot]
    assert beat.base_mode & mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED, "or no flight mode has a name"


# InitialConnectStateMachine.cc


def test_the_version_tells_what_to_ask_for_next(qgc: Connection) -> None:
    """``_autopilotVersionRequestMessageHandler``, ``Vehicle::_setCapabilities``, ``GeoFenceManager::supported``."""
    version = qgc.message(mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION)
    able = version.capabilities
    for name in ("MISSION_INT", "COMMAND_INT", "MAVLINK2", "FTP"):
        assert able & getattr(mavlink, f"MAV_PROTOCOL_CAPABILITY_{name}"), name
    for name in ("MISSION_FENCE", "MISSION_RALLY"):
        assert not able & getattr(mavlink, f"MAV_PROTOCOL_CAPABILITY_{name}"), "it would ask for a plan she has not"
    assert version.flight_sw_version >> 8, "major, minor and patch: zero is taken for unknown"


def test_modes_come_all_at_once_or_one_by_one(qgc: Connection) -> None:
    """``StandardModes::request`` asks for index 0 and is done at the last; of older releases, for one after another."""
    heard = qgc.command(REQUEST_MESSAGE, AVAILABLE_MODES, 0)
    assert heard[0].get_type() == "COMMAND_ACK", "commandResultHandler: anything but ACCEPTED ends the request"
    assert heard[0].result == mavlink.MAV_RESULT_ACCEPTED
    listed = heard[1:]
    assert [m.mode_index for m in listed] == list(range(1, listed[0].number_modes + 1))
    for mode in listed:
        assert qgc.message(AVAILABLE_MODES, mode.mode_index).custom_mode == mode.custom_mode


def test_every_mode_has_one_name_and_a_number_that_can_be_set(qgc: Connection) -> None:
    """``StandardModes::availableModesReceived`` names the standard ones itself; ``ensureUniqueModeNames``."""
    listed = qgc.command(REQUEST_MESSAGE, AVAILABLE_MODES, 0)[1:]
    given = {SAFE_RECOVERY: "Safe Recovery", STANDARD_MISSION: "Mission", LAND: "Land"}
    names = [given.get(m.standard_mode, m.mode_name) for m in listed]
    assert len(set(names)) == len(names)
    assert all(names)
    assert {m.standard_mode for m in listed} <= {0, *given}, "the others are for aircraft"
    assert not any(m.properties & mavlink.MAV_MODE_PROPERTY_NOT_USER_SELECTABLE for m in listed)
    assert {m.custom_mode for m in listed} == {mode.number for mode in modes.MODES}


class Ftp:
    """``FTPManager``: open, read in bursts, reset the sessions."""

    def __init__(self, qgc: Connection) -> None:
        self._qgc, self._sequence = qgc, 0

    def ask(
        self, opcode: int, session: int = 0, offset: int = 0, data: bytes = b"", size: int | None = None
    ) -> list[Any]:
        head = struct.pack(
            "<HBBBBBxI", self._sequence, session, opcode, len(data) if size is None else size, 0, 0, offset
        )
        heard = self._qgc.ask(
            mavlink.MAVLink_file_transfer_protocol_message(0, 1, AUTOPILOT, (head + data).ljust(251, b"\0"))
        )
        answers = [bytes(m.payload) for m in heard if m.get_type() == "FILE_TRANSFER_PROTOCOL"]
        for answer in answers:
            assert answer[5] == opcode, "hdr.req_opcode, or the answer is disregarded"
            assert struct.unpack_from("<H", answer)[0] >= self._sequence + 1, "hdr.seqNumber"
        self._sequence += 2
        return answers

    def download(self, path: str) -> bytes:
        """``_openFileROBegin``, ``_burstReadFileBegin``, ``_resetSessionsBegin`` and what follows each."""
        (opened,) = self.ask(mavlink.MAV_FTP_OPCODE_OPENFILERO, data=path.encode())
        assert (opened[3], opened[4]) == (mavlink.MAV_FTP_OPCODE_ACK, 4), "ack, with the size of the file"
        session, size = opened[2], struct.unpack_from("<I", opened, 12)[0]
        content, over = b"", False
        while not over:
            for packet in self.ask(mavlink.MAV_FTP_OPCODE_BURSTREADFILE, session, len(content), size=239):
                if packet[3] == mavlink.MAV_FTP_OPCODE_NAK:
                    assert packet[12] == mavlink.MAV_FTP_ERR_EOF
                    over = True
                    continue
                assert packet[2] == session
                assert struct.unpack_from("<I", packet, 8)[0] == len(content), "a hole would be filled by single reads"
                content += packet[12 : 12 + packet[4]]
        (reset,) = self.ask(mavlink.MAV_FTP_OPCODE_RESETSESSION)
        assert reset[3] == mavlink.MAV_FTP_OPCODE_ACK
        assert len(content) == size
        return content


def test_parameter_metadata_is_found_fetched_and_read(qgc: Connection) -> None:
    """``RequestMetaDataTypeStateMachine``, ``CompInfoGeneral::setJson``, ``CompInfoParam::setJson``."""
    answer = qgc.message(COMPONENT_METADATA)
    _, crc, padded = struct.unpack("<II100s", bytes(answer.data)[10:-2].ljust(108, b"\0"))
    uri = padded.rstrip(b"\0").decode()
    assert uri.startswith("mftp://")
    ftp = Ftp(qgc)
    content = ftp.download(uri.removeprefix("mftp://"))
    assert crc == zlib.crc32(content, 0xFFFFFFFF) ^ 0xFFFFFFFF, "by which it keeps the file for the next time"
    general = json.loads(content)
    assert general["version"] == 1, "'Metadata json unsupported version' otherwise"
    uris = {row["type"]: row["uri"] for row in general["metadataTypes"]}
    parameters = json.loads(ftp.download(uris[1].removeprefix("mftp://")))
    assert parameters["version"] == 1
    assert [row["name"] for row in parameters["parameters"]] == [row.name for row in PARAMETERS]
    assert all(row["type"] == "Float" for row in parameters["parameters"]), "the type of PARAM_VALUE, or no metadata"


def test_what_it_would_ask_without_metadata_is_answered_at_once(qgc: Connection) -> None:
    """``_requestCompInfoDeprecated``: UNSUPPORTED is an answer, silence costs three tries of three seconds."""
    (acknowledgement,) = qgc.command(REQUEST_MESSAGE, COMPONENT_INFORMATION)
    assert acknowledgement.result == mavlink.MAV_RESULT_UNSUPPORTED


def test_a_file_that_is_not_there_is_refused_at_once(qgc: Connection) -> None:
    """``FTPManager::_openFileROAckOrNak``."""
    (answer,) = Ftp(qgc).ask(mavlink.MAV_FTP_OPCODE_OPENFILERO, data=b"/etc/extras/parameters.json.xz")
    assert (answer[3], answer[12]) == (mavlink.MAV_FTP_OPCODE_NAK, mavlink.MAV_FTP_ERR_FILENOTFOUND)


# ParameterManager.cc


def test_the_parameter_list_is_whole_and_numbered(qgc: Connection) -> None:
    """``refreshAllParameters`` asks component 0; ``_parameterUpdate`` waits for every index below param_count."""
    heard = qgc.ask(mavlink.MAVLink_param_request_list_message(1, ALL_COMPONENTS))
    values = [m for m in heard if m.get_type() == "PARAM_VALUE"]
    assert {m.param_count for m in values} == {len(PARAMETERS)}
    assert [m.param_index for m in values] == list(range(len(PARAMETERS))), "65535 is disregarded before the list"
    assert values[0].param_id != "_HASH_CHECK", "WaitForHashCheckParamValue: another name ends the wait for a cache"
    assert {m.param_type for m in values} == {mavlink.MAV_PARAM_TYPE_REAL32}
    assert {m.get_srcComponent() for m in values} == {AUTOPILOT}


def test_a_missing_parameter_is_asked_for_by_index(qgc: Connection) -> None:
    """``_fillIndexBatchQueue`` after 3 s: up to ten at once, param_id empty."""
    for index in (0, 7, len(PARAMETERS) - 1):
        value = only(qgc.ask(mavlink.MAVLink_param_request_read_message(1, AUTOPILOT, b"", index)), "PARAM_VALUE")
        assert (value.param_index, value.param_id) == (index, PARAMETERS[index].name)


def test_a_parameter_that_is_set_is_told_with_the_value_she_keeps(qgc: Connection) -> None:
    """``_valueUpdated``: the write is open until PARAM_VALUE of that name; ``fact->_containerSetRawValue(value)``."""
    told = only(qgc.ask(mavlink.MAVLink_param_set_message(1, AUTOPILOT, b"HDG_P", 0.75, 9)), "PARAM_VALUE")
    assert (told.param_id, told.param_value, told.param_index) == ("HDG_P", 0.75, only_index("HDG_P"))
    refused = qgc.ask(mavlink.MAVLink_param_set_message(1, AUTOPILOT, b"HDG_P", 99.0, 9))
    assert only(refused, "PARAM_VALUE").param_value == 0.75, "so that the page shows what is in force"
    assert texts(refused)


def only_index(name: str) -> int:
    return [row.name for row in PARAMETERS].index(name)


def test_the_hash_it_may_ask_px4_for_is_refused_at_once(qgc: Connection) -> None:
    """``ParamHashCheckStateMachine`` is for autopilots that cache; PARAM_ERROR ends it without a second's wait."""
    heard = qgc.ask(mavlink.MAVLink_param_request_read_message(1, AUTOPILOT, b"_HASH_CHECK", -1))
    assert only(heard, "PARAM_ERROR").error == mavlink.MAV_PARAM_ERROR_DOES_NOT_EXIST


# PlanManager.cc


@pytest.mark.parametrize("kind", [MISSION, FENCE, RALLY])
def test_every_kind_of_plan_has_a_count(qgc: Connection, kind: int) -> None:
    """``_handleMissionCount``: of the kind that was asked for, or it is disregarded; 0 is read to its end at once."""
    count = only(qgc.ask(mavlink.MAVLink_mission_request_list_message(1, AUTOPILOT, kind)), "MISSION_COUNT")
    assert (count.mission_type, count.count) == (kind, 0)
    assert (count.target_system, count.target_component) == (255, 190)
    assert qgc.ask(mavlink.MAVLink_mission_ack_message(1, AUTOPILOT, mavlink.MAV_MISSION_ACCEPTED, kind)) == []


def legs() -> list[tuple[Any, ...]]:
    """frame, command, param1 to 4, x, y, z as its plan view writes them."""
    nan = math.nan
    return [
        (2, 178, 1, -1, 40, 0, 0, 0, 0),
        (3, 16, 0, 0, 0, nan, 415_010_000, -707_000_000, -3.0),
        (2, 93, 10, -1, -1, -1, 0, 0, 0),
    ]


def test_a_mission_is_written_item_by_item_and_read_back(qgc: Connection) -> None:
    """``_handleMissionRequest`` in order, ``_handleMissionAck`` when all were asked for, ``_handleMissionItem``."""
    items = legs()
    heard = qgc.ask(mavlink.MAVLink_mission_count_message(1, AUTOPILOT, len(items), MISSION))
    for n, (frame, command, p1, p2, p3, p4, x, y, z) in enumerate(items):
        request = only(heard, "MISSION_REQUEST_INT")
        assert (request.seq, request.mission_type) == (n, MISSION)
        heard = qgc.ask(
            mavlink.MAVLink_mission_item_int_message(
                1, AUTOPILOT, n, frame, command, int(n == 0), 1, p1, p2, p3, p4, x, y, z, MISSION
            )
        )
    acknowledgement = only(heard, "MISSION_ACK")
    assert (acknowledgement.type, acknowledgement.mission_type) == (mavlink.MAV_MISSION_ACCEPTED, MISSION)
    count = only(qgc.ask(mavlink.MAVLink_mission_request_list_message(1, AUTOPILOT, MISSION)), "MISSION_COUNT")
    assert count.count == len(items)
    for n, item in enumerate(items):
        back = only(qgc.ask(mavlink.MAVLink_mission_request_int_message(1, AUTOPILOT, n, MISSION)), "MISSION_ITEM_INT")
        fields = back.frame, back.command, back.param1, back.param2, back.param3, back.param4, back.x, back.y, back.z
        assert repr(tuple(map(float, fields))) == repr(tuple(map(float, item)))
        assert (back.seq, back.mission_type, back.current) == (n, MISSION, int(n == 0))


def test_a_refused_item_is_named_in_words(qgc: Connection) -> None:
    """``_handleMissionAck`` shows the result, and the item that was requested last; the reason comes as a text."""
    qgc.ask(mavlink.MAVLink_mission_count_message(1, AUTOPILOT, 1, MISSION))
    camera = mavlink.MAVLink_mission_item_int_message(1, AUTOPILOT, 0, 2, 2000, 1, 1, 0, 0, 0, 0, 0, 0, 0, MISSION)
    heard = qgc.ask(camera)
    assert only(heard, "MISSION_ACK").type == mavlink.MAV_MISSION_UNSUPPORTED
    assert texts(heard) == ["Mission item 0: command 2000 is not one this vehicle flies"]


@pytest.mark.parametrize(("kind", "result"), [(MISSION, 0), (ALL_PLANS, 0), (FENCE, 3), (RALLY, 3)])
def test_removing_a_plan_is_acknowledged_with_its_kind(qgc: Connection, kind: int, result: int) -> None:
    """``_removeAllWorker`` and ``_handleMissionAck``, AckMissionClearAll."""
    acknowledgement = only(qgc.ask(mavlink.MAVLink_mission_clear_all_message(1, AUTOPILOT, kind)), "MISSION_ACK")
    assert (acknowledgement.type, acknowledgement.mission_type) == (result, kind)


# Vehicle.cc: what it shows


def streams(qgc: Connection, seconds: int = 6) -> dict[str, Any]:
    """The latest of each message of some seconds."""
    qgc.deck.tick(50 * seconds, fix=FIX)
    qgc.deck.serve()
    return {m.get_type(): m for m in qgc.deck.station.heard()}


def test_it_finds_where_she_is_without_asking(qgc: Connection) -> None:
    """``_handleGlobalPositionInt``, ``_handleHomePosition``, ``_handleAltitude``, ``_handleGpsRawInt``."""
    heard = streams(qgc)
    assert heard["GLOBAL_POSITION_INT"].lat == pytest.approx(415_000_000, abs=100)
    home = heard["HOME_POSITION"]
    assert (home.latitude, home.longitude, home.altitude) == (415_000_000, -707_000_000, 0)
    assert home.get_srcComponent() == AUTOPILOT, "_handleHomePosition takes it from the default component only"
    assert "ALTITUDE" in heard
    assert heard["GPS_RAW_INT"].fix_type == mavlink.GPS_FIX_TYPE_3D_FIX


def test_nothing_that_is_switched_on_counts_as_unhealthy(qgc: Connection) -> None:
    """``_handleSysStatus``: unhealthy is ``enabled & ~health``; the arm button heeds MAV_SYS_STATUS_PREARM_CHECK."""
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
    """``BatteryFactGroupListModel``: UINT16_MAX and -1 are "not available", charge_state decides the colour."""
    unknown = streams(qgc)["BATTERY_STATUS"]
    assert (set(unknown.voltages), unknown.current_battery, unknown.battery_remaining) == ({0xFFFF}, -1, -1)
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
    """``MissionManager::_handleMissionCurrent`` and the progress that ``mission_state`` and ``total`` give."""
    assert streams(qgc)["MISSION_CURRENT"].total == 0xFFFF, "no mission, as common.xml has it"
    test_a_mission_is_written_item_by_item_and_read_back(qgc)
    current = streams(qgc)["MISSION_CURRENT"]
    assert (current.seq, current.total, current.mission_state) == (0, 3, mavlink.MISSION_STATE_NOT_STARTED)


# Vehicle.cc, PX4FirmwarePlugin.cc: what its buttons send


def test_arming_is_acknowledged_and_seen_in_the_heartbeat(qgc: Connection) -> None:
    """``Vehicle::setArmed``; ``MavCommandQueue`` repeats after 3 s and shows a refusal with its reason."""
    heard = qgc.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1)
    assert only(heard, "COMMAND_ACK").result == mavlink.MAV_RESULT_ACCEPTED
    assert only(heard, "HEARTBEAT").base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED


@pytest.mark.parametrize("mode", [modes.MISSION, modes.RTL, modes.SURFACE, modes.MANUAL, modes.DEPTH])
def test_the_mode_menu_is_answered_by_a_heartbeat_alone(qgc: Connection, mode: modes.Mode) -> None:
    """``Vehicle::setFlightMode``: SET_MODE with PX4's numbers; ``_setFlightModeAndValidate`` watches the heartbeat."""
    heard = qgc.ask(mavlink.MAVLink_set_mode_message(1, 1, mode.number))
    assert only(heard, "HEARTBEAT").custom_mode == mode.number
    assert not [m for m in heard if m.get_type() == "COMMAND_ACK"], "an ack that it never queued"


def test_the_pause_button_holds(qgc: Connection) -> None:
    """``PX4FirmwarePlugin::pauseVehicle``: DO_REPOSITION, change of mode, no place."""
    qgc.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1)
    qgc.ask(mavlink.MAVLink_set_mode_message(1, 1, modes.DEPTH.number))
    nan = math.nan
    heard = qgc.command(
        mavlink.MAV_CMD_DO_REPOSITION, -1, mavlink.MAV_DO_REPOSITION_FLAGS_CHANGE_MODE, 0, nan, nan, nan, nan
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
    """``LogDownloadController::_logEntry`` with num_logs 0; silence would be asked again for seconds."""
    entry = only(qgc.ask(mavlink.MAVLink_log_request_list_message(1, AUTOPILOT, 0, 0xFFFF)), "LOG_ENTRY")
    assert entry.num_logs == 0


def test_its_clock_and_pings_are_answered(qgc: Connection) -> None:
    """``Vehicle::_sendQGCTimeToVehicle`` wants no answer; PING and TIMESYNC do."""
    assert qgc.ask(mavlink.MAVLink_system_time_message(1, 1)) == []
    assert only(qgc.ask(mavlink.MAVLink_ping_message(1, 2, 0, 0)), "PING").seq == 2
    assert only(qgc.ask(mavlink.MAVLink_timesync_message(0, 9)), "TIMESYNC").ts1 == 9
