"""The environment of the vehicle: motion, density and boundaries of the water, and disturbances.

One module each: ``current``, ``waves``, ``density``, ``floor``, ``moments``; ``field`` combines
them at the hull. If the water is uniform in space and time, its properties are computed once and no
random numbers are drawn.
"""

from __future__ import annotations

from math import cos, inf, pi, radians, sin
from typing import NamedTuple

import numpy as np
from numpy.random import Generator

from mavlink_io.frames import Vector as Vector3
from mavlink_io.frames import flip
from mavlink_io.jit import Native, native
from sitl.core.environment import current, density, field, floor, moments, waves
from sitl.core.environment.current import CurrentVariation, Drift
from sitl.core.environment.field import LocalWater, WaterField
from sitl.core.environment.moments import Levels
from sitl.core.environment.waves import Swell
from sitl.scenario import Scenario
from sitl.vehicle.vectors import Vector
from sitl.vehicle.water import Water

PASCAL_PER_HPA = 100.0
_ZERO: Vector3 = (0.0, 0.0, 0.0)


class Environment(NamedTuple):
    """Parameters of a scenario's environment."""

    latitude_deg: float
    longitude_deg: float
    density_kgpm3: float
    """Density that the pressure sensor assumes."""
    gravity_mps2: float
    surface_pressure_hpa: float
    temperature_degc: float
    magnetic_field_ned_gauss: Vector3
    field: WaterField
    swell: Swell | None
    drift: Drift | None
    uniform: LocalWater | None
    """The water if it is uniform in space and time, else None."""
    moments: Levels


class Weather(NamedTuple):
    """Waves and current variation of one run at one instant."""

    field: WaterField
    native: Native
    """Copy of ``field`` for compiled code."""
    current_variation: CurrentVariation | None


def build(
    scenario: Scenario,
    gravity_mps2: float,
    tick_s: float,
    half_length_m: float = 1.0,
    ballast_density_kgpm3: float = 1025.0,
) -> Environment:
    """Build the environment of a scenario.

    Parameters
    ----------
    scenario : Scenario
        Content of a scenario file.
    gravity_mps2 : float
        Gravity of the vehicle model, so that accelerometer and pressure sensor are consistent.
    tick_s : float
        Length of a tick.
    half_length_m : float
        Half the length of the hull.
    ballast_density_kgpm3 : float
        Water density in which the vehicle was ballasted.

    Raises
    ------
    ScenarioError
        The floor file cannot be used.
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
    """Draw the waves and the current variation of a run at time zero."""
    drawn = (
        sea.field._replace(sea=waves.draw_components(sea.swell, swell)) if sea.swell else sea.field
    )
    return Weather(drawn, native(drawn), current.sample_stationary(drift) if sea.drift else None)


def advance(sea: Environment, weather: Weather, drift: Generator) -> Weather:
    """Return the weather one tick later."""
    if sea.drift is None or weather.current_variation is None:
        return weather
    variation = current.advance(sea.drift, weather.current_variation, drift)
    return weather._replace(current_variation=variation)


def sample_water(
    sea: Environment, weather: Weather, body: Vector, time_s: float, ahead_s: float = 0.0
) -> LocalWater:
    """Return the water around the vehicle.

    Parameters
    ----------
    sea : Environment
        The environment.
    weather : Weather
        Waves and current variation of the run.
    body : Vector
        State of ``vehicle.dynamics``, shape (13,).
    time_s : float
        Vehicle time.
    ahead_s : float
        Time by which the position of ``body`` is extrapolated with its velocity.
    """
    if sea.uniform is not None:
        return sea.uniform
    variation, variation_rate = _ZERO, _ZERO
    if sea.drift is not None and weather.current_variation is not None:
        variation, variation_rate = current.variation_motion(sea.drift, weather.current_variation)
    return LocalWater(
        *field.sample_native(weather.native, body, ahead_s, time_s, variation, variation_rate)
    )


def pressure_hpa(sea: Environment, depth_m: float, wave_pa: float = 0.0) -> float:
    """Return the absolute pressure at a depth (m below still surface), at least that of the air."""
    _, still_pa = density.density_and_pressure(sea.field.column, depth_m, sea.gravity_mps2)
    return sea.surface_pressure_hpa + max(0.0, still_pa + wave_pa) / PASCAL_PER_HPA


def floor_range_m(sea: Environment, position_ned_m: Vector3, direction_ned: Vector3) -> float:
    """Return the distance (m) to the sea floor along a unit vector; infinite without a hit."""
    return floor.range_m(sea.field.floor, flip(*position_ned_m), flip(*direction_ned))


def _uniform_water(still: WaterField) -> LocalWater | None:
    """Return the water if it has no waves, variation, layers or floor relief, else None."""
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
    """Build the disturbance moments of a scenario."""
    slow, band = scenario.disturbance.slow, scenario.disturbance.waves
    return Levels(
        slow=moments.slow_moment(slow.time_constant_s, tick_s),
        wave=moments.second_order(2.0 * pi * band.frequency_hz, band.damping, tick_s),
        slow_rms_nm=(slow.yaw_rms_nm, slow.pitch_rms_nm),
        wave_rms_nm=(band.yaw_rms_nm, band.pitch_rms_nm),
    )


def _magnetic_field_ned(scenario: Scenario) -> Vector3:
    """Return Earth's magnetic field in NED, gauss.

    B (cos I cos D, cos I sin D, sin I) for strength B, inclination I (down positive) and
    declination D (east positive).
    """
    earth = scenario.magnetic_field
    declination, inclination = radians(earth.declination_deg), radians(earth.inclination_deg)
    horizontal = earth.strength_gauss * cos(inclination)
    return (
        horizontal * cos(declination),
        horizontal * sin(declination),
        earth.strength_gauss * sin(inclination),
    )
