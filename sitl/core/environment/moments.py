"""Disturbance moments on the vehicle, in addition to the forces of moving water.

In yaw and in pitch there is a slow moment (first-order Gauss-Markov process) and one in the wave
band (white noise through a lightly damped second-order filter); all four are independent. They
serve to test control loops at known levels; the table [waves] of a scenario simulates moving water
instead. Each process is discretised exactly and starts in its stationary distribution.
"""

from __future__ import annotations

from math import cos, exp, sin, sqrt
from typing import NamedTuple

from numpy.random import Generator


class SlowMoment(NamedTuple):
    """First-order Gauss-Markov process of unit variance: x(k+1) = decay x(k) + noise_gain n(k)."""

    decay: float
    """Factor of the value over one tick: exp(-tick / time constant)."""
    noise_gain: float
    """Gain of the unit white noise n: sqrt(1 - decay^2)."""


class SecondOrder(NamedTuple):
    """Second-order process of unit variance, discretised over one tick.

    x'' + 2 zeta omega x' + omega^2 x = white noise, with the states (x, x'/omega). In these states
    the stationary covariance is the identity I, so the noise covariance of a tick is I - Phi Phi^T.
    """

    transition: tuple[float, float, float, float]
    """Transition matrix Phi, row by row."""
    noise: tuple[float, float, float]
    """Lower Cholesky factor L of I - Phi Phi^T: elements (1,1), (2,1), (2,2)."""


class Disturbance(NamedTuple):
    """States of the four unit-variance processes at one instant, in the order yaw, pitch."""

    slow: tuple[float, float]
    wave: tuple[tuple[float, float], tuple[float, float]]
    """States (x, x'/omega)."""


class Levels(NamedTuple):
    """Discretised disturbances of a scenario; rms values in the order yaw, pitch."""

    slow: SlowMoment
    wave: SecondOrder
    slow_rms_nm: tuple[float, float]
    wave_rms_nm: tuple[float, float]


def slow_moment(time_constant_s: float, tick_s: float) -> SlowMoment:
    """Discretise the first-order process."""
    decay = exp(-tick_s / time_constant_s)
    return SlowMoment(decay, sqrt(1.0 - decay * decay))


def second_order(frequency_radps: float, damping: float, tick_s: float) -> SecondOrder:
    """Discretise the second-order process.

    Parameters
    ----------
    frequency_radps : float
        Natural frequency omega.
    damping : float
        Damping ratio zeta, 0 < zeta <= 1.
    tick_s : float
        Length T of a tick.

    Notes
    -----
    With r = sqrt(1 - zeta^2), c = exp(-zeta omega T) cos(r omega T) and
    s = exp(-zeta omega T) sin(r omega T) / r,

        Phi = [[c + zeta s, s], [-s, c - zeta s]],  L L^T = I - Phi Phi^T.
    """
    damped = sqrt(1.0 - damping * damping)
    decay, angle = exp(-damping * frequency_radps * tick_s), frequency_radps * tick_s
    c, s = decay * cos(damped * angle), decay * (sin(damped * angle) / damped if damped else angle)
    a, b, d = c + damping * s, s, c - damping * s
    q11, q12, q22 = 1.0 - a * a - b * b, a * b - b * d, 1.0 - b * b - d * d
    first = sqrt(q11)
    return SecondOrder((a, b, -b, d), (first, q12 / first, sqrt(q22 - q12 * q12 / q11)))


def sample_stationary(slow: Generator, wave: Generator) -> Disturbance:
    """Draw all four processes from their stationary distribution."""
    slow_yaw, slow_pitch = slow.standard_normal(2).tolist()
    a, b, c, d = wave.standard_normal(4).tolist()
    return Disturbance((slow_yaw, slow_pitch), ((a, b), (c, d)))


def advance(
    levels: Levels, disturbance: Disturbance, slow: Generator, wave: Generator
) -> Disturbance:
    """Return the disturbance one tick later."""
    decay, noise_gain = levels.slow
    n_yaw, n_pitch = slow.standard_normal(2).tolist()
    a, b, c, d = wave.standard_normal(4).tolist()
    return Disturbance(
        (
            decay * disturbance.slow[0] + noise_gain * n_yaw,
            decay * disturbance.slow[1] + noise_gain * n_pitch,
        ),
        (
            step_second_order(levels.wave, disturbance.wave[0], a, b),
            step_second_order(levels.wave, disturbance.wave[1], c, d),
        ),
    )


def moments_flu_nm(levels: Levels, disturbance: Disturbance) -> tuple[float, float]:
    """Return pitch and yaw moment (M, N) on the vehicle, FLU, N m."""
    yaw = (
        levels.slow_rms_nm[0] * disturbance.slow[0] + levels.wave_rms_nm[0] * disturbance.wave[0][0]
    )
    pitch = (
        levels.slow_rms_nm[1] * disturbance.slow[1] + levels.wave_rms_nm[1] * disturbance.wave[1][0]
    )
    return pitch, yaw


def step_second_order(
    process: SecondOrder, x: tuple[float, float], n1: float, n2: float
) -> tuple[float, float]:
    """Return x(k+1) = Phi x(k) + L n for two standard normal draws ``n1``, ``n2``."""
    p11, p12, p21, p22 = process.transition
    l11, l21, l22 = process.noise
    return p11 * x[0] + p12 * x[1] + l11 * n1, p21 * x[0] + p22 * x[1] + l21 * n1 + l22 * n2
