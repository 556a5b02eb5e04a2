"""What a plant does under logged commands, and how that changes with each of its values. Both are
exact.

Between samples of the 50 Hz grid the duct's angle runs straight; one output step is STRIDE samples,
so the state is carried over it by one matrix and one tap for each angle on the way. A sample is
short against anything a vehicle does, so the exponential's series ends early, and so does that of
its derivative."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sitl.vehicle.jit import kernel
from sysid.data.segments import RATE_HZ
from sysid.estimation.linear import linear_model as plants
from sysid.estimation.linear import tailcone
from sysid.estimation.linear.linear_model import NUMBERS, LinearModel
from sysid.estimation.map.fit import STRIDE

Array = NDArray[np.float64]

DT = STRIDE / RATE_HZ
"""Of the outputs, seconds."""
TERMS = 22
"""Of the exponential's series: whole to rounding for a generator of up to norm 2, a plane hundred
times as fast."""


class SurfaceCommand(NamedTuple):
    """What a run was told."""

    angle_rad: Array
    """On the 50 Hz grid."""
    lead: int = 0
    """Samples of it before the first output: what the duct was still doing when the outputs
    begin."""


class DuctMotion(NamedTuple):
    """What the tailcone makes of a command, at every sample from the command's lead on."""

    angle_rad: Array
    """(samples,): of the duct, from that of level flight."""
    slopes: Array
    """(TAIL, samples): of the angle by each value of the tailcone."""


class Discrete(NamedTuple):
    """x[k+1] = transition x[k] + taps angles[k STRIDE ... (k+1) STRIDE], and the slopes of both by
    each number."""

    transition: Array
    """(n, n)"""
    taps: Array
    """(n, STRIDE + 1)"""
    transition_slopes: Array
    """(numbers, n, n)"""
    taps_slopes: Array
    """(numbers, n, STRIDE + 1)"""


def discretise(plant: LinearModel) -> Discrete:
    """One output step of the plane, exact for an angle that is straight between samples of the 50
    Hz grid."""
    frame, numbers = plant.frame, plant.values[: len(NUMBERS[plant.frame.plane])]
    A, B = plants.equations(frame, numbers)
    origin = plants.equations(frame, np.zeros(numbers.size))
    units = [plants.equations(frame, unit) for unit in np.eye(numbers.size)]
    slopes = np.stack([_sample_generator(dA - origin[0], dB - origin[1]) for dA, dB in units])
    # A straight angle is a state with a constant slope: the last entry is what it gains over the
    # sample.
    n = A.shape[0]
    M = _sample_generator(A, B)
    M[n, n + 1] = 1.0
    over, over_slopes = _exponential(M, slopes)
    return _combine_steps(over[:n], over_slopes[:, :n])


def _exponential(M: Array, slopes: Array) -> tuple[Array, Array]:
    """exp(M), (m, m), and its derivatives along each of ``slopes``, (count, m, m), by the series'
    own."""
    term, term_slopes = np.eye(len(M)), np.zeros_like(slopes)
    total, total_slopes = term.copy(), term_slopes.copy()
    for k in range(1, TERMS + 1):
        term_slopes = (term_slopes @ M + term @ slopes) / k
        term = term @ M / k
        total += term
        total_slopes += term_slopes
    return total, total_slopes


def _sample_generator(A: Array, B: Array) -> Array:
    """Generator of one sample, (n + 2, n + 2): states, angle, gain of the angle."""
    n = A.shape[0]
    M = np.zeros((n + 2, n + 2))
    M[:n, :n], M[:n, n] = A / RATE_HZ, B / RATE_HZ
    return M


def _combine_steps(over: Array, slopes: Array) -> Discrete:
    """STRIDE samples as one step. Value and slope travel together as the stacked pair (x, dx)."""
    n, count = over.shape[0], slopes.shape[0]
    pair = np.zeros((count, 2 * n, 2 * n))
    pair[:, :n, :n] = pair[:, n:, n:] = over[:, :n]
    pair[:, n:, :n] = slopes[:, :, :n]
    both = np.concatenate([np.broadcast_to(over, slopes.shape), slopes], axis=1)
    earlier, later = both[:, :, n] - both[:, :, n + 1], both[:, :, n + 1]
    taps = np.zeros((count, 2 * n, STRIDE + 1))
    whole = np.broadcast_to(np.eye(2 * n), pair.shape)
    for sample in reversed(range(STRIDE)):
        taps[:, :, sample] += np.einsum("kij,kj->ki", whole, earlier)
        taps[:, :, sample + 1] += np.einsum("kij,kj->ki", whole, later)
        whole = whole @ pair
    parts = whole[0, :n, :n], taps[0, :n], whole[:, n:, :n], taps[:, n:]
    return Discrete(*(np.ascontiguousarray(part) for part in parts))


@kernel
def _advance(transition: Array, taps: Array, angles: Array, x0: Array) -> Array:
    """States at every output step, (steps, n)."""
    n, width = taps.shape
    steps = (angles.size - 1) // (width - 1) + 1
    x = np.empty((steps, n))
    x[0] = x0
    for k in range(steps - 1):
        for i in range(n):
            total = 0.0
            for j in range(n):
                total += transition[i, j] * x[k, j]
            for j in range(width):
                total += taps[i, j] * angles[k * (width - 1) + j]
            x[k + 1, i] = total
    return x


@kernel
def _advance_slopes(by: Discrete, driven: DuctMotion, x: Array) -> Array:
    """Slopes of the states ``x`` by each number and each value of the tailcone, (numbers + TAIL,
    steps, n), from a start that does not depend on them."""
    count, n, width = by.taps_slopes.shape
    slopes = np.zeros((count + len(driven.slopes), x.shape[0], n))
    for k in range(x.shape[0] - 1):
        first = k * (width - 1)
        for p in range(len(slopes)):
            for i in range(n):
                total = 0.0
                for j in range(n):
                    total += by.transition[i, j] * slopes[p, k, j]
                if p < count:
                    for j in range(n):
                        total += by.transition_slopes[p, i, j] * x[k, j]
                    for j in range(width):
                        total += by.taps_slopes[p, i, j] * driven.angle_rad[first + j]
                else:
                    for j in range(width):
                        total += by.taps[i, j] * driven.slopes[p - count, first + j]
                slopes[p, k + 1, i] = total
    return slopes


def duct(plant: LinearModel, command: SurfaceCommand) -> Array:
    """Duct angle from that of level flight, at every sample from ``command.lead`` on."""
    return tailcone.angles(command.angle_rad, plants.actuator(plant))[command.lead :]


def duct_motion(plant: LinearModel, command: SurfaceCommand) -> DuctMotion:
    """The same with its slopes."""
    angle_rad, slopes = tailcone.angle_sensitivity(command.angle_rad, plants.actuator(plant))
    return DuctMotion(angle_rad[command.lead :], slopes[:, command.lead :])


def steps(command: SurfaceCommand) -> int:
    """Output steps of a run."""
    return (command.angle_rad.size - command.lead - 1) // STRIDE + 1


def outputs(
    plant: LinearModel, by: Discrete, command: SurfaceCommand, x0: Array, count: int
) -> Array:
    """(steps, count): rate, angle and, in pitch, depth, at every STRIDE-th sample, from the state
    ``x0``."""
    return outputs_to_duct(plant, by, duct(plant, command), x0, count)


def outputs_to_duct(
    plant: LinearModel, by: Discrete, angle_rad: Array, x0: Array, count: int
) -> Array:
    """``outputs`` to the duct's angle."""
    x: Array = _advance(by.transition, by.taps, angle_rad, x0)[:, 1 : 1 + count]
    x[:, 1] += plants.level_rad(plant)
    return x


def slopes(plant: LinearModel, by: Discrete, what: DuctMotion, x0: Array, count: int) -> Array:
    """(values, steps, count): how ``outputs`` change with each value, the starting state held."""
    x = _advance(by.transition, by.taps, what.angle_rad, x0)
    found = np.zeros((plant.values.size, x.shape[0], count))
    moved = _advance_slopes(by, what, x)[:, :, 1 : 1 + count]
    found[: len(moved)] = moved
    if plant.frame.plane == "pitch":
        found[-1, :, 1] = 1.0
    return found


def nuisances(by: Discrete, steps: int, count: int) -> Array:
    """(steps, count, n + 1): what each starting state and the gyro's bias leave in the outputs."""
    n = by.transition.shape[0]
    angles = np.zeros((steps - 1) * STRIDE + 1)
    found = np.zeros((steps, count, n + 1))
    for i, unit in enumerate(np.eye(n)):
        found[:, :, i] = _advance(by.transition, by.taps, angles, unit)[:, 1 : 1 + count]
    found[:, 0, n] = 1.0
    return found
