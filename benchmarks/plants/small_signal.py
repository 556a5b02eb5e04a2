"""True linear behaviour of a plant: trim, calibration and response, by numerical differentiation.

The rows of the state matrix are central differences of ``forces.slopes`` at straight level flight
with the thrust of the tests.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import fsolve

from benchmarks.plants import actuators, forces
from benchmarks.plants.actuators import Axis
from benchmarks.plants.forces import Body

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

STEP = 1e-5
"""Difference step of states and angles (m/s, rad/s, rad)."""
CALIBRATIONS = 5
"""Number of corrections of tail and hull."""
YAW_STATES, PITCH_STATES = (1, 5), (2, 4, 7)
"""Indices of (v, r) and (w, q, theta)."""


class Trim(NamedTuple):
    """Straight level flight at the thrust of the tests."""

    state: Array
    elevator_rad: float
    """Angle of the surface itself."""


class Numbers(NamedTuple):
    """Small-signal numbers of a plane; the names are those of a model file."""

    static_gain_per_s: float
    b1_per_s2: float
    p_fast_per_s: float
    p_slow_per_s: float
    restoring_per_s2: float


def derivative(x: Array, rudder: float, elevator: float, body: Body) -> Array:
    """Return the derivative of the state at the design thrust."""
    out = np.empty(forces.STATES)
    forces.slopes(x, rudder, elevator, 1.0, body, out)
    return out


def trim(body: Body) -> Trim:
    """Return straight level flight: u, w, theta and elevator without acceleration or climb."""

    def state(unknown: Array) -> Array:
        x = np.zeros(forces.STATES)
        x[0], x[2], x[7] = unknown[:3]
        return x

    def imbalance(unknown: Array) -> Array:
        out = derivative(state(unknown), 0.0, float(unknown[3]), body)
        return out[[0, 2, 4, 9]]

    found = fsolve(imbalance, np.array([body.design_speed_mps, 0.0, 0.0, 0.0]), xtol=1e-12)
    return Trim(state(found), float(found[3]))


def linearise(body: Body, at: Trim, rows: tuple[int, ...], rudder: bool) -> tuple[Array, Array]:
    """Return A and B of the states ``rows`` for one surface."""
    A, B = np.empty((len(rows), len(rows))), np.empty(len(rows))
    for column, i in enumerate(rows):
        moved = STEP * (np.arange(forces.STATES) == i)
        A[:, column] = (
            derivative(at.state + moved, 0.0, at.elevator_rad, body)
            - derivative(at.state - moved, 0.0, at.elevator_rad, body)
        )[list(rows)] / (2.0 * STEP)
    up, down = (
        derivative(
            at.state,
            sign * STEP if rudder else 0.0,
            at.elevator_rad + (0.0 if rudder else sign * STEP),
            body,
        )
        for sign in (1.0, -1.0)
    )
    B[:] = (up - down)[list(rows)] / (2.0 * STEP)
    return A, B


def numbers(body: Body, at: Trim, yaw: bool) -> Numbers:
    """Return the small-signal numbers from the block of cross speed and rate.

    a0 = det A, b1 = B_2, b0 = A_21 B_1 - A_11 B_2; static gain b0 / a0.
    """
    A, B = linearise(body, at, YAW_STATES if yaw else PITCH_STATES, yaw)
    block = A[:2, :2]
    slow, fast = sorted(np.linalg.eigvals(block).real, key=abs)
    a0 = float(np.linalg.det(block))
    return Numbers(
        static_gain_per_s=float(A[1, 0] * B[0] - A[0, 0] * B[1]) / a0,
        b1_per_s2=float(B[1]),
        p_fast_per_s=float(fast),
        p_slow_per_s=float(slow),
        restoring_per_s2=0.0 if yaw else float(A[1, 2]),
    )


def response(
    body: Body, at: Trim, axis: Axis, gyro_lag_s: float, yaw: bool, omega_radps: Array
) -> ComplexArray:
    """Return the response from command to measured rate (1/s) at each frequency."""
    A, B = linearise(body, at, YAW_STATES if yaw else PITCH_STATES, yaw)
    s = 1j * omega_radps
    rate = np.array([np.linalg.solve(value * np.eye(len(A)) - A, B)[1] for value in s])
    return np.asarray(rate * actuators.response(axis, omega_radps) / (1.0 + s * gyro_lag_s))


def equivalent_delay_s(
    axis: Axis, gyro_lag_s: float, lag: tuple[float, float], omega_radps: float
) -> float:
    """Return the delay that, behind a known second-order lag, gives the true phase of command.

    ``lag`` is natural frequency (rad/s) and damping ratio from a bench test; drive and gyro are
    compared with it at ``omega_radps``.
    """
    s = 1j * omega_radps
    wn, zeta = lag
    assumed = wn**2 / (s**2 + 2.0 * zeta * wn * s + wn**2)
    true = actuators.response(axis, np.array([omega_radps]))[0] / (1.0 + s * gyro_lag_s)
    return float(-np.angle(true / assumed) / omega_radps)


def calibrate(body: Body, yaw: Array, pitch: Array, b1_per_s2: float) -> Body:
    """Set tail and hull so that straight flight has the given state matrices and b1 in yaw.

    ``yaw`` and ``pitch`` are the (2, 2) blocks of (v, r) and (w, q), 1/s and m/s.
    """
    for _ in range(CALIBRATIONS):  # the trim changes with the coefficients
        at = trim(body)
        u = float(at.state[0])
        b1 = float(linearise(body, at, YAW_STATES, True)[1][1])
        body = body._replace(tail_kgpm=body.tail_kgpm * b1_per_s2 / b1)
        m2, m3, j2, j3 = body.m_kg[1], body.m_kg[2], body.j_kgm2[1], body.j_kgm2[2]
        short_yaw = yaw - linearise(body, at, YAW_STATES, True)[0]
        short_pitch = pitch - linearise(body, at, PITCH_STATES, False)[0][:2, :2]
        d_yaw = (np.array([[m2], [j3]]) * short_yaw).ravel() / u
        d_pitch = (np.array([[m3], [j2]]) * short_pitch).ravel() / u
        body = body._replace(
            hull_yaw=_added(body.hull_yaw, d_yaw), hull_pitch=_added(body.hull_pitch, d_pitch)
        )
    return body


def _added(
    values: tuple[float, float, float, float], change: Array
) -> tuple[float, float, float, float]:
    """Return the sum, element by element."""
    a, b, c, d = (value + float(extra) for value, extra in zip(values, change, strict=True))
    return a, b, c, d
