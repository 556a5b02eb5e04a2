"""What pushes a rehearsed vehicle: the identified noise of both planes, played tick by tick."""

from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sitl.vehicle.jit import entry_point
from sysid.control_analysis.loop_transfer import TICK_S
from sysid.data.segments import Plane
from sysid.estimation.map import fit
from sysid.models import noise
from sysid.models.noise import Noise
from sysid.models.parameters import CandidateVehicle

Array = NDArray[np.float64]

BLOCK = 1024
"""Ticks that are drawn at a time."""
ACTS_ON: dict[Plane, tuple[int, int]] = {"yaw": (1, 5), "pitch": (2, 4)}
"""Rows of the generalised acceleration (FLU) that a plane's force and moment stand in."""


class ShapingFilter(NamedTuple):
    """Slow moment, waves and their rate (``sysid.models.noise``), discrete."""

    transition: Array
    root: Array
    """Of the covariance that a tick adds."""
    spread: Array
    """Standard deviations when it begins."""


def of_plane(vehicle: CandidateVehicle, plane: Plane, level: Noise) -> ShapingFilter:
    linear = fit.linear_plane(vehicle, plane)
    A, density, _, _, P0 = noise.system(linear, level)
    n = len(linear.states)
    sea = slice(n, n + 3)
    transition, process = noise.discrete(A[sea, sea], density[sea, sea], TICK_S)
    return ShapingFilter(transition, noise.root(process), np.sqrt(np.diag(P0)[sea]))


def wrenches(
    vehicle: CandidateVehicle, levels: Mapping[Plane, Noise], times: float, rng: np.random.Generator
) -> Iterator[Array]:
    """For every tick (6,), N and N m in FLU: such as give the accelerations of the noise model,
    ``times`` over.

    The draws do not depend on ``times``: a rougher sea is the same sea, louder.
    """
    colours = {plane: of_plane(vehicle, plane, level) for plane, level in levels.items()}
    states = {plane: colour.spread * rng.standard_normal(3) for plane, colour in colours.items()}
    while True:
        accelerations = np.zeros((BLOCK, 6))
        for plane, colour in colours.items():
            force, moment = ACTS_ON[plane]
            kicks = rng.standard_normal((BLOCK, 3)) @ colour.root.T
            accelerations[:, moment] = _generate(colour.transition, kicks, states[plane])
            accelerations[:, force] = (
                levels[plane].force_mps15 / TICK_S**0.5 * rng.standard_normal(BLOCK)
            )
        yield from times * accelerations @ vehicle.model.inertia.M.T


@entry_point
def _generate(transition: Array, kicks: Array, state: Array) -> Array:
    """Slow moment and waves together, tick by tick; ``state`` is left where the next block
    begins."""
    out = np.empty(len(kicks))
    for k in range(len(kicks)):
        out[k] = state[0] + state[1]
        slow, wave, rate = state[0], state[1], state[2]
        for i in range(3):
            state[i] = (
                transition[i, 0] * slow
                + transition[i, 1] * wave
                + transition[i, 2] * rate
                + kicks[k, i]
            )
    return out
