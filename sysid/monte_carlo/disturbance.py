"""Disturbance of a simulated vehicle: the identified noise of both planes, tick by tick.

Moments and forces act on the hull; the pressure of waves moves the measured depth.
"""

import math
from collections.abc import Iterator, Mapping
from itertools import count
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mavlink_io.jit import entry_point
from mavlink_io.tick import TICK_S
from sysid.estimation.map import steady_state
from sysid.models import noise
from sysid.models.noise import Noise
from sysid.models.parameters import CandidateVehicle
from sysid.planes import PLANES, Plane

Array = NDArray[np.float64]

BLOCK = 1024
"""Number of ticks that are drawn at a time."""


class ShapingFilter(NamedTuple):
    """Discrete shaping filter x[k+1] = transition x[k] + root w[k], w standard normal.

    States: slow acceleration, wave acceleration and its rate (``sysid.models.noise``), rad/s^2.
    """

    transition: Array
    root: Array
    """Square root of the covariance of the process noise per tick."""
    spread: Array
    """Standard deviations of the initial state."""


def of_plane(vehicle: CandidateVehicle, plane: Plane, level: Noise) -> ShapingFilter:
    """Return the shaping filter of one plane at the autopilot's tick."""
    linear = steady_state.linear_plane(vehicle, plane)
    A, density, _, _, P0 = noise.system(linear, level)
    n = len(linear.states)
    disturbance_states = slice(n, n + noise.DISTURBANCE_STATES)
    transition, process = noise.discrete(
        A[disturbance_states, disturbance_states],
        density[disturbance_states, disturbance_states],
        TICK_S,
    )
    return ShapingFilter(transition, noise.root(process), np.sqrt(np.diag(P0)[disturbance_states]))


def wave_pressure(level: Noise) -> ShapingFilter:
    """Return the shaping filter of the depth (m) by the pressure of waves, without slow part."""
    A, density = noise.oscillator(level, level.wave_depth_m)
    waves = slice(1, 3)
    transition, root, spread = np.zeros((3, 3)), np.zeros((3, 3)), np.zeros(3)
    transition[waves, waves], process = noise.discrete(A, density, TICK_S)
    root[waves, waves] = noise.root(process)
    omega = 2.0 * math.pi * level.wave_frequency_hz
    spread[waves] = level.wave_depth_m, level.wave_depth_m * omega
    return ShapingFilter(transition, root, spread)


def initial_state(shaping_filter: ShapingFilter, rng: np.random.Generator) -> Array:
    """Return a random initial state of a shaping filter."""
    return shaping_filter.spread * rng.standard_normal(3)


def next_block(shaping_filter: ShapingFilter, state: Array, rng: np.random.Generator) -> Array:
    """Return the sum of slow and wave part in `BLOCK` ticks; ``state`` is updated."""
    process_noise = rng.standard_normal((BLOCK, 3)) @ shaping_filter.root.T
    return _generate(shaping_filter.transition, process_noise, state)


def wave_depths_m(level: Noise, rng: np.random.Generator) -> Iterator[Array]:
    """Return an iterator over the depth (m) by the pressure of waves in `BLOCK` ticks."""
    shaping_filter = wave_pressure(level)
    state = initial_state(shaping_filter, rng)
    return (next_block(shaping_filter, state, rng) for _ in count())


def wrenches(
    vehicle: CandidateVehicle, levels: Mapping[Plane, Noise], times: float, rng: np.random.Generator
) -> Iterator[Array]:
    """Yield the disturbing wrenches of `BLOCK` ticks at a time, (BLOCK, 6), N and N m in FLU.

    Parameters
    ----------
    vehicle : CandidateVehicle
        Vehicle with mass matrix M, added mass included.
    levels : Mapping
        Noise model of each plane.
    times : float
        Factor on the disturbance; the random draws do not depend on it.
    rng : Generator
        Random generator.

    Yields
    ------
    ndarray
        tau = M a with the generalised acceleration a of the noise model.
    """
    filters = {plane: of_plane(vehicle, plane, level) for plane, level in levels.items()}
    states = {plane: initial_state(each, rng) for plane, each in filters.items()}
    while True:
        accelerations = np.zeros((BLOCK, 6))
        for plane, shaping_filter in filters.items():
            _, force, moment = PLANES[plane].velocities
            accelerations[:, moment] = next_block(shaping_filter, states[plane], rng)
            accelerations[:, force] = (
                levels[plane].force_mps15 / TICK_S**0.5 * rng.standard_normal(BLOCK)
            )
        yield times * accelerations @ vehicle.model.inertia.M.T


@entry_point
def _generate(transition: Array, process_noise: Array, state: Array) -> Array:
    """Return slow plus wave acceleration tick by tick; ``state`` is updated for the next block."""
    accelerations = np.empty(len(process_noise))
    for k in range(len(process_noise)):
        accelerations[k] = state[0] + state[1]
        slow, wave, rate = state[0], state[1], state[2]
        for i in range(3):
            state[i] = (
                transition[i, 0] * slow
                + transition[i, 1] * wave
                + transition[i, 2] * rate
                + process_noise[k, i]
            )
    return accelerations
