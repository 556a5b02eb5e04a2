"""The sea the vehicle meets: how it moves, how heavy it is, where it ends, and what else disturbs
her.

One page each: ``current``, ``waves``, ``density``, ``floor``, ``moments``; ``field`` puts them
together at the hull. In water that is the same everywhere and always, nothing of it is computed and
no random number drawn."""

from __future__ import annotations

from math import cos, inf, pi, radians, sin
from typing import NamedTuple

import numpy as np
from numpy.random import Generator

from mavlink_io.frames import Vector as Vector3
from mavlink_io.frames import flip
from sitl.core.environment import current, density, field, floor, moments, waves
from sitl.core.environment.current import CurrentVariation, Drift
from sitl.core.environment.field import LocalWater, WaterField
from sitl.core.environment.moments import Levels
from sitl.core.environment.waves import Swell
from sitl.scenario import Scenario
from sitl.vehicle.jit import Native, Vector, native
from sitl.vehicle.water import Water

PASCAL_PER_HPA = 100.0
_ZERO: Vector3 = (0.0, 0.0, 0.0)


class Environment(NamedTuple):
    """A scenario in the form the plant runs on."""

    latitude_deg: float
    longitude_deg: float
    density_kgpm3: float
    """What the pressure sensor takes for it."""
    gravity_mps2: float
    surface_pressure_hpa: float
    temperature_degc: float
    magnetic_field_ned_gauss: Vector3
    field: WaterField
    swell: Swell | None
    drift: Drift | None
    uniform: LocalWater | None
    """The water where it is the same everywhere and always, else None."""
    moments: Levels


class Weather(NamedTuple):
    """What a run has for itself: its own waves, and the current's variation as it stands at one
    instant."""

    field: WaterField
    native: Native
    """The same, for the kernels."""
    swerve: CurrentVariation | None


def build(
    scenario: Scenario,
    gravity_mps2: float,
    tick_s: float,
    half_length_m: float = 1.0,
    ballast_density_kgpm3: float = 1025.0,
) -> Environment:
    """A scenario's sea for a hull of that length, ballasted in water of that density. Raises
    ScenarioError.

    Gravity is the vehicle model's, so that accelerometer and pressure sensor live in one world.
    """
    ground = floor.build(scenario.floor)
    depth_m = -floor.height_and_slope(ground, 0.0, 0.0)[0]
    still = WaterField(
        sea=np.empty((0, 7)),
        profile=current.profile(scenario.current),
        column=density.column(scenario.density, scenario.water, gravity_mps2),
        floor=ground,
        ceiling_m=-scenario.ice.draft_m if scenario.ice.draft_m else inf,
        gravity_mps2=gravity_mps2,
        ballast_density_kgpm3=ballast_density_kgpm3,
        half_length_m=half_length_m,
    )
    swell = waves.build(scenario.waves, depth_m, gravity_mps2)
    drift = current.current_drift(scenario.current.variation, tick_s)
    return Environment(
        latitude_deg=scenario.site.latitude_deg,
        longitude_deg=scenario.site.longitude_deg,
        density_kgpm3=scenario.water.density_kgpm3,
        gravity_mps2=gravity_mps2,
        surface_pressure_hpa=scenario.water.surface_pressure_hpa,
        temperature_degc=scenario.water.temperature_degc,
        magnetic_field_ned_gauss=_magnetic_field_ned(scenario),
        field=still,
        swell=swell,
        drift=drift,
        uniform=None if swell or drift else _uniform_water(still),
        moments=_disturbance_levels(scenario, tick_s),
    )


def initial_weather(sea: Environment, swell: Generator, drift: Generator) -> Weather:
    """The weather of a run at time zero, drawn from the streams of waves and current."""
    drawn = (
        sea.field._replace(sea=waves.draw_components(sea.swell, swell)) if sea.swell else sea.field
    )
    return Weather(drawn, native(drawn), current.sample_stationary(drift) if sea.drift else None)


def advance(sea: Environment, weather: Weather, drift: Generator) -> Weather:
    """The weather one tick later."""
    if sea.drift is None or weather.swerve is None:
        return weather
    return weather._replace(swerve=current.advance(sea.drift, weather.swerve, drift))


def sample_water(
    sea: Environment, weather: Weather, body: Vector, time_s: float, ahead_s: float = 0.0
) -> LocalWater:
    """The water round the vehicle at ``time_s``: where ``body`` (state of ``vehicle.dynamics``) is
    ``ahead_s`` on."""
    if sea.uniform is not None:
        return sea.uniform
    swerve, swerving = _ZERO, _ZERO
    if sea.drift is not None and weather.swerve is not None:
        swerve, swerving = current.variation_motion(sea.drift, weather.swerve)
    return LocalWater(*field.sample_native(weather.native, body, ahead_s, time_s, swerve, swerving))


def pressure_hpa(sea: Environment, depth_m: float, wave_pa: float = 0.0) -> float:
    """Absolute pressure at a depth under the still surface, waves included; never less than that of
    the air."""
    _, still_pa = density.density_and_pressure(sea.field.column, depth_m, sea.gravity_mps2)
    return sea.surface_pressure_hpa + max(0.0, still_pa + wave_pa) / PASCAL_PER_HPA


def floor_range_m(sea: Environment, position_ned_m: Vector3, direction_ned: Vector3) -> float:
    """Distance from a place to the sea floor along a unit vector; infinite where the ray meets
    none."""
    return floor.range_m(sea.field.floor, flip(*position_ned_m), flip(*direction_ned))


def _uniform_water(still: WaterField) -> LocalWater | None:
    """Water without waves or variation, if nothing else in it changes from place to place."""
    ground = still.floor
    tilted = ground.grid.size or ground.north_slope or ground.west_slope
    if len(still.profile) > 1 or len(still.column) > 1 or tilted:
        return None
    _, north, west = still.profile[0].tolist()
    water = Water(
        velocity_mps=(north, west, 0.0),
        density_ratio=float(still.column[0, 1]) / still.ballast_density_kgpm3,
        ceiling_m=still.ceiling_m,
        floor_m=ground.height_m,
    )
    return LocalWater(water, 0.0)


def _disturbance_levels(scenario: Scenario, tick_s: float) -> Levels:
    slow, band = scenario.disturbance.slow, scenario.disturbance.waves
    return Levels(
        slow=moments.slow_moment(slow.time_constant_s, tick_s),
        wave=moments.second_order(2.0 * pi * band.frequency_hz, band.damping, tick_s),
        slow_rms_nm=(slow.yaw_rms_nm, slow.pitch_rms_nm),
        wave_rms_nm=(band.yaw_rms_nm, band.pitch_rms_nm),
    )


def _magnetic_field_ned(scenario: Scenario) -> Vector3:
    earth = scenario.magnetic_field
    declination, inclination = radians(earth.declination_deg), radians(earth.inclination_deg)
    horizontal = earth.strength_gauss * cos(inclination)
    return (
        horizontal * cos(declination),
        horizontal * sin(declination),
        earth.strength_gauss * sin(inclination),
    )
