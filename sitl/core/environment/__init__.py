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
from mavlink_io.jit import entry_point, kernel
from sitl.core.environment import current, density, field, floor, moments, waves
from sitl.core.environment.current import Drift
from sitl.core.environment.field import LocalWater, WaterField
from sitl.core.environment.moments import Levels
from sitl.core.environment.waves import Swell
from sitl.scenario import Scenario
from sitl.vehicle.vectors import Vector
from sitl.vehicle.water import Water

PASCAL_PER_HPA = 100.0
STILL_WATER = LocalWater(Water(), 0.0)
"""Still, deep and uniform water."""


class Surroundings(NamedTuple):
    """Environment of a run, for compiled code."""

    latitude_deg: float
    longitude_deg: float
    """Position of the origin of NED."""
    density_kgpm3: float
    """Density that the pressure sensor assumes."""
    gravity_mps2: float
    surface_pressure_hpa: float
    temperature_degc: float
    magnetic_field_ned_gauss: Vector3
    field: WaterField
    drift: Drift
    moments: Levels
    is_uniform: bool
    """Whether the water is uniform in space and time."""
    uniform: LocalWater
    """The water if it is uniform."""


class Environment(NamedTuple):
    """Parameters of a scenario's environment."""

    swell: Swell | None
    surroundings: Surroundings
    """Water without waves, and the disturbances."""

    @property
    def latitude_deg(self) -> float:
        """Latitude of the origin of NED."""
        return self.surroundings.latitude_deg

    @property
    def longitude_deg(self) -> float:
        """Longitude of the origin of NED."""
        return self.surroundings.longitude_deg

    @property
    def field(self) -> WaterField:
        """The water without waves."""
        return self.surroundings.field

    @property
    def gravity_mps2(self) -> float:
        """Gravity of the vehicle model."""
        return self.surroundings.gravity_mps2


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
    uniform = None if swell or drift.rms_mps else _uniform_water(still)
    return Environment(
        swell=swell,
        surroundings=Surroundings(
            latitude_deg=float(scenario.site.latitude_deg),
            longitude_deg=float(scenario.site.longitude_deg),
            density_kgpm3=scenario.water.density_kgpm3,
            gravity_mps2=gravity_mps2,
            surface_pressure_hpa=scenario.water.surface_pressure_hpa,
            temperature_degc=scenario.water.temperature_degc,
            magnetic_field_ned_gauss=_magnetic_field_ned(scenario),
            field=still,
            drift=drift,
            moments=_disturbance_levels(scenario, tick_s),
            is_uniform=uniform is not None,
            uniform=uniform or STILL_WATER,
        ),
    )


def draw_waves(sea: Environment, swell: Generator) -> Surroundings:
    """Return the environment of a run: draw its waves, if there are any."""
    if sea.swell is None:
        return sea.surroundings
    drawn = sea.field._replace(sea=waves.draw_components(sea.swell, swell))
    return sea.surroundings._replace(field=drawn)


@kernel
def local_water(
    sea: Surroundings, variation: Vector, body: Vector, time_s: float, ahead_s: float
) -> LocalWater:
    """Return the water around the vehicle.

    Parameters
    ----------
    sea : Surroundings
        Environment of the run.
    variation : ndarray, shape (4,)
        State of the current's variation, see ``current``.
    body : ndarray, shape (13,)
        State of ``vehicle.dynamics``.
    time_s : float
        Vehicle time.
    ahead_s : float
        Time by which the position of ``body`` is extrapolated with its velocity.
    """
    if sea.is_uniform:
        return sea.uniform
    velocity, rate = current.variation_motion(sea.drift, variation)
    water, wave_pa = field.sample(sea.field, body, ahead_s, time_s, velocity, rate)
    return LocalWater(water, wave_pa)


@entry_point
def sample_water(sea: Surroundings, variation: Vector, body: Vector, time_s: float) -> LocalWater:
    """Return the water around the vehicle; see ``local_water``."""
    return local_water(sea, variation, body, time_s, 0.0)


@kernel
def pressure_hpa(
    column: Vector, gravity_mps2: float, surface_hpa: float, depth_m: float, wave_pa: float
) -> float:
    """Return the absolute pressure at a depth, at least that of the air.

    Parameters
    ----------
    column : ndarray
        Water column of ``density.column``.
    gravity_mps2 : float
        Gravity.
    surface_hpa : float
        Pressure of the air.
    depth_m : float
        Depth below the still surface.
    wave_pa : float
        Pressure due to waves.
    """
    _, still_pa = density.density_and_pressure(column, depth_m, gravity_mps2)
    return surface_hpa + max(0.0, still_pa + wave_pa) / PASCAL_PER_HPA


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
