"""Requirements of QGroundControl, message by message, after its source of 2026.

Source: github.com/mavlink/qgroundcontrol. QGroundControl itself does not run here: the tests send
its requests to the real server in the same order as the files and functions named in each test, and
check the replies by the same rules. The order is that of ``InitialConnectStateMachine``: version,
standard modes, component information, parameters, mission, geofence, rally points.

Three functions do not depend on the replies, because ``FirmwarePlugin`` decides them by
HEARTBEAT.autopilot: with ``generic`` there are no mode buttons (``FirmwarePlugin::setFlightMode``
returns false) and there is no "start mission"; with ``px4`` both work, but the setup pages report
missing PX4 parameters.
"""

import json
import struct
import zlib

import pytest
from pymavlink.dialects.v20 import all as mavlink

from autopilot.control import modes
from autopilot.control.params import PARAMETERS
from autopilot.telemetry.autopilot_id import AutopilotId
from tests.autopilot.qgroundcontrol import (
    AUTOPILOT,
    MISSION,
    REQUEST_MESSAGE,
    Connection,
    Ftp,
    legs,
    write_mission,
)
from tests.helpers.fake_hil import only, texts

ALL_COMPONENTS = 0
COMPONENT_METADATA, COMPONENT_INFORMATION, AVAILABLE_MODES = 397, 395, 435
FENCE, RALLY, ALL_PLANS = 1, 2, 255
SAFE_RECOVERY, STANDARD_MISSION, LAND = 5, 6, 7


# MultiVehicleManager.cc, VehicleLinkManager.h: discovery


def test_heartbeat_comes_from_component_1(qgc: Connection) -> None:
    """``MultiVehicleManager::_vehicleHeartbeatInfo`` ignores all other components.

    ``VehicleLinkManager``: a link is lost after 3500 ms without a heartbeat.
    """
    qgc.harness.server._heartbeat.hasten()
    qgc.harness.serve()
    beat = only(qgc.harness.station.pop_received(), "HEARTBEAT")
    assert beat.get_srcComponent() == mavlink.MAV_COMP_ID_AUTOPILOT1
    assert beat.type == mavlink.MAV_TYPE_SUBMARINE, "selects vehicle class and toolbar"
    assert beat.autopilot == {AutopilotId.GENERIC: 0, AutopilotId.PX4: 12}[qgc.autopilot]
    assert beat.base_mode & mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED, (
        "otherwise no flight mode has a name"
    )


# InitialConnectStateMachine.cc


def test_version_reports_supported_protocols(qgc: Connection) -> None:
    """``Vehicle::_setCapabilities``, ``GeoFenceManager::supported``.

    Called by ``_autopilotVersionRequestMessageHandler``.
    """
    version = qgc.message(mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION)
    able = version.capabilities
    for name in (
        "MISSION_INT",
        "MISSION_FENCE",
        "MISSION_RALLY",
        "COMMAND_INT",
        "MAVLINK2",
        "FTP",
    ):
        assert able & getattr(mavlink, f"MAV_PROTOCOL_CAPABILITY_{name}"), name
    assert version.flight_sw_version >> 8, "major, minor and patch: zero is taken for unknown"


def test_modes_are_sent_all_or_one_by_one(qgc: Connection) -> None:
    """``StandardModes::request`` requests index 0; older releases request the modes one by one."""
    received = qgc.command(REQUEST_MESSAGE, AVAILABLE_MODES, 0)
    assert received[0].get_type() == "COMMAND_ACK", (
        "commandResultHandler: anything but ACCEPTED ends the request"
    )
    assert received[0].result == mavlink.MAV_RESULT_ACCEPTED
    listed = received[1:]
    assert [m.mode_index for m in listed] == list(range(1, listed[0].number_modes + 1))
    for mode in listed:
        assert qgc.message(AVAILABLE_MODES, mode.mode_index).custom_mode == mode.custom_mode


def test_modes_have_unique_names_and_settable_numbers(qgc: Connection) -> None:
    """``StandardModes::availableModesReceived``, ``ensureUniqueModeNames``.

    QGroundControl has its own names for standard modes.
    """
    listed = qgc.command(REQUEST_MESSAGE, AVAILABLE_MODES, 0)[1:]
    standard_names = {SAFE_RECOVERY: "Safe Recovery", STANDARD_MISSION: "Mission", LAND: "Land"}
    names = [standard_names.get(m.standard_mode, m.mode_name) for m in listed]
    assert len(set(names)) == len(names)
    assert all(names)
    assert {m.standard_mode for m in listed} <= {0, *standard_names}, "the others are for aircraft"
    assert not any(m.properties & mavlink.MAV_MODE_PROPERTY_NOT_USER_SELECTABLE for m in listed)
    assert {m.custom_mode for m in listed} == {mode.number for mode in modes.MODES}


def test_parameter_metadata_is_downloaded_and_read(qgc: Connection) -> None:
    """``CompInfoGeneral::setJson``, ``CompInfoParam::setJson``.

    Called by ``RequestMetaDataTypeStateMachine``.
    """
    answer = qgc.message(COMPONENT_METADATA)
    _, crc, padded = struct.unpack("<II100s", bytes(answer.data)[10:-2].ljust(108, b"\0"))
    uri = padded.rstrip(b"\0").decode()
    assert uri.startswith("mftp://")
    ftp = Ftp(qgc)
    content = ftp.download(uri.removeprefix("mftp://"))
    assert crc == zlib.crc32(content, 0xFFFFFFFF) ^ 0xFFFFFFFF, "cache key of the file"
    general = json.loads(content)
    assert general["version"] == 1, "'Metadata json unsupported version' otherwise"
    uris = {row["type"]: row["uri"] for row in general["metadataTypes"]}
    parameters = json.loads(ftp.download(uris[1].removeprefix("mftp://")))
    assert parameters["version"] == 1
    assert [row["name"] for row in parameters["parameters"]] == [row.name for row in PARAMETERS]
    assert all(row["type"] == "Float" for row in parameters["parameters"]), (
        "type of PARAM_VALUE, otherwise no metadata"
    )


def test_deprecated_component_info_is_refused_at_once(qgc: Connection) -> None:
    """``_requestCompInfoDeprecated``: UNSUPPORTED is a reply; without one it tries for 3 x 3 s."""
    (acknowledgement,) = qgc.command(REQUEST_MESSAGE, COMPONENT_INFORMATION)
    assert acknowledgement.result == mavlink.MAV_RESULT_UNSUPPORTED


def test_missing_file_is_refused_at_once(qgc: Connection) -> None:
    """``FTPManager::_openFileROAckOrNak``."""
    (answer,) = Ftp(qgc).ask(
        mavlink.MAV_FTP_OPCODE_OPENFILERO, data=b"/etc/extras/parameters.json.xz"
    )
    assert (answer[3], answer[12]) == (mavlink.MAV_FTP_OPCODE_NAK, mavlink.MAV_FTP_ERR_FILENOTFOUND)


# ParameterManager.cc


def test_parameter_list_is_complete_and_indexed(qgc: Connection) -> None:
    """``refreshAllParameters`` sends to component 0; ``_parameterUpdate`` needs every index."""
    received = qgc.ask(mavlink.MAVLink_param_request_list_message(1, ALL_COMPONENTS))
    values = [m for m in received if m.get_type() == "PARAM_VALUE"]
    assert {m.param_count for m in values} == {len(PARAMETERS)}
    assert [m.param_index for m in values] == list(range(len(PARAMETERS))), (
        "65535 is disregarded before the list"
    )
    assert values[0].param_id != "_HASH_CHECK", (
        "WaitForHashCheckParamValue: another name ends the wait for a cache"
    )
    assert {m.param_type for m in values} == {mavlink.MAV_PARAM_TYPE_REAL32}
    assert {m.get_srcComponent() for m in values} == {AUTOPILOT}


def test_missing_parameter_is_sent_by_index(qgc: Connection) -> None:
    """``_fillIndexBatchQueue`` after 3 s: up to ten requests, param_id empty."""
    for index in (0, 7, len(PARAMETERS) - 1):
        value = only(
            qgc.ask(mavlink.MAVLink_param_request_read_message(1, AUTOPILOT, b"", index)),
            "PARAM_VALUE",
        )
        assert (value.param_index, value.param_id) == (index, PARAMETERS[index].name)


def test_set_parameter_is_sent_with_stored_value(qgc: Connection) -> None:
    """``_valueUpdated``: the write ends with PARAM_VALUE of that name, whose value is used."""
    reported = only(
        qgc.ask(mavlink.MAVLink_param_set_message(1, AUTOPILOT, b"HDG_P", 0.75, 9)), "PARAM_VALUE"
    )
    assert (reported.param_id, reported.param_value, reported.param_index) == (
        "HDG_P",
        0.75,
        only_index("HDG_P"),
    )
    refused = qgc.ask(mavlink.MAVLink_param_set_message(1, AUTOPILOT, b"HDG_P", 99.0, 9))
    assert only(refused, "PARAM_VALUE").param_value == 0.75, "the page shows the stored value"
    assert texts(refused)


def only_index(name: str) -> int:
    return [row.name for row in PARAMETERS].index(name)


def test_parameter_hash_is_refused_at_once(qgc: Connection) -> None:
    """``ParamHashCheckStateMachine``: PARAM_ERROR ends it without a wait of one second."""
    received = qgc.ask(mavlink.MAVLink_param_request_read_message(1, AUTOPILOT, b"_HASH_CHECK", -1))
    assert only(received, "PARAM_ERROR").error == mavlink.MAV_PARAM_ERROR_DOES_NOT_EXIST


# PlanManager.cc


@pytest.mark.parametrize("kind", [MISSION, FENCE, RALLY])
def test_every_plan_type_has_a_count(qgc: Connection, kind: int) -> None:
    """``_handleMissionCount`` ignores other plan types; a count of 0 ends the download."""
    count = only(
        qgc.ask(mavlink.MAVLink_mission_request_list_message(1, AUTOPILOT, kind)), "MISSION_COUNT"
    )
    assert (count.mission_type, count.count) == (kind, 0)
    assert (count.target_system, count.target_component) == (255, 190)
    assert (
        qgc.ask(
            mavlink.MAVLink_mission_ack_message(1, AUTOPILOT, mavlink.MAV_MISSION_ACCEPTED, kind)
        )
        == []
    )


def test_mission_is_written_and_read_back(qgc: Connection) -> None:
    """``_handleMissionAck`` after all items, ``_handleMissionItem``."""
    items, received = legs(), write_mission(qgc)
    acknowledgement = only(received, "MISSION_ACK")
    assert (acknowledgement.type, acknowledgement.mission_type) == (
        mavlink.MAV_MISSION_ACCEPTED,
        MISSION,
    )
    count = only(
        qgc.ask(mavlink.MAVLink_mission_request_list_message(1, AUTOPILOT, MISSION)),
        "MISSION_COUNT",
    )
    assert count.count == len(items)
    for n, item in enumerate(items):
        back = only(
            qgc.ask(mavlink.MAVLink_mission_request_int_message(1, AUTOPILOT, n, MISSION)),
            "MISSION_ITEM_INT",
        )
        fields = (
            back.frame,
            back.command,
            back.param1,
            back.param2,
            back.param3,
            back.param4,
            back.x,
            back.y,
            back.z,
        )
        assert repr(tuple(map(float, fields))) == repr(tuple(map(float, item)))
        assert (back.seq, back.mission_type, back.current) == (n, MISSION, int(n == 0))


def test_refused_item_is_named_in_text(qgc: Connection) -> None:
    """``_handleMissionAck`` shows the result and the last requested item; a text has the reason."""
    qgc.ask(mavlink.MAVLink_mission_count_message(1, AUTOPILOT, 1, MISSION))
    camera = mavlink.MAVLink_mission_item_int_message(
        1, AUTOPILOT, 0, 2, 2000, 1, 1, 0, 0, 0, 0, 0, 0, 0, MISSION
    )
    received = qgc.ask(camera)
    assert only(received, "MISSION_ACK").type == mavlink.MAV_MISSION_UNSUPPORTED
    assert texts(received) == ["Mission item 0: command 2000 is not one this vehicle flies"]


@pytest.mark.parametrize(("kind", "result"), [(MISSION, 0), (ALL_PLANS, 0), (FENCE, 0), (RALLY, 0)])
def test_plan_removal_is_acknowledged_with_its_type(
    qgc: Connection, kind: int, result: int
) -> None:
    """``_removeAllWorker`` and ``_handleMissionAck``, AckMissionClearAll."""
    acknowledgement = only(
        qgc.ask(mavlink.MAVLink_mission_clear_all_message(1, AUTOPILOT, kind)), "MISSION_ACK"
    )
    assert (acknowledgement.type, acknowledgement.mission_type) == (result, kind)


def write_plan(qgc: Connection, kind: int, rows: list[tuple[int, float, float, float]]) -> int:
    """Upload (command, p1, latitude, longitude); return the MAV_MISSION_RESULT."""
    received = qgc.ask(mavlink.MAVLink_mission_count_message(1, AUTOPILOT, len(rows), kind))
    for n, (command, p1, lat, lon) in enumerate(rows):
        place = round(lat * 1e7), round(lon * 1e7), 0.0
        received = qgc.ask(
            mavlink.MAVLink_mission_item_int_message(
                1, AUTOPILOT, n, 0, command, 0, 1, p1, 0, 0, 0, *place, kind
            )
        )
    acknowledgement = only(received, "MISSION_ACK")
    assert acknowledgement.mission_type == kind
    return int(acknowledgement.type)


SQUARE = [(42.36, -71.01), (42.36, -70.99), (42.34, -70.99), (42.34, -71.01)]


def test_fence_and_rally_are_written_and_read_back(qgc: Connection) -> None:
    """``GeoFenceManager::sendToVehicle`` and ``RallyPointManager::sendToVehicle``."""
    fence = [(5001, 4.0, *corner) for corner in SQUARE] + [(5004, 50.0, 42.351, -71.0)]
    assert write_plan(qgc, FENCE, fence) == mavlink.MAV_MISSION_ACCEPTED
    assert write_plan(qgc, RALLY, [(5100, 0.0, 42.352, -71.0)]) == mavlink.MAV_MISSION_ACCEPTED
    for kind, rows in ((FENCE, fence), (RALLY, [(5100, 0.0, 42.352, -71.0)])):
        count = qgc.ask(mavlink.MAVLink_mission_request_list_message(1, AUTOPILOT, kind))
        assert only(count, "MISSION_COUNT").count == len(rows)
        last = len(rows) - 1
        back = only(
            qgc.ask(mavlink.MAVLink_mission_request_int_message(1, AUTOPILOT, last, kind)),
            "MISSION_ITEM_INT",
        )
        command, p1, lat, lon = rows[-1]
        assert (back.command, back.param1, back.mission_type) == (command, p1, kind)
        assert (back.x, back.y) == (round(lat * 1e7), round(lon * 1e7))


@pytest.mark.parametrize(
    ("rows", "result", "text"),
    [
        ([(5001, 3.0, *SQUARE[0])] * 2, "INVALID_PARAM1", "polygon of 3 vertices"),
        ([(5003, -5.0, 42.35, -71.0)], "INVALID_PARAM1", "radius -5 m"),
        ([(5003, 50.0, 95.0, -71.0)], "INVALID_PARAM5_X", "latitude 95"),
        ([(16, 0.0, 42.35, -71.0)], "UNSUPPORTED", "command 16 is not an item of a fence"),
    ],
)
def test_fence_with_fault_is_refused_with_reason(
    qgc: Connection, rows: list[tuple[int, float, float, float]], result: str, text: str
) -> None:
    received = qgc.ask(mavlink.MAVLink_mission_count_message(1, AUTOPILOT, len(rows), FENCE))
    for n, (command, p1, lat, lon) in enumerate(rows):
        place = round(lat * 1e7), round(lon * 1e7), 0.0
        received = qgc.ask(
            mavlink.MAVLink_mission_item_int_message(
                1, AUTOPILOT, n, 0, command, 0, 1, p1, 0, 0, 0, *place, FENCE
            )
        )
    expected = getattr(mavlink, f"MAV_MISSION_{result}")
    assert only(received, "MISSION_ACK").type == expected
    assert text in texts(received)[0]
