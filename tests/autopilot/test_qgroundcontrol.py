"""Requirements of QGroundControl, message by message, after its source of 2026.

Source: github.com/mavlink/qgroundcontrol. QGroundControl itself does not run here: the tests send
its requests to the real server in the same order as the files and functions named in each test, and
check the replies by the same rules. The order is that of ``InitialConnectStateMachine``: version,
standard modes, component information and parameters (test_qgroundcontrol_parameters.py), mission,
geofence, rally points.

Three functions do not depend on the replies, because ``FirmwarePlugin`` decides them by
HEARTBEAT.autopilot: with ``generic`` there are no mode buttons (``FirmwarePlugin::setFlightMode``
returns false) and there is no "start mission"; with ``px4`` both work, but the setup pages report
missing PX4 parameters.
"""

import pytest
from pymavlink.dialects.v20 import all as mavlink

from autopilot.control import modes
from autopilot.telemetry.autopilot_id import AutopilotId
from tests.autopilot.qgroundcontrol import (
    AUTOPILOT,
    MISSION,
    REQUEST_MESSAGE,
    Connection,
    legs,
    write_mission,
)
from tests.helpers.fake_hil import only, texts

AVAILABLE_MODES = 435
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
