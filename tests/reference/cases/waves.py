"""Waves.

Verifies: the dispersion relation; that the motion decays with depth, is free of divergence and
rotation, and satisfies the free-surface condition; height and period of a random sea; the
second-order force that pulls a body near the surface upwards. Leaves out: effects beyond linear
theory: steepness, breaking, influence of the hull on the waves. Reference: linear wave theory (Airy
1845; Newman 1977, ch. 6); differences of the velocity field itself; H_s = 4 sigma, T_z / T_p of
both spectra (DNV-RP-C205, 2010, sec. 3.5.5); the long-wave limit 2 rho V k sigma^2 a^2 exp(-2 k h)
of the mean force on a slender body held under waves (Ogilvie 1963, J. Fluid Mech. 16; Lee and
Newman 1971, J. Ship Res. 15). Tolerance: rounding and differences; 5 % of height and period for an
hour of 200 components, the last of which represents the whole tail of the spectrum; 1 % of the
suction, whose limit is that of waves long against the hull.
"""

from collections.abc import Iterator
from itertools import pairwise
from math import exp, inf, pi, sqrt, tanh
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from sitl.core.environment import current, density, field, floor, waves
from sitl.core.environment.field import WaterField
from sitl.core.environment.waves import WaveKinematics
from sitl.environment_schema import CurrentConfig, Density, FloorTable, WaterTable, Waves
from sitl.vehicle import dynamics
from tests.reference import bodies
from tests.reference.check import Check, relative, worst
from tests.sitl.vehicle import flight

Array = NDArray[np.float64]

G = bodies.GRAVITY_MPS2
DEEP_M = 500.0
PERIOD_S, AMPLITUDE_M = 8.0, 0.5
LENGTH_M, DIAMETER_M, SUBMERGED_M = 2.0, 0.3, 4.0
Spectrum = Literal["pierson-moskowitz", "jonswap"]
PERIOD_RATIOS: dict[Spectrum, float] = {"pierson-moskowitz": 0.7104, "jonswap": 0.7777}
"""T_z / T_p; the latter by DNV's cubic at gamma = 3.3."""


def checks() -> Iterator[Check]:
    """Regular wave, irregular sea, suction."""
    yield from _dispersion()
    yield from _kinematics(_regular(DEEP_M, towards_rad=0.7))
    for spectrum in PERIOD_RATIOS:
        yield from _statistics(spectrum)
    for label, towards in (("head", pi), ("beam", pi / 2), ("quartering", pi / 4)):
        k = (2 * pi / PERIOD_S) ** 2 / G
        body = bodies.cylinder(LENGTH_M, DIAMETER_M, 0.0)
        reference = (
            2
            * body.inertia.mass_kg
            * k
            * (2 * pi / PERIOD_S) ** 2
            * AMPLITUDE_M**2
            * exp(-2 * k * SUBMERGED_M)
        )
        found = _suction_n(_regular(DEEP_M, towards))
        yield relative(f"suction in a {label} sea", "N", found, reference, 0.01, "Ogilvie 1963")


def _regular(depth_m: float, towards_rad: float) -> Array:
    """A sea of one component."""
    sigma = 2 * pi / PERIOD_S
    k = waves.wave_number_pm(sigma, depth_m, G)
    swell = waves.Swell(
        np.array([sigma]), np.array([k]), np.array([AMPLITUDE_M]), towards_rad - pi, 0.0, depth_m
    )
    return waves.draw_components(swell, np.random.default_rng(1))


def _dispersion() -> Iterator[Check]:
    for depth, period in ((DEEP_M, 6.0), (10.0, 6.0), (5.0, 12.0)):
        k, sigma = waves.wave_number_pm(2 * pi / period, depth, G), 2 * pi / period
        yield relative(
            f"sigma^2 of {period:.0f} s in {depth:.0f} m",
            "1/s2",
            G * k * tanh(k * depth),
            sigma**2,
            1e-9,
            "g k tanh kd",
        )
    shallow = 2 * pi / 60.0 / waves.wave_number_pm(2 * pi / 60.0, 1.0, G)
    yield relative("speed of a minute's wave in 1 m", "m/s", shallow, sqrt(G), 0.01, "sqrt(g d)")


def _kinematics(sea: Array) -> Iterator[Check]:
    sigma = 2 * pi / PERIOD_S
    k = sigma**2 / G
    times = np.arange(0.0, PERIOD_S, PERIOD_S / 64)
    for depth in (0.0, 5.0, 20.0):
        speed = [np.linalg.norm(waves.motion(sea, 3.0, 7.0, -depth, t).velocity) for t in times]
        reference = AMPLITUDE_M * sigma * exp(-k * depth)
        yield relative(
            f"orbital speed at {depth:.0f} m",
            "m/s",
            float(np.mean(speed)),
            reference,
            1e-9,
            "a s exp(-kz)",
        )
        yield worst(
            f"orbit at {depth:.0f} m, roundness", "m/s", speed, reference, 1e-12, "deep water"
        )
    here, h = np.array([3.0, 7.0, -2.0]), 1e-5
    moving = _motion(sea, here, 1.3)
    slopes = [
        (_velocity(sea, here + h * e, 1.3) - _velocity(sea, here - h * e, 1.3)) / (2 * h)
        for e in np.eye(3)
    ]
    yield worst(
        "gradient of velocity",
        "1/s",
        [moving.along_north, moving.along_west, moving.along_up],
        slopes,
        1e-9,
        "differences",
    )
    yield worst(
        "divergence and spin",
        "1/s",
        [np.trace(slopes), *(slopes - np.transpose(slopes)).ravel()],
        0.0,
        1e-9,
        "Laplace",
    )
    change = (_velocity(sea, here, 1.3 + h) - _velocity(sea, here, 1.3 - h)) / (2 * h)
    yield worst(
        "change of velocity", "m/s2", moving.local_acceleration, change, 1e-9, "differences"
    )
    heights = [waves.motion(sea, 3.0, 7.0, 0.0, t).elevation_m for t in (1.3 - h, 1.3 + h)]
    rising = (heights[1] - heights[0]) / (2 * h)
    yield worst(
        "rise of the surface",
        "m/s",
        _velocity(sea, np.array([3.0, 7.0, 0.0]), 1.3)[2],
        rising,
        1e-9,
        "kinematic condition",
    )


def _velocity(sea: Array, place: Array, time_s: float) -> Array:
    return np.array(_motion(sea, place, time_s).velocity)


def _motion(sea: Array, place: Array, time_s: float) -> WaveKinematics:
    north_m, west_m, up_m = place
    return waves.motion(sea, north_m, west_m, up_m, time_s)


def _statistics(spectrum: Spectrum) -> Iterator[Check]:
    """An hour at one place, twice a second."""
    weather = Waves(spectrum=spectrum, significant_height_m=1.5, peak_period_s=7.0, components=200)
    swell = waves.build(weather, DEEP_M, G)
    assert swell is not None
    sea = waves.draw_components(swell, np.random.default_rng(2))
    times = np.arange(0.0, 3600.0, 0.5)
    height = np.array([waves.motion(sea, 0.0, 0.0, 0.0, t).elevation_m for t in times])
    yield relative(f"{spectrum}, 4 sigma of an hour", "m", 4 * height.std(), 1.5, 0.05, "H_s")
    energy = float((swell.amplitude_m**2).sum() / 2)
    yield relative(f"{spectrum}, 4 sqrt(m_0)", "m", 4 * sqrt(energy), 1.5, 1e-9, "H_s")
    crossings = np.array([i for i, (a, b) in enumerate(pairwise(height)) if a < 0 <= b])
    period = float(np.mean(np.diff(times[crossings])))
    yield relative(
        f"{spectrum}, T_z of an hour",
        "s",
        period,
        7.0 * PERIOD_RATIOS[spectrum],
        0.05,
        "DNV-RP-C205",
    )


def _suction_n(sea: Array) -> float:
    """Mean upward force on a neutral cylinder held where it lies, over a period."""
    body = bodies.cylinder(LENGTH_M, DIAMETER_M, 0.0)
    state = dynamics.state_at_rest(-SUBMERGED_M)
    water = WaterField(
        sea=sea,
        profile=current.profile(CurrentConfig()),
        column=density.column(Density(), WaterTable(), G),
        floor=floor.build(FloorTable(depth_m=DEEP_M)),
        ceiling_m=inf,
        gravity_mps2=G,
        ballast_density_kgpm3=bodies.RHO_KGPM3,
        half_length_m=LENGTH_M / 2,
    )
    still = (0.0, 0.0, 0.0)
    times = np.arange(0.0, PERIOD_S, PERIOD_S / 64)
    met = [field.sample(water, state, 0.0, t, still, still)[0] for t in times]
    return float(
        np.mean([body.inertia.M[2, 2] * flight.rate(body, state, water=now)[9] for now in met])
    )
