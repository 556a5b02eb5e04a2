"""Disturbance moments on the vehicle, in addition to the forces of moving water.

In yaw and in pitch there is a slow moment (first-order Gauss-Markov process) and one in the wave
band (white noise through a lightly damped second-order filter); all four are independent. They
serve to test control loops at known levels; the table [waves] of a scenario simulates moving water
instead. Each process is discretised exactly and starts in its stationary distribution.
"""

from __future__ import annotations

from math import cos, exp, sin, sqrt
from typing import NamedTuple

from mavlink_io.jit import numeric
from sitl.core.draws import SLOW, WAVE, Draws, DrawTable, draw
from sitl.vehicle.vectors import Vector

PROCESSES = 6
"""Length of the state: four unit-variance processes at one instant.

Slow process of yaw and pitch, then (x, x'/omega) of the wave band for yaw and for pitch.
"""
_SLOW_YAW, _SLOW_PITCH, _WAVE_YAW, _WAVE_PITCH = 0, 1, 2, 4


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


def sample_stationary(stream: Draws) -> list[float]:
    """Draw all four processes from their stationary distribution."""
    return stream.normals(SLOW, 2) + stream.normals(WAVE, 4)


@numeric
def advance(levels: Levels, state: Vector, table: DrawTable) -> None:
    """Advance the processes by one tick, in place."""
    slow = levels.slow
    for i in (_SLOW_YAW, _SLOW_PITCH):
        state[i] = slow.decay * state[i] + slow.noise_gain * draw(table, SLOW)
    for i in (_WAVE_YAW, _WAVE_PITCH):
        step_second_order(levels.wave, state[i : i + 2], draw(table, WAVE), draw(table, WAVE))


@numeric
def moments_flu_nm(levels: Levels, state: Vector) -> tuple[float, float]:
    """Return pitch and yaw moment (M, N) on the vehicle, FLU, N m."""
    yaw = levels.slow_rms_nm[0] * state[_SLOW_YAW] + levels.wave_rms_nm[0] * state[_WAVE_YAW]
    pitch = levels.slow_rms_nm[1] * state[_SLOW_PITCH] + levels.wave_rms_nm[1] * state[_WAVE_PITCH]
    return pitch, yaw


@numeric
def step_second_order(process: SecondOrder, state: Vector, n1: float, n2: float) -> None:
    """Advance x(k+1) = Phi x(k) + L n in place, for two standard normal draws ``n1``, ``n2``."""
    p11, p12, p21, p22 = process.transition
    l11, l21, l22 = process.noise
    x1, x2 = state[0], state[1]
    state[0] = p11 * x1 + p12 * x2 + l11 * n1
    state[1] = p21 * x1 + p22 * x2 + l21 * n1 + l22 * n2
