"""The moments that disturb the vehicle, beside whatever the water itself does.

Two act in yaw and in pitch, all four independent: a slow one (first-order Gauss-Markov) and one in
the band of the waves (white noise through a lightly damped second-order filter). They are pure
moments: levels a loop can be judged by, where [waves] of a scenario gives water that moves. Each
process is discretised exactly and starts stationary."""

from __future__ import annotations

from math import cos, exp, sin, sqrt
from typing import NamedTuple

from numpy.random import Generator


class SlowMoment(NamedTuple):
    """First-order Gauss-Markov process of unit variance over one tick: x' = keep x + renew n."""

    keep: float
    renew: float


class SecondOrder(NamedTuple):
    """x'' + 2 zeta omega x' + omega^2 x = white noise, of unit variance, over one tick, in the
    states (x, x'/omega).

    In these states the stationary covariance is the identity, hence the noise of a tick is I - Phi
    Phi^T."""

    transition: tuple[float, float, float, float]
    """Phi, row by row."""
    noise: tuple[float, float, float]
    """Lower Cholesky factor of I - Phi Phi^T: (1,1), (2,1), (2,2)."""


class Disturbance(NamedTuple):
    """The four unit processes as they stand at one instant, in order yaw, pitch."""

    slow: tuple[float, float]
    wave: tuple[tuple[float, float], tuple[float, float]]


class Levels(NamedTuple):
    """A scenario's disturbances in the form the plant runs on; rms values in order yaw, pitch."""

    slow: SlowMoment
    wave: SecondOrder
    slow_rms_nm: tuple[float, float]
    wave_rms_nm: tuple[float, float]


def slow_moment(time_constant_s: float, tick_s: float) -> SlowMoment:
    keep = exp(-tick_s / time_constant_s)
    return SlowMoment(keep, sqrt(1.0 - keep * keep))


def second_order(frequency_radps: float, damping: float, tick_s: float) -> SecondOrder:
    """The shaping filter over one tick; ``damping`` is at most 1, where the two poles meet."""
    damped = sqrt(1.0 - damping * damping)
    decay, angle = exp(-damping * frequency_radps * tick_s), frequency_radps * tick_s
    c, s = decay * cos(damped * angle), decay * (sin(damped * angle) / damped if damped else angle)
    a, b, d = c + damping * s, s, c - damping * s
    q11, q12, q22 = 1.0 - a * a - b * b, a * b - b * d, 1.0 - b * b - d * d
    first = sqrt(q11)
    return SecondOrder((a, b, -b, d), (first, q12 / first, sqrt(q22 - q12 * q12 / q11)))


def sample_stationary(slow: Generator, wave: Generator) -> Disturbance:
    """A draw of all four processes from their stationary distribution."""
    slow_yaw, slow_pitch = slow.standard_normal(2).tolist()
    a, b, c, d = wave.standard_normal(4).tolist()
    return Disturbance((slow_yaw, slow_pitch), ((a, b), (c, d)))


def advance(
    levels: Levels, disturbance: Disturbance, slow: Generator, wave: Generator
) -> Disturbance:
    """The disturbance one tick later."""
    keep, renew = levels.slow
    n_yaw, n_pitch = slow.standard_normal(2).tolist()
    a, b, c, d = wave.standard_normal(4).tolist()
    return Disturbance(
        (keep * disturbance.slow[0] + renew * n_yaw, keep * disturbance.slow[1] + renew * n_pitch),
        (
            step_second_order(levels.wave, disturbance.wave[0], a, b),
            step_second_order(levels.wave, disturbance.wave[1], c, d),
        ),
    )


def moments_flu_nm(levels: Levels, disturbance: Disturbance) -> tuple[float, float]:
    """Pitch and yaw moment on the vehicle, (M, N), N m."""
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
    """The states of a second-order process one tick later under two draws of white noise."""
    p11, p12, p21, p22 = process.transition
    l11, l21, l22 = process.noise
    return p11 * x[0] + p12 * x[1] + l11 * n1, p21 * x[0] + p22 * x[1] + l21 * n1 + l22 * n2
