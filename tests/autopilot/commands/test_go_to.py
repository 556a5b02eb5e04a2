"""Go there: every message of a client that names a place, its effect and its refusals."""

import math
from typing import Any

import pytest
from pymavlink.dialects.v20 import all as mavlink

from autopilot.control import modes
from autopilot.control.setpoints import Circle
from mavlink_io.frames import offset_to_geodetic
from tests.helpers.commands import (
    ACCEPTED,
    DENIED,
    FIX,
    INT32_MAX,
    NAN,
    REJECTED,
    UNSUPPORTED,
    results,
    under_way,
)
from tests.helpers.fake_hil import Harness, only, texts

PLACE_M = 80.0 - 60.0j
LAT, LON = offset_to_geodetic(PLACE_M.real, PLACE_M.imag, FIX.lat_deg, FIX.lon_deg)
X, Y = round(LAT * 1e7), round(LON * 1e7)
REPOSITION, ORBIT, RADIUS_M = 192, 34, 20.0
SPEED_MPS = 0.65
POSITION_ONLY = 0b1101_1111_1000
"""POSITION_TARGET_TYPEMASK of x, y and z."""


def reposition(
    *,
    p: tuple[float, ...] = (-1, 1, 0, NAN),
    x: int = X,
    y: int = Y,
    z: float = -4.0,
    frame: int = 0,
) -> Any:
    return mavlink.MAVLink_command_int_message(1, 1, frame, REPOSITION, 0, 0, *p, x, y, z)


def item(current: int, **changes: Any) -> Any:
    fields = {"frame": 3, "command": 16, "x": X, "y": Y, "z": -4.0} | changes
    numbers = (fields["frame"], fields["command"], current, 0, 0, 0, 0, 0)
    return mavlink.MAVLink_mission_item_int_message(
        1, 1, 0, *numbers, fields["x"], fields["y"], fields["z"], 0
    )


def old_item() -> Any:
    """DroneKit's ``simple_goto``."""
    return mavlink.MAVLink_mission_item_message(1, 1, 0, 3, 16, 2, 0, 0, 0, 0, 0, LAT, LON, -4.0)


def long_command() -> Any:
    return mavlink.MAVLink_command_long_message(1, 1, REPOSITION, 0, -1, 1, 0, NAN, LAT, LON, -4.0)


def target(*, mask: int = POSITION_ONLY) -> Any:
    return mavlink.MAVLink_set_position_target_global_int_message(
        0, 1, 1, 6, mask, X, Y, -4.0, 0, 0, 0, 0, 0, 0, 0, 0
    )


def local_target(x_m: float, y_m: float, z_m: float, frame: int = 1) -> Any:
    return mavlink.MAVLink_set_position_target_local_ned_message(
        0, 1, 1, frame, POSITION_ONLY, x_m, y_m, z_m, 0, 0, 0, 0, 0, 0, 0, 0
    )


def circle(harness: Harness) -> Circle:
    path = harness.vehicle.state.path
    assert isinstance(path, Circle)
    return path


def assert_goes_there(harness: Harness, tolerance_m: float = 0.05) -> None:
    state = harness.vehicle.state
    assert state.mode == modes.STATION.number
    assert circle(harness).centre_m == pytest.approx(PLACE_M, abs=tolerance_m)
    assert state.setpoint.depth_m == 4.0
    assert state.setpoint.thrust == pytest.approx(0.58)


@pytest.mark.parametrize("before", [modes.HOLD, modes.MANUAL, modes.STATION])
def test_reposition_from_any_mode_circles_place(harness: Harness, before: modes.Mode) -> None:
    under_way(harness)
    harness.command(176, 1, float(before.number))
    received = harness.ask(reposition())
    assert results(received) == [ACCEPTED]
    assert_goes_there(harness)
    assert circle(harness).radius_m == RADIUS_M
    assert circle(harness).clockwise


@pytest.mark.parametrize(
    ("message", "tolerance_m"),
    [
        (reposition(p=(NAN, NAN, NAN, 0.0)), 0.05),  # MAVSDK, after HOLD
        (reposition(p=(-1, 0, 0, 0), frame=6), 0.05),  # pymavlink scripts
        (long_command(), 1.0),  # a float32 of 70 degrees has steps of 0.8 m
        (
            mavlink.MAVLink_command_int_message(
                1, 1, 1, REPOSITION, 0, 0, -1, 1, 0, NAN, 800_000, -600_000, 4.0
            ),
            0.05,
        ),
        (item(2), 0.05),  # MAVProxy's ``guided``, Mission Planner
        (old_item(), 1.0),
    ],
)
def test_each_client_message_goes_there_from_hold(
    harness: Harness, message: Any, tolerance_m: float
) -> None:
    under_way(harness)
    harness.command(176, 1, float(modes.HOLD.number))
    received = harness.ask(message)
    answers = [m for m in received if m.get_type() in ("COMMAND_ACK", "MISSION_ACK")]
    assert [getattr(m, "result", getattr(m, "type", None)) for m in answers] == [0]
    assert_goes_there(harness, tolerance_m)


def test_reposition_sets_radius_sense_and_speed(harness: Harness) -> None:
    under_way(harness)
    assert results(harness.ask(reposition(p=(SPEED_MPS, 1, 25.0, 1.0)))) == [ACCEPTED]
    path = circle(harness)
    assert (path.radius_m, path.clockwise) == (25.0, False)
    assert harness.vehicle.state.setpoint.thrust == pytest.approx(0.58 * SPEED_MPS / 1.3)
    harness.ask(reposition(z=NAN))
    setpoint = harness.vehicle.state.setpoint
    assert setpoint.thrust == pytest.approx(0.58 * SPEED_MPS / 1.3), "the present speed stays"
    assert setpoint.depth_m == 4.0, "the present depth stays"


def test_repeated_reposition_keeps_circle_in_progress(harness: Harness) -> None:
    under_way(harness)
    harness.ask(reposition())
    harness.vehicle.state = harness.vehicle.state._replace(
        path=circle(harness)._replace(since_us=7, swept_rad=1.0)
    )
    harness.ask(reposition())
    assert circle(harness).since_us == 7


def test_reposition_without_place_holds_or_changes_depth(harness: Harness) -> None:
    under_way(harness)
    pause = reposition(x=INT32_MAX, y=INT32_MAX, z=NAN)
    assert results(harness.ask(pause)) == [ACCEPTED]
    assert harness.vehicle.state.mode == modes.HOLD.number
    harness.ask(reposition())
    deeper = reposition(x=INT32_MAX, y=INT32_MAX, z=-6.0)  # QGroundControl's change of altitude
    assert results(harness.ask(deeper)) == [ACCEPTED]
    assert harness.vehicle.state.mode == modes.STATION.number
    assert circle(harness).centre_m == pytest.approx(PLACE_M, abs=0.05)
    assert harness.vehicle.state.setpoint.depth_m == 6.0
    harness.command(176, 1, float(modes.DEPTH.number))
    assert results(harness.ask(deeper)) == [ACCEPTED]
    assert harness.vehicle.state.mode == modes.HOLD.number
    assert harness.vehicle.state.setpoint.depth_m == 6.0


def test_item_with_current_3_changes_depth(harness: Harness) -> None:
    under_way(harness)
    harness.ask(reposition())
    assert only(harness.ask(item(3, x=0, y=0, z=-7.0)), "MISSION_ACK").type == 0
    assert harness.vehicle.state.setpoint.depth_m == 7.0
    assert circle(harness).centre_m == pytest.approx(PLACE_M, abs=0.05)


@pytest.mark.parametrize(
    ("message", "result", "reason"),
    [
        (reposition(z=2.0), DENIED, "depth -2 m: must be 0 or more"),
        (reposition(z=-30.0), DENIED, "depth 30 m: must be at most FS_DEPTH_M = 18 m"),
        (reposition(x=0, y=0), DENIED, "0, 0 is not a place near home"),
        (reposition(x=950_000_000), DENIED, "latitude 95: must be -90 to 90 deg"),
        (reposition(x=INT32_MAX), DENIED, "latitude and longitude: give both or none"),
        (reposition(x=X + 1_100_000), DENIED, "must be at most MIS_DIST_MAX = 10000 m"),
        (reposition(frame=10), DENIED, "frame 10"),
        (reposition(p=(NAN, 0, 0, NAN)), REJECTED, "mode DEPTH; set the change-mode flag"),
        (reposition(p=(NAN, 0, 0, NAN), x=INT32_MAX, y=INT32_MAX, z=NAN), DENIED, "neither"),
    ],
)
def test_impossible_place_is_refused_with_reason(
    harness: Harness, message: Any, result: int, reason: str
) -> None:
    under_way(harness)
    harness.command(176, 1, float(modes.DEPTH.number))
    received = harness.ask(message)
    assert results(received) == [result]
    assert reason in texts(received)[0]
    assert harness.vehicle.state.mode == modes.DEPTH.number


def test_altitude_of_vehicle_at_surface_is_accepted(harness: Harness) -> None:
    """QGroundControl repeats the altitude of the vehicle, which is above 0 in a wave."""
    under_way(harness)
    assert results(harness.ask(reposition(z=0.1))) == [ACCEPTED]
    assert harness.vehicle.state.setpoint.depth_m == 0.0


def test_disarmed_or_homeless_vehicle_refuses_place(harness: Harness) -> None:
    received = harness.ask(reposition())
    assert (results(received), texts(received)) == ([REJECTED], ["Go-to refused: not armed"])
    lost = Harness()
    lost.tick(3)
    under_way(lost)
    received = lost.ask(reposition())
    assert (results(received), texts(received)) == (
        [REJECTED],
        ["Go-to refused: home is not known"],
    )


def test_place_outside_fence_is_refused(harness: Harness) -> None:
    fence = mavlink.MAVLink_mission_item_int_message(
        1, 1, 0, 3, 5004, 0, 1, 20.0, 0, 0, 0, X, Y, 0, 1
    )
    harness.ask(mavlink.MAVLink_mission_count_message(1, 1, 1, 1))
    assert only(harness.ask(fence), "MISSION_ACK").type == 0
    under_way(harness)
    received = harness.ask(reposition())
    assert results(received) == [DENIED]
    assert texts(received) == ["Go-to refused: geofence: inside exclusion zone 0"]


def test_orbit_circles_centre_with_radius_sense_and_speed(harness: Harness) -> None:
    under_way(harness)
    orbit = mavlink.MAVLink_command_int_message(
        1, 1, 5, ORBIT, 0, 0, -30.0, SPEED_MPS, 0, NAN, X, Y, -4.0
    )
    received = harness.ask(orbit)
    assert ACCEPTED in results(received)
    assert texts(received)[-1] == "DO_ORBIT: the bow points along the circle"
    path = circle(harness)
    assert (path.radius_m, path.clockwise) == (30.0, False)
    assert path.centre_m == pytest.approx(PLACE_M, abs=0.05)
    assert harness.vehicle.state.setpoint.thrust == pytest.approx(0.58 * SPEED_MPS / 1.3)
    assert results(harness.command(ORBIT, 20.0, NAN, 3, 6.28, LAT, LON, -4.0)) == [DENIED]


@pytest.mark.parametrize("message", [target(), local_target(80.0, -60.0, 4.0)])
def test_position_target_moves_circle_in_station(harness: Harness, message: Any) -> None:
    under_way(harness)
    harness.command(176, 1, float(modes.STATION.number))
    harness.ask(message)
    assert_goes_there(harness)


def test_position_target_in_other_modes_is_a_setpoint_only(harness: Harness) -> None:
    """Clients stream set-points before they select OFFBOARD."""
    under_way(harness)
    for mode in (modes.HOLD, modes.DEPTH):
        harness.command(176, 1, float(mode.number))
        harness.ask(target())
        assert harness.vehicle.state.mode == mode.number
        assert harness.vehicle.state.path is None
    assert results(harness.command(176, 1, float(modes.OFFBOARD.number))) == [ACCEPTED]


def test_refused_stream_is_explained_once(harness: Harness) -> None:
    under_way(harness)
    harness.command(176, 1, float(modes.STATION.number))
    before = circle(harness)
    far = local_target(20_000.0, 0.0, 4.0)
    received = [m for _ in range(5) for m in harness.ask(far)]
    assert texts(received) == [
        "Go-to refused: 20000 m from home: must be at most MIS_DIST_MAX = 10000 m"
    ]
    assert circle(harness).centre_m == before.centre_m


def test_offset_in_body_axes_is_ahead_of_bow(harness: Harness) -> None:
    """MAVProxy's ``guided forward 40`` and ``position 40 0 2``."""
    under_way(harness)
    harness.command(176, 1, float(modes.STATION.number))
    estimate = harness.vehicle.state.estimate
    ahead = complex(math.cos(estimate.heading_rad), math.sin(estimate.heading_rad)) * 40.0
    harness.ask(local_target(40.0, 0.0, 2.0, frame=8))
    here = complex(estimate.north_m, estimate.east_m)
    assert circle(harness).centre_m == pytest.approx(here + ahead, abs=0.1)
    assert harness.vehicle.state.setpoint.depth_m == pytest.approx(estimate.depth_m + 2.0, abs=0.1)


def test_depth_target_changes_depth_of_circle(harness: Harness) -> None:
    """A set-point without a place keeps the centre."""
    under_way(harness)
    harness.command(176, 1, float(modes.STATION.number))
    centre_m = circle(harness).centre_m
    depth_m = harness.vehicle.state.estimate.depth_m
    harness.ask(local_target(0.0, 0.0, 1.5, frame=7))
    assert harness.vehicle.state.setpoint.depth_m == pytest.approx(depth_m + 1.5, abs=0.05)
    assert circle(harness).centre_m == centre_m


@pytest.mark.parametrize(
    ("command", "parameters", "reason"),
    [
        (22, (), "Takeoff refused"),
        (181, (1, 1), "Relay refused"),
        (185, (1,), "Termination refused"),
        (246, (2,), "Shutdown refused"),
    ],
)
def test_command_without_sense_under_water_is_explained(
    harness: Harness, command: int, parameters: tuple[float, ...], reason: str
) -> None:
    received = harness.command(command, *parameters)
    assert results(received) == [UNSUPPORTED]
    assert texts(received)[0].startswith(reason)
