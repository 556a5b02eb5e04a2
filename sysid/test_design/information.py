"""Fisher information of a test, and the resulting uncertainty of design parameters.

With J the whitened sensitivities of the outputs with respect to z, a test has the information J^T
J. Information of tests is additive; with the inverse covariance of the prior it gives the
covariance that the fit would report (``sysid.estimation.map.fit``: same residuals and whitening
filter, linearised at the prior's mean)::

    P = (P_0^-1 + sum_k J_k^T J_k)^-1
"""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.control_analysis.loop_transfer import Gains
from sysid.estimation.map import datasets, steady_state
from sysid.estimation.map.datasets import STEP_S
from sysid.models import linear_planes, noise
from sysid.models.parameters import NAMES, PARAMETERS
from sysid.planes import Plane
from sysid.test_design import closed_loop as loops
from sysid.test_design import prior as design_priors
from sysid.test_design.closed_loop import Loop
from sysid.test_design.prior import DesignPrior
from sysid.test_design.simulate import Manoeuvre, as_run, signal_rad
from sysid.validation import crossover

Array = NDArray[np.float64]

STEP = 1e-3
"""Step of finite differences, in prior standard deviations."""


def information_of(
    prior: DesignPrior, manoeuvres: Sequence[Manoeuvre], gains: Gains
) -> list[Array]:
    """Return the information matrix of z, (n, n), of each manoeuvre.

    Parameters
    ----------
    prior : DesignPrior
        Prior of z.
    manoeuvres : Sequence of Manoeuvre
        Tests of one plane, from straight level flight.
    gains : Gains
        Gains of the loops, for tests with the loop on.

    Returns
    -------
    list of ndarray
        J^T J of each manoeuvre.
    """
    jacobians = [
        jacobian.reshape(-1, jacobian.shape[2])
        for jacobian in sensitivities(prior, manoeuvres, gains)
    ]
    return [jacobian.T @ jacobian for jacobian in jacobians]


def sensitivities(prior: DesignPrior, manoeuvres: Sequence[Manoeuvre], gains: Gains) -> list[Array]:
    """Return the whitened sensitivities of each manoeuvre, (steps, outputs, n).

    Forward differences of the residuals with respect to z, whitened with the filter of the noise
    model. They begin `LEAD_S` before the test.
    """
    if not manoeuvres:
        return []
    plane = manoeuvres[0].plane
    base = prior.vehicle(prior.mean)
    trim = design_priors.level_flight(base, plane)
    loop = loops.of_vehicle(base, plane, gains, prior.noise[plane])
    experiments = [datasets.dataset(as_run(m, trim, _command_rad(m, loop))) for m in manoeuvres]
    longest = max(len(e.measured) for e in experiments)
    whitening = noise.build(
        steady_state.linear_plane(base, plane), prior.noise[plane], STEP_S, longest
    )
    residuals = datasets.residuals(base, experiments)
    jacobians = [np.zeros((*r.shape, len(NAMES))) for r in residuals]
    for i, parameter in enumerate(PARAMETERS):
        if plane not in parameter.planes:
            continue
        perturbed = prior.vehicle(prior.mean + STEP * np.eye(len(NAMES))[i])
        for jacobian, residual, perturbed_residual in zip(
            jacobians, residuals, datasets.residuals(perturbed, experiments), strict=True
        ):
            jacobian[:, :, i] = noise.whiten_residual(
                (perturbed_residual - residual) / STEP, whitening
            )
    return jacobians


def _command_rad(manoeuvre: Manoeuvre, loop: Loop) -> Array:
    """Return the command relative to trim: the test, with the loop on plus its feedback."""
    signal = signal_rad(manoeuvre)
    return (
        loops.simulate(loop, manoeuvre.plane, signal).command_rad if manoeuvre.loop_on else signal
    )


class DesignUncertainty(NamedTuple):
    """Standard deviations of the design parameters of one plane."""

    static_gain_pct: float
    b1_pct: float
    p_fast_pct: float
    p_slow_pct: float
    delay_s: float
    crossover_db: float
    crossover_deg: float


class Slopes(NamedTuple):
    """Derivatives of one plane's design parameters with respect to z."""

    transfer: Array
    """(5, n): b1, b0, a1, a0 and the delay, for D-optimality.

    The rate response is (b1 s + b0) / (s^2 + a1 s + a0) exp(-s delay). D-optimality does not depend
    on the choice of five parameters of the same plane.
    """
    crossover: Array
    """(2, n): ln gain and phase (rad) at the feasible crossover of the prior's mean."""
    reported: Array
    """(5, n): the first five of ``DesignUncertainty``, relative except for the delay."""


def slopes(prior: DesignPrior, plane: Plane) -> Slopes:
    """Return the derivatives of a plane's design parameters at the prior's mean."""
    frequency = crossover.highest_feasible_radps(prior.vehicle(prior.mean), plane)

    def transfer(z: Array) -> Array:
        """Return b1, b0, a1, a0 and the delay."""
        vehicle = prior.vehicle(z)
        linear = steady_state.linear_plane(vehicle, plane)
        A, B = linear.A[:2, :2], linear.B[:2]
        b0 = float(A[1, 0] * B[0] - A[0, 0] * B[1])
        return np.array(
            [B[1], b0, -np.trace(A), np.linalg.det(A), vehicle.actuators[plane].delay_s]
        )

    def crossover_response(z: Array) -> Array:
        """Return ln gain and phase at the crossover."""
        return crossover.gain_and_phase(prior.vehicle(z), plane, frequency)

    def reported(z: Array) -> Array:
        """Return the reported parameters."""
        vehicle = prior.vehicle(z)
        small_signal = linear_planes.small_signal(steady_state.linear_plane(vehicle, plane))
        return np.array([*small_signal[:4], vehicle.actuators[plane].delay_s])

    sizes = np.abs(reported(prior.mean))
    sizes[4] = 1.0
    return Slopes(
        _slope(transfer, prior.mean),
        _slope(crossover_response, prior.mean),
        _slope(reported, prior.mean) / sizes[:, None],
    )


def _slope(function: Callable[[Array], Array], z: Array) -> Array:
    """Return the Jacobian by central differences."""
    return np.column_stack(
        [(function(z + STEP * e) - function(z - STEP * e)) / (2.0 * STEP) for e in np.eye(z.size)]
    )


def numbers(slope: Slopes, covariance: Array) -> DesignUncertainty:
    """Return the standard deviations that a covariance of z implies: sqrt(diag(S P S^T))."""
    sd = np.sqrt(np.einsum("ij,jk,ik->i", slope.reported, covariance, slope.reported))
    gain, phase = np.sqrt(np.einsum("ij,jk,ik->i", slope.crossover, covariance, slope.crossover))
    gain_pct, b1_pct, p_fast_pct, p_slow_pct = (
        100.0 * float(relative_sd) for relative_sd in sd[:4]
    )
    gain_db = 20.0 * float(gain) / math.log(10.0)
    return DesignUncertainty(
        static_gain_pct=gain_pct,
        b1_pct=b1_pct,
        p_fast_pct=p_fast_pct,
        p_slow_pct=p_slow_pct,
        delay_s=float(sd[4]),
        crossover_db=gain_db,
        crossover_deg=math.degrees(phase),
    )


def determinant(slope: Slopes, covariance: Array) -> float:
    """Return criterion "d": log determinant of the covariance of the design parameters."""
    return float(np.linalg.slogdet(slope.transfer @ covariance @ slope.transfer.T)[1])


def phase(slope: Slopes, covariance: Array) -> float:
    """Return criterion "crossover": variance of the crossover phase (deg^2).

    The sum over planes is dominated by the less certain plane.
    """
    row = np.degrees(slope.crossover[1])
    return float(row @ covariance @ row)


CRITERIA: dict[str, Callable[[Slopes, Array], float]] = {"d": determinant, "crossover": phase}
"""Criteria by name; smaller is better."""
