"""Response of a linear plane to logged commands, and its derivatives by every value.

Both are exact.

The duct angle delta is linear between samples of the 50 Hz grid, h = 1 / RATE_HZ. One output step
is STRIDE samples; the state is carried over it by one matrix and one weight for each angle in the
step::

    x[k+1] = Phi x[k] + sum_j tap_j delta[k STRIDE + j],    j = 0 ... STRIDE

Over one sample Phi and the taps follow from exp(M), M = [[A h, B h, 0], [0, 0, 1], [0, 0, 0]] for
the state (x, delta, change of delta). A sample is short compared with the motion of a vehicle, so
that the power series of the exponential and of its derivative converge fast.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mavlink_io.jit import kernel
from sysid.data.runs import RATE_HZ
from sysid.estimation.linear import linear_model, tailcone
from sysid.estimation.linear.linear_model import NUMBERS, LinearModel
from sysid.estimation.map.datasets import STRIDE

Array = NDArray[np.float64]

TERMS = 22
"""Terms of the power series of the exponential.

It is exact to rounding for a generator of norm 2, that is, for a plane a hundred times as fast.
"""


class SurfaceCommand(NamedTuple):
    """Command of a run."""

    angle_rad: Array
    """(samples,), commanded angle on the 50 Hz grid, rad."""
    lead: int = 0
    """Samples before the first output; they determine the duct motion at the first output."""


class DuctMotion(NamedTuple):
    """Duct angle for a command, from the first output on."""

    angle_rad: Array
    """(samples,), duct angle relative to level flight, rad."""
    slopes: Array
    """(TAIL, samples), derivatives by each value of the tailcone."""


class Discrete(NamedTuple):
    """One output step of a plane, and its derivatives by each coefficient.

    x[k+1] = transition x[k] + taps angles[k STRIDE ... (k+1) STRIDE].
    """

    transition: Array
    """(n, n), Phi."""
    taps: Array
    """(n, STRIDE + 1), weights of the duct angles."""
    transition_slopes: Array
    """(numbers, n, n), derivatives of the transition by each coefficient."""
    taps_slopes: Array
    """(numbers, n, STRIDE + 1), derivatives of the weights by each coefficient."""


def discretise(model: LinearModel) -> Discrete:
    """Return one output step, exact for a duct angle that is linear between 50 Hz samples.

    Parameters
    ----------
    model : LinearModel
        Structure and values.

    Returns
    -------
    Discrete
        Transition over STRIDE samples and input weights, with their slopes by the coefficients.
    """
    frame, numbers = model.frame, model.values[: len(NUMBERS[model.frame.plane])]
    A, B = linear_model.equations(frame, numbers)
    origin = linear_model.equations(frame, np.zeros(numbers.size))
    unit_equations = [
        linear_model.equations(frame, unit_vector) for unit_vector in np.eye(numbers.size)
    ]
    slopes = np.stack(
        [_sample_generator(dA - origin[0], dB - origin[1]) for dA, dB in unit_equations]
    )
    # A linear angle is a state with a constant slope: the last state is its change per sample.
    n = A.shape[0]
    M = _sample_generator(A, B)
    M[n, n + 1] = 1.0
    sample_map, sample_map_slopes = _exponential(M, slopes)
    return _combine_steps(sample_map[:n], sample_map_slopes[:, :n])


def _exponential(M: Array, slopes: Array) -> tuple[Array, Array]:
    """Return exp(M) and its derivatives along ``slopes`` (count, m, m), by the power series.

    Terms T_k = T_{k-1} M / k and dT_k = (dT_{k-1} M + T_{k-1} dM) / k.
    """
    term, term_slopes = np.eye(len(M)), np.zeros_like(slopes)
    total, total_slopes = term.copy(), term_slopes.copy()
    for k in range(1, TERMS + 1):
        term_slopes = (term_slopes @ M + term @ slopes) / k
        term = term @ M / k
        total += term
        total_slopes += term_slopes
    return total, total_slopes


def _sample_generator(A: Array, B: Array) -> Array:
    """Return the generator of one sample, (n + 2, n + 2).

    The state is (x, angle, change of the angle per sample).
    """
    n = A.shape[0]
    M = np.zeros((n + 2, n + 2))
    M[:n, :n], M[:n, n] = A / RATE_HZ, B / RATE_HZ
    return M


def _combine_steps(sample_map: Array, slopes: Array) -> Discrete:
    """Combine STRIDE samples to one output step. Value and derivative are stacked as (x, dx)."""
    # One sample: x <- F x + g0 delta_j + g1 (delta_j+1 - delta_j), [F g0 g1] = ``sample_map``, so
    # that delta_j has the weight g0 - g1 and delta_j+1 the weight g1. Over S samples, j = 0 ... S:
    #     Phi = F^S,   tap_j = F^(S-1-j) (g0 - g1) + F^(S-j) g1   (one term at the two ends).
    # Derivative by a coefficient: the same with the pair matrix [[F, 0], [dF, F]].
    n, count = sample_map.shape[0], slopes.shape[0]
    pair = np.zeros((count, 2 * n, 2 * n))
    pair[:, :n, :n] = pair[:, n:, n:] = sample_map[:, :n]
    pair[:, n:, :n] = slopes[:, :, :n]
    stacked = np.concatenate([np.broadcast_to(sample_map, slopes.shape), slopes], axis=1)
    earlier_tap, later_tap = stacked[:, :, n] - stacked[:, :, n + 1], stacked[:, :, n + 1]
    taps = np.zeros((count, 2 * n, STRIDE + 1))
    product = np.broadcast_to(np.eye(2 * n), pair.shape)
    for sample in reversed(range(STRIDE)):
        taps[:, :, sample] += np.einsum("kij,kj->ki", product, earlier_tap)
        taps[:, :, sample + 1] += np.einsum("kij,kj->ki", product, later_tap)
        product = product @ pair
    parts = product[0, :n, :n], taps[0, :n], product[:, n:, :n], taps[:, n:]
    return Discrete(*(np.ascontiguousarray(part) for part in parts))


@kernel
def _advance(transition: Array, taps: Array, angles: Array, x0: Array) -> Array:
    """Return the states at every output step, (steps, n): the recursion of the module docstring."""
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
def _advance_slopes(discrete: Discrete, duct_motion: DuctMotion, x: Array) -> Array:
    """Return the derivatives of the states by each value, (numbers + TAIL, steps, n).

    dx[k+1] = Phi dx[k] + dPhi x[k] + dtaps angles + taps dangles, from zero.
    """
    count, n, width = discrete.taps_slopes.shape
    slopes = np.zeros((count + len(duct_motion.slopes), x.shape[0], n))
    for k in range(x.shape[0] - 1):
        first = k * (width - 1)
        for p in range(len(slopes)):
            for i in range(n):
                total = 0.0
                for j in range(n):
                    total += discrete.transition[i, j] * slopes[p, k, j]
                if p < count:
                    for j in range(n):
                        total += discrete.transition_slopes[p, i, j] * x[k, j]
                    for j in range(width):
                        total += discrete.taps_slopes[p, i, j] * duct_motion.angle_rad[first + j]
                else:
                    for j in range(width):
                        total += discrete.taps[i, j] * duct_motion.slopes[p - count, first + j]
                slopes[p, k + 1, i] = total
    return slopes


def duct(model: LinearModel, command: SurfaceCommand) -> Array:
    """Return the duct angle relative to level flight.

    Parameters
    ----------
    model : LinearModel
        Structure and values, which include the actuator's.
    command : SurfaceCommand
        Command before and during a run.

    Returns
    -------
    ndarray
        Duct angle from ``command.lead`` on, in radians.
    """
    return tailcone.angles(command.angle_rad, linear_model.actuator(model))[command.lead :]


def duct_motion(model: LinearModel, command: SurfaceCommand) -> DuctMotion:
    """Duct angle relative to level flight from ``command.lead`` on, with its derivatives."""
    angle_rad, slopes = tailcone.angle_sensitivity(command.angle_rad, linear_model.actuator(model))
    return DuctMotion(angle_rad[command.lead :], slopes[:, command.lead :])


def steps(command: SurfaceCommand) -> int:
    """Return the number of output steps of a run.

    Parameters
    ----------
    command : SurfaceCommand
        Command before and during the run.

    Returns
    -------
    int
        Number of every STRIDE-th sample from ``command.lead`` on.
    """
    return (command.angle_rad.size - command.lead - 1) // STRIDE + 1


def outputs(
    model: LinearModel, discrete: Discrete, command: SurfaceCommand, x0: Array, count: int
) -> Array:
    """Return the outputs of a run that starts at ``x0``.

    Parameters
    ----------
    model : LinearModel
        Structure and values.
    discrete : Discrete
        Output step of the model, from `discretise`.
    command : SurfaceCommand
        Command before and during the run.
    x0 : ndarray, shape (n,)
        Initial state.
    count : int
        Number of outputs.

    Returns
    -------
    ndarray, shape (steps, count)
        Rate (rad/s), angle (rad) and, in pitch, depth (m), at every STRIDE-th sample.
    """
    return outputs_to_duct(model, discrete, duct(model, command), x0, count)


def outputs_to_duct(
    model: LinearModel, discrete: Discrete, angle_rad: Array, x0: Array, count: int
) -> Array:
    """Return the outputs for a given duct angle, (steps, count)."""
    x: Array = _advance(discrete.transition, discrete.taps, angle_rad, x0)[:, 1 : 1 + count]
    x[:, 1] += linear_model.level_rad(model)
    return x


def slopes(
    model: LinearModel, discrete: Discrete, motion: DuctMotion, x0: Array, count: int
) -> Array:
    """Return the derivatives of ``outputs`` by each value, (values, steps, count).

    The initial state is fixed.
    """
    x = _advance(discrete.transition, discrete.taps, motion.angle_rad, x0)
    derivatives = np.zeros((model.values.size, x.shape[0], count))
    state_slopes = _advance_slopes(discrete, motion, x)[:, :, 1 : 1 + count]
    derivatives[: len(state_slopes)] = state_slopes
    derivatives[len(state_slopes) :, :, 1] = 1.0  # level pitch, in pitch
    return derivatives


def nuisances(discrete: Discrete, steps: int, count: int) -> Array:
    """Effect of each initial state and of the gyro bias on the outputs, (steps, count, n + 1)."""
    n = discrete.transition.shape[0]
    angles = np.zeros((steps - 1) * STRIDE + 1)
    columns = np.zeros((steps, count, n + 1))
    for i, unit in enumerate(np.eye(n)):
        columns[:, :, i] = _advance(discrete.transition, discrete.taps, angles, unit)[
            :, 1 : 1 + count
        ]
    columns[:, 0, n] = 1.0
    return columns
