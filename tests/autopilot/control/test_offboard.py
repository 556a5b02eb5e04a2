"""Modes OFFBOARD and STABILIZE and the loss of the ground station, through the pure tick."""

import math
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from autopilot.comms import offboard_messages
from autopilot.control import guidance, modes, offboard, requests
from autopilot.control.params import Config
from autopilot.control.setpoints import (
    AttitudeTarget,
    Circle,
    MotionTarget,
    Targets,
    TrackLine,
)
from autopilot.control.types import (
    ACCEPTED,
    TEMPORARILY_REJECTED,
    AutopilotState,
    Home,
    Inputs,
    Stick,
)
from mavlink_io.frames import offset_to_geodetic, quaternion_from_euler
from mavlink_io.mission_items import MissionItem
from tests.helpers.missions import Flight, sensors

HOME = Home(42.35, -71.0, True)
STATE = AutopilotState(home=HOME)


def armed(mode: modes.Mode, *initial_requests: requests.Request, **changes: Any) -> Flight:
    flight = Flight(config=Config(**changes))
    flight.step()
    for request in (*initial_requests, requests.SetMode(mode.number), requests.Arm()):
        assert flight.ask(request) == ACCEPTED, request
    flight.step()
    return flight


def target(flight: Flight, wanted: AttitudeTarget | MotionTarget) -> Flight:
    assert flight.ask(requests.SetTarget(wanted)) == ACCEPTED
    return flight


def test_attitude_target_is_flown() -> None:
    flight = armed(modes.OFFBOARD, requests.SetTarget(AttitudeTarget(-0.1, 0.5, thrust=0.4)))
    for _ in flight.run(20.0):
        pass
    assert flight.heading == pytest.approx(0.5, abs=0.02)
    assert flight.pitch == pytest.approx(-0.1, abs=0.01)
    assert flight.trace.thrust == 0.4


def test_depth_and_attitude_targets_without_position() -> None:
    """SET_POSITION_TARGET streams the depth, SET_ATTITUDE_TARGET heading and thrust."""
    flight = armed(modes.OFFBOARD, requests.SetTarget(AttitudeTarget(0.3, -1.0, thrust=0.6)))
    target(flight, MotionTarget(depth_m=8.0))
    for _ in flight.run(60.0):
        pass
    assert flight.depth_m == pytest.approx(8.0, abs=0.1)
    assert flight.heading == pytest.approx(-1.0, abs=0.06)
    assert flight.trace.thrust == 0.6


def test_rates_move_setpoints_within_limits() -> None:
    flight = armed(
        modes.OFFBOARD,
        requests.SetTarget(AttitudeTarget(heading_rate_radps=0.05, pitch_rate_radps=-0.1)),
    )
    for _ in flight.run(20.0):
        pass
    assert flight.state.setpoint.heading_rad == pytest.approx(1.0, abs=0.05)
    assert flight.state.setpoint.pitch_rad == pytest.approx(-flight.config.pitch_limit_rad)


def test_offboard_without_streams_is_refused_and_ends() -> None:
    flight = armed(modes.DEPTH)
    assert flight.ask(requests.SetMode(modes.OFFBOARD.number)) == TEMPORARILY_REJECTED
    target(flight, AttitudeTarget(0.0, 0.2, thrust=0.5))
    assert flight.ask(requests.SetMode(modes.OFFBOARD.number)) == ACCEPTED
    flight.more = {"attitude_silent_s": 0.9}
    flight.step()
    assert flight.state.mode == modes.OFFBOARD.number
    flight.more = {"attitude_silent_s": 1.1}
    flight.step()
    assert flight.state.mode == modes.HOLD.number
    assert any(text.startswith("OFFBOARD lost") for text in flight.texts())
    assert math.isnan(flight.state.setpoint.pitch_rad)
    assert flight.state.setpoint.thrust == 0.5


def test_stream_timeout_beside_another_is_dropped() -> None:
    kept = offboard.drop_stale_targets(
        Targets(AttitudeTarget(0.0, 0.0), MotionTarget(depth_m=3.0)),
        Inputs(sensors(0), None, None, None, attitude_silent_s=5.0, motion_silent_s=0.1),
        Config(),
    )
    assert kept == Targets(None, MotionTarget(depth_m=3.0))


def test_position_target_is_reached_and_circled() -> None:
    flight = armed(
        modes.OFFBOARD, requests.SetTarget(MotionTarget(position_m=60 + 0j, depth_m=6.0))
    )
    flight.run_until(lambda s: isinstance(s.path, Circle), 90.0)
    assert abs(guidance.position_of(flight.state.estimate) - 60.0) < 6.0
    target(flight, MotionTarget(position_m=0 + 60j))
    flight.step()
    assert isinstance(flight.state.path, TrackLine)
    assert flight.state.path.to_m == 60j
    assert flight.state.setpoint.depth_m == 6.0


def test_velocity_target_is_corrected_for_current() -> None:
    flight = armed(
        modes.OFFBOARD, requests.SetTarget(MotionTarget(velocity_mps=0.8 + 0j, depth_rate_mps=0.1))
    )
    learned = flight.state.estimate.navigation._replace(current_mps=0.3j)
    flight.state = flight.state._replace(
        estimate=flight.state.estimate._replace(navigation=learned)
    )
    flight.step()
    through = 0.8 - 0.3j
    assert flight.state.setpoint.heading_rad == pytest.approx(math.atan2(-0.3, 0.8), abs=1e-6)
    assert flight.state.setpoint.thrust == pytest.approx(abs(through) / 1.3 * 0.58, rel=1e-6)
    for _ in flight.run(10.0):
        pass
    assert flight.state.setpoint.depth_m == pytest.approx(6.0, abs=0.05)
    target(flight, MotionTarget(velocity_mps=0j, heading_rad=0.7))
    flight.step()
    assert (flight.state.setpoint.thrust, flight.state.setpoint.heading_rad) == (0.0, 0.7)


def test_stabilize_follows_stick() -> None:
    flight = armed(modes.STABILIZE)
    flight.more = {"stick": Stick(rudder=0.5, elevator=-0.5, thrust=0.6)}
    for _ in flight.run(15.0):
        pass
    assert flight.pitch == pytest.approx(-0.5 * flight.config.pitch_limit_rad, abs=0.02)
    assert flight.state.setpoint.heading_rad == pytest.approx(math.radians(4.0 * 15.0), abs=0.15)
    flight.more = {}
    for _ in flight.run(40.0):
        pass
    assert flight.pitch == pytest.approx(0.0, abs=0.03)
    assert flight.trace.thrust == 0.0
    assert flight.heading == pytest.approx(flight.state.setpoint.heading_rad, abs=0.04)


@pytest.mark.parametrize(
    ("action", "home", "mode"),
    [
        (0, True, modes.HOLD),
        (1, True, modes.SURFACE),
        (2, True, modes.RTL),
        (2, False, modes.SURFACE),
    ],
)
def test_ground_lost_action_ends_when_ground_returns(
    action: int, home: bool, mode: modes.Mode
) -> None:
    initial_requests = (requests.SetHome(HOME.lat_deg, HOME.lon_deg),) if home else ()
    flight = armed(modes.DEPTH, *initial_requests, fs_ground_s=10.0, fs_ground_action=action)
    flight.state = flight.state._replace(estimate=flight.state.estimate._replace(north_m=200.0))
    flight.more = {"ground_silent_s": 11.0}
    flight.step()
    assert flight.state.mode == mode.number
    assert f"Failsafe: ground lost -> {mode.name}" in flight.texts()
    flight.more = {"ground_silent_s": 0.1}
    assert flight.ask(requests.SetMode(modes.DEPTH.number)) == ACCEPTED
    assert flight.state.failsafe == ""


def test_hold_of_lost_ground_ends_at_time_limit() -> None:
    flight = armed(modes.DEPTH, fs_ground_s=10.0, fs_ground_action=0, fs_ground_hold_s=5.0)
    flight.more = {"ground_silent_s": 11.0}
    flight.step()
    flight.more = {"ground_silent_s": 0.1}  # heartbeats without a request do not extend it
    for _ in flight.run(4.9):
        pass
    assert flight.state.mode == modes.HOLD.number
    for _ in flight.run(0.2):
        pass
    assert flight.state.mode == modes.SURFACE.number
    assert "Failsafe: ground lost, HOLD for 5 s -> SURFACE" in flight.texts()
    assert flight.ask(requests.SetMode(modes.DEPTH.number)) == ACCEPTED


@pytest.mark.parametrize(
    "request_of_ground", [requests.SetMode(modes.HOLD.number), requests.ChangeTarget(depth_m=4.0)]
)
def test_hold_that_ground_requests_has_no_limit(request_of_ground: requests.Request) -> None:
    flight = armed(modes.DEPTH, fs_ground_s=10.0, fs_ground_action=0, fs_ground_hold_s=5.0)
    flight.more = {"ground_silent_s": 11.0}
    flight.step()
    flight.more = {"ground_silent_s": 0.1}
    assert flight.ask(request_of_ground) == ACCEPTED
    for _ in flight.run(10.0):
        pass
    assert (flight.state.mode, flight.state.failsafe) == (modes.HOLD.number, "")


def test_hold_before_loss_of_ground_ends_at_time_limit() -> None:
    flight = armed(modes.HOLD, fs_ground_s=10.0, fs_ground_action=0, fs_ground_hold_s=5.0)
    for _ in flight.run(10.0):
        pass
    assert flight.state.mode == modes.HOLD.number
    flight.more = {"ground_silent_s": 11.0}
    for _ in flight.run(5.2):
        pass
    assert flight.state.mode == modes.SURFACE.number


def test_ground_lost_is_replaced_by_other_failsafe() -> None:
    flight = armed(modes.DEPTH, fs_ground_s=10.0, fs_ground_action=0)
    flight.more = {"ground_silent_s": 11.0}
    flight.step()
    flight.config = Config(fs_ground_s=10.0, fs_ground_action=0, fs_depth_m=4.0)
    flight.step()
    assert flight.state.mode == modes.SURFACE.number
    assert flight.state.failsafe.startswith("depth")


def test_rtl_and_positions_without_home_are_refused() -> None:
    flight = armed(modes.DEPTH)
    assert flight.ask(requests.SetMode(modes.RTL.number)) == TEMPORARILY_REJECTED
    items = (MissionItem(0, 3, 16, x=423_500_000, y=-710_000_000, z=-3.0),)
    assert flight.ask(requests.LoadMission(items)) == ACCEPTED
    assert flight.ask(requests.SetMode(modes.MISSION.number)) == TEMPORARILY_REJECTED
    assert flight.ask(requests.SetHome(HOME.lat_deg, HOME.lon_deg)) == ACCEPTED
    assert flight.ask(requests.SetMode(modes.MISSION.number)) == ACCEPTED


def test_set_home_during_leg_keeps_path() -> None:
    flight = armed(modes.DEPTH, requests.SetHome(HOME.lat_deg, HOME.lon_deg))
    path = TrackLine(0j, 100 + 0j)
    flight.state = flight.state._replace(path=path)
    north = offset_to_geodetic(10.0, 0.0, HOME.lat_deg, HOME.lon_deg)
    assert flight.ask(requests.SetHome(*north)) == ACCEPTED
    assert flight.state.estimate.north_m == pytest.approx(-10.0, abs=1e-3)
    assert isinstance(flight.state.path, TrackLine)
    assert flight.state.path.to_m == pytest.approx(90.0, abs=1e-3)


def message(**fields: Any) -> Any:
    plain = dict.fromkeys(("x", "y", "z", "vx", "vy", "vz", "yaw", "yaw_rate", "thrust"), 0.0)
    return SimpleNamespace(**{**plain, "type_mask": 0, "coordinate_frame": 1, **fields})


@given(
    pitch=st.floats(-1.4, 1.4),
    heading=st.floats(-3.1, 3.1),
    roll=st.floats(-1.0, 1.0),
    scale=st.floats(0.6, 1.9),
)
def test_attitude_message_any_roll_is_read(
    pitch: float, heading: float, roll: float, scale: float
) -> None:
    q = [scale * part for part in quaternion_from_euler(roll, pitch, heading)]
    read = offboard_messages.attitude(message(q=q, thrust=0.5, type_mask=7))
    assert read.pitch_rad == pytest.approx(pitch, abs=1e-6)
    assert read.heading_rad == pytest.approx(heading, abs=1e-6)


def test_position_message_masks_and_frames_are_read() -> None:
    local, world = offboard_messages.LOCAL, offboard_messages.GLOBAL
    place = offboard_messages.read(
        local, message(x=3.0, y=-4.0, z=5.0, yaw=0.2, type_mask=0b1001_1111_1000), STATE
    )
    assert place == MotionTarget(position_m=3 - 4j, depth_m=5.0, heading_rad=0.2)
    depth = offboard_messages.read(local, message(z=-2.0, type_mask=0b1101_1111_1011), STATE)
    assert depth == MotionTarget(depth_m=0.0), "above the water is at the surface"
    both = offboard_messages.read(
        local, message(x=1.0, y=1.0, z=1.0, vx=0.6, vy=0.8, type_mask=0b1101_1110_0000), STATE
    )
    assert both == MotionTarget(position_m=1 + 1j, depth_m=1.0, speed_mps=1.0)
    ahead = offboard_messages.read(
        local,
        message(vx=0.9, vz=0.1, yaw_rate=0.05, coordinate_frame=8, type_mask=0b0101_1100_0111),
        STATE,
    )
    assert ahead == MotionTarget(depth_rate_mps=0.1, speed_mps=0.9, heading_rate_radps=0.05)
    lat, lon = offset_to_geodetic(50.0, 20.0, HOME.lat_deg, HOME.lon_deg)
    there = message(
        lat_int=round(lat * 1e7),
        lon_int=round(lon * 1e7),
        alt=-7.0,
        coordinate_frame=6,
        type_mask=0b1101_1111_1000,
    )
    read = offboard_messages.read(world, there, STATE)
    assert isinstance(read, MotionTarget)
    assert read.position_m == pytest.approx(50 + 20j, abs=0.02)
    assert read.depth_m == 7.0


POSITION_ONLY = 0b1101_1111_1000


@pytest.mark.parametrize(("frame", "place_m"), [(7, 13.0 + 24.0j), (9, -18.0 - 1.0j)])
def test_offset_frames_count_from_vehicle(frame: int, place_m: complex) -> None:
    """LOCAL_OFFSET_NED has the axes of the earth, BODY_OFFSET_NED those of the vehicle."""
    eastward = STATE.estimate._replace(
        north_m=10.0, east_m=-4.0, depth_m=2.0, heading_rad=math.pi / 2.0
    )
    wanted = message(x=3.0, y=28.0, z=1.5, coordinate_frame=frame, type_mask=POSITION_ONLY)
    state = STATE._replace(estimate=eastward)
    read = offboard_messages.read(offboard_messages.LOCAL, wanted, state)
    assert isinstance(read, MotionTarget)
    assert read.position_m == pytest.approx(place_m)
    assert read.depth_m == 3.5


def test_offset_of_depth_alone_keeps_course() -> None:
    """Cockpit's "change altitude" and MAVProxy's ``position 0 0 2``."""
    for frame in (7, 9):
        wanted = message(x=0.0, y=0.0, z=2.0, coordinate_frame=frame, type_mask=POSITION_ONLY)
        read = offboard_messages.read(offboard_messages.LOCAL, wanted, STATE)
        assert read == MotionTarget(depth_m=STATE.estimate.depth_m + 2.0)


@pytest.mark.parametrize(
    ("name", "fields", "word"),
    [
        (offboard_messages.LOCAL, {"type_mask": 0xFFF}, "type_mask"),
        (offboard_messages.LOCAL, {"coordinate_frame": 2}, "frame 2"),
        (offboard_messages.LOCAL, {"coordinate_frame": 8}, "body axes"),
        (
            offboard_messages.LOCAL,
            {"coordinate_frame": 8, "vy": 0.1, "type_mask": 0b0101_1100_0111},
            "sideways",
        ),
        (offboard_messages.LOCAL, {"type_mask": 0b1101_1111_1010}, "together"),
        (offboard_messages.LOCAL, {"z": math.inf}, "z is inf"),
        (
            offboard_messages.GLOBAL,
            {"coordinate_frame": 10, "lat_int": 0, "lon_int": 0, "alt": 0.0},
            "frame 10",
        ),
        (offboard_messages.ATTITUDE, {"q": [0.0, 0.0, 0.0, 0.0]}, "no attitude"),
        (offboard_messages.ATTITUDE, {"q": [math.nan] * 4}, "q is nan"),
        (offboard_messages.ATTITUDE, {"q": [1.0, 0.0, 0.0, 0.0], "thrust": math.nan}, "thrust"),
    ],
)
def test_unsupported_message_returns_reason(name: str, fields: dict[str, Any], word: str) -> None:
    with pytest.raises(offboard_messages.TargetError, match=word):
        offboard_messages.read(name, message(**fields), STATE)
