"""Modes, missions, tests and failsafes in the pure tick."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from autopilot.control import mission, modes, requests
from autopilot.control.params import Config
from autopilot.control.types import (
    ACCEPTED,
    DENIED,
    FAILED,
    TEMPORARILY_REJECTED,
    UNSUPPORTED,
    Home,
    ItemReached,
    MissionState,
)
from autopilot.vehicle import ACTIVE, COMPLETE, PAUSED, mission_progress
from mavlink_io.mission_items import MavCmd, MissionItem
from mavlink_io.records import Leak
from tests.helpers.missions import Flight, excitation_item, leg, under_way


def test_disarmed_actuators_are_neutral() -> None:
    flight = Flight()
    flight.step()
    assert flight.frame is not None
    assert set(flight.frame.controls) == {0.0}
    assert not flight.frame.armed


def test_depth_mode_holds_initial_depth() -> None:
    flight = under_way()
    for _ in flight.run(60.0):
        pass
    assert abs(flight.depth_m - 5.0) < 0.02
    assert abs(flight.heading) < math.radians(0.2)


def test_heading_change_takes_shorter_turn() -> None:
    flight = under_way()
    flight.ask(requests.ChangeTarget(heading_rad=math.radians(-170.0)))
    flight.run_until(lambda s: abs(s.estimate.heading_rad + math.radians(170.0)) < 0.02, 60.0)
    flight.ask(requests.ChangeTarget(heading_rad=math.radians(170.0)))
    flight.step()
    assert flight.trace.heading_error_rad == pytest.approx(math.radians(-20.0), abs=0.03)


def test_signs_of_depth_and_heading_commands() -> None:
    flight = under_way()
    flight.ask(requests.ChangeTarget(depth_m=8.0, heading_rad=math.radians(10.0)))
    flight.step()
    assert flight.trace.pitch_setpoint_rad < 0.0
    assert flight.trace.elevator_rad < 0.0
    assert flight.trace.rudder_rad > 0.0


@given(rudder=st.floats(-9, 9), elevator=st.floats(-9, 9), thrust=st.floats(-9, 9))
def test_controls_stay_within_range(rudder: float, elevator: float, thrust: float) -> None:
    from autopilot.control import core

    limited = core.limit(rudder, elevator, thrust, Config())
    assert all(abs(value) <= math.radians(15.0) for value in limited[:2])
    assert abs(limited[2]) <= 1.0


def test_mission_flies_legs_then_surfaces_and_disarms() -> None:
    flight = Flight()
    flight.step()
    items = leg(depth_m=4, heading_deg=-80, duration_s=45) + leg(
        depth_m=7, heading_deg=-40, duration_s=60, first=4
    )
    assert flight.ask(requests.LoadMission(items)) == ACCEPTED
    assert flight.ask(requests.SetMode(modes.MISSION.number)) == ACCEPTED
    assert flight.ask(requests.Arm()) == ACCEPTED
    flight.run_until(lambda s: s.mission.current >= 4, 46.0)
    assert flight.heading == pytest.approx(math.radians(-80), abs=0.02)
    flight.run_until(lambda s: s.mode == modes.SURFACE.number, 61.0)
    assert flight.depth_m == pytest.approx(7.0, abs=0.1)
    flight.run_until(lambda s: not s.armed, 60.0)
    assert flight.depth_m < 0.6
    assert [e.sequence for e in flight.events if isinstance(e, ItemReached)] == list(range(8))
    assert flight.texts()[-1] == "Surfaced: disarmed"


def fly_mission(*items: MissionItem) -> Flight:
    """Return a flight armed in a mission, with home at its start."""
    flight = Flight()
    flight.step()
    flight.state = flight.state._replace(home=Home(42.0, -71.0, known=True))
    for request in (
        requests.LoadMission(items),
        requests.SetMode(modes.MISSION.number),
        requests.Arm(),
    ):
        assert flight.ask(request) == ACCEPTED, flight.texts()
    return flight


def stage_of(flight: Flight) -> int:
    """Return MISSION_CURRENT.mission_state."""
    return mission_progress(flight.state, flight.config).mission_state


END_ITEMS = {
    "SURFACE": MissionItem(4, 2, MavCmd.NAV_LAND),
    "SURFACE at a place": MissionItem(4, 1, MavCmd.NAV_LAND, x=1_000_000),
    "RTL": MissionItem(4, 2, MavCmd.NAV_RETURN_TO_LAUNCH),
}


@pytest.mark.parametrize("name", END_ITEMS)
def test_mission_that_surfaces_itself_is_complete_at_the_surface(name: str) -> None:
    """A ground station showed it as paused, and the next dive surfaced at once."""
    flight = fly_mission(*leg(depth_m=4, heading_deg=0, duration_s=20), END_ITEMS[name])
    assert stage_of(flight) == ACTIVE
    flight.run_until(lambda s: s.mode == modes.SURFACE.number, 300.0)
    assert stage_of(flight) == ACTIVE
    flight.run_until(lambda s: not s.armed, 60.0)
    assert stage_of(flight) == COMPLETE
    assert [e.sequence for e in flight.events if isinstance(e, ItemReached)] == list(range(5))
    flight.ask(requests.SetMode(modes.MISSION.number))
    assert flight.ask(requests.Arm()) == ACCEPTED
    flight.step()
    assert (flight.state.mode, flight.state.mission.current) == (modes.MISSION.number, 3)


def test_mission_is_complete_when_disarmed_at_the_surface() -> None:
    flight = fly_mission(*leg(depth_m=4, heading_deg=0, duration_s=20), END_ITEMS["SURFACE"])
    flight.run_until(lambda s: s.mode == modes.SURFACE.number, 60.0)
    flight.run_until(lambda s: s.estimate.depth_m < flight.config.surfaced_depth_m, 60.0)
    assert flight.ask(requests.Disarm()) == ACCEPTED
    assert stage_of(flight) == COMPLETE


@pytest.mark.parametrize("mode", [modes.SURFACE, modes.RTL])
def test_mission_that_is_left_on_the_way_to_its_surface_place_is_paused(mode: modes.Mode) -> None:
    items = *leg(depth_m=4, heading_deg=0, duration_s=20), END_ITEMS["SURFACE at a place"]
    flight = fly_mission(*items)
    flight.run_until(lambda s: s.mission.current == 4, 60.0)
    flight.step()
    flight.ask(requests.SetMode(mode.number))
    assert stage_of(flight) == PAUSED
    flight.run_until(lambda s: not s.armed, 300.0)
    assert stage_of(flight) == PAUSED


def test_mission_that_is_left_by_a_failsafe_is_paused() -> None:
    items = *leg(depth_m=4, heading_deg=0, duration_s=20), END_ITEMS["SURFACE at a place"]
    flight = fly_mission(*items)
    flight.run_until(lambda s: s.mission.current == 4, 60.0)
    flight.more["leak"] = Leak(True)
    flight.run_until(lambda s: bool(s.failsafe), 60.0)
    assert stage_of(flight) == PAUSED
    flight.run_until(lambda s: not s.armed, 60.0)
    assert stage_of(flight) == PAUSED


def test_ascent_of_a_mission_goes_on_after_hold() -> None:
    flight = fly_mission(*leg(depth_m=4, heading_deg=0, duration_s=20), END_ITEMS["SURFACE"])
    flight.run_until(lambda s: s.mode == modes.SURFACE.number, 60.0)
    flight.ask(requests.SetMode(modes.HOLD.number))
    assert stage_of(flight) == PAUSED
    flight.ask(requests.SetMode(modes.MISSION.number))
    flight.step()
    assert flight.state.mode == modes.SURFACE.number


@pytest.mark.parametrize(
    ("p2", "p3", "thrust"),
    [
        (1.0, 0.0, 0.58 / 1.3),  # MAVProxy's setspeed, DroneKit's examples: throttle left at 0
        (1.0, -1.0, 0.58 / 1.3),
        (-2.0, 0.0, 0.58),
        (1.0, 40.0, 0.4),
        (-1.0, 40.0, 0.4),
        (-1.0, 0.0, 0.0),
        (0.0, 0.0, 0.0),
        (-1.0, -1.0, 0.2),
    ],
)
def test_change_of_speed_ignores_zero_throttle_beside_speed(
    p2: float, p3: float, thrust: float
) -> None:
    """The thrust before is 0.2; cruise is 1.3 m/s at 58 %."""
    item = MissionItem(0, 2, 178, p1=1.0, p2=p2, p3=p3)
    assert mission.item_thrust(item, 0.2, Config()) == pytest.approx(thrust)


def test_paused_mission_continues_with_its_setpoints() -> None:
    flight = Flight()
    flight.step()
    flight.ask(requests.LoadMission(leg(depth_m=6, heading_deg=40, duration_s=300)))
    flight.ask(requests.SetMode(modes.MISSION.number))
    flight.ask(requests.Arm())
    for _ in flight.run(5.0):
        pass
    flight.ask(requests.SetMode(modes.HOLD.number))
    flight.step()
    assert flight.state.setpoint.depth_m != 6.0
    flight.ask(requests.SetMode(modes.MISSION.number))
    for _ in flight.run(60.0):
        pass
    assert flight.depth_m == pytest.approx(6.0, abs=0.1)
    assert flight.heading == pytest.approx(math.radians(40), abs=0.02)


@pytest.mark.parametrize(
    ("command", "result"),
    [
        (requests.SetMode(12345), UNSUPPORTED),
        (requests.SetMode(modes.SYSID.number), DENIED),
        (requests.StartTest(12, 5.0, 0.0, 0.0, 4.0, 1, 0.0), TEMPORARILY_REJECTED),
        (requests.SetMissionItem(3), FAILED),
        (requests.LoadMission((MissionItem(0, 3, 22),)), UNSUPPORTED),
        (requests.LoadMission((MissionItem(0, 2, 186, p1=4.0),)), DENIED),
        (requests.LoadMission((MissionItem(0, 2, 113, z=4.0),)), DENIED),
        (requests.LoadMission((MissionItem(0, 2, 177, p1=7.0),)), DENIED),
        (
            requests.LoadMission((excitation_item(0, axis=9, magnitude_deg=5.0, duration_s=4),)),
            DENIED,
        ),
    ],
)
def test_impossible_request_is_refused_without_effect(
    command: requests.Request, result: int
) -> None:
    flight = Flight()
    flight.step()
    before = flight.state
    assert flight.ask(command) == result
    assert flight.state == before


@given(
    command=st.sampled_from(sorted(mission.COMMANDS)),
    numbers=st.lists(
        st.sampled_from([math.nan, math.inf, -math.inf, 0.0, 1.0, -3.0, 12.0]),
        min_size=5,
        max_size=5,
    ),
    frame=st.sampled_from([0, 1, 2, 3]),
)
def test_accepted_items_give_finite_actuators(
    command: int, numbers: list[float], frame: int
) -> None:
    flight = Flight()
    flight.step()
    p1, p2, p3, p4, z = numbers
    items = (
        MissionItem(0, frame, command, p1=p1, p2=p2, p3=p3, p4=p4, x=10, y=1, z=z),
        MissionItem(1, 2, 93, p1=1.0),
    )
    if flight.ask(requests.LoadMission(items)) != ACCEPTED:
        return
    flight.ask(requests.SetMode(modes.MISSION.number))
    flight.ask(requests.Arm())
    for state in flight.run(0.2):
        assert flight.frame is not None
        assert all(math.isfinite(value) for value in flight.frame.controls)
        assert all(math.isfinite(value) for value in state.setpoint[:3])


def test_arming_requires_sensors_and_mission() -> None:
    flight = Flight()
    assert flight.ask(requests.Arm()) == TEMPORARILY_REJECTED
    flight.step()
    flight.ask(requests.SetMode(modes.MISSION.number))
    assert flight.ask(requests.Arm()) == TEMPORARILY_REJECTED
    assert flight.ask(requests.Arm(force=True)) == ACCEPTED


def test_disarming_submerged_requires_force() -> None:
    flight = under_way()
    assert flight.ask(requests.Disarm()) == TEMPORARILY_REJECTED
    assert flight.ask(requests.Disarm(force=True)) == ACCEPTED
    assert not flight.state.armed


@pytest.mark.parametrize(
    ("changes", "altitude_m", "cause"),
    [
        ({"fs_depth_m": 4.0}, None, "depth"),
        ({"fs_altitude_m": 2.0}, 1.5, "altitude"),
        ({"fs_time_s": 3.0}, None, "armed"),
    ],
)
def test_failsafe_surfaces_and_remains_until_disarmed(
    changes: dict[str, float], altitude_m: float | None, cause: str
) -> None:
    flight = under_way(modes.DEPTH, **changes)
    flight.altitude_m = altitude_m
    flight.run_until(lambda s: s.mode == modes.SURFACE.number, 10.0)
    assert any(
        text.startswith(f"Failsafe: {cause}") and text.endswith("-> SURFACE")
        for text in flight.texts()
    )
    assert flight.ask(requests.SetMode(modes.DEPTH.number)) == TEMPORARILY_REJECTED
    flight.altitude_m = None
    flight.run_until(lambda s: not s.armed, 60.0)


@pytest.mark.parametrize(
    ("item", "depth_m"),
    [
        (MissionItem(0, 2, 186, p1=-4.0), 4.0),
        (MissionItem(0, 3, 113, z=-4.0), 4.0),
        (MissionItem(0, 2, 113, z=-4.0), 4.0),
        (MissionItem(0, 1, 113, z=4.0), 4.0),
    ],
)
def test_item_altitude_sign_depends_on_frame(item: MissionItem, depth_m: float) -> None:
    flight = under_way()
    assert mission.begin_item(item, flight.state, flight.config)[0].setpoint.depth_m == depth_m
    at_depth, deeper = (
        flight.state._replace(estimate=flight.state.estimate._replace(depth_m=depth))
        for depth in (depth_m, 9.0)
    )
    waits = item.command == MavCmd.CONDITION_CHANGE_ALT
    assert [mission.item_done(item, state, flight.config) for state in (deeper, at_depth)] == [
        not waits,
        True,
    ]


@pytest.mark.parametrize(
    ("direction", "turn_deg"), [(1.0, 30.0), (0.0, 30.0), (math.nan, 30.0), (-1.0, -30.0)]
)
def test_relative_turn_default_is_clockwise(direction: float, turn_deg: float) -> None:
    flight = under_way()
    item = MissionItem(0, 2, 115, p1=30.0, p3=direction, p4=1.0)
    after = mission.begin_item(item, flight.state, flight.config)[0]
    turned = after.setpoint.heading_rad - flight.state.setpoint.heading_rad
    assert math.degrees(turned) == pytest.approx(turn_deg)


def test_jump_repeats_its_count() -> None:
    flight = Flight()
    flight.step()
    items = (MissionItem(0, 2, 93, p1=0.1), MissionItem(1, 2, 177, p1=0, p2=3))
    flight.ask(requests.LoadMission(items))
    flight.ask(requests.SetMode(modes.MISSION.number))
    flight.ask(requests.Arm())
    flight.run_until(lambda s: s.mode == modes.SURFACE.number, 5.0)
    assert [e.sequence for e in flight.events if isinstance(e, ItemReached)].count(0) == 4


def circle_of_jumps(count: int) -> tuple[MissionItem, ...]:
    """Return items that each jump to the next one, without end."""
    return tuple(MissionItem(n, 2, 177, p1=float((n + 1) % count), p2=-1.0) for n in range(count))


def test_endless_jumps_are_bounded_per_tick() -> None:
    """The upload refuses them; the bound does not rely on that."""
    flight, jumps = under_way(), circle_of_jumps(1000)
    assert flight.ask(requests.LoadMission(jumps)) == DENIED
    delay = MissionItem(0, 2, 93, p1=60.0)
    flight.ask(requests.LoadMission((delay,)))
    assert flight.ask(requests.SetMode(modes.MISSION.number)) == ACCEPTED
    flight.state = flight.state._replace(mission=MissionState(jumps))
    for tick in range(250):
        flight.events.clear()
        state = flight.step()
        reached = [event.sequence for event in flight.events if isinstance(event, ItemReached)]
        first = tick * mission.ITEMS_PER_TICK % 1000
        assert reached == list(range(first, first + mission.ITEMS_PER_TICK))  # no item is missing
    assert state.mode == modes.MISSION.number
    jump_counts = dict(state.mission.jumps)
    assert list(jump_counts) == sorted(jump_counts)
    assert sum(jump_counts.values()) == 250 * mission.ITEMS_PER_TICK


def test_items_beyond_tick_limit_continue_in_next_tick() -> None:
    flight = under_way()
    count = 2 * mission.ITEMS_PER_TICK + 3
    items = tuple(MissionItem(n, 2, 178, p1=1.0, p2=-1.0, p3=float(n)) for n in range(count))
    flight.ask(requests.LoadMission((*items, MissionItem(count, 2, 93, p1=60.0))))
    flight.ask(requests.SetMode(modes.MISSION.number))
    thrusts = [round(100.0 * flight.step().setpoint.thrust) for _ in range(3)]
    assert thrusts == [mission.ITEMS_PER_TICK - 1, 2 * mission.ITEMS_PER_TICK - 1, count - 1]


def test_seq0_home_is_stored_but_not_flown() -> None:
    flight = Flight(config=Config(mission_seq0_home=1))
    flight.step()
    items = (
        MissionItem(0, 0, 16, x=423_500_000, y=-710_000_000),
        *leg(depth_m=5, heading_deg=0, duration_s=1, first=1),
    )
    flight.ask(requests.LoadMission(items))
    assert flight.state.mission.items == items
    flight.ask(requests.SetMode(modes.MISSION.number))
    flight.ask(requests.Arm())
    flight.run_until(lambda s: not s.armed, 60.0)
    assert 0 not in [e.sequence for e in flight.events if isinstance(e, ItemReached)]


def test_tick_is_deterministic() -> None:
    """Two flights of the same mission give the same events and actuators to the last bit."""
    traces = []
    for _ in range(2):
        flight = under_way()
        flight.ask(requests.ChangeTarget(depth_m=7.0, heading_rad=1.0))
        traces.append([(state, flight.trace) for state in flight.run(20.0)])
    assert traces[0] == traces[1]
