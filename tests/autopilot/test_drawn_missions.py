"""Random missions: impossible ones are refused with the right result and item, others accepted.

``python -m tests.autopilot.test_drawn_missions [SEED]`` draws 200 of each; the tests draw fewer.
"""

import math
import random
import sys

import pytest
from pymavlink.dialects.v20 import all as mavlink

from autopilot.control import feasibility, fence, modes, requests
from autopilot.control.params import Config
from autopilot.control.types import ACCEPTED, AutopilotState, Home
from mavlink_io.mission_items import FENCE_TYPE, MissionItem
from mavlink_io.records import Battery, GpsFix
from tests.helpers import mission_draws
from tests.helpers.fake_hil import Harness, texts
from tests.helpers.mission_draws import HOME
from tests.helpers.missions import Flight

DRAWS = 25
PARAM1, PARAM7 = 6, 12


def connected() -> Harness:
    """Return a vehicle with home and geofence."""
    harness = Harness()
    harness.tick(3, fix=GpsFix(0, 3, HOME.lat_deg, HOME.lon_deg, 0.0, 0.0, 0.0, 0.0, 9))
    harness.serve()
    assert upload(harness, mission_draws.fence(), FENCE_TYPE)[0] == 0
    return harness


def upload(
    harness: Harness, items: tuple[MissionItem, ...], kind: int = 0
) -> tuple[int, list[str]]:
    """Return the MISSION_ACK of an upload, and the texts that were sent."""
    received = harness.ask(mavlink.MAVLink_mission_count_message(1, 1, len(items), kind))
    for i in items:
        if any(m.get_type() == "MISSION_ACK" for m in received):
            break
        numbers = i.p1, i.p2, i.p3, i.p4, i.x, i.y, i.z, kind
        message = mavlink.MAVLink_mission_item_int_message(
            1, 1, i.sequence, i.frame, i.command, 0, 1, *numbers
        )
        received += harness.ask(message)
    (ack,) = [m for m in received if m.get_type() == "MISSION_ACK"]
    return ack.type, texts(received)


def wrong_refusals(count: int, seed: int) -> list[str]:
    """Return the drawn impossible missions whose result or item is not the right one.

    Each goes to a vehicle of its own, as a vehicle limits the rate of its texts.
    """
    rng, wrong = random.Random(seed), []
    for _ in range(count):
        drawn = mission_draws.impossible(rng)
        result, said = upload(connected(), drawn.items)
        named = f"Mission item {drawn.sequence}:"
        if result not in drawn.results or not (said and said[-1].startswith(named)):
            wrong.append(f"{drawn.reason}: {result} {said}, not {drawn.results} of {named}")
    return wrong


def refused_though_feasible(count: int, seed: int) -> list[str]:
    """Return the reasons of refusals of drawn feasible missions."""
    harness, rng = connected(), random.Random(seed)
    outcomes = [upload(harness, mission_draws.feasible(rng)) for _ in range(count)]
    return [f"{result}: {said}" for result, said in outcomes if result or said]


def test_drawn_impossible_missions_are_refused_by_item() -> None:
    assert wrong_refusals(2 * DRAWS, seed=1) == []


def test_drawn_feasible_missions_are_accepted() -> None:
    assert refused_though_feasible(DRAWS, seed=2) == []


def test_every_kind_of_fault_is_drawn() -> None:
    rng = random.Random(1)
    kinds = {mission_draws.impossible(rng).reason for _ in range(2 * DRAWS)}
    assert len(kinds) >= 20


def place(
    north_m: float, east_m: float = 0.0, *, command: int = 16, p1: float = 0.0
) -> MissionItem:
    x, y = round(north_m * 1e4), round(east_m * 1e4)
    return MissionItem(0, 1, command, p1=p1, x=x, y=y, z=3.0)


def fault_of(
    *items: MissionItem,
    state: AutopilotState | None = None,
    start: feasibility.MissionStart | None = None,
    **changes: float,
) -> tuple[int, str, int]:
    """Return the first fault of a mission; (-1, "", 0) without one."""
    numbered = tuple(item._replace(sequence=n) for n, item in enumerate(items))
    config = Config(**changes)  # type: ignore[arg-type]
    fault = feasibility.find_fault(state or AutopilotState(home=HOME), numbered, config, start)
    return fault or (-1, "", 0)


def test_length_of_lines_counts_against_charge() -> None:
    """46.8 km take 10 h at 1.3 m/s; at 50 % charge and 15 % reserve 3.5 h, 16.4 km, remain."""
    lines = [place(9000.0 * (n % 2)) for n in range(3)]
    half = AutopilotState(home=HOME, charge=0.5)
    assert fault_of(*lines) == (-1, "", 0)
    sequence, reason, parameter = fault_of(*lines, state=half)
    assert (sequence, parameter) == (2, 5)
    assert reason.startswith("needs 3.85 h of the battery at cruise: must be at most 3.5 h (50 %")
    assert fault_of(*lines, state=half, battery_cruise_h=0.0) == (-1, "", 0)
    assert fault_of(*lines, state=half, fs_battery_action=0) == (-1, "", 0), "no reserve: 5 h"


def test_length_just_above_the_charge_differs_from_its_limit() -> None:
    lines = [place(8220.0 * (n % 2)) for n in range(3)]
    _, reason, _ = fault_of(*lines, state=AutopilotState(home=HOME, charge=0.5))
    assert reason.startswith("needs 3.51 h of the battery at cruise: must be at most 3.5 h (")


def test_faster_than_cruise_needs_more_of_the_battery() -> None:
    """At 1.5 times cruise the drive needs 3.4 times the power for 2/3 of the time."""
    fast = MissionItem(0, 2, 178, p2=1.95, p3=-1.0)
    lines = [place(9000.0 * (n % 2)) for n in range(5)]
    assert fault_of(*lines, cruise_thrust_pct=50.0) == (-1, "", 0)
    assert fault_of(fast, *lines, cruise_thrust_pct=50.0)[0] == 3, "18 km"


def test_jumps_multiply_the_way_and_endless_ones_are_not_counted() -> None:
    lines = place(0.0), place(9000.0)
    jump = MissionItem(0, 2, 177, p1=0.0, p2=5.0)
    assert fault_of(*lines, jump)[0] == 1
    assert fault_of(*lines, jump._replace(p2=1.0)) == (-1, "", 0)
    assert fault_of(*lines, jump._replace(p2=-1.0)) == (-1, "", 0)


def test_endless_jump_needs_one_pass_within_the_battery_and_its_failsafe() -> None:
    lines = place(0.0), place(9000.0), MissionItem(0, 2, 177, p1=0.0, p2=-1.0)
    half = AutopilotState(home=HOME, charge=0.5)
    assert fault_of(*lines, state=half) == (-1, "", 0), "a pass takes 1.9 h there, 3.8 h in all"
    assert fault_of(*lines, state=half._replace(charge=0.3))[::2] == (1, 5), "1.5 h"
    sequence, reason, parameter = fault_of(*lines, fs_battery_action=0)
    assert (sequence, parameter) == (2, 2)
    assert reason.startswith("endless DO_JUMP: must have a battery failsafe")


@pytest.mark.parametrize("count", [-1.0, 5000.0])
def test_repetition_of_one_place_is_refused(count: float) -> None:
    """The second pass begins at the place: nothing is left to fly."""
    jump = MissionItem(0, 2, 177, p1=0.0, p2=count)
    reason = "DO_JUMP repeats items that take no time"
    assert fault_of(place(50.0), jump) == (1, reason, 1)
    assert fault_of(place(50.0), jump, battery_cruise_h=0.0) == (1, reason, 1)
    assert fault_of(place(50.0), jump._replace(p2=3.0)) == (-1, "", 0)
    wait = MissionItem(0, 2, 93, p1=1.0)
    assert fault_of(place(50.0), wait, jump, battery_cruise_h=0.0) == (-1, "", 0)


def test_thrust_of_0_in_a_repetition_is_refused_without_a_battery() -> None:
    """The first pass reaches both places before the thrust is set to 0."""
    stop, jump = MissionItem(0, 2, 178, p2=-1.0, p3=0.0), MissionItem(0, 2, 177, p2=-1.0)
    items = place(0.0), place(100.0), stop, jump
    for battery_h in (0.0, 10.0):
        fault = fault_of(*items, battery_cruise_h=battery_h)
        assert fault == (0, "it is never reached: the thrust is 0", 5)


def test_skipped_passes_use_the_time_of_each() -> None:
    """Delays of 60 s: 509 passes are 8.5 h less a minute, all that is left above the reserve."""
    delay, jump = MissionItem(0, 2, 93, p1=60.0), MissionItem(0, 2, 177)
    assert fault_of(delay, jump._replace(p2=508.0), delay) == (-1, "", 0)
    assert fault_of(delay, jump._replace(p2=509.0), delay)[::2] == (2, 1)
    assert fault_of(delay, jump._replace(p2=510.0), delay)[::2] == (0, 1)
    assert fault_of(delay, jump._replace(p2=1e9), battery_cruise_h=0.0) == (-1, "", 0)


def test_jump_to_the_home_of_item_0_is_refused() -> None:
    items = place(0.0), place(100.0), MissionItem(0, 2, 177, p1=0.0, p2=1.0)
    assert fault_of(*items) == (-1, "", 0)
    reason = "DO_JUMP to 0: there is no such item"
    assert fault_of(*items, mission_seq0_home=1) == (2, reason, 1)


def test_drawn_depths_below_the_floor_are_refused_at_the_start() -> None:
    rng = random.Random(4)
    for _ in range(DRAWS):
        floor_m, altitude_m = rng.uniform(4.0, 17.0), rng.uniform(0.5, 3.0)
        over_m = rng.uniform(0.01, 3.0) * rng.choice((-1.0, 1.0))
        item = place(rng.uniform(-19.0, 19.0))._replace(z=max(0.0, floor_m - altitude_m + over_m))
        start = feasibility.MissionStart(0j, floor_m)
        sequence, reason, parameter = fault_of(item, start=start, fs_altitude_m=altitude_m)
        assert (sequence, parameter) == ((0, 7) if over_m > 0.0 else (-1, 0)), reason


def test_way_from_the_start_counts_for_the_rest_of_the_mission() -> None:
    state = AutopilotState(home=HOME, charge=0.3)
    state = state._replace(mission=state.mission._replace(current=1))
    start = feasibility.MissionStart(9000.0 + 0j)
    items = place(0.0, command=19, p1=50_000.0), place(8000.0)
    assert fault_of(*items, state=state)[:1] == (0,), "an upload begins with item 0"
    assert fault_of(*items, state=state, start=start) == (-1, "", 0), "item 0 has been flown"
    far = feasibility.MissionStart(-9000.0 + 0j)
    assert fault_of(*items, state=state, start=far)[0] == 1


def test_way_home_of_rtl_counts() -> None:
    state = AutopilotState(home=HOME, charge=0.35)
    items = place(8000.0), MissionItem(0, 2, 20)
    assert fault_of(place(0.0), items[0], state=state) == (-1, "", 0)
    assert fault_of(place(0.0), *items, state=state)[::2] == (2, 0)


def test_floor_under_the_vehicle_limits_the_depth_there() -> None:
    start = feasibility.MissionStart(0j, floor_m=5.0)
    here, away = place(5.0)._replace(z=4.0), place(200.0)._replace(z=12.0)
    assert fault_of(here, away, start=start, fs_altitude_m=1.0) == (-1, "", 0)
    sequence, reason, parameter = fault_of(here, start=start, fs_altitude_m=2.0)
    assert (sequence, parameter) == (0, PARAM7 - PARAM1 + 1)
    assert reason == "depth 4 m: the floor is at 5.0 m, keep FS_ALT_M above it"
    dive = MissionItem(0, 2, 186, p1=-4.0)
    assert fault_of(dive, start=start, fs_altitude_m=2.0)[::2] == (0, 1)
    assert fault_of(away, dive, start=start, fs_altitude_m=2.0) == (-1, "", 0)
    unknown = feasibility.MissionStart(0j, floor_m=math.nan)
    assert fault_of(here, start=unknown, fs_altitude_m=2.0) == (-1, "", 0)


def test_line_is_checked_against_every_zone_it_crosses() -> None:
    zones = fence.parse_fence(mission_draws.fence())
    assert isinstance(zones, fence.Fence)
    home = HOME.lat_deg, HOME.lon_deg
    assert fence.line_breach(zones, 0j, 500.0 + 0j, home) == ""
    assert fence.line_breach(zones, 0j, 1500.0 + 0j, home) == "inside exclusion zone 1"
    assert fence.line_breach(zones, 0j, 1500.0 + 400j, home) == ""
    assert fence.line_breach(zones, 0j, 2500.0 + 900j, home) == "outside the inclusion zones"
    assert fence.line_breach(zones, 0j, 0j, home) == ""


def test_low_battery_refuses_the_start_of_a_loaded_mission() -> None:
    harness = connected()
    items = tuple(
        item._replace(frame=1, sequence=n)
        for n, item in enumerate((place(0.0), place(-1900.0), place(500.0)))
    )
    assert upload(harness, items)[0] == 0
    harness.command(176, 1, float(modes.MISSION.number))
    harness.vehicle._battery = Battery(28.0, 1.0, 40.0, 0.17)
    (text,) = texts(harness.command(400, 1))
    assert text.startswith("Not armed: mission item 1: needs 0.407 h of the battery")


def test_mission_without_home_is_accepted_until_the_start() -> None:
    flight = Flight()
    flight.step()
    flight.state = flight.state._replace(home=Home())
    items = mission_draws.feasible(random.Random(3))
    assert flight.ask(requests.LoadMission(items)) == ACCEPTED


if __name__ == "__main__":
    seed = int(sys.argv[1]) if len(sys.argv) > 1 else 17
    faults = wrong_refusals(200, seed), refused_though_feasible(200, seed + 1)
    print("wrong refusals:", len(faults[0]), "refused though feasible:", len(faults[1]))
    print(*faults[0], *faults[1], sep="\n")
    sys.exit(any(faults))
