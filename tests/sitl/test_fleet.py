"""Several vehicles in one sea: the same water for all, and noise of its own for each."""

from dataclasses import dataclass

import pytest

from mavlink_io.errors import InputError
from mavlink_io.records import ActuatorFrame
from sitl import scenario
from sitl.cli import _parse_place
from sitl.core import plant
from sitl.core.draws import AT_START, DRIFT, SLOW
from sitl.core.plant import RandomStreams
from sitl.vehicle import config

NEUTRAL = ActuatorFrame(time_us=0, flags=0, controls=(0.0, 0.0, 0.0), mode=0)


@dataclass
class Run:
    """A simulation that floats without thrust."""

    streams: RandomStreams
    place_m: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        site = scenario.with_place(scenario.load("swell"), *self.place_m)
        self.plant = plant.build(config.load("caribou_truth"), site)
        self.state, self.sensors = plant.initial_state(self.plant, self.streams)

    def step(self, ticks: int) -> None:
        for _ in range(ticks):
            self.state, self.sensors = plant.step(self.plant, self.state, NEUTRAL, self.streams)


def test_same_sea_seed_gives_same_waves_and_current_and_other_noise() -> None:
    first, second, third = (
        Run(plant.random_streams(seed, sea)) for seed, sea in ((1, 7), (2, 7), (1, 8))
    )
    assert first.state.truth.surface_m == second.state.truth.surface_m
    water_mps = [run.state.truth.water_velocity_ned_mps for run in (first, second, third)]
    assert water_mps[0] == water_mps[1] != water_mps[2]
    assert first.sensors.frame != second.sensors.frame, "own sensors"
    one, two, other = (plant.random_streams(*seeds).draws for seeds in ((1, 7), (2, 7), (1, 8)))
    for draws in (one, two, other):
        draws.prepare(AT_START)
    currents = [draws.normals(DRIFT, AT_START) for draws in (one, two, other)]
    assert currents[0] == currents[1] != currents[2]
    assert one.normals(SLOW, 8) != two.normals(SLOW, 8), "own moments"


def test_waves_differ_between_places_of_one_sea() -> None:
    near, far = (Run(plant.random_streams(1, 7), place_m) for place_m in ((0.0, 0.0), (13.0, 40.0)))
    assert near.state.truth.surface_m != far.state.truth.surface_m


def test_sea_seed_that_equals_the_seed_changes_nothing() -> None:
    runs = [Run(plant.random_streams(3)), Run(plant.random_streams(3, 3))]
    for run in runs:
        run.step(2)
    assert runs[0].sensors.frame == runs[1].sensors.frame


def test_vehicle_starts_at_its_place() -> None:
    run = Run(plant.random_streams(1), (120.0, -30.0))
    north_m, east_m = run.state.truth.position_ned_m[:2]
    assert (north_m, east_m) == pytest.approx((120.0, -30.0), abs=0.1)


@pytest.mark.parametrize("text", ["1", "1,2,3", "a,b", "nan,0", "0,1e9"])
def test_place_that_is_no_pair_of_metres_is_refused(text: str) -> None:
    with pytest.raises(InputError, match="expected NORTH,EAST"):
        _parse_place(text)
    assert _parse_place("10,-2.5") == (10.0, -2.5)
