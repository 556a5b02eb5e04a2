"""A dive whose vehicle waits for a depth that it does not reach."""

import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from ground.client.depth_progress import ASCENT_S, DepthProgress
from ground.missions.plans import Plan
from mavlink_io.errors import OperationError
from mavlink_io.mission_items import MavCmd, MissionItem

PLAN = Plan(
    (
        MissionItem(0, 2, MavCmd.DO_CHANGE_ALTITUDE),
        MissionItem(1, 3, MavCmd.CONDITION_CHANGE_ALT),
        MissionItem(2, 2, MavCmd.NAV_DELAY),
        MissionItem(3, 3, MavCmd.NAV_WAYPOINT),
    ),
    ("step 1", "step 1", "step 2", "step 3"),
)


class Vehicle:
    """Stands in for the client: mode, current item and depth of the last messages."""

    def __init__(self, mode: str, sequence: int = 0) -> None:
        self.mode, self.sequence, self.depth_m = mode, sequence, 0.7

    def latest(self, name: str) -> Any:
        if name == "MISSION_CURRENT":
            return SimpleNamespace(seq=self.sequence)
        assert name == "LOCAL_POSITION_NED"
        return SimpleNamespace(z=self.depth_m)


def waited_s(vehicle: Vehicle, depth_rate_mps: float = 0.0, wave_m: float = 0.0) -> float:
    """Return the time after which a dive is given up; raises AssertionError if it is not."""
    progress, first_m = DepthProgress(PLAN, Path("dive.mcap")), vehicle.depth_m
    for time_s in range(0, int(4.0 * ASCENT_S), 7):
        vehicle.depth_m = first_m + depth_rate_mps * time_s + wave_m * math.sin(time_s)
        try:
            progress.update(vehicle, float(time_s))  # type: ignore[arg-type]
        except OperationError:
            return time_s
    raise AssertionError("not given up")


@pytest.mark.parametrize("wave_m", [0.0, 0.5])
def test_ascent_without_change_of_depth_is_given_up(wave_m: float) -> None:
    """The vehicle of `combined` in `estuary` moved up and down by 0.5 m at 1.2 m."""
    assert ASCENT_S < waited_s(Vehicle("SURFACE"), wave_m=wave_m) < ASCENT_S + 60.0


def test_item_whose_depth_is_not_reached_is_given_up() -> None:
    vehicle = Vehicle("MISSION", sequence=1)
    vehicle.depth_m = 0.2
    progress = DepthProgress(PLAN, Path("dive.mcap"))
    progress.update(vehicle, 10.0)  # type: ignore[arg-type]
    reason = r"0\.2 m deep in step 1 of 3, .* for 1800 s: .*kept in dive\.mcap"
    with pytest.raises(OperationError, match=reason):
        progress.update(vehicle, 11.0 + ASCENT_S)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("mode", "sequence"), [("MISSION", 2), ("MISSION", 3), ("HOLD", 1), ("RTL", 1), ("STATION", 1)]
)
def test_vehicle_that_waits_for_no_depth_is_not_given_up(mode: str, sequence: int) -> None:
    """A leg, a waypoint at any distance, and modes in which an operator may leave it."""
    with pytest.raises(AssertionError, match="not given up"):
        waited_s(Vehicle(mode, sequence))


@pytest.mark.parametrize("vehicle", [Vehicle("SURFACE"), Vehicle("MISSION", sequence=1)])
def test_slow_change_of_depth_is_not_given_up(vehicle: Vehicle) -> None:
    with pytest.raises(AssertionError, match="not given up"):
        waited_s(vehicle, depth_rate_mps=0.001)
