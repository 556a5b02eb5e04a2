"""Identity ``--autopilot-id ardupilot``: what tools for ArduSub send and expect.

Sources: pymavlink 2.4.50, mavutil.py (mode numbers); ArduPilot, ArduSub/joystick.cpp and
GCS_Common.cpp (manual control, streams). The tests send their messages to the real server in
memory. Cockpit's requirements: test_cockpit.py.
"""

from typing import Any

import pytest
from pymavlink import mavutil
from pymavlink.dialects.v20 import all as mavlink

from autopilot.comms import ground_server, services
from autopilot.control import modes
from autopilot.telemetry.autopilot_id import AutopilotId
from mavlink_io import dialect
from mavlink_io.records import GpsFix
from mavlink_io.vehicle_modes import VehicleMode, mode_of_heartbeat
from tests.helpers.fake_hil import Harness, only, texts

FIX = GpsFix(0, 3, 41.5, -70.7, 12.0, 0.0, 0.0, 0.0, 9)
IDENTITY = AutopilotId.ARDUPILOT
DO_SET_MODE, REQUEST_MESSAGE = 176, 512
TICKS_PER_S = 50


@pytest.fixture(autouse=True)
def stopped_clock(monkeypatch: pytest.MonkeyPatch) -> None:
    """Stop the wall clock of manual control, which ends after a time without messages."""
    for module in (ground_server, services):
        monkeypatch.setattr(module, "wall_s", lambda: 1000.0)


@pytest.fixture
def harness() -> Harness:
    """Return a vehicle at the surface with a position, disarmed."""
    harness = Harness(autopilot=IDENTITY)
    harness.station.transmit(mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_GCS, 8, 0, 0, 0, 3))
    harness.serve()
    harness.tick(100, fix=FIX)
    harness.serve()
    harness.station.pop_received()
    return harness


def heartbeat(harness: Harness) -> Any:
    """Return the next HEARTBEAT."""
    harness.server._heartbeat.hasten()
    harness.serve()
    return harness.station.pop_named("HEARTBEAT")[-1]


def result(received: list[Any]) -> int:
    return int(only(received, "COMMAND_ACK").result)


def pymavlink_command(harness: Harness, number: int, *parameters: float) -> list[Any]:
    """Send a COMMAND_LONG whose other parameters are 0, as pymavlink does."""
    filled = [*parameters, *[0.0] * (7 - len(parameters))]
    return harness.ask(mavlink.MAVLink_command_long_message(1, 0, number, 0, *filled))


def rates(harness: Harness, seconds: int = 4) -> dict[str, float]:
    """Return the rate of each message that is received, in Hz of vehicle time."""
    harness.station.pop_received()
    counts: dict[str, int] = {}
    for _ in range(seconds * TICKS_PER_S):
        harness.tick(fix=FIX)
        for message in harness.station.pop_received():
            counts[message.get_type()] = counts.get(message.get_type(), 0) + 1
    return {name: count / seconds for name, count in counts.items()}


def test_heartbeat_is_read_as_guided_by_pymavlink(harness: Harness) -> None:
    beat = heartbeat(harness)
    assert (beat.type, beat.autopilot) == (12, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA)
    assert mavutil.mode_string_v10(beat) == "GUIDED"


@pytest.mark.parametrize(
    ("name", "mode"),
    [
        ("MANUAL", modes.MANUAL),
        ("STABILIZE", modes.STABILIZE),
        ("ALT_HOLD", modes.DEPTH),
        ("POSHOLD", modes.STATION),
        ("SURFACE", modes.SURFACE),
        ("GUIDED", modes.HOLD),
    ],
)
def test_mode_of_pymavlinks_table_is_entered_and_shown(
    harness: Harness, name: str, mode: modes.Mode
) -> None:
    number = mavutil.mode_mapping_byname(mavlink.MAV_TYPE_SUBMARINE)[name]
    pymavlink_command(harness, DO_SET_MODE, 1, 19 if name != "MANUAL" else 0)
    received = pymavlink_command(harness, DO_SET_MODE, 1, number)
    assert result(received) == mavlink.MAV_RESULT_ACCEPTED
    assert harness.vehicle.state.mode == mode.number
    assert mavutil.mode_string_v10(heartbeat(harness)) == name
    assert only(received, "CURRENT_MODE").custom_mode == number
    harness.ask(mavlink.MAVLink_set_mode_message(1, 1, 19))
    harness.ask(mavlink.MAVLink_set_mode_message(1, 1, number))
    assert harness.vehicle.state.mode == mode.number


@pytest.mark.parametrize("number", [1, 7, 20, 21, modes.MANUAL.number])
def test_mode_that_the_vehicle_lacks_is_refused_with_names(harness: Harness, number: int) -> None:
    """ACRO, CIRCLE, MOTOR_DETECT and SURFTRAK of ArduSub, and a number of PX4's."""
    received = pymavlink_command(harness, DO_SET_MODE, 1, number)
    assert result(received) == mavlink.MAV_RESULT_UNSUPPORTED
    assert "ALT_HOLD" in "".join(texts(received))
    assert harness.vehicle.state.mode == modes.HOLD.number


def test_available_modes_have_ardusubs_numbers_and_names(harness: Harness) -> None:
    listed = [
        m for m in harness.command(REQUEST_MESSAGE, 435, 0) if m.get_type() == "AVAILABLE_MODES"
    ]
    assert {m.custom_mode: m.mode_name for m in listed} == {
        0: "STABILIZE",
        2: "ALT_HOLD",
        3: "",
        4: "GUIDED",
        6: "",
        9: "",
        16: "POSHOLD",
        19: "MANUAL",
        25: "SYSID",
    }
    assert [m.mode_index for m in listed] == list(range(1, len(listed) + 1))


def test_heartbeat_in_a_log_names_the_mode() -> None:
    assert mode_of_heartbeat(3, 4) is VehicleMode.HOLD
    assert mode_of_heartbeat(3, 3) is VehicleMode.MISSION
    assert mode_of_heartbeat(0, VehicleMode.MISSION) is VehicleMode.MISSION
    assert mode_of_heartbeat(3, VehicleMode.MISSION) is None
    assert mode_of_heartbeat(12, 3) is None


def test_version_says_that_integers_are_converted(harness: Harness) -> None:
    version = only(pymavlink_command(harness, 520, 1), "AUTOPILOT_VERSION")
    assert version.capabilities & mavlink.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_C_CAST
    assert not version.capabilities & mavlink.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_BYTEWISE


def test_stream_request_sets_the_rate_of_its_group(harness: Harness) -> None:
    before = rates(harness)
    harness.ask(mavlink.MAVLink_request_data_stream_message(1, 0, 10, 2, 1))
    after = rates(harness)
    assert (after["ATTITUDE"], after["AHRS2"]) == (2.0, 2.0)
    assert after["VFR_HUD"] == before["VFR_HUD"]
    harness.ask(mavlink.MAVLink_request_data_stream_message(1, 0, 10, 0, 0))
    assert "ATTITUDE" not in rates(harness)
    harness.ask(mavlink.MAVLink_request_data_stream_message(1, 0, 0, 5, 1))
    every = rates(harness)
    assert (every["ATTITUDE"], every["VFR_HUD"], every["SYS_STATUS"]) == (5.0, 5.0, 5.0)


def test_stream_request_changes_nothing_with_the_default_identity() -> None:
    harness = Harness()
    harness.tick(100, fix=FIX)
    harness.ask(mavlink.MAVLink_request_data_stream_message(1, 0, 0, 1, 1))
    assert rates(harness)["ATTITUDE"] == 10.0


def test_ahrs2_and_ekf_status_agree_with_the_estimate(harness: Harness) -> None:
    names = "AHRS2", "ATTITUDE", "EKF_STATUS_REPORT", "GLOBAL_POSITION_INT"
    ahrs, attitude, ekf, position = (
        only(harness.command(REQUEST_MESSAGE, dialect.by_name(name).message_id), name)
        for name in names
    )
    assert (ahrs.roll, ahrs.pitch, ahrs.yaw) == pytest.approx(
        (attitude.roll, attitude.pitch, attitude.yaw), abs=1e-6
    )
    assert (ahrs.lat, ahrs.lng) == (position.lat, position.lon)
    needed = mavlink.EKF_PRED_POS_HORIZ_ABS | mavlink.EKF_POS_HORIZ_ABS  # DroneKit's is_armable
    assert ekf.flags & needed == needed
    assert not ekf.flags & (mavlink.EKF_CONST_POS_MODE | mavlink.EKF_UNINITIALIZED)


def test_inertial_messages_have_ardupilots_units(harness: Harness) -> None:
    """The fake sensors are at rest: 1 g upwards is -1000 mG on the z axis; field in gauss."""
    for name in ("RAW_IMU", "SCALED_IMU2"):
        imu = only(harness.command(REQUEST_MESSAGE, dialect.by_name(name).message_id), name)
        assert (imu.xacc, imu.yacc, imu.zacc) == (0, 0, -1000)
        assert (imu.xmag, imu.ymag, imu.zmag) == (200, 0, 400)
        assert imu.temperature == 1000


def test_manual_control_is_neutral_at_500(harness: Harness) -> None:
    def stick(x: int, z: int, r: int) -> Any:
        harness.ask(mavlink.MAVLink_manual_control_message(1, x, 0, z, r, 0))
        return harness.server.stick

    assert stick(0, 500, 0) == (0.0, 0.0, 0.0)
    assert stick(600, 1000, -250) == (-0.25, 1.0, 0.6)
    assert stick(0, 0, 0) == (0.0, -1.0, 0.0)
    assert stick(32767, 32767, 32767) == (0.0, 0.0, 0.0)


def override(harness: Harness, *channels_us: int) -> None:
    """Send RC_CHANNELS_OVERRIDE; the other channels of the first eight stay unchanged."""
    filled = [*channels_us, *[65_535] * (8 - len(channels_us))]
    harness.ask(mavlink.MAVLink_rc_channels_override_message(1, 0, *filled))


def test_channels_move_rudder_elevator_and_thrust(harness: Harness) -> None:
    override(harness, 1500, 1500, 1700, 1400, 1900)
    assert harness.server.stick == pytest.approx((-0.25, 0.5, 1.0))
    override(harness, 65_535, 65_535, 65_535, 65_535, 1500)
    assert harness.server.stick == pytest.approx((-0.25, 0.5, 0.0))
    harness.tick()
    channels = only(harness.command(REQUEST_MESSAGE, 65), "RC_CHANNELS")
    assert (channels.chancount, channels.chan3_raw, channels.chan4_raw) == (8, 1700, 1400)
    override(harness, *[0] * 8)
    assert harness.server.stick is None
    override(harness, 1500, 1500, 65_535, 65_535, 1700)
    assert harness.server.stick == pytest.approx((0.0, 0.0, 0.5)), "old channels do not return"


def test_channels_are_released_after_their_timeout(harness: Harness) -> None:
    override(harness, 1500, 1500, 1500, 1500, 1900)
    helm, state = harness.server._services.helm, harness.vehicle.state
    received_s = helm._stick[1] - 3.0  # type: ignore[index]
    assert helm.stick(state, received_s + 2.9) is not None
    assert helm.stick(state, received_s + 3.1) is None


def test_channels_are_ignored_with_the_default_identity() -> None:
    harness = Harness()
    harness.tick(100, fix=FIX)
    override(harness, 1500, 1500, 1500, 1500, 1900)
    assert harness.server.stick is None


def test_setpoint_in_guided_is_followed(harness: Harness) -> None:
    """ArduPilot's tools stream set-points in GUIDED; here OFFBOARD follows them."""
    assert result(pymavlink_command(harness, 400, 1)) == mavlink.MAV_RESULT_ACCEPTED
    target = mavlink.MAVLink_set_position_target_local_ned_message(
        0, 1, 1, 1, 0b1101_1111_1000, 10.0, 0.0, 0.0, 0, 0, 0, 0, 0, 0, 0, 0
    )
    harness.ask(target)
    assert harness.vehicle.state.mode == modes.OFFBOARD.number
    assert mavutil.mode_string_v10(heartbeat(harness)) == "GUIDED"


def test_mission_is_requested_by_mission_request_with_home_first(harness: Harness) -> None:
    """DroneKit answers MISSION_REQUEST only, and waits for home as item 0."""
    count = only(harness.ask(mavlink.MAVLink_mission_request_list_message(1, 1)), "MISSION_COUNT")
    assert count.count == 1
    home = only(
        harness.ask(mavlink.MAVLink_mission_request_int_message(1, 1, 0)), "MISSION_ITEM_INT"
    )
    assert (home.x, home.y, home.z) == (415_000_000, -707_000_000, 0.0)
    received = harness.ask(mavlink.MAVLink_mission_count_message(1, 1, 2))
    for sequence, command in enumerate((16, 93)):
        assert only(received, "MISSION_REQUEST").seq == sequence
        received = harness.ask(
            mavlink.MAVLink_mission_item_int_message(
                1, 1, sequence, 0 if sequence == 0 else 2, command, 0, 1, 5, -1, -1, -1, 0, 0, 0
            )
        )
    assert only(received, "MISSION_ACK").type == mavlink.MAV_MISSION_ACCEPTED
    assert harness.vehicle.params.get("MIS_SEQ0_HOME") == 1.0
