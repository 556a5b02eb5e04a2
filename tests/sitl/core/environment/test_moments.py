"""Disturbance moments compared with linear theory, and constants with textbook values."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import signal
from scipy.linalg import expm, solve_continuous_lyapunov

from mavlink_io.frames import euler_from_quaternion
from mavlink_io.jit import native
from mavlink_io.records import ActuatorFrame
from sitl import scenario
from sitl.core import environment, plant
from sitl.core.draws import AT_START, PER_TICK
from sitl.core.environment import moments
from sitl.core.plant import Plant
from sitl.environment_schema import FloorTable
from sitl.vehicle import build_model, config
from sitl.vehicle.linearise import linearise

TICK_S = 0.02
SWELL_RADPS = 2.0 * math.pi * 0.15
ZETA = 0.1
Matrix = NDArray[np.float64]


def sea_of(name: str) -> environment.Environment:
    return environment.build(scenario.load(name), 9.81, TICK_S)


def yaw_rate_rms_degps(
    filter_F: Matrix, filter_G: Matrix, filter_H: Matrix, moment_rms_nm: float
) -> float:
    """Return the rms yaw rate of the true vehicle's linear plane with fixed rudder.

    The moment is filtered white noise of a given rms. Lyapunov equation of plane and shaping
    filter: A P + P A' + B B' = 0.
    """
    plane = linearise(build_model.build(config.load("caribou_truth"))).yaw
    A = plane.A[:2, :2]
    by_moment = np.linalg.inv(plane.M)[:2, 1]
    n = len(filter_F)
    joint = np.block([[A, np.outer(by_moment, filter_H)], [np.zeros((n, 2)), filter_F]])
    noise = np.concatenate([np.zeros(2), filter_G])
    P = solve_continuous_lyapunov(joint, -np.outer(noise, noise))
    unit = math.sqrt(filter_H @ P[2:, 2:] @ filter_H)
    return math.degrees(math.sqrt(P[1, 1])) / unit * moment_rms_nm


def test_disturbed_levels_match_linear_theory() -> None:
    levels = scenario.load("disturbed").disturbance
    tau = levels.slow.time_constant_s
    omega, zeta = 2.0 * math.pi * levels.waves.frequency_hz, levels.waves.damping
    slow = yaw_rate_rms_degps(
        np.array([[-1.0 / tau]]),
        np.array([math.sqrt(2.0 / tau)]),
        np.array([1.0]),
        levels.slow.yaw_rms_nm,
    )
    wave = yaw_rate_rms_degps(
        np.array([[0.0, 1.0], [-(omega**2), -2.0 * zeta * omega]]),
        np.array([0.0, math.sqrt(4.0 * zeta * omega**3)]),
        np.array([1.0, 0.0]),
        levels.waves.yaw_rms_nm,
    )
    assert slow == pytest.approx(0.30, rel=0.005)
    assert wave == pytest.approx(0.30, rel=0.005)
    assert round(math.hypot(slow, wave), 2) == 0.42


def fly_through(sea: Plant, minutes: int) -> tuple[Matrix, Matrix]:
    """Return true yaw rates and yaw moments; duct centred, depth held at 100 m, 58 % thrust."""
    rng = plant.random_streams(seed=1)
    state, _ = plant.initial_state(sea, rng)
    truths = [state.truth]
    for _ in range(minutes * 60 * 50):
        truth = state.truth
        _, pitch, _ = euler_from_quaternion(*truth.attitude_q)
        elevator = (
            0.8 * (0.13 * (truth.position_ned_m[2] - 100.0) - pitch) - 1.9 * truth.rates_radps[1]
        )
        amidships = -sea.vessel.rudder.bias_rad / sea.vessel.rudder.travel_rad
        controls = (amidships, elevator / sea.vessel.elevator.travel_rad, 0.58, *(0.0,) * 13)
        state, _ = plant.step(sea, state, ActuatorFrame(truth.time_us, 1, controls, 129), rng)
        truths.append(state.truth)
    return np.array([t.rates_radps[2] for t in truths]), np.array(
        [t.yaw_disturbance_nm for t in truths]
    )


def linear_yaw_rates(moments_nm: Matrix) -> Matrix:
    """Return the response of the true vehicle's linear plane to the moments (zero-order hold)."""
    plane = linearise(build_model.build(config.load("caribou_truth"))).yaw
    by_moment = np.linalg.inv(plane.M)[:2, 1:2]
    held = signal.cont2discrete(
        (plane.A[:2, :2], by_moment, np.array([[0.0, 1.0]]), np.zeros((1, 1))), TICK_S
    )
    return np.asarray(signal.dlsim(held, moments_nm)[1][:, 0])


@pytest.mark.slow
def test_yaw_rate_in_disturbed_sea_matches_linear_theory() -> None:
    """Compare the nonlinear vehicle with the linear plane, without and with crossflow drag.

    Crossflow drag is the only force that linear theory lacks; it reduces the rate by a few percent.
    Over 40 minutes of one seed the rms of the moments is uncertain by about 2 %, hence the
    tolerance of the linear response.
    """
    disturbance = scenario.load("disturbed").disturbance
    start = scenario.StartTable(depth_m=100.0, speed_mps=1.3)
    deep = scenario.Scenario(start=start, floor=FloorTable(depth_m=200.0), disturbance=disturbance)
    sea = plant.build(config.load("caribou_truth"), deep)
    model = sea.vessel.model
    no_crossflow = model._replace(
        stations=model.stations._replace(drag_kgpm=np.zeros_like(model.stations.drag_kgpm))
    )
    vessel = sea.vessel._replace(model=no_crossflow)
    rates, moments = fly_through(sea._replace(vessel=vessel, native=native(vessel)), minutes=40)
    linear = np.std(linear_yaw_rates(moments))
    assert math.degrees(linear) == pytest.approx(0.42, rel=0.06)
    assert np.std(rates) == pytest.approx(linear, rel=0.02)
    assert 0.90 < np.std(fly_through(sea, minutes=40)[0]) / linear < 0.96


def test_second_order_discretisation_is_exact() -> None:
    wave = moments.second_order(SWELL_RADPS, ZETA, TICK_S)
    generator = np.array([[0.0, SWELL_RADPS], [-SWELL_RADPS, -2.0 * ZETA * SWELL_RADPS]])
    phi = np.array(wave.transition).reshape(2, 2)
    l11, l21, l22 = wave.noise
    lower = np.array([[l11, 0.0], [l21, l22]])
    np.testing.assert_allclose(phi, expm(TICK_S * generator), atol=1e-14)
    np.testing.assert_allclose(phi @ phi.T + lower @ lower.T, np.eye(2), atol=1e-14)


def test_disturbances_are_stationary() -> None:
    sea = sea_of("disturbed")
    start, later = [], []
    for seed in range(1500):
        draws = plant.random_streams(seed).draws
        draws.prepare(AT_START)
        disturbance = np.array(moments.sample_stationary(draws))
        start.append(disturbance.copy())
        for _ in range(20):
            draws.prepare(PER_TICK)
            moments.advance(sea.surroundings.moments, disturbance, draws.table)
        later.append(disturbance)
    four_sigma = 4.0 * math.sqrt(2.0 / 1500)
    np.testing.assert_allclose(np.cov(np.array(start).T), np.eye(6), atol=four_sigma)
    np.testing.assert_allclose(np.cov(np.array(later).T), np.eye(6), atol=four_sigma)
    correlation = [
        np.corrcoef(np.array(start)[:, i], np.array(later)[:, i])[0, 1] for i in range(2)
    ]
    np.testing.assert_allclose(correlation, math.exp(-20 * TICK_S / 3.0), atol=0.03)


def test_calm_scenario_has_no_disturbance() -> None:
    levels = sea_of("calm").surroundings.moments
    assert moments.moments_flu_nm(levels, np.ones(moments.PROCESSES)) == (0.0, 0.0)


def test_pressure_grows_one_bar_per_ten_metres() -> None:
    sea = sea_of("calm")
    surface_hpa = sea.surroundings.surface_pressure_hpa

    def pressure_hpa(depth_m: float) -> float:
        return environment.pressure_hpa(
            sea.field.column, sea.gravity_mps2, surface_hpa, depth_m, 0.0
        )

    assert pressure_hpa(-1.0) == surface_hpa == 1013.25
    assert pressure_hpa(10.0) - pressure_hpa(0.0) == pytest.approx(1005.5, abs=0.1)


def test_magnetic_field_matches_boston() -> None:
    north, east, down = sea_of("calm").surroundings.magnetic_field_ned_gauss
    assert math.degrees(math.atan2(east, north)) == pytest.approx(-14.4)
    assert math.degrees(math.atan2(down, math.hypot(north, east))) == pytest.approx(67.0)
    assert math.hypot(north, east, down) == pytest.approx(0.52)
