"""What the instruments tell, against motions worked out by hand."""

import math
from typing import Any

import numpy as np
import pytest

from link.frames import quaternion_from_euler, rotate
from link.records import SENSORS_ALL, ActuatorFrame
from sitl import environment, plant, scenario, sensors
from sitl.sensors import Biases, Sensors
from sitl.truth import Truth
from sitl.vehicle import config

SEA = environment.build(scenario.load("calm"), 9.81, plant.TICK_S)
UNBIASED = Biases((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
AT_REST = Truth(
    time_us=0,
    position_ned_m=(0.0, 0.0, 5.0),
    attitude_q=(1.0, 0.0, 0.0, 0.0),
    velocity_ned_mps=(0.0, 0.0, 0.0),
    rates_radps=(0.0, 0.0, 0.0),
    specific_force_mps2=(0.0, 0.0, -9.81),
    water_velocity_ned_mps=(0.0, 0.0, 0.0),
    rudder_rad=0.0,
    elevator_rad=0.0,
    propeller_rps=0.0,
    pitch_disturbance_nm=0.0,
    yaw_disturbance_nm=0.0,
)


def read(truth: Truth, biases: Biases = UNBIASED, seed: int = 1) -> Sensors:
    return sensors.sample(truth, SEA, biases, plant.random_streams(seed).sensors)


def many(truth: Truth, count: int = 4000) -> Any:
    streams = plant.random_streams(seed=3).sensors
    return np.array([sensors.sample(truth, SEA, UNBIASED, streams).frame for _ in range(count)])


def test_means_are_true_and_spreads_are_those_of_the_instruments() -> None:
    samples = many(AT_REST._replace(rates_radps=(0.01, -0.02, 0.03)))
    columns = dict(zip(sensors.SensorFrame._fields, samples.T, strict=True))
    # Density times the square root of half the sample rate: 5 in all.
    expected = {
        "accel_z_mps2": (-9.81, 5.0 * 60e-6 * 9.80665),
        "gyro_x_radps": (0.01, 5.0 * math.radians(0.01)),
        "gyro_z_radps": (0.03, 5.0 * math.radians(0.01)),
        "mag_z_gauss": (0.52 * math.sin(math.radians(67.0)), 5.0 * 0.2e-3),
        "pressure_hpa": (1013.25 + 1025.0 * 9.81 * 5.0 / 100.0, 0.5),
        "pressure_altitude_m": (-5.0, 0.5 * 100.0 / (1025.0 * 9.81)),
        "temperature_degc": (10.0, 0.01),
    }
    for name, (mean, spread) in expected.items():
        assert columns[name].mean() == pytest.approx(mean, abs=4.0 * spread / math.sqrt(4000)), name
        assert columns[name].std() == pytest.approx(spread, rel=0.05), name
    assert set(columns["fields_updated"]) == {SENSORS_ALL}


@pytest.mark.parametrize("heading_deg", [0.0, 77.0, -135.0])
def test_the_compass_shows_heading_less_declination(heading_deg: float) -> None:
    frame = read(AT_REST._replace(attitude_q=quaternion_from_euler(0.0, 0.0, math.radians(heading_deg)))).frame
    magnetic = math.degrees(math.atan2(-frame.mag_y_gauss, frame.mag_x_gauss))
    assert (magnetic - 14.4 - heading_deg + 180.0) % 360.0 - 180.0 == pytest.approx(0.0, abs=1.5)


def test_biases_are_drawn_once_a_run_and_added() -> None:
    biases = sensors.draw_biases(plant.random_streams(seed=5).sensors.biases)
    assert biases == sensors.draw_biases(plant.random_streams(seed=5).sensors.biases)
    assert biases != sensors.draw_biases(plant.random_streams(seed=6).sensors.biases)
    plain, biased = read(AT_REST).frame, read(AT_REST, biases).frame
    shifts = np.array(biased[1:10]) - np.array(plain[1:10])
    expected = [*biases.accelerometer_mps2, *biases.gyro_radps, *biases.magnetometer_gauss]
    np.testing.assert_allclose(shifts, expected, atol=1e-12)


def test_gps_is_heard_five_times_a_second_at_the_surface_only() -> None:
    surfaced = AT_REST._replace(position_ned_m=(30.0, -40.0, 0.2))
    assert read(surfaced._replace(time_us=20_000)).gps is None
    assert read(AT_REST).gps is None
    fix = read(surfaced).gps
    assert fix is not None
    # 111.2 km a degree of latitude; a fix strays a few metres.
    assert (fix.lat_deg - 42.35) * 111_195 == pytest.approx(30.0, abs=6.0)
    assert (fix.lon_deg + 71.0) * 111_195 * math.cos(math.radians(42.35)) == pytest.approx(-40.0, abs=6.0)


@pytest.mark.parametrize(
    ("depth_m", "pitch_deg", "range_m"),
    [(5.0, 0.0, 15.0), (5.0, 30.0, 15.0 / math.cos(math.radians(30.0))), (19.8, 0.0, None), (5.0, 80.0, None)],
)
def test_the_altimeter_sees_the_floor_within_range_and_tilt(depth_m: float, pitch_deg: float, range_m: float) -> None:
    attitude = quaternion_from_euler(0.0, math.radians(pitch_deg), 0.0)
    echo = read(AT_REST._replace(position_ned_m=(0.0, 0.0, depth_m), attitude_q=attitude)).altimeter
    assert (echo is None) == (range_m is None)
    if echo is not None:
        assert echo.range_m == pytest.approx(range_m, abs=0.1)


def test_one_instrument_more_or_less_leaves_the_others_as_they_were() -> None:
    """A surfaced vehicle draws for GPS too; what the gyro says afterwards is the same."""
    readings = []
    for depth_m in (0.2, 0.6):
        streams = plant.random_streams(seed=2).sensors
        truth = AT_REST._replace(position_ned_m=(0.0, 0.0, depth_m))
        sensors.sample(truth, SEA, UNBIASED, streams)
        readings.append(sensors.sample(truth._replace(time_us=20_000), SEA, UNBIASED, streams).frame[1:10])
    assert readings[0] == readings[1]


def test_specific_force_is_acceleration_less_gravity_during_a_manoeuvre() -> None:
    """Differences of the true velocity, which is worked out another way, against the accelerometer's ideal."""
    dive = scenario.Scenario(start=scenario.Start(depth_m=10.0, speed_mps=1.3))
    sea = plant.build(config.load("field"), dive)
    rng = plant.random_streams(seed=1)
    state, _ = plant.launch(sea, rng)
    truths = []
    for _ in range(400):
        state, _ = plant.step(sea, state, ActuatorFrame(0, 1, (0.9, 0.6, 0.58, *(0.0,) * 13), 129), rng)
        truths.append(state.truth)
    velocity = np.array([truth.velocity_ned_mps for truth in truths])
    force = np.array([rotate(truth.attitude_q, truth.specific_force_mps2) for truth in truths])
    acceleration = (velocity[2:] - velocity[:-2]) / (2.0 * plant.TICK_S)
    gravity = (0.0, 0.0, sea.sea.gravity_mps2)
    np.testing.assert_allclose(force[1:-1] + gravity, acceleration, atol=2e-4)
    assert np.max(np.abs(acceleration)) > 0.02
