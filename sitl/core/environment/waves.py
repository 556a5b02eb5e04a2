"""Sea waves: linear (Airy) components drawn from a spectrum, and the water motion under them.

NWU axes, z up. A component of amplitude a (m), wave number k (rad/m) and frequency sigma (rad/s)
travels along the unit vector e. Its elevation is a cos(theta), theta = k e.(x - U t) - sigma t +
phase, where U is the steady current at the surface: a vehicle that drifts with U meets the waves at
sigma. Components are superposed linearly. Of the second-order terms of the fluid acceleration,
(v.grad) v is kept, because it draws a vehicle near the surface upwards (Ogilvie 1963, J. Fluid
Mech. 16).

Linear theory is valid up to the still surface. Above it, in crests, velocity and its gradient are
held at their values at the still surface, as DNV-RP-C205 (2010, sec. 3.3.3) describes for
extrapolation.
"""

from __future__ import annotations

from math import cos, exp, pi, radians, sin, sqrt, tanh
from typing import NamedTuple

import numpy as np
from numpy.random import Generator

from mavlink_io.jit import kernel
from sitl.environment_schema import Waves
from sitl.vehicle.vectors import Vector, Vector3

FULLY_DEVELOPED = 0.4
"""Peak frequency over sqrt(g / H_s) of the Pierson-Moskowitz spectrum (Fossen 2021, sec. 10.2)."""
_MIN_FREQUENCY_RATIO, _MAX_FREQUENCY_RATIO = 0.3, 8.0
"""Band of the spectrum over the peak frequency; less than 0.1 % of the energy lies outside."""
_SPECTRUM_SAMPLES = 20_000
_NEWTON_STEPS = 30
NORTH, WEST, NUMBER, FREQUENCY, AMPLITUDE, PHASE, BOTTOM_DECAY = range(7)
"""Columns of a component table.

North and west components of the wave vector (rad/m), wave number (rad/m), frequency (rad/s),
amplitude (m), phase (rad), and exp(-2 k d) for the water depth d.
"""


class Swell(NamedTuple):
    """Sea state before phases and directions are drawn; arrays have one entry per component."""

    frequency_radps: Vector
    number_pm: Vector
    """Wave numbers, rad/m."""
    amplitude_m: Vector
    from_rad: float
    """Bearing that the waves come from."""
    spreading: float
    """Exponent s of the spreading function; 0 for long-crested waves."""
    depth_m: float
    """Water depth."""


def spectrum(waves: Waves, peak_radps: float, omega: Vector) -> Vector:
    """Return the spectral density S(omega) up to a constant factor, which ``build`` determines.

    Pierson-Moskowitz: omega^-5 exp(-5/4 (omega_p/omega)^4) (Pierson and Moskowitz 1964).

    JONSWAP: the same times gamma^exp(-((omega - omega_p) / (sigma omega_p))^2 / 2), with sigma =
    0.07 up to the peak and 0.09 above (Hasselmann et al. 1973).
    """
    ratio = omega / peak_radps
    shape = np.asarray(ratio**-5.0 * np.exp(-1.25 * ratio**-4.0))
    if waves.spectrum == "jonswap":
        width = np.where(ratio <= 1.0, 0.07, 0.09)
        shape = shape * waves.gamma ** np.exp(-0.5 * ((ratio - 1.0) / width) ** 2)
    return shape


def build(waves: Waves, depth_m: float, gravity_mps2: float) -> Swell | None:
    """Divide a spectrum into components of equal energy; return None if there are no waves.

    Each component has the mean frequency of its share of the energy and the amplitude
    H_s / 4 sqrt(2 / n), so that the variance of the n components is that of the spectrum,
    (H_s / 4)^2. Components are dense near the peak.
    """
    # S spectral density over omega (rad/s), E(omega) and F(omega) the integrals of S and omega S
    # from the lowest frequency, n components with bounds omega_i at equal shares of the energy:
    #     E(omega_i) = i / n E_total,   frequency_i = n / E_total (F(omega_i) - F(omega_i-1)).
    # The grid is uniform, so sums stand for the integrals. Without a peak period, the peak is that
    # of a fully developed sea, omega_p = 0.4 sqrt(g / H_s) (Fossen 2021, sec. 10.2).
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
    return Swell(
        frequency_radps=frequency,
        number_pm=number,
        amplitude_m=amplitude,
        from_rad=radians(waves.from_deg),
        spreading=waves.spreading,
        depth_m=depth_m,
    )


def wave_number_pm(frequency_radps: float, depth_m: float, gravity_mps2: float) -> float:
    """Return the root k (rad/m) of omega^2 = g k tanh(k d) (Airy 1845; Newman 1977, sec. 6.2).

    Newton's method on f(k) = k tanh(k d) - omega^2 / g, from the larger of the deep-water and the
    shallow-water root.
    """
    deep = frequency_radps**2 / gravity_mps2
    k = max(deep, frequency_radps / sqrt(gravity_mps2 * depth_m))
    for _ in range(_NEWTON_STEPS):
        t = tanh(k * depth_m)
        k -= (k * t - deep) / (t + k * depth_m * (1.0 - t * t))
    return k


def draw_components(swell: Swell, stream: Generator) -> Vector:
    """Draw phases and directions; return the component table, shape (components, 7).

    Each frequency has one direction, drawn from the spreading function by stratified sampling:
    two components of one frequency would form a standing wave pattern (Jefferys 1987, Appl. Ocean
    Res. 9).
    """
    # Component i travels towards the bearing b_i (rad): wave vector k_i (cos b_i, -sin b_i) in NWU,
    # rad/m. BOTTOM_DECAY: e^(-2 k d) with d the depth of the water, m.
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
    sea[:, PHASE] = phase
    sea[:, BOTTOM_DECAY] = np.exp(-2.0 * swell.number_pm * swell.depth_m)
    return sea


def spread_rad(share: Vector, spreading: float) -> Vector:
    """Return the quantile (rad off the mean direction) of the distribution cos^2s(angle/2)."""
    angle = np.linspace(-pi, pi, _SPECTRUM_SAMPLES)
    cumulative = np.cumsum(np.cos(0.5 * angle) ** (2.0 * spreading))
    return np.interp(share, cumulative / cumulative[-1], angle)


class WaveKinematics(NamedTuple):
    """Motion of the water due to waves at one point and instant, NWU."""

    velocity: Vector3
    """Velocity, m/s."""
    local_acceleration: Vector3
    """Time derivative of the velocity at a point that drifts with the surface current, m/s2."""
    along_north: Vector3
    along_west: Vector3
    along_up: Vector3
    """Derivatives of the velocity in each direction, 1/s."""
    elevation_m: float
    """Height of the surface above the still level."""
    rise_north: float
    rise_west: float
    """Slope of the surface."""
    head_m: float
    """Pressure due to waves as metres of water."""


@kernel
def motion(sea: Vector, north_m: float, west_m: float, z_m: float, time_s: float) -> WaveKinematics:
    """Return the sum of all components at a point, in a frame that moves with the surface current.

    ``z_m`` is the height above the still surface. For each component, with z limited to 0 and the
    water depth d (Airy 1845; Newman 1977, sec. 6.2):

        (u, v) = a sigma cosh k(z+d) / sinh kd  e cos theta
        w      = a sigma sinh k(z+d) / sinh kd  sin theta
        head   = a cosh k(z+d) / cosh kd  cos theta

    The hyperbolic functions are computed from exp(k z) and exp(-2 k d), which do not overflow:
    cosh k(z+d) / sinh kd = (exp(k z) + exp(-k(z + 2d))) / (1 - exp(-2 k d)). The horizontal
    derivatives follow from theta, the vertical ones from zero rotation and zero divergence.
    """
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
        # Depth factors cosh k(z+d) / sinh kd and sinh k(z+d) / sinh kd.
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
