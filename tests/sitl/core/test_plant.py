"""The plant's step: purity, repeatability, signs, and initial conditions."""

import math
from collections.abc import Iterator

import numpy as np
import pytest
from msgspec.structs import replace

from mavlink_io.frames import euler_from_quaternion
from mavlink_io.records import ActuatorFrame
from mavlink_io.tick import TICK_S
from sitl import scenario
from sitl.core import plant
from sitl.core.plant import Plant, PlantState
from sitl.core.sensors import Sensors
from sitl.environment_schema import CurrentConfig
from sitl.scenario import Scenario, StartTable
from sitl.vehicle import config

TICKS_PER_S = round(1.0 / TICK_S)


def put(vehicle: str, sea: Scenario) -> Plant:
    return plant.build(config.load(vehicle), sea)


def actuators(rudder: float = 0.0, elevator: float = 0.0, thrust: float = 0.0) -> ActuatorFrame:
    return ActuatorFrame(0, 1, (rudder, elevator, thrust, *(0.0,) * 13), 129)


def fly(
    sea: Plant, frame: ActuatorFrame, seconds: float, seed: int = 1
) -> Iterator[tuple[PlantState, Sensors]]:
    rng = plant.random_streams(seed)
    state, reading = plant.initial_state(sea, rng)
    yield state, reading
    for _ in range(round(seconds * TICKS_PER_S)):
        state, reading = plant.step(sea, state, frame, rng)
        yield state, reading


def last(flight: Iterator[tuple[PlantState, Sensors]]) -> PlantState:
    *_, (state, _) = flight
    return state


UNDER_WAY = Scenario(start=StartTable(depth_m=10.0, speed_mps=1.3))


def test_readings_depend_on_seed_only() -> None:
    sea = put("caribou_truth", scenario.load("disturbed"))
    flights = [
        [reading for _, reading in fly(sea, actuators(thrust=0.58), 5.0, seed)]
        for seed in (4, 4, 5)
    ]
    assert flights[0] == flights[1]
    assert flights[0] != flights[2]


def test_step_does_not_modify_its_state() -> None:
    sea = put("caribou_truth", UNDER_WAY)
    before = last(fly(sea, actuators(0.5, 0.5, 0.58), 2.0))
    kept = before.values.copy()
    twice = [
        plant.step(sea, before, actuators(-1.0, 1.0, 0.3), plant.random_streams(9))
        for _ in range(2)
    ]
    np.testing.assert_array_equal(before.values, kept)
    assert twice[0][0].truth == twice[1][0].truth
    assert twice[0][1] == twice[1][1]


def test_vehicle_time_starts_at_zero_with_20_ms_ticks() -> None:
    times = [
        reading.frame.time_us
        for _, reading in fly(put("caribou_nominal", Scenario()), actuators(), 0.1)
    ]
    assert times == [0, 20_000, 40_000, 60_000, 80_000, 100_000]


def test_positive_controls_turn_starboard_and_pitch_up() -> None:
    sea = put("caribou_nominal", UNDER_WAY)
    third = 5.0 / 15.0
    straight = euler_from_quaternion(
        *last(fly(sea, actuators(0.0, 0.0, 0.58), 5.0)).truth.attitude_q
    )
    turned = euler_from_quaternion(
        *last(fly(sea, actuators(third, 0.0, 0.58), 5.0)).truth.attitude_q
    )
    lifted = euler_from_quaternion(
        *last(fly(sea, actuators(0.0, third, 0.58), 5.0)).truth.attitude_q
    )
    assert turned[2] > straight[2] + math.radians(5.0)
    assert lifted[1] > straight[1] + math.radians(5.0)


def test_true_vehicle_has_rudder_bias_only() -> None:
    truth = last(
        fly(put("caribou_truth", UNDER_WAY), actuators(rudder=5.0 / 15.0, thrust=0.58), 5.0)
    ).truth
    assert math.degrees(truth.rudder_rad) == pytest.approx(-1.0, abs=0.01)
    assert truth.elevator_rad == 0.0


@pytest.mark.parametrize("vehicle", ["caribou_nominal", "caribou_truth"])
def test_initial_floating_trim_is_an_equilibrium(vehicle: str) -> None:
    sea = put(vehicle, Scenario(start=StartTable(heading_deg=77.0)))
    truths = [state.truth for state, _ in fly(sea, actuators(), 120.0)]
    roll, pitch, yaw = euler_from_quaternion(*truths[0].attitude_q)
    assert roll == pytest.approx(0.0, abs=1e-12)
    assert math.degrees(yaw) == pytest.approx(77.0)
    assert abs(math.degrees(pitch)) < 2.0
    assert 0.1 < truths[0].position_ned_m[2] < 0.27
    assert truths[0].specific_force_mps2[2] == pytest.approx(
        -sea.sea.gravity_mps2 * math.cos(pitch), abs=1e-6
    )
    for truth in truths[:: 10 * TICKS_PER_S]:
        np.testing.assert_allclose(truth.position_ned_m, truths[0].position_ned_m, atol=1e-3)
        np.testing.assert_allclose(truth.rates_radps, 0.0, atol=1e-6)


def test_drifting_vehicle_moves_with_current() -> None:
    current = (0.3 * math.cos(0.4), 0.3 * math.sin(0.4), 0.0)
    flowing = CurrentConfig(speed_mps=0.3, towards_deg=math.degrees(0.4))
    adrift = Scenario(start=StartTable(depth_m=10.0, heading_deg=40.0), current=flowing)
    carried = [state.truth for state, _ in fly(put("caribou_nominal", adrift), actuators(), 20.0)]
    still = Scenario(start=StartTable(depth_m=10.0, heading_deg=40.0))
    resting = [state.truth for state, _ in fly(put("caribou_nominal", still), actuators(), 20.0)]
    for moving, resting_ in zip(carried[::50], resting[::50], strict=True):
        seconds = moving.time_us * 1e-6
        expected = np.array(resting_.position_ned_m) + seconds * np.array(current)
        np.testing.assert_allclose(moving.position_ned_m, expected, atol=1e-9)
        np.testing.assert_allclose(moving.rates_radps, resting_.rates_radps, atol=1e-12)
        np.testing.assert_allclose(
            moving.specific_force_mps2, resting_.specific_force_mps2, atol=1e-9
        )


def test_scenario_sets_initial_depth_and_speed() -> None:
    under_way = Scenario(start=StartTable(depth_m=4.0, speed_mps=1.3, heading_deg=90.0))
    state, _ = next(fly(put("caribou_nominal", under_way), actuators(), 0.0))
    np.testing.assert_allclose(state.truth.position_ned_m, (0.0, 0.0, 4.0), atol=1e-12)
    np.testing.assert_allclose(state.truth.velocity_ned_mps, (0.0, 1.3, 0.0), atol=1e-12)


def test_heavy_vehicle_starts_at_surface_and_sinks() -> None:
    vehicle = config.load("caribou_nominal")
    heavy = replace(vehicle, ballast=replace(vehicle.ballast, net_buoyancy_n=-20.0))
    depths = [
        state.truth.position_ned_m[2]
        for state, _ in fly(plant.build(heavy, Scenario()), actuators(), 10.0)
    ]
    assert depths[0] == pytest.approx(0.2667)
    assert depths[-1] > depths[0] + 0.1


def test_nan_control_is_zero_and_large_control_is_limited() -> None:
    sea = put("caribou_nominal", UNDER_WAY)
    nothing = last(fly(sea, actuators(math.nan, math.nan, math.nan), 1.0)).truth
    assert nothing == last(fly(sea, actuators(), 1.0)).truth
    assert (
        last(fly(sea, actuators(9.0, -9.0, 9.0), 2.0)).truth
        == last(fly(sea, actuators(1.0, -1.0, 1.0), 2.0)).truth
    )


def test_clamped_body_rests_and_encoder_measures_duct() -> None:
    bench = scenario.load("bench")
    flight = list(fly(put("caribou_truth", bench), actuators(rudder=0.5, thrust=1.0), 4.0))
    (first, _), (end, _) = flight[0], flight[-1]
    assert np.array_equal(first.body, end.body)
    assert math.hypot(*end.truth.specific_force_mps2) == pytest.approx(9.80665, abs=1e-3)
    assert math.degrees(end.truth.rudder_rad) == pytest.approx(7.5 - 6.0, abs=0.2)
    assert end.truth.propeller_rps > 0.0
    angles = [reading.duct for _, reading in flight if reading.duct is not None]
    assert 15.0 * angles[-1].rudder == pytest.approx(math.degrees(end.truth.rudder_rad), abs=0.5)
    assert all(
        reading.duct is None
        for _, reading in fly(put("caribou_truth", Scenario()), actuators(), 1.0)
    )
