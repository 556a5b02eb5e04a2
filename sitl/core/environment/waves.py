"""The waves: linear (Airy) components drawn from a spectrum, and how the water moves under them.
NWU axes, z up.

A component of amplitude a, wave number k and frequency sigma runs along the unit vector e:
elevation a cos(theta) with theta = k e.(x - U t) - sigma t + phase, carried by the steady current U
of the surface, so that a vehicle adrift meets waves of sigma. Each moves on its own (first order);
what is of second order in the motion of the water under them, (v.grad) v, is kept, for it draws a
vehicle near the surface upwards (Ogilvie 1963, J. Fluid Mech. 16).

Linear theory ends at the still surface. Above it, in crests, the water moves as at the still
surface: velocity and its gradient are held constant there, as DNV-RP-C205 (2010, sec. 3.3.3) has it
for extrapolation."""

from __future__ import annotations

from math import cos, exp, pi, radians, sin, sqrt, tanh
from typing import NamedTuple

import numpy as np
from numpy.random import Generator

from sitl.environment_schema import Waves
from sitl.vehicle.jit import Vector, Vector3, kernel

FULLY_DEVELOPED = 0.4
"""Peak frequency over sqrt(g / H_s) of the Pierson-Moskowitz sea (Fossen 2021, sec. 10.2)."""
_MIN_FREQUENCY_RATIO, _MAX_FREQUENCY_RATIO = 0.3, 8.0
"""Band of the spectrum, in peak frequencies; less than 0.1 % of the energy lies outside."""
_SPECTRUM_SAMPLES = 20_000
_NEWTON_STEPS = 30
NORTH, WEST, NUMBER, FREQUENCY, AMPLITUDE, PHASE, FAR = range(7)
"""Columns of a drawn sea: wave vector (1/m), wave number (1/m), frequency (rad/s), amplitude (m),
phase (rad), and exp(-2 k d) for the depth d of the water."""


class Swell(NamedTuple):
    """A sea before its phases and directions are drawn; arrays of one entry a component."""

    frequency_radps: Vector
    number_pm: Vector
    amplitude_m: Vector
    from_rad: float
    spreading: float
    depth_m: float


def spectrum(waves: Waves, peak_radps: float, omega: Vector) -> Vector:
    """S(omega) in m2 s, up to a factor that ``build`` finds from the height.

    Pierson-Moskowitz: omega^-5 exp(-5/4 (omega_p/omega)^4) (Pierson and Moskowitz 1964). JONSWAP:
    times gamma to the exp(-((omega - omega_p) / (sigma omega_p))^2 / 2), sigma 0.07 below the peak,
    0.09 above (Hasselmann et al. 1973)."""
    ratio = omega / peak_radps
    shape = np.asarray(ratio**-5.0 * np.exp(-1.25 * ratio**-4.0))
    if waves.spectrum == "jonswap":
        width = np.where(ratio <= 1.0, 0.07, 0.09)
        shape = shape * waves.gamma ** np.exp(-0.5 * ((ratio - 1.0) / width) ** 2)
    return shape


def build(waves: Waves, depth_m: float, gravity_mps2: float) -> Swell | None:
    """Split a spectrum into components of equal energy, each at the mean frequency of its share;
    None in a flat sea.

    So the variance is that of the spectrum to rounding, and the crowded peak is where the
    components are."""
    height, count = waves.significant_height_m, waves.components
    if not height:
        return None
    fully_developed = 2.0 * pi / (FULLY_DEVELOPED * sqrt(gravity_mps2 / height))
    peak = 2.0 * pi / (waves.peak_period_s or fully_developed)
    omega = np.linspace(_MIN_FREQUENCY_RATIO * peak, _MAX_FREQUENCY_RATIO * peak, _SPECTRUM_SAMPLES)
    density = spectrum(waves, peak, omega)
    energy, moment = np.cumsum(density), np.cumsum(density * omega)
    energy, moment = energy - energy[0], moment - moment[0]
    edges = np.interp(np.linspace(0.0, energy[-1], count + 1), energy, omega)
    frequency = np.diff(np.interp(edges, omega, moment)) / (energy[-1] / count)
    number = np.array([wave_number_pm(w, depth_m, gravity_mps2) for w in frequency])
    amplitude = np.full(count, height / 4.0 * sqrt(2.0 / count))
    return Swell(frequency, number, amplitude, radians(waves.from_deg), waves.spreading, depth_m)


def wave_number_pm(frequency_radps: float, depth_m: float, gravity_mps2: float) -> float:
    """Root k of omega^2 = g k tanh(k d) (Airy 1845; Newman 1977, sec. 6.2), rad/m."""
    deep = frequency_radps**2 / gravity_mps2
    k = max(deep, frequency_radps / sqrt(gravity_mps2 * depth_m))
    for _ in range(_NEWTON_STEPS):
        t = tanh(k * depth_m)
        k -= (k * t - deep) / (t + k * depth_m * (1.0 - t * t))
    return k


def draw_components(swell: Swell, stream: Generator) -> Vector:
    """A sea of this kind, shape (components, 7), columns as above: phases at random, and directions
    where it spreads.

    Each frequency runs in one direction, from the distribution by stratified draw, so that no two
    components of one frequency stand still against each other (Jefferys 1987, Appl. Ocean Res. 9).
    """
    count = len(swell.number_pm)
    phase = stream.uniform(0.0, 2.0 * pi, count)
    towards = np.full(count, swell.from_rad + pi)
    if swell.spreading:
        share = (stream.permutation(count) + stream.random(count)) / count
        towards = towards + spread_rad(share, swell.spreading)
    sea = np.empty((count, 7))
    sea[:, NORTH], sea[:, WEST] = (
        swell.number_pm * np.cos(towards),
        -swell.number_pm * np.sin(towards),
    )
    sea[:, NUMBER], sea[:, FREQUENCY], sea[:, AMPLITUDE] = (
        swell.number_pm,
        swell.frequency_radps,
        swell.amplitude_m,
    )
    sea[:, PHASE], sea[:, FAR] = phase, np.exp(-2.0 * swell.number_pm * swell.depth_m)
    return sea


def spread_rad(share: Vector, spreading: float) -> Vector:
    """Angle off the mean direction below which that share of a cos^2s(angle/2) sea runs."""
    angle = np.linspace(-pi, pi, _SPECTRUM_SAMPLES)
    below = np.cumsum(np.cos(0.5 * angle) ** (2.0 * spreading))
    return np.interp(share, below / below[-1], angle)


class WaveKinematics(NamedTuple):
    """Water under waves at one point and instant."""

    velocity: Vector3
    change: Vector3
    """Of velocity in time, for who drifts with the current of the surface, m/s2."""
    along_north: Vector3
    along_west: Vector3
    along_up: Vector3
    """Change of velocity per metre in each direction, 1/s."""
    elevation_m: float
    rise_north: float
    rise_west: float
    """Slope of the surface."""
    head_m: float
    """What the waves add to pressure at the point, in metres of water."""


@kernel
def motion(sea: Vector, north_m: float, west_m: float, z_m: float, time_s: float) -> WaveKinematics:
    """Sum of the components at a point ``z_m`` above the still surface, in the frame of the
    surface's current."""
    u = v = w = ut = vt = wt = 0.0
    xx = xy = xz = yy = yz = 0.0
    elevation = rise_n = rise_w = head = 0.0
    z = min(z_m, 0.0)
    for i in range(len(sea)):
        kn, kw, k, omega, a, far = sea[i, 0], sea[i, 1], sea[i, 2], sea[i, 3], sea[i, 4], sea[i, 6]
        theta = kn * north_m + kw * west_m - omega * time_s + sea[i, 5]
        c, s = cos(theta), sin(theta)
        near = max(exp(k * z), sqrt(far))
        image = far / near if far > 0.0 else 0.0
        # cosh k(z+d) / sinh kd and sinh k(z+d) / sinh kd
        level, upright = (near + image) / (1.0 - far), (near - image) / (1.0 - far)
        en, ew, speed = kn / k, kw / k, a * omega
        along, up = speed * level, speed * upright
        u += en * along * c
        v += ew * along * c
        w += up * s
        ut += en * along * omega * s
        vt += ew * along * omega * s
        wt -= up * omega * c
        xx -= en * kn * along * s
        xy -= en * kw * along * s
        yy -= ew * kw * along * s
        xz += kn * up * c
        yz += kw * up * c
        elevation += a * c
        rise_n -= a * kn * s
        rise_w -= a * kw * s
        head += a * c * (near + image) / (1.0 + far)
    return WaveKinematics(
        (u, v, w),
        (ut, vt, wt),
        (xx, xy, xz),
        (xy, yy, yz),
        (xz, yz, -xx - yy),
        elevation,
        rise_n,
        rise_w,
        head,
    )
