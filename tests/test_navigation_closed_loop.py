"""Position estimate, waypoints, station keeping and RTL in currents, in closed loop."""

import math

import numpy as np
import pytest

from autopilot.control import modes, requests
from mavlink_io.mission_items import MissionItem
from tests.helpers.missions import leg
from tests.helpers.navigation_sim import Voyage, water

NORTH_MPS, EAST_MPS = 0.2, -0.22
"""A current of 0.3 m/s."""
DIVES = 30


def waypoint(
    sequence: int, north_m: float, east_m: float, depth_m: float = 4.0, p1: float = 0.0
) -> MissionItem:
    """Return a waypoint at an offset (m) from home."""
    return MissionItem(
        sequence, 1, 16, p1=p1, x=round(north_m * 1e4), y=round(east_m * 1e4), z=depth_m
    )


def under_way(**how: object) -> Voyage:
    """Return a dive at 4 m in the current, 60 s after the start."""
    voyage = Voyage(water("disturbed", NORTH_MPS, EAST_MPS), **how).sail(5.0)  # type: ignore[arg-type]
    voyage.ask(
        requests.SetMode(modes.DEPTH.number), requests.Arm(), requests.ChangeTarget(4.0, 0.3, 0.58)
    )
    return voyage.sail(60.0)


def dive(seed: int, *, dvl: bool) -> Voyage:
    """Return a dive with two turns and two depths.

    The current has the standard deviation that the estimator assumes (0.2 m/s per axis).
    """
    north, east = np.random.default_rng(seed).normal(0.0, 0.2, 2)
    voyage = Voyage(water("disturbed", north, east, rms_mps=0.05), dvl=dvl, seed=seed).sail(10.0)
    legs = ((5.0, 40.0, 20.0), (5.0, 130.0, 15.0), (8.0, -100.0, 60.0))
    items = [
        item
        for k, (depth, heading, time) in enumerate(legs)
        for item in leg(depth_m=depth, heading_deg=heading, duration_s=time, first=4 * k)
    ]
    voyage.fly(*items)
    return voyage.sail(50.0)


@pytest.mark.slow
@pytest.mark.parametrize(("dvl", "worst_m"), [(True, 1.5), (False, 10.0)])
def test_position_error_agrees_with_reported_sd(dvl: bool, worst_m: float) -> None:
    """At least 86 % of the errors are within 2 sd, and the sd is at most 3 start_times_s too large.

    Reference: a circular normal error is within 2 sd with probability 1 - exp(-2) = 0.86. More may
    be: the estimator assumes satellite errors of longer correlation than the simulated ones have.
    """
    dives = [dive(seed, dvl=dvl) for seed in range(1, DIVES + 1)]
    error_m = np.array([np.abs(voyage.error_m()) for voyage in dives])
    sd_m = np.array([voyage["sd_m"] for voyage in dives])
    for after_s in (8.0, 25.0, 40.0, 59.0):
        tick = round(after_s * 10.0)
        within = float((error_m[:, tick] < 2.0 * sd_m[:, tick]).mean())
        error_to_sd = float(np.sqrt(np.mean((error_m[:, tick] / sd_m[:, tick]) ** 2) / 2.0))
        assert within >= 0.86, after_s
        assert 0.3 < error_to_sd < 1.0, after_s
    assert np.median(sd_m[:, -1]) < worst_m
    current = np.array(
        [complex(v["current_north_mps"][-1], v["current_east_mps"][-1]) for v in dives]
    )
    assert np.abs(current).max() > 0.2


def test_fix_after_dive_without_dvl_estimates_current() -> None:
    """Only the fixes before and after the dive hold information on the current."""
    voyage = Voyage(water("calm", 0.0, 0.3), dvl=False, values={"NAV_SPD_PCT": 2.0})
    voyage.fly(*leg(depth_m=3.0, heading_deg=0.0, duration_s=150.0))
    voyage.sail(150.0)
    submerged_error_m, reported_sd_m = abs(voyage.error_m()[-1]), voyage["sd_m"][-1]
    voyage.sail(60.0)
    assert submerged_error_m > 10.0
    assert reported_sd_m > 0.5 * submerged_error_m
    assert abs(voyage.error_m()[-1]) < 3.0
    assert voyage["current_east_mps"][-1] == pytest.approx(0.3, abs=0.1)
    assert voyage["current_north_mps"][-1] == pytest.approx(0.0, abs=0.1)


def test_square_mission_in_current_tracks_legs_and_returns() -> None:
    """From half of each side on, the cross-track error is below 2 m; the mission ends at home."""
    voyage = Voyage(water("disturbed", NORTH_MPS, EAST_MPS)).sail(5.0)
    corners = (100 + 0j, 100 + 100j, 100j, 0j)
    voyage.fly(*(waypoint(n, corner.real, corner.imag) for n, corner in enumerate(corners)))
    voyage.sail(500.0, until_disarmed=True)
    position = voyage["north_m"] + 1j * voyage["east_m"]
    # home is the first fix, one or two metres from the true position
    home = voyage.error_m()[0]
    for start, end in zip((0j, *corners), corners, strict=False):
        direction = (end - start) / abs(end - start)
        offset = (position - home - start) * direction.conjugate()
        steady = (offset.real > 50.0) & (offset.real < 95.0) & (abs(offset.imag) < 20.0)
        assert steady.any()
        assert np.abs(offset.imag[steady]).max() < 2.0
    assert voyage.texts()[-3:] == ["Mission complete", "Mode SURFACE", "Surfaced: disarmed"]
    assert abs(position[voyage["depth_m"] > 3.0][-1]) < 15.0


def test_station_in_current_circles_the_requested_position() -> None:
    voyage = under_way()
    voyage.ask(requests.SetMode(modes.STATION.number))
    centre = complex(voyage["north_m"][-1], voyage["east_m"][-1])
    depth_m = voyage["depth_m"][-1]
    start_index = len(voyage)
    voyage.sail(240.0)
    radius = np.abs(voyage["north_m"] + 1j * voyage["east_m"] - centre)[start_index + 900 :]
    assert radius.min() > 17.0
    assert radius.max() < 23.0
    assert np.abs(voyage["depth_m"][start_index + 900 :] - depth_m).max() < 0.8


def test_rtl_surfaces_near_home() -> None:
    voyage = under_way(dvl=False)
    voyage.ask(requests.SetMode(modes.RTL.number))
    voyage.sail(400.0, until_disarmed=True)
    assert voyage.texts()[-4:] == [
        "Mode RTL",
        "RTL: home reached",
        "Mode SURFACE",
        "Surfaced: disarmed",
    ]
    last_submerged = np.flatnonzero(voyage["depth_m"] > 1.5)[-1]
    position = complex(voyage["north_m"][last_submerged], voyage["east_m"][last_submerged])
    sd_m = voyage["sd_m"][last_submerged]
    assert abs(position) < 10.0 + 3.0 * math.sqrt(2.0) * sd_m + 10.0, (
        "10 m of acceptance radius, 3 sd, and 10 m travelled during the ascent"
    )


def test_loiter_items_hold_for_time_and_count_turns() -> None:
    voyage = Voyage(water("calm"), depth_m=4.0).sail(2.0)
    voyage.fly(
        waypoint(0, 60.0, 0.0, p1=40.0),
        MissionItem(1, 1, 18, p1=1.5, p3=-15.0, x=1_200_000, y=0, z=6.0),
        MissionItem(2, 2, 93, p1=600.0),
    )
    start_times_s: dict[int, float] = {}
    for _ in range(700):
        start_times_s.setdefault(voyage.state.mission.current, voyage.state.time_us / 1e6)
        if voyage.state.mission.current == 2:
            break
        voyage.sail(1.0)
    assert 75.0 < start_times_s[1] < 115.0, "55 m, then 40 s"
    assert voyage.state.estimate.depth_m == pytest.approx(6.0, abs=0.4)
    distance_m = (start_times_s[2] - start_times_s[1]) * 1.29
    assert 1.5 * 2.0 * math.pi * 15.0 < distance_m < 1.5 * 2.0 * math.pi * 17.0 + 110.0


def test_paused_leg_resumes_and_reaches_its_waypoint() -> None:
    voyage = Voyage(water("calm"), depth_m=4.0).sail(2.0)
    voyage.fly(waypoint(0, 80.0, 0.0), MissionItem(1, 2, 93, p1=600.0))
    voyage.sail(15.0).ask(requests.SetMode(modes.STATION.number))
    voyage.sail(30.0).ask(requests.SetMode(modes.MISSION.number))
    voyage.sail(120.0)
    assert voyage.state.mission.current == 1
    distances_m = np.hypot(voyage["north_m"] - 80.0, voyage["east_m"])
    assert distances_m.min() < 8.0
