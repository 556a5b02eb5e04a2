"""Estimator against motions with known truth."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from autopilot.control import estimator
from autopilot.control.params import Config
from autopilot.control.types import PRESSURE_HELD, Home, Inputs, VehicleEstimate
from mavlink_io.frames import offset_to_geodetic, wrap_pi
from mavlink_io.records import GYRO_FRESH, PRESSURE_FRESH, GpsFix
from tests.helpers.missions import TICK_US, sensors

NO_HOME = Home()


def run(
    estimate: VehicleEstimate, seconds: float, thrust: float = 0.0, **reading: object
) -> VehicleEstimate:
    for k in range(round(seconds * 50)):
        sample = sensors((k + 1) * TICK_US, **reading)  # type: ignore[arg-type]
        estimate = estimator.update(
            estimate, Inputs(sample, None, None, None), thrust, NO_HOME, Config(), 0.02
        )
    return estimate


@given(
    roll=st.floats(-0.5, 0.5),
    pitch=st.floats(-1.2, 1.2),
    heading=st.floats(-3.14, 3.14),
    depth_m=st.floats(0.0, 50.0),
)
def test_initial_estimate_any_attitude_is_exact(
    roll: float, pitch: float, heading: float, depth_m: float
) -> None:
    estimate = estimator.initial_estimate(
        sensors(0, roll=roll, pitch=pitch, heading=heading, depth_m=depth_m), Config()
    )
    assert estimate.roll_rad == pytest.approx(roll, abs=1e-9)
    assert estimate.pitch_rad == pytest.approx(pitch, abs=1e-9)
    assert abs(wrap_pi(estimate.heading_rad - heading)) < 1e-9
    assert estimate.depth_m == pytest.approx(depth_m, abs=1e-9)


def test_attitude_wrong_start_converges() -> None:
    wrong = estimator.initial_estimate(sensors(0, roll=0.2, pitch=-0.2, heading=1.0), Config())
    estimate = run(wrong, 120.0, roll=-0.05, pitch=0.1, heading=0.8)
    assert estimate.roll_rad == pytest.approx(-0.05, abs=2e-3)
    assert estimate.pitch_rad == pytest.approx(0.1, abs=2e-3)
    assert estimate.heading_rad == pytest.approx(0.8, abs=2e-3)


def test_gyro_bias_constant_is_estimated_and_removed() -> None:
    bias = (0.002, -0.003, 0.004)
    estimate = run(estimator.initial_estimate(sensors(0), Config()), 300.0, rates=bias)
    assert estimate.gyro_bias_radps == pytest.approx(bias, abs=1e-4)
    assert estimate.r_radps == pytest.approx(0.0, abs=1e-4)
    assert estimate.heading_rad == pytest.approx(0.0, abs=1e-3)


def test_attitude_steady_turn_keeps_roll() -> None:
    """A level turn at 1.3 m/s and 10 deg/s tilts the specific force by 1.3 deg."""
    rate, speed, config = math.radians(10.0), 1.3, Config()
    estimate = estimator.initial_estimate(sensors(0), config)._replace(speed_mps=speed)
    for k in range(1, 3000):
        level = sensors(k * TICK_US, heading=wrap_pi(rate * 0.02 * k), rates=(0.0, 0.0, rate))
        turning = level._replace(accel_y_mps2=level.accel_y_mps2 + rate * speed)
        estimate = estimator.update(
            estimate, Inputs(turning, None, None, None), 0.58, NO_HOME, config, 0.02
        )
    assert abs(estimate.roll_rad) < math.radians(0.05)
    assert abs(estimate.pitch_rad) < math.radians(0.05)


def test_wrong_gyro_that_is_excluded_leaves_neither_angle_nor_rate() -> None:
    """Before, the angle of 12 deg that it left was estimated as a rate of 20 deg/s."""
    wrong = (0.0, math.radians(4.0), math.radians(4.0))
    estimate = run(estimator.initial_estimate(sensors(0), Config()), 8.0, rates=wrong)
    assert abs(estimate.pitch_rad) > math.radians(8.0)
    for k in range(50):
        reading = sensors((400 + k) * TICK_US)
        reading = reading._replace(fields_updated=reading.fields_updated & ~GYRO_FRESH)
        estimate = estimator.update(
            estimate, Inputs(reading, None, None, None), 0.0, NO_HOME, Config(), 0.02
        )
        assert abs(estimate.pitch_rad) < math.radians(2.5)
        assert max(map(abs, (estimate.q_radps, estimate.r_radps))) < math.radians(4.0)


def test_depth_constant_rate_is_tracked_without_lag() -> None:
    estimate = estimator.initial_estimate(sensors(0, depth_m=1.0), Config())
    for k in range(1, 1000):
        reading = sensors(k * TICK_US, depth_m=1.0 + 0.3 * 0.02 * k)
        estimate = estimator.update(
            estimate, Inputs(reading, None, None, None), 0.0, NO_HOME, Config(), 0.02
        )
    assert estimate.depth_rate_mps == pytest.approx(0.3, abs=1e-3)
    assert estimate.depth_m == pytest.approx(1.0 + 0.3 * 0.02 * 999, abs=2e-3)


@pytest.mark.parametrize(("period", "tolerance_mps"), [(5, 0.002), (25, 0.02), (130, 0.1)])
def test_depth_rate_follows_a_slow_sensor(period: int, tolerance_mps: float) -> None:
    """10 Hz, 2 Hz and one reading in 2.6 s, with the last reading held for 0.5 s.

    Before, the held reading stopped the rate: 0.0 of 0.3 m/s were left after 0.5 s of it. Without
    a reading the rate decays with 10 s, and a reading corrects by the mean error: 0.09 of 0.3 m/s.
    """
    estimate, held = estimator.initial_estimate(sensors(0, depth_m=1.0), Config()), 1.0
    errors = []
    for k in range(1, 2000):
        is_new, last = k % period == 0, k - k % period
        held = 1.0 + 0.3 * 0.02 * last
        reading = sensors(k * TICK_US, depth_m=held)
        fields = reading.fields_updated
        if not is_new:
            is_used = (k - last) * 0.02 <= Config().health_lost_s
            fields = fields | PRESSURE_HELD if is_used else fields & ~PRESSURE_FRESH
        reading = reading._replace(fields_updated=fields)
        estimate = estimator.update(
            estimate, Inputs(reading, None, None, None), 0.0, NO_HOME, Config(), 0.02
        )
        errors.append(estimate.depth_rate_mps - 0.3)
    assert max(map(abs, errors[1000:])) < tolerance_mps


def test_depth_sensor_that_returns_with_an_offset_moves_the_depth_not_its_rate() -> None:
    """Before, 7 m of difference gave a rate of 12 m/s, and 160 m when the sensor was lost again."""
    estimate = estimator.initial_estimate(sensors(0, depth_m=5.0), Config())
    rates_mps = []
    for k in range(1, 1000):
        reading = sensors(k * TICK_US, depth_m=5.0 if k < 100 else 12.0)
        if 100 <= k < 400 or k > 500:
            reading = reading._replace(fields_updated=reading.fields_updated & ~PRESSURE_FRESH)
        estimate = estimator.update(
            estimate, Inputs(reading, None, None, None), 0.0, NO_HOME, Config(), 0.02
        )
        rates_mps.append(abs(estimate.depth_rate_mps))
    assert max(rates_mps) < 0.01
    assert estimate.depth_m == pytest.approx(12.0, abs=0.01)


@pytest.mark.parametrize("time_s", [0.7, 0.4])
def test_depth_rate_in_waves_contains_the_heave_of_the_water(time_s: float) -> None:
    """A vehicle that heaves with the water of deep waves measures no change of pressure.

    Reference, with the triple pole w = 1 / EST_DPT_TIME, the accelerometer's part of the estimated
    rate: s^2 (s + 3 w) / (s + w)^3 times the true one. 0.87 of it with 0.7 s and waves of 6 s, 0.42
    with 0.4 s. Tolerance: steps of 0.02 s.
    """
    radps, amplitude_m = 2.0 * math.pi / 6.0, 0.1
    config = Config(depth_time_s=time_s)
    estimate = estimator.initial_estimate(sensors(0, depth_m=3.0), config)
    rates_mps = []
    for k in range(1, 3000):
        down_mps2 = -amplitude_m * radps**2 * math.sin(radps * 0.02 * k)
        level = sensors(k * TICK_US, depth_m=3.0)
        reading = level._replace(accel_z_mps2=level.accel_z_mps2 + down_mps2)
        estimate = estimator.update(
            estimate, Inputs(reading, None, None, None), 0.0, NO_HOME, config, 0.02
        )
        rates_mps.append(estimate.depth_rate_mps)
    pole = 1.0 / time_s
    ratio = radps**2 * math.hypot(radps, 3.0 * pole) / math.hypot(radps, pole) ** 3
    assert max(rates_mps[-300:]) == pytest.approx(ratio * amplitude_m * radps, rel=0.03)


def test_speed_cruise_thrust_settles_at_cruise_speed() -> None:
    assert run(
        estimator.initial_estimate(sensors(0), Config()), 200.0, thrust=0.58
    ).speed_mps == pytest.approx(1.3, rel=1e-3)


def test_position_fix_replaces_dead_reckoning() -> None:
    start = estimator.initial_estimate(sensors(0, heading=math.pi / 2), Config())._replace(
        speed_mps=1.3
    )
    estimate = run(start, 100.0, thrust=0.58, heading=math.pi / 2)
    assert estimate.east_m == pytest.approx(130.0, rel=0.01)
    assert abs(estimate.north_m) < 0.5
    assert estimate.position_sd_m > 10.0
    lat, lon = offset_to_geodetic(5.0, 120.0, 42.35, -71.0)
    fix = GpsFix(0, 3, lat, lon, 0.0, 0.0, 0.0, 0.0, 10)
    seen = Inputs(sensors(0, heading=math.pi / 2), fix, None, None)
    estimate = estimator.update(estimate, seen, 0.58, Home(42.35, -71.0, True), Config(), 0.02)
    assert estimate.east_m == pytest.approx(120.0, abs=0.01)
    assert estimate.north_m == pytest.approx(5.0, abs=0.01)
    assert estimate.position_sd_m < 5.0
