"""Telemetry of position and path, and offboard set-points, as pymavlink reads and sends them."""

import math

import pytest
from pymavlink.dialects.v20 import all as mavlink

from autopilot.control import modes
from autopilot.control.setpoints import Circle, TrackLine
from autopilot.control.types import NavCovariance, Navigation
from autopilot.reports import Snapshot
from tests.autopilot.telemetry.test_streams import message, snapshot
from tests.helpers.fake_hil import Harness, only, texts

IGNORE_RATES = 7
Z_ONLY = 0xDFB


def on(path: TrackLine | Circle, north_m: float, east_m: float) -> Snapshot:
    plain = snapshot(north_m=north_m, east_m=east_m)
    return plain._replace(state=plain.state._replace(path=path))


def test_line_reports_end_and_cross_track_error() -> None:
    s = on(TrackLine(0j, 100 + 0j), 40.0, 3.0)
    reported = message("NAV_CONTROLLER_OUTPUT", s)
    assert (reported.wp_dist, reported.target_bearing) == (60, -3)
    assert reported.xtrack_error == pytest.approx(3.0)
    assert reported.nav_bearing == round(math.degrees(-1.0))
    target = message("POSITION_TARGET_LOCAL_NED", s)
    assert (target.x, target.y, target.z) == (100.0, 0.0, 4.0)
    assert not target.type_mask & mavlink.POSITION_TARGET_TYPEMASK_X_IGNORE


def test_circle_reports_centre() -> None:
    reported = message("NAV_CONTROLLER_OUTPUT", on(Circle(10 + 0j, 20.0), 10.0, -25.0))
    assert (reported.wp_dist, reported.target_bearing) == (25, 90)
    assert reported.xtrack_error == pytest.approx(5.0)


def test_odometry_reports_velocity_and_covariance() -> None:
    quarter = (math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))
    learned = Navigation(covariance=NavCovariance(9.0, 0.04, 0.0, 0.0))
    s = snapshot(
        attitude=quarter,
        east_rate_mps=1.1,
        north_rate_mps=0.2,
        position_sd_m=3.0,
        navigation=learned,
    )
    reported = message("ODOMETRY", s)
    assert (reported.vx, reported.vy) == pytest.approx((1.1, -0.2), abs=1e-6), (
        "body axes: heading is east"
    )
    assert (reported.pose_covariance[0], reported.pose_covariance[6]) == (9.0, 9.0)
    assert reported.pose_covariance[1] == 0.0
    assert reported.velocity_covariance[0] == pytest.approx(0.04, abs=1e-3)


def test_estimator_status_reports_accuracy_and_glitch() -> None:
    learned = Navigation(
        current_mps=0.2 - 0.1j, covariance=NavCovariance(4.0, 0.01, 0.0, 0.0), fixes_rejected=3
    )
    s = snapshot(position_sd_m=2.0, navigation=learned, depth_time_us=12_340_000)
    reported = message("ESTIMATOR_STATUS", s)
    assert reported.pos_horiz_accuracy == 2.0
    for flag in ("POS_HORIZ_REL", "POS_HORIZ_ABS", "POS_VERT_ABS", "GPS_GLITCH"):
        assert reported.flags & getattr(mavlink, f"ESTIMATOR_{flag}"), flag
    assert not reported.flags & mavlink.ESTIMATOR_POS_VERT_AGL
    current = message("WIND_COV", s)
    assert (current.wind_x, current.wind_y, current.horiz_accuracy) == pytest.approx(
        (0.2, -0.1, 0.1)
    )


def test_setpoint_messages_allow_offboard_mode() -> None:
    harness = Harness()
    harness.tick(5)
    attitude = mavlink.MAVLink_set_attitude_target_message(
        0, 1, 1, IGNORE_RATES, [1.0, 0.0, 0.0, 0.0], 0, 0, 0, 0.5
    )
    depth = mavlink.MAVLink_set_position_target_local_ned_message(
        0, 1, 1, 1, Z_ONLY, 0, 0, 6.0, *[0.0] * 8
    )
    assert only(harness.command(400, 1), "COMMAND_ACK").result == 0
    assert (
        only(harness.command(176, 1, 6, 0), "COMMAND_ACK").result
        == mavlink.MAV_RESULT_TEMPORARILY_REJECTED
    )
    assert texts(harness.ask(attitude)) == []
    assert texts(harness.ask(depth)) == []
    assert only(harness.command(176, 1, 6, 0), "COMMAND_ACK").result == 0
    harness.tick(2)
    state = harness.vehicle.state
    assert state.mode == modes.OFFBOARD.number
    assert (state.setpoint.depth_m, state.setpoint.thrust) == (6.0, 0.5)
    assert math.isnan(state.setpoint.pitch_rad)


def test_unsupported_setpoint_is_reported_once() -> None:
    harness = Harness()
    harness.tick(5)
    sideways = mavlink.MAVLink_set_position_target_local_ned_message(
        0, 1, 1, 4, Z_ONLY, 0, 0, 6.0, *[0.0] * 8
    )
    (reported,) = texts(harness.ask(sideways))
    assert reported.startswith("Set-point ignored: frame 4")
    assert texts(harness.ask(sideways)) == []


def test_capabilities_include_setpoints() -> None:
    harness = Harness()
    harness.tick(1)
    capabilities = only(harness.command(512, 148), "AUTOPILOT_VERSION").capabilities
    for name in ("ATTITUDE_TARGET", "POSITION_TARGET_LOCAL_NED", "POSITION_TARGET_GLOBAL_INT"):
        assert capabilities & getattr(mavlink, f"MAV_PROTOCOL_CAPABILITY_SET_{name}"), name
