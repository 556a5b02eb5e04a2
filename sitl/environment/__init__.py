"""The sea the vehicle meets: water, current, floor, magnetic field, and the moments that disturb her.

Two disturbances act in yaw and in pitch, all four independent: a slow one (first-order Gauss-Markov) and one in the
band of the waves (white noise through a lightly damped second-order filter). They are pure moments: a wave also pushes
a hull bodily, but one much shorter than the wave (3.5 m against 70 m at 0.15 Hz) rides with the orbit, and the loops
under test turn the vehicle. Each process is discretised exactly and starts stationary.
"""

from __future__ import annotations

from math import cos, exp, inf, pi, radians, sin, sqrt
from typing import NamedTuple

from numpy.random import Generator

from link.frames import Vector as Vector3
from link.frames import flip
from sitl.scenario import Scenario
from sitl.vehicle.water import Water, drifting

PASCAL_PER_HPA = 100.0


class SlowMoment(NamedTuple):
    """First-order Gauss-Markov process of unit variance over one tick: x' = keep x + renew n."""

    keep: float
    renew: float


class WaveMoment(NamedTuple):
    """x'' + 2 zeta omega x' + omega^2 x = white noise, of unit variance, over one tick, in the states (x, x'/omega).

    In these states the stationary covariance is the identity, hence the noise of a tick is I - Phi Phi^T.
    """

    transition: tuple[float, float, float, float]
    """Phi, row by row."""
    noise: tuple[float, float, float]
    """Lower Cholesky factor of I - Phi Phi^T: (1,1), (2,1), (2,2)."""


class Disturbance(NamedTuple):
    """The four unit processes as they stand at one instant, in order yaw, pitch."""

    slow: tuple[float, float]
    wave: tuple[tuple[float, float], tuple[float, float]]


class Environment(NamedTuple):
    """A scenario in the form the plant runs on."""

    latitude_deg: float
    longitude_deg: float
    density_kgpm3: float
    gravity_mps2: float
    surface_pressure_hpa: float
    temperature_degc: float
    floor_depth_m: float
    magnetic_field_ned_gauss: Vector3
    water: Water
    """About the hull, wherever she is."""
    slow: SlowMoment
    wave: WaveMoment
    slow_rms_nm: tuple[float, float]
    wave_rms_nm: tuple[float, float]
    """Yaw, pitch."""


def build(scenario: Scenario, gravity_mps2: float, tick_s: float) -> Environment:
    """Discretise a scenario's disturbances over a tick and turn its vectors to the axes they are used in.

    Gravity is the vehicle model's, so that accelerometer and pressure sensor live in one world.
    """
    slow, waves = scenario.disturbance.slow, scenario.disturbance.waves
    return Environment(
        latitude_deg=scenario.site.latitude_deg,
        longitude_deg=scenario.site.longitude_deg,
        density_kgpm3=scenario.water.density_kgpm3,
        gravity_mps2=gravity_mps2,
        surface_pressure_hpa=scenario.water.surface_pressure_hpa,
        temperature_degc=scenario.water.temperature_degc,
        floor_depth_m=scenario.floor.depth_m,
        magnetic_field_ned_gauss=_magnetic_field_ned(scenario),
        water=drifting(_towards(scenario.current.speed_mps, scenario.current.towards_deg)),
        slow=slow_moment(slow.time_constant_s, tick_s),
        wave=wave_moment(2.0 * pi * waves.frequency_hz, waves.damping, tick_s),
        slow_rms_nm=(slow.yaw_rms_nm, slow.pitch_rms_nm),
        wave_rms_nm=(waves.yaw_rms_nm, waves.pitch_rms_nm),
    )


def slow_moment(time_constant_s: float, tick_s: float) -> SlowMoment:
    keep = exp(-tick_s / time_constant_s)
    return SlowMoment(keep, sqrt(1.0 - keep * keep))


def wave_moment(frequency_radps: float, damping: float, tick_s: float) -> WaveMoment:
    """The shaping filter over one tick; ``damping`` is below 1."""
    damped = sqrt(1.0 - damping * damping)
    decay = exp(-damping * frequency_radps * tick_s)
    c, s = decay * cos(damped * frequency_radps * tick_s), decay * sin(damped * frequency_radps * tick_s) / damped
    a, b, d = c + damping * s, s, c - damping * s
    q11, q12, q22 = 1.0 - a * a - b * b, a * b - b * d, 1.0 - b * b - d * d
    first = sqrt(q11)
    return WaveMoment((a, b, -b, d), (first, q12 / first, sqrt(q22 - q12 * q12 / q11)))


def stationary(slow: Generator, wave: Generator) -> Disturbance:
    """A draw of all four processes from their stationary distribution."""
    slow_yaw, slow_pitch = slow.standard_normal(2).tolist()
    a, b, c, d = wave.standard_normal(4).tolist()
    return Disturbance((slow_yaw, slow_pitch), ((a, b), (c, d)))


def advance(sea: Environment, disturbance: Disturbance, slow: Generator, wave: Generator) -> Disturbance:
    """The disturbance one tick later."""
    keep, renew = sea.slow
    n_yaw, n_pitch = slow.standard_normal(2).tolist()
    a, b, c, d = wave.standard_normal(4).tolist()
    return Disturbance(
        (keep * disturbance.slow[0] + renew * n_yaw, keep * disturbance.slow[1] + renew * n_pitch),
        (_wave(sea.wave, disturbance.wave[0], a, b), _wave(sea.wave, disturbance.wave[1], c, d)),
    )


def moments_flu_nm(sea: Environment, disturbance: Disturbance) -> tuple[float, float]:
    """Pitch and yaw moment on the vehicle, (M, N), N m."""
    yaw = sea.slow_rms_nm[0] * disturbance.slow[0] + sea.wave_rms_nm[0] * disturbance.wave[0][0]
    pitch = sea.slow_rms_nm[1] * disturbance.slow[1] + sea.wave_rms_nm[1] * disturbance.wave[1][0]
    return pitch, yaw


def pressure_hpa(sea: Environment, depth_m: float) -> float:
    """Absolute pressure at a depth; above the surface that of the air."""
    return sea.surface_pressure_hpa + sea.density_kgpm3 * sea.gravity_mps2 * max(0.0, depth_m) / PASCAL_PER_HPA


def floor_range_m(sea: Environment, position_ned_m: Vector3, direction_ned: Vector3) -> float:
    """Distance from a place to the sea floor along a unit vector; infinite where the ray meets none."""
    clearance_m = sea.floor_depth_m - position_ned_m[2]
    return clearance_m / direction_ned[2] if direction_ned[2] > 0.0 else inf


def _wave(filter_: WaveMoment, x: tuple[float, float], n1: float, n2: float) -> tuple[float, float]:
    p11, p12, p21, p22 = filter_.transition
    l11, l21, l22 = filter_.noise
    return p11 * x[0] + p12 * x[1] + l11 * n1, p21 * x[0] + p22 * x[1] + l21 * n1 + l22 * n2


def _magnetic_field_ned(scenario: Scenario) -> Vector3:
    field = scenario.magnetic_field
    declination, inclination = radians(field.declination_deg), radians(field.inclination_deg)
    horizontal = field.strength_gauss * cos(inclination)
    return horizontal * cos(declination), horizontal * sin(declination), field.strength_gauss * sin(inclination)


def _towards(speed_mps: float, towards_deg: float) -> Vector3:
    """NWU."""
    towards = radians(towards_deg)
    return speed_mps * cos(towards), -speed_mps * sin(towards), 0.0
