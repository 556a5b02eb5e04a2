"""What a test would tell: whitened sensitivities of its run, and what knowledge of z means for
design.

Information of runs adds up; with the belief's own it gives the covariance that the fit would report
(``sysid.estimation.map.fit``: the same residuals, whitened by the same filter, linearised about the
belief's mean)."""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.control_analysis.loop_transfer import Gains
from sysid.data.segments import RATE_HZ, Plane
from sysid.estimation.map import fit
from sysid.models import linear_planes, noise
from sysid.models.parameters import NAMES, PARAMETERS
from sysid.test_design import closed_loop as loops
from sysid.test_design import crossover
from sysid.test_design import prior as beliefs
from sysid.test_design.closed_loop import Loop
from sysid.test_design.prior import DesignPrior
from sysid.test_design.simulate import Manoeuvre, as_run, signal_rad

Array = NDArray[np.float64]

PLANES: tuple[Plane, ...] = ("yaw", "pitch")
STEP = 1e-3
"""Of the differences, in prior standard deviations."""


def information_of(
    belief: DesignPrior, manoeuvres: Sequence[Manoeuvre], gains: Gains
) -> list[Array]:
    """Information about z, (n, n), of each manoeuvre, all of one plane, flown from straight level
    flight."""
    flat = [told.reshape(-1, told.shape[2]) for told in sensitivities(belief, manoeuvres, gains)]
    return [jacobian.T @ jacobian for jacobian in flat]


def sensitivities(
    belief: DesignPrior, manoeuvres: Sequence[Manoeuvre], gains: Gains
) -> list[Array]:
    """(steps, outputs, n) of each manoeuvre: whitened outputs' derivatives by z, from LEAD_S before
    the test on."""
    if not manoeuvres:
        return []
    plane = manoeuvres[0].plane
    base = belief.vehicle(belief.mean)
    at = beliefs.level_flight(base, plane)
    loop = loops.of_vehicle(base, plane, gains, belief.noise[plane])
    experiments = [fit.dataset(as_run(m, at, _command_rad(m, loop))) for m in manoeuvres]
    longest = max(len(e.measured) for e in experiments)
    by = noise.build(
        fit.linear_plane(base, plane), belief.noise[plane], fit.STRIDE / RATE_HZ, longest
    )
    first = fit.residuals(base, experiments)
    told = [np.zeros((*r.shape, len(NAMES))) for r in first]
    for i, parameter in enumerate(PARAMETERS):
        if plane not in parameter.planes:
            continue
        moved = belief.vehicle(belief.mean + STEP * np.eye(len(NAMES))[i])
        for each, before, after in zip(told, first, fit.residuals(moved, experiments), strict=True):
            each[:, :, i] = noise.whiten_residual((after - before) / STEP, by)
    return told


def _command_rad(manoeuvre: Manoeuvre, loop: Loop) -> Array:
    signal = signal_rad(manoeuvre)
    return (
        loops.simulate(loop, manoeuvre.plane, signal).command_rad if manoeuvre.loop_on else signal
    )


class DesignUncertainty(NamedTuple):
    """Standard deviations of what design rests on, one plane."""

    static_gain_pct: float
    b1_pct: float
    p_fast_pct: float
    p_slow_pct: float
    delay_s: float
    crossover_db: float
    crossover_deg: float


class Slopes(NamedTuple):
    """Derivatives with respect to z of one plane's design numbers."""

    transfer: Array
    """(5, n): b1, b0, a1, a0 and the delay: what D-optimality is about. Any other
    five numbers of the same plane have the same optimum."""
    crossover: Array
    """(2, n): gain (natural logarithm) and phase (rad) at the crossover that the belief's mean
    allows."""
    reported: Array
    """(5, n): of ``DesignUncertainty``, relative but for the delay."""


def slopes(belief: DesignPrior, plane: Plane) -> Slopes:
    frequency = crossover.frequency_radps(belief.vehicle(belief.mean), plane)

    def transfer(z: Array) -> Array:
        vehicle = belief.vehicle(z)
        linear = fit.linear_plane(vehicle, plane)
        A, B = linear.A[:2, :2], linear.B[:2]
        b0 = float(A[1, 0] * B[0] - A[0, 0] * B[1])
        return np.array(
            [B[1], b0, -np.trace(A), np.linalg.det(A), vehicle.actuators[plane].delay_s]
        )

    def answer(z: Array) -> Array:
        return crossover.gain_and_phase(belief.vehicle(z), plane, frequency)

    def reported(z: Array) -> Array:
        vehicle = belief.vehicle(z)
        found = linear_planes.small_signal(fit.linear_plane(vehicle, plane))
        return np.array([*found[:4], vehicle.actuators[plane].delay_s])

    sizes = np.abs(reported(belief.mean))
    sizes[4] = 1.0
    return Slopes(
        _slope(transfer, belief.mean),
        _slope(answer, belief.mean),
        _slope(reported, belief.mean) / sizes[:, None],
    )


def _slope(function: Callable[[Array], Array], z: Array) -> Array:
    return np.column_stack(
        [(function(z + STEP * e) - function(z - STEP * e)) / (2.0 * STEP) for e in np.eye(z.size)]
    )


def numbers(slope: Slopes, covariance: Array) -> DesignUncertainty:
    """What a covariance of z leaves unsure."""
    sd = np.sqrt(np.einsum("ij,jk,ik->i", slope.reported, covariance, slope.reported))
    gain, phase = np.sqrt(np.einsum("ij,jk,ik->i", slope.crossover, covariance, slope.crossover))
    gain_pct, b1_pct, fast_pct, slow_pct = (100.0 * float(part) for part in sd[:4])
    gain_db = 20.0 * float(gain) / math.log(10.0)
    return DesignUncertainty(
        gain_pct, b1_pct, fast_pct, slow_pct, float(sd[4]), gain_db, math.degrees(phase)
    )


def determinant(slope: Slopes, covariance: Array) -> float:
    """Criterion D: log determinant of the design numbers' covariance; smaller is better."""
    return float(np.linalg.slogdet(slope.transfer @ covariance @ slope.transfer.T)[1])


def phase(slope: Slopes, covariance: Array) -> float:
    """Criterion crossover: variance of the crossover phase, deg²; smaller is better, the worse
    plane counts more."""
    row = np.degrees(slope.crossover[1])
    return float(row @ covariance @ row)


CRITERIA: dict[str, Callable[[Slopes, Array], float]] = {"d": determinant, "crossover": phase}
