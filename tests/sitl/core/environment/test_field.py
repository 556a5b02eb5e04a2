"""The water at the hull: acceleration of the fluid, averages along the hull, and uniform water."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.random import default_rng
from numpy.typing import NDArray

from mavlink_io.records import ActuatorFrame
from mavlink_io.tick import TICK_S
from sitl import scenario
from sitl.core import environment, plant
from sitl.core.draws import BLOCK, DRIFT
from sitl.core.environment import current, field
from sitl.core.environment.field import WaterField
from sitl.environment_schema import (
    CurrentConfig,
    CurrentLayer,
    FloorTable,
    Ice,
    Variation,
    WaterTable,
    Waves,
)
from sitl.scenario import Scenario, StartTable
from sitl.vehicle import config, dynamics
from sitl.vehicle.water import Water
from tests.reference import bodies
from tests.sitl.vehicle import flight

Array = NDArray[np.float64]
NOTHING = (0.0, 0.0, 0.0)
STEADY = np.zeros(current.VARIATION)
ROUGH = Scenario(
    current=CurrentConfig(
        layer=(
            CurrentLayer(depth_m=0.0, speed_mps=0.6, towards_deg=30.0),
            CurrentLayer(depth_m=10.0, speed_mps=0.1, towards_deg=150.0),
        )
    ),
    waves=Waves(significant_height_m=1.0, peak_period_s=5.0, spreading=6.0, from_deg=70.0),
)
VARIATION, VARIATION_RATE = np.array([0.1, -0.2, 0.0]), np.array([0.03, 0.02, 0.0])
LONG_WAVE = Waves(
    spectrum="pierson-moskowitz", significant_height_m=1.0, peak_period_s=8.0, components=1
)


def sea_of(what: Scenario, half_length_m: float = 1.0, seed: int = 1) -> WaterField:
    sea = environment.build(what, bodies.GRAVITY_MPS2, TICK_S, half_length_m)
    return environment.draw_waves(sea, default_rng(seed)).field


def velocity(sea: WaterField, point: Array, time_s: float) -> Array:
    variation = VARIATION + VARIATION_RATE * (time_s - 3.0)
    return np.array(
        field.flow(sea, tuple(point), time_s, tuple(variation), tuple(VARIATION_RATE))[0]
    )


@given(st.floats(-50.0, 50.0), st.floats(-50.0, 50.0), st.floats(0.1, 9.0))
def test_acceleration_is_material_derivative(north: float, west: float, depth_m: float) -> None:
    """Reference: finite differences of a particle's velocity on its path, with waves and shear."""
    sea, point, h = sea_of(ROUGH), np.array([north, west, -depth_m]), 1e-4
    v = velocity(sea, point, 3.0)
    _, acceleration, _ = field.flow(sea, tuple(point), 3.0, tuple(VARIATION), tuple(VARIATION_RATE))
    bend = 0.5 * h * h * np.array(acceleration)
    later = velocity(sea, point + h * v + bend, 3.0 + h)
    earlier = velocity(sea, point - h * v + bend, 3.0 - h)
    np.testing.assert_allclose(acceleration, (later - earlier) / (2 * h), atol=1e-5)


def test_waves_in_drifting_frame_ignore_current() -> None:
    waves = Waves(significant_height_m=1.0, peak_period_s=5.0, from_deg=70.0)
    still = sea_of(Scenario(waves=waves))
    flowing = sea_of(Scenario(waves=waves, current=CurrentConfig(speed_mps=0.8, towards_deg=0.0)))
    for time_s in (0.0, 2.0, 30.0):
        at_rest = field.flow(still, (3.0, 4.0, -2.0), time_s, NOTHING, NOTHING)
        adrift = field.flow(flowing, (3.0 + 0.8 * time_s, 4.0, -2.0), time_s, NOTHING, NOTHING)
        np.testing.assert_allclose(np.array(adrift[0]) - (0.8, 0.0, 0.0), at_rest[0], atol=1e-12)
        np.testing.assert_allclose(adrift[1], at_rest[1], atol=1e-12)


def test_pitched_hull_in_shear_has_velocity_slope() -> None:
    """With 20 degrees of pitch: shear times the height gained per metre forward."""
    layers = tuple(
        CurrentLayer(depth_m=z, speed_mps=v, towards_deg=0.0) for z, v in ((0.0, 0.5), (10.0, 0.0))
    )
    sea = sea_of(Scenario(current=CurrentConfig(layer=layers)), 1.7)
    body = dynamics.state_at_rest(-4.0)
    body[3:7] = math.cos(math.radians(10.0)), 0.0, -math.sin(math.radians(10.0)), 0.0
    water, _ = field.sample(sea, body, 0.0, 0.0, NOTHING, NOTHING)
    assert water.velocity_mps == pytest.approx((0.3, 0.0, 0.0))
    assert water.slope_per_s == pytest.approx((0.05 * math.sin(math.radians(20.0)), 0.0, 0.0))


def test_mean_and_slope_match_least_squares_line() -> None:
    sea, body, half = sea_of(ROUGH, 1.7), dynamics.state_at_rest(-2.0), 1.7
    water, _ = field.sample(sea, body, 0.0, 3.0, NOTHING, NOTHING)
    x = np.linspace(-half, half, 401)
    along = np.array([field.flow(sea, (at, 0.0, -2.0), 3.0, NOTHING, NOTHING)[0] for at in x])
    slope, mean = np.polyfit(x, along, 1)
    np.testing.assert_allclose(water.velocity_mps, mean, atol=2e-3)
    np.testing.assert_allclose(water.slope_per_s, slope, atol=2e-3)


def test_wave_pressure_gradient_matches_acceleration() -> None:
    """Linearised Euler: rho v_t = -grad p; gauge pressure at the elevation is zero to 2nd order."""
    waves = Waves(significant_height_m=0.1, peak_period_s=5.0, from_deg=70.0)
    what = Scenario(waves=waves)
    sea = environment.build(what, bodies.GRAVITY_MPS2, TICK_S)
    own = environment.draw_waves(sea, default_rng(1))
    h = 1e-4

    def gauge_pa(point: Array) -> float:
        body = dynamics.state_at_rest()
        body[:3] = point
        wave_pa = environment.sample_water(own, STEADY, body, 3.0).wave_pressure_pa
        return 100.0 * environment.pressure_hpa(
            own.field.column, own.gravity_mps2, 0.0, -point[2], wave_pa
        )

    point = np.array([2.0, 5.0, -3.0])
    gradient = [(gauge_pa(point + h * e) - gauge_pa(point - h * e)) / (2 * h) for e in np.eye(3)]
    north, west, up = field.flow(own.field, tuple(point), 3.0, NOTHING, NOTHING)[
        2
    ].local_acceleration
    expected = -1025.0 * np.array([north, west, up + sea.gravity_mps2])
    np.testing.assert_allclose(gradient, expected, rtol=1e-5, atol=0.02)
    elevation = field.flow(own.field, (2.0, 5.0, 0.0), 3.0, NOTHING, NOTHING)[2].elevation_m
    assert abs(elevation) > 0.01
    assert gauge_pa(np.array([2.0, 5.0, elevation])) == pytest.approx(0.0, abs=2.0)


@pytest.mark.parametrize("heading", [0.0, 90.0, 200.0])
def test_waves_cause_mean_upward_acceleration(heading: float) -> None:
    """Mean Dv/Dt is k omega^2 a^2 exp(-2 k h) upwards for a short hull (Ogilvie 1963)."""
    sea = sea_of(Scenario(waves=LONG_WAVE, floor=FloorTable(depth_m=500.0)), 0.5)
    body = dynamics.state_at_rest(-1.5)
    body[3], body[6] = math.cos(math.radians(heading) / 2), -math.sin(math.radians(heading) / 2)
    _, _, k, omega, a, _, _ = sea.sea[0]
    times = np.arange(64) / 64 * 2.0 * math.pi / omega
    lift = [field.sample(sea, body, 0.0, t, NOTHING, NOTHING)[0].acceleration_mps2 for t in times]
    expected = k * omega**2 * a**2 * math.exp(-2.0 * k * 1.5)
    assert np.mean(lift, axis=0) == pytest.approx((0.0, 0.0, expected), rel=0.01, abs=1e-6)


def test_neutral_sphere_follows_fluid_particle() -> None:
    """Reference: path of a fluid particle, integrated for two minutes in swell: orbit and drift.

    The particle's drift is a^2 omega k exp(-2 k h) (Stokes 1847).
    """
    sea = sea_of(Scenario(waves=LONG_WAVE, floor=FloorTable(depth_m=500.0)), 0.05)
    body = bodies.spheroid(0.1, 0.1)
    state = dynamics.state_at_rest(-4.0)
    particle = np.array([0.0, 0.0, -4.0])
    work, push, tick = dynamics.work_array(), np.zeros(6), 0.01
    state[7:10] = field.flow(sea, (0.0, 0.0, -4.0), 0.0, NOTHING, NOTHING)[0]
    for n in range(12_000):
        water, _ = field.sample(sea, state, tick / 2, (n + 0.5) * tick, NOTHING, NOTHING)
        dynamics.rk4_step(state, 0.0, 0.0, 0.0, push, water, tick, body, work)
        half = particle + tick / 2 * np.array(
            field.flow(sea, tuple(particle), n * tick, NOTHING, NOTHING)[0]
        )
        particle = particle + tick * np.array(
            field.flow(sea, tuple(half), (n + 0.5) * tick, NOTHING, NOTHING)[0]
        )
    drifted = math.hypot(particle[0], particle[1])
    _, _, k, omega, a, _, _ = sea.sea[0]
    assert drifted == pytest.approx(120.0 * a**2 * omega * k * math.exp(-8.0 * k), abs=0.5 * a)
    np.testing.assert_allclose(state[:3], particle, atol=0.02 * drifted)


@pytest.mark.parametrize("name", ["calm", "disturbed", "under_ice"])
def test_uniform_water_draws_no_random_numbers(name: str) -> None:
    sea = environment.build(scenario.load(name), 9.81, TICK_S)
    swell, draws = default_rng(1), plant.random_streams(1).draws
    before: Any = swell.bit_generator.state
    own = environment.draw_waves(sea, swell)
    variation = np.array(current.sample_stationary(own.drift, draws))
    current.advance(own.drift, variation, draws.table)
    assert swell.bit_generator.state == before
    assert (draws.table.used == BLOCK).all()
    assert (variation == 0.0).all()
    water = environment.sample_water(own, variation, dynamics.state_at_rest(-3.0), 5.0)
    assert water == own.uniform


def test_uniform_water_equals_sampled_field() -> None:
    what = Scenario(
        current=CurrentConfig(speed_mps=0.4, towards_deg=50.0),
        ice=Ice(draft_m=0.5),
        floor=FloorTable(depth_m=12.0),
    )
    sea = environment.build(what, 9.81, TICK_S, 1.0, 1000.0)
    own = sea.surroundings
    assert own.is_uniform
    water, wave_pa = field.sample(
        sea.field, dynamics.state_at_rest(-3.0), 0.02, 5.0, NOTHING, NOTHING
    )
    assert wave_pa == own.uniform.wave_pressure_pa == 0.0
    for name in Water._fields:
        sampled, uniform = getattr(water, name), getattr(own.uniform.water, name)
        np.testing.assert_allclose(sampled, uniform, atol=1e-15)


def test_waves_and_variation_use_separate_streams() -> None:
    restless = Scenario(current=CurrentConfig(variation=Variation(rms_mps=0.1)))
    for what, drawn in ((restless, (False, True)), (Scenario(waves=LONG_WAVE), (True, False))):
        vehicle = plant.build(config.load("caribou_nominal"), what)
        used, fresh = plant.random_streams(3), plant.random_streams(3)
        plant.initial_state(vehicle, used)
        assert (
            used.swell.random() != fresh.swell.random(),
            bool(used.draws.table.used[DRIFT]),
        ) == drawn


def test_dive_in_waves_depends_on_seed_only() -> None:
    vehicle = plant.build(config.load("caribou_truth"), scenario.load("swell"))
    idle = ActuatorFrame(0, 1, (0.4, 0.0, 0.58, *(0.0,) * 13), 129)

    def end(seed: int) -> tuple[float, ...]:
        streams = plant.random_streams(seed)
        state, _ = plant.initial_state(vehicle, streams)
        for _ in range(250):
            state, _ = plant.step(vehicle, state, idle, streams)
        return tuple(state.body.tolist())

    assert end(1) == end(1)
    assert end(1) != end(2)


def test_initial_velocity_includes_current_at_depth() -> None:
    deep = Scenario(
        start=StartTable(depth_m=4.0, speed_mps=1.0, heading_deg=90.0), current=ROUGH.current
    )
    vehicle = plant.build(config.load("caribou_truth"), deep)
    state, _ = plant.initial_state(vehicle, plant.random_streams(1))
    north, west, _, _ = current.steady_current(vehicle.sea.field.profile, -4.0)
    np.testing.assert_allclose(state.truth.velocity_ned_mps, (north, 1.0 - west, 0.0), atol=1e-12)
    np.testing.assert_allclose(state.truth.water_velocity_ned_mps, (north, -west, 0.0), atol=1e-12)


@pytest.mark.parametrize(("density_kgpm3", "sinks"), [(1005.0, True), (1040.0, False)])
def test_buoyancy_scales_with_water_density(density_kgpm3: float, sinks: bool) -> None:
    """Net force at rest is rho / 1025 of the buoyancy minus the weight."""
    what = Scenario(start=StartTable(depth_m=8.0), water=WaterTable(density_kgpm3=density_kgpm3))
    vehicle = plant.build(config.load("caribou_nominal"), what)
    state, _ = plant.initial_state(vehicle, plant.random_streams(1))
    h = flight.model("caribou_nominal").hydrostatics
    inertia = flight.model("caribou_nominal").inertia
    force = np.array(state.truth.specific_force_mps2)
    net = density_kgpm3 / 1025.0 * h.buoyancy_n - h.weight_n
    sinking = force[2] + h.gravity_mps2
    assert (sinking > 0.0) == sinks == (net < 0.0)
    assert sinking == pytest.approx(-net / inertia.M[2, 2], rel=1e-3)
