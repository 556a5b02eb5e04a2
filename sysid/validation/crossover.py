"""Crossover of a model's loops, with standard deviations of gain and phase there."""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.control_analysis import loop_transfer
from sysid.control_analysis.loop_transfer import GRID_RADPS, Gains, Lag
from sysid.estimation.map import fit
from sysid.models import linear_planes, parameters
from sysid.models.parameters import CandidateVehicle
from sysid.planes import PLANES, Plane
from sysid.reproduction.paper_tables import CARIBOU_TURN_PER_S2, TABLE_3_INITIAL
from sysid.validation.results import Crossover

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

STEP = 1e-3
"""Central difference step along each axis of the covariance, in standard deviations."""


class UncertainVehicle(NamedTuple):
    """Vehicle as a function of z, with an estimate of z and its covariance."""

    vehicle: Callable[[Array], CandidateVehicle]
    """Function from z (p,) to the vehicle."""
    z: Array
    """(p,), estimate of z, in prior standard deviations."""
    covariance: Array | None
    """(p, p), covariance of z; None if it is unknown."""


def response(
    vehicle: CandidateVehicle, plane: Plane, frequency_radps: Array = GRID_RADPS
) -> ComplexArray:
    """Return the small-signal response from command to rate.

    Parameters
    ----------
    vehicle : CandidateVehicle
        Vehicle.
    plane : Plane
        Plane.
    frequency_radps : ndarray
        Frequencies, rad/s.

    Returns
    -------
    ndarray, complex
        Rate over command (1/s), actuator included, sampling delay of the autopilot excluded.
    """
    return np.asarray(_responses(vehicle, plane, 0.0, frequency_radps).command[:, 1])


def _responses(
    vehicle: CandidateVehicle,
    plane: Plane,
    additional_delay_s: float,
    frequency_radps: Array = GRID_RADPS,
) -> loop_transfer.Responses:
    """Responses of a plane with an additional delay (s)."""
    actuator = vehicle.actuators[plane]
    lag = Lag(
        actuator.delay_s + additional_delay_s,
        actuator.natural_frequency_radps,
        actuator.damping_ratio,
    )
    return loop_transfer.responses(fit.linear_plane(vehicle, plane), lag, frequency_radps)


def loop(vehicle: CandidateVehicle, plane: Plane, gains: Gains) -> ComplexArray:
    """Return the plane's loop transfer function, opened at its surface, on ``GRID_RADPS``.

    Parameters
    ----------
    vehicle : CandidateVehicle
        Vehicle.
    plane : Plane
        Plane.
    gains : Gains
        Gains by parameter name.

    Returns
    -------
    ndarray, complex
        Loop transfer function, sampling delay included.
    """
    plane_responses = _responses(vehicle, plane, loop_transfer.SAMPLING_S)
    return loop_transfer.surface_loop(plane, plane_responses, gains)


def gains_for(prior_vehicle: CandidateVehicle) -> dict[str, float]:
    """Return default gains for loops whose gains during the tests are unknown.

    Parameters
    ----------
    prior_vehicle : CandidateVehicle
        Prior vehicle.

    Returns
    -------
    dict
        The paper's initial gains (Table 3), scaled by the control effectiveness b1 of Caribou
        over that of the vehicle.
    """
    gains = dict(TABLE_3_INITIAL)
    for plane, traits in PLANES.items():
        b1_per_s2 = linear_planes.small_signal(fit.linear_plane(prior_vehicle, plane)).b1_per_s2
        for term in ("P", "D", "I"):
            gains[f"{traits.gain_prefix}_{term}"] *= CARIBOU_TURN_PER_S2 / b1_per_s2
    return gains


def crossover(uncertain: UncertainVehicle, plane: Plane, gains: Gains) -> Crossover | None:
    """Return crossover and margins of a plane's loop, with standard deviations.

    Parameters
    ----------
    uncertain : UncertainVehicle
        Vehicle and its uncertainty.
    plane : Plane
        Plane.
    gains : Gains
        Gains by parameter name, as in Table 3 of the paper.

    Returns
    -------
    Crossover or None
        None if the loop gain never crosses one.
    """
    nominal = loop(uncertain.vehicle(uncertain.z), plane, gains)
    margins = loop_transfer.margins(nominal)
    if not (math.isfinite(margins.crossover_radps) and math.isfinite(margins.pm_deg)):
        return None
    nominal_phase = np.unwrap(np.angle(nominal))

    def quantities(z: Array) -> Array:
        """Crossover (rad/s), phase margin (deg).

        Gain (dB), phase (deg) at the nominal crossover.
        """
        perturbed = loop(uncertain.vehicle(z), plane, gains)
        perturbed_margins = loop_transfer.margins(perturbed)
        phase = nominal_phase + np.angle(perturbed / nominal)
        return np.array(
            [
                perturbed_margins.crossover_radps,
                perturbed_margins.pm_deg,
                np.interp(margins.crossover_radps, GRID_RADPS, 20.0 * np.log10(np.abs(perturbed))),
                math.degrees(float(np.interp(margins.crossover_radps, GRID_RADPS, phase))),
            ]
        )

    sds: list[float] | list[None] = [None] * 4
    if uncertain.covariance is not None:
        sds = propagate_sd(quantities, uncertain.z, uncertain.covariance).tolist()
    return Crossover(
        loop=PLANES[plane].surface,
        crossover_radps=margins.crossover_radps,
        crossover_sd_radps=sds[0],
        gain_sd_db=sds[2],
        phase_sd_deg=sds[3],
        pm_deg=margins.pm_deg,
        pm_sd_deg=sds[1],
    )


def propagate_sd(function: Callable[[Array], Array], z: Array, covariance: Array) -> Array:
    """Return the standard deviation of ``function(z)`` to first order (delta method).

    With the eigenvectors u_i and eigenvalues s_i^2 of the covariance: var = sum_i (df/du_i s_i)^2.
    The derivatives are central differences along s_i u_i.

    Parameters
    ----------
    function : callable
        Function from z (p,) to values (m,).
    z : ndarray, (p,)
        Point of linearisation.
    covariance : ndarray, (p, p)
        Covariance of z.

    Returns
    -------
    ndarray, (m,)
        Standard deviation of each value.
    """
    variances, axes = np.linalg.eigh(covariance)
    steps = [
        math.sqrt(variance) * axis
        for variance, axis in zip(np.maximum(variances, 0.0), axes.T, strict=True)
    ]
    derivatives = [
        parameters.change_per_step(function, z, STEP * step) / STEP
        for step in steps
        if np.any(step)
    ]
    return np.asarray(np.sqrt(np.sum(np.square(derivatives), axis=0)))


def response_sd(
    uncertain: UncertainVehicle, plane: Plane, frequency_radps: Array = GRID_RADPS
) -> tuple[Array, Array]:
    """Return the standard deviations of gain (dB) and phase (deg) of ``response``.

    Parameters
    ----------
    uncertain : UncertainVehicle
        Vehicle and its uncertainty.
    plane : Plane
        Plane.
    frequency_radps : ndarray
        Frequencies, rad/s.

    Returns
    -------
    tuple of ndarray
        Gain (dB) and phase (deg); zeros if the covariance is unknown.
    """
    nominal = response(uncertain.vehicle(uncertain.z), plane, frequency_radps)
    if uncertain.covariance is None:
        return np.zeros(nominal.size), np.zeros(nominal.size)

    def quantities(z: Array) -> Array:
        ratio = response(uncertain.vehicle(z), plane, frequency_radps) / nominal
        return np.concatenate([20.0 * np.log10(np.abs(ratio)), np.degrees(np.angle(ratio))])

    gain_db, phase_deg = np.split(propagate_sd(quantities, uncertain.z, uncertain.covariance), 2)
    return gain_db, phase_deg
