"""Dives of a plant: loops, sea, sensors and tests.

The loops are those of a first dive: heading PID, depth to pitch to elevator. They run at 50 Hz on
the measured motion, which lags the true one. A test replaces the command of its surface by trim
plus signal until it ends or the vehicle leaves the envelope.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from benchmarks.plants import actuators, forces
from benchmarks.plants.actuators import STEP_S, Axis
from benchmarks.plants.catalogue import Plant
from benchmarks.plants.forces import Body

Array = NDArray[np.float64]

TICK_STEPS = 5
"""Steps of the simulation per tick of the autopilot, 50 Hz."""
TICK_S = TICK_STEPS * STEP_S
QUEUE = 200
"""Steps that the queue of delayed commands holds."""
DEPTH_M = 20.0
MAX_HEADING_RAD, MAX_PITCH_RAD = math.radians(180.0), math.radians(35.0)
"""Change of heading or pitch that ends a test."""
SLOW_RADPS2, WAVE_RADPS2 = math.radians(0.128), math.radians(0.261)
"""Standard deviations of the angular accelerations by slow moments and by waves."""
WAVE_TONES = 12
FORCE_SHARE = 0.3
"""Sway and heave acceleration (m/s2) per angular acceleration (rad/s2) and metre of length."""
SLOW_S = 4.5
"""Correlation time of the slow moments."""


class Gains(NamedTuple):
    """Gains of the loops."""

    heading_p: float
    heading_d: float
    heading_i: float
    pitch_p: float
    pitch_d: float
    depth_p: float
    depth_i: float
    max_heading_error_rad: float = math.inf
    """Largest heading error on which the loop acts, as behind a reference of limited rate."""


class Test(NamedTuple):
    """One test: surface, start and signal."""

    rudder: bool
    start_s: float
    signal_rad: Array
    """At 50 Hz, relative to trim."""


class Recorded(NamedTuple):
    """Measured motion and commands at 50 Hz."""

    rows: Array
    """(ticks, 10), SI units and radians.

    p, q, r, roll, pitch, heading, depth, rudder, elevator, speed.
    """
    under_test: NDArray[np.int64]
    """0 none, 1 rudder, 2 elevator."""


def accelerations(ticks: int, rng: np.random.Generator, level: float) -> Array:
    """Return disturbing angular accelerations about y and z, (ticks, 2), rad/s2.

    Waves: tones with Rayleigh amplitudes between 0.1 and 0.25 Hz. Slow: first-order process.
    """
    time_s = TICK_S * np.arange(ticks)
    out = np.empty((ticks, 2))
    for axis in range(2):
        frequency = rng.uniform(0.10, 0.25, WAVE_TONES)
        weight = rng.rayleigh(1.0, WAVE_TONES) * np.exp(-(((frequency - 0.15) / 0.05) ** 2))
        phase = rng.uniform(0.0, 2.0 * math.pi, WAVE_TONES)
        waves = np.sin(2.0 * math.pi * np.outer(time_s, frequency) + phase) @ weight
        keep = math.exp(-TICK_S / SLOW_S)
        draws = rng.standard_normal(ticks) * math.sqrt(1.0 - keep**2)
        out[:, axis] = level * (
            WAVE_RADPS2 * waves / float(np.std(waves)) + SLOW_RADPS2 * _first_order(draws, keep)
        )
    return out


@njit(cache=True)
def _first_order(draws: Array, keep: float) -> Array:
    """Return x[k] = keep x[k-1] + draws[k]."""
    out = np.empty_like(draws)
    x = 0.0
    for k in range(draws.size):
        x = keep * x + draws[k]
        out[k] = x
    return out


@njit(cache=True)
def _advance(
    x: Array,
    rudder: float,
    elevator: float,
    thrust: float,
    push: Array,
    body: Body,
    work: Array,
) -> None:
    """Advance the body one step by the midpoint method with the disturbance ``push``."""
    forces.slopes(x, rudder, elevator, thrust, body, work[0])
    for i in range(forces.STATES):
        work[1, i] = x[i] + 0.5 * STEP_S * (work[0, i] + push[i])
    forces.slopes(work[1], rudder, elevator, thrust, body, work[0])
    for i in range(forces.STATES):
        x[i] += STEP_S * (work[0, i] + push[i])


@njit(cache=True)
def _dive(
    start: Array,
    body: Body,
    axes: tuple[Axis, Axis],
    trim: tuple[float, float],
    travel: float,
    gains: Gains,
    signals: Array,
    wanted: NDArray[np.int64],
    pushes: Array,
    thrust: Array,
    lags: tuple[float, float, float],
    errors: Array,
    grip: Array,
) -> tuple[Array, NDArray[np.int64]]:
    """Simulate all ticks; ``wanted`` names the surface under test, ``errors`` the sensor noise.

    ``grip`` is the share of a deflection from trim that reaches the surfaces.
    """
    ticks = signals.size
    rows, under = np.empty((ticks, 10)), np.zeros(ticks, np.int64)
    x, work, push = start.copy(), np.empty((2, forces.STATES)), np.zeros(forces.STATES)
    drives = np.zeros((2, actuators.STATES))
    for a in range(2):
        drives[a, 0] = drives[a, 2] = trim[a]
        drives[a, 3] = trim[a] + axes[a].bias_rad
    delays = np.array([axes[a].delay_s / STEP_S for a in range(2)])
    queue = np.empty((2, QUEUE))
    for a in range(2):
        queue[a] = trim[a]
    true = np.zeros(8)
    measured = np.zeros(8)  # p, q, r, roll, pitch, heading, depth, speed behind their lags
    for i in range(3):
        measured[3 + i] = x[6 + i]
    measured[6], measured[7] = x[9], x[0]
    integral = np.zeros(2)
    reference = np.zeros(2)
    over = False
    commands = np.array([trim[0], trim[1]])
    head = 0
    for k in range(ticks):
        seen = measured + errors[k]
        if wanted[k] == 0 or (k > 0 and wanted[k - 1] == 0):
            over = False
            reference[0], reference[1] = seen[5], seen[4]
        if wanted[k] != 0 and (
            abs(seen[5] - reference[0]) > MAX_HEADING_RAD
            or abs(seen[4] - reference[1]) > MAX_PITCH_RAD
        ):
            over = True
        under[k] = 0 if over else wanted[k]
        psi = seen[5] - 2.0 * math.pi * math.floor(seen[5] / (2.0 * math.pi) + 0.5)
        psi = min(max(psi, -gains.max_heading_error_rad), gains.max_heading_error_rad)
        if under[k] == 1:
            commands[0] = trim[0] + signals[k]
        else:
            integral[0] = min(max(integral[0] - gains.heading_i * psi * TICK_S, -0.1), 0.1)
            commands[0] = trim[0] - gains.heading_p * psi - gains.heading_d * seen[2] + integral[0]
        if under[k] == 2:
            commands[1] = trim[1] + signals[k]
        else:
            error = seen[6] - DEPTH_M
            integral[1] = min(max(integral[1] + gains.depth_i * error * TICK_S, -0.1), 0.1)
            goal = min(max(gains.depth_p * error + integral[1], -0.3), 0.3)
            commands[1] = trim[1] + gains.pitch_p * (goal - seen[4]) - gains.pitch_d * seen[1]
        for a in range(2):
            commands[a] = min(max(commands[a], -travel), travel)
        for i in range(7):
            rows[k, i] = seen[i]
        rows[k, 7], rows[k, 8], rows[k, 9] = commands[0], commands[1], seen[7]
        push[4], push[5] = pushes[k, 0], pushes[k, 1]
        push[1] = FORCE_SHARE * body.length_m * pushes[k, 1]
        push[2] = -FORCE_SHARE * body.length_m * pushes[k, 0]
        for _ in range(TICK_STEPS):
            angles = np.empty(2)
            for a in range(2):
                queue[a, head % QUEUE] = trim[a] + grip[k] * (commands[a] - trim[a])
                # The command of a delay that is no whole number of steps: the mean over the step.
                whole = int(delays[a])
                newer, older = (
                    queue[a, (head - whole) % QUEUE],
                    queue[a, (head - whole - 1) % QUEUE],
                )
                late = newer + (delays[a] - whole) * (older - newer)
                angles[a] = actuators.advance(drives[a], late, axes[a])
            head += 1
            for i in range(8):
                true[i] = x[3 + i] if i < 6 else (x[9] if i == 6 else x[0])
            _advance(x, angles[0], angles[1], thrust[k], push, body, work)
            for i in range(8):
                now = x[3 + i] if i < 6 else (x[9] if i == 6 else x[0])
                lag = lags[0] if i < 3 else (lags[1] if i < 6 else (lags[2] if i == 6 else 0.1))
                if lag == 0.0:
                    measured[i] = now
                else:
                    share = 1.0 - math.exp(-STEP_S / lag)
                    measured[i] += share * (0.5 * (true[i] + now) - measured[i])
    return rows, under


def sensor_errors(ticks: int, speed_noise_mps: float, rng: np.random.Generator) -> Array:
    """Return the errors of rates, angles, depth and speed, (ticks, 8).

    White noise, a constant gyro bias, and attitude errors that wander by 0.1 deg within 20 s.
    """
    errors = rng.standard_normal((ticks, 8))
    errors[:, :3] *= math.radians(0.05)
    errors[:, 3:6] *= math.radians(0.08)
    errors[:, 6] *= 0.005
    errors[:, 7] *= speed_noise_mps
    errors[:, :3] += math.radians(0.02) * rng.standard_normal(3)
    keep = math.exp(-TICK_S / 20.0)
    for column in range(3, 6):
        draws = rng.standard_normal(ticks) * math.sqrt(1.0 - keep**2)
        errors[:, column] += math.radians(0.1) * _first_order(draws, keep)
    return errors


def dive(
    plant: Plant,
    tests: list[Test],
    duration_s: float,
    gains: Gains,
    rng: np.random.Generator,
    level: float = 1.0,
    grip: float = 1.0,
) -> Recorded:
    """Simulate one dive.

    Parameters
    ----------
    plant : Plant
        The vehicle.
    tests : list of Test
        Tests in the order of their start.
    duration_s : float
        Duration of the dive, s.
    gains : Gains
        Gains of the loops.
    rng : Generator
        Source of sea and sensor noise.
    level : float
        Size of the disturbance; 1 is the rough sea of the study.
    grip : float
        Share of the deflection that reaches the surface in the second half of every other test,
        because the coupling between drive and surface slips; 1 for a sound tail.

    Returns
    -------
    Recorded
        Measured motion, commands and tests at 50 Hz.
    """
    ticks = int(duration_s / TICK_S)
    signals, wanted, grips = np.zeros(ticks), np.zeros(ticks, np.int64), np.ones(ticks)
    for number, test in enumerate(tests):
        first = int(test.start_s / TICK_S)
        part = slice(first, first + test.signal_rad.size)
        signals[part], wanted[part] = test.signal_rad, 1 if test.rudder else 2
        if number % 2:
            grips[first + test.signal_rad.size // 2 : part.stop] = grip
    start = plant.trim.state.copy()
    start[9] = DEPTH_M
    rows, under = _dive(
        start,
        plant.body,
        (plant.rudder, plant.elevator),
        plant.trim_command_rad,
        plant.travel_rad,
        gains,
        signals,
        wanted,
        accelerations(ticks, rng, level),
        np.ones(ticks),
        (plant.sensors.gyro_lag_s, plant.sensors.angle_lag_s, plant.sensors.depth_lag_s),
        sensor_errors(ticks, plant.sensors.speed_noise_mps, rng),
        grips,
    )
    return Recorded(rows, under)
