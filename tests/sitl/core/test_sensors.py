"""Sensor output compared with hand-calculated motions and with the data sheets."""

import math
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace

from mavlink_io.frames import flip, flip_quaternion, quaternion_from_euler, rotate
from mavlink_io.records import SENSORS_ALL, ActuatorFrame, SensorFrame
from mavlink_io.tick import TICK_S
from sitl import scenario
from sitl.core import environment, plant
from sitl.core import state as layout
from sitl.core.plant import Plant, PlantState
from sitl.core.sensors import Sensors
from sitl.core.truth import Truth
from sitl.vehicle import config
from sitl.vehicle.config import Instruments, VehicleFileError
from sitl.vehicle.dynamics import POSITION, QUATERNION

TRUE_VEHICLE = config.load("caribou_truth")
SEA = environment.build(scenario.load("calm"), 9.81, TICK_S)
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


def held_with(**instruments: str) -> Plant:
    """Return a vehicle with other sensors that is held in place."""
    vehicle = replace(TRUE_VEHICLE, instruments=Instruments(**instruments))
    return plant.build(vehicle, scenario.Scenario(rig=scenario.Rig(clamped=True)))


def moved_to(truth: Truth, state: PlantState) -> PlantState:
    """Return the state with another true motion."""
    values = state.values.copy()
    parts = layout.parts(state.layout, values)
    parts.body[POSITION] = flip(*truth.position_ned_m)
    parts.body[QUATERNION] = flip_quaternion(*truth.attitude_q)
    parts.body[plant.RATES] = flip(*truth.rates_radps)
    for start, vector in (
        (layout.VELOCITY, truth.velocity_ned_mps),
        (layout.FORCE, truth.specific_force_mps2),
        (layout.WATER_VELOCITY, truth.water_velocity_ned_mps),
    ):
        parts.motion[start : start + 3] = flip(*vector)
    return state._replace(values=values)


def readings(truth: Truth, ticks: int, held: Plant | None = None, seed: int = 1) -> list[Sensors]:
    """Return the output of ticks while the vehicle's state is constant."""
    held = held or held_with()
    rng = plant.random_streams(seed)
    state, _ = plant.initial_state(held, rng)
    state, output = moved_to(truth, state), []
    for _ in range(ticks):
        state, reading = plant.step(held, state, ActuatorFrame(0, 1, (0.0, 0.0, 0.0), 129), rng)
        output.append(reading)
    return output


def test_noise_matches_data_sheets_every_tick() -> None:
    samples: Any = np.array([reading.frame for reading in readings(AT_REST, 4000)])
    columns = dict(zip(SensorFrame._fields, samples.T, strict=True))
    # Density times the square root of half the sample rate: 5 in all.
    expected = {
        "accel_z_mps2": 5.0 * 60e-6 * 9.80665,
        "gyro_x_radps": 5.0 * math.radians(0.01),
        "gyro_z_radps": 5.0 * math.radians(0.01),
        "mag_z_gauss": 5.0 * 0.2e-3,
        "pressure_hpa": math.hypot(0.5, 0.2 / math.sqrt(12.0)),
        "temperature_degc": 0.01,
    }
    for name, spread in expected.items():
        assert columns[name].std() == pytest.approx(spread, rel=0.05), name
    assert set(columns["fields_updated"]) == {SENSORS_ALL}


def test_turn_on_errors_over_runs_match_data_sheets() -> None:
    runs = 300
    truth = AT_REST._replace(rates_radps=(0.01, -0.02, 0.03))
    samples: Any = np.array([readings(truth, 1, seed=seed)[0].frame for seed in range(runs)])
    columns = dict(zip(SensorFrame._fields, samples.T, strict=True))
    milli_g = 9.80665e-3
    tilt_and_scale = 9.81 * math.hypot(3e-4, 0.0)
    expected = {
        "accel_z_mps2": (-9.81, math.hypot(0.5 * milli_g, 0.3 * milli_g, tilt_and_scale)),
        "gyro_z_radps": (0.03, 5.0 * math.radians(0.01)),
        "mag_z_gauss": (0.52 * math.sin(math.radians(67.0)), math.hypot(1e-3, 0.5e-3, 0.48e-3)),
        "pressure_hpa": (1013.25 + 1025.0 * 9.80665 * 5.0 / 100.0, math.hypot(0.5, 0.5)),
    }
    for name, (mean, spread) in expected.items():
        assert columns[name].mean() == pytest.approx(mean, abs=4.0 * spread / math.sqrt(runs)), name
        assert columns[name].std() == pytest.approx(spread, rel=0.15), name


@pytest.mark.parametrize("heading_deg", [0.0, 77.0, -135.0])
def test_magnetometer_shows_heading_minus_declination(heading_deg: float) -> None:
    attitude = quaternion_from_euler(0.0, 0.0, math.radians(heading_deg))
    frame = readings(AT_REST._replace(attitude_q=attitude), 1)[0].frame
    magnetic = math.degrees(math.atan2(-frame.mag_y_gauss, frame.mag_x_gauss))
    assert (magnetic - 14.4 - heading_deg + 180.0) % 360.0 - 180.0 == pytest.approx(0.0, abs=1.5)


def test_sensor_errors_depend_on_seed_only() -> None:
    first, again, other = (repr(readings(AT_REST, 20, seed=seed)) for seed in (5, 5, 6))
    assert first == again
    assert first != other


def test_sensor_errors_are_independent_of_other_sensors() -> None:
    plain = readings(AT_REST, 200)
    bare = readings(
        AT_REST,
        200,
        held_with(gps="none", dvl="none", altimeter="none", battery="none", leak="none"),
    )
    rich = readings(AT_REST, 200, held_with(encoder="as5048"))
    assert [r.frame for r in bare] == [r.frame for r in plain] == [r.frame for r in rich]
    assert [r.dvl for r in rich] == [r.dvl for r in plain]
    assert any(r.duct for r in rich)


def test_sensor_not_fitted_has_no_output() -> None:
    nothing = held_with(**dict.fromkeys(Instruments.__struct_fields__, "none"))
    for reading in readings(AT_REST, 60, nothing):
        assert reading.frame == SensorFrame(reading.frame.time_us, *(0.0,) * 13, 0, 0)
        assert set(reading[1:]) == {None}


def test_unknown_sensor_name_is_rejected() -> None:
    with pytest.raises(
        VehicleFileError, match=r"instruments\.dvl = 'a5O': unknown; known here: a50, .*none"
    ):
        held_with(dvl="a5O")


def test_specific_force_is_acceleration_minus_gravity() -> None:
    """Reference: finite differences of the true velocity."""
    dive = scenario.Scenario(start=scenario.StartTable(depth_m=10.0, speed_mps=1.3))
    sea = plant.build(TRUE_VEHICLE, dive)
    rng = plant.random_streams(seed=1)
    state, _ = plant.initial_state(sea, rng)
    truths = []
    for _ in range(400):
        state, _ = plant.step(
            sea, state, ActuatorFrame(0, 1, (0.9, 0.6, 0.58, *(0.0,) * 13), 129), rng
        )
        truths.append(state.truth)
    velocity = np.array([truth.velocity_ned_mps for truth in truths])
    force = np.array([rotate(truth.attitude_q, truth.specific_force_mps2) for truth in truths])
    acceleration = (velocity[2:] - velocity[:-2]) / (2.0 * TICK_S)
    gravity = (0.0, 0.0, sea.sea.gravity_mps2)
    np.testing.assert_allclose(force[1:-1] + gravity, acceleration, atol=2e-4)
    assert np.max(np.abs(acceleration)) > 0.02
