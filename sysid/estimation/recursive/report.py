"""Report of the recursive estimate.

Design numbers with standard deviations, and whether they suffice.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.control_analysis import loop_transfer
from sysid.control_analysis.loop_transfer import Gains
from sysid.estimation.map import steady_state
from sysid.estimation.map.problem import DIFFERENCE, Prior
from sysid.estimation.recursive.intervals import Estimate
from sysid.models import linear_planes, parameters
from sysid.models.parameters import CandidateVehicle
from sysid.planes import Plane
from sysid.validation import crossover

Array = NDArray[np.float64]

NAMES = (
    "static_gain_per_s",
    "b1_per_s2",
    "p_fast_per_s",
    "p_slow_per_s",
    "delay_s",
    "actuator_bias_deg",
)
"""Reported numbers, by their names in `model_file.PlaneModel`."""
ENOUGH_PHASE_SD_DEG, ENOUGH_GAIN_SD_DB = 1.5, 0.25
"""Standard deviations of phase (deg) and gain (dB) at crossover that suffice for a redesign.

Two standard deviations, 3 deg and 0.5 dB, are small compared with the margins that a redesign
keeps.
"""


class Number(NamedTuple):
    """An estimated number."""

    value: float
    """Estimate, in the unit of its name."""
    sd: float
    """Standard deviation; infinite if no interval is bounded."""
    prior_sd: float
    """Standard deviation before the first test; infinite in the same case."""


class PlaneReport(NamedTuple):
    """Present estimate of one plane."""

    plane: Plane
    numbers: dict[str, Number]
    """Numbers by NAMES."""
    crossover_radps: float
    """Frequency at which gain and phase are reported, rad/s."""
    gain_db: Number
    """Gain from command to rate at this frequency, dB (1/s)."""
    phase_deg: Number
    """Phase from command to rate at this frequency, deg."""

    @property
    def enough(self) -> bool:
        """Return whether gain and phase at crossover are known well enough for a redesign."""
        return self.phase_deg.sd <= ENOUGH_PHASE_SD_DEG and self.gain_db.sd <= ENOUGH_GAIN_SD_DB


def read(prior: Prior, estimate: Estimate, plane: Plane, crossover_radps: float) -> PlaneReport:
    """Report the present estimate of a plane.

    Parameters
    ----------
    prior : Prior
        Prior of the parameters.
    estimate : Estimate
        Estimate of z from the prior and the tests.
    plane : Plane
        Plane.
    crossover_radps : float
        Frequency at which gain and phase are reported, rad/s.

    Returns
    -------
    PlaneReport
        Numbers with standard deviations.

    Notes
    -----
    Delta method: a number g(z) with the gradient c has the variance c'P c, P the covariance of z.
    """
    values, sds = _with_sds(prior, *estimate, plane, crossover_radps)
    prior_sds = _with_sds(prior, prior.mean, prior.covariance, plane, crossover_radps)[1]
    numbers = [Number(*map(float, row)) for row in zip(values, sds, prior_sds, strict=True)]
    return PlaneReport(
        plane, dict(zip(NAMES, numbers, strict=False)), crossover_radps, *numbers[len(NAMES) :]
    )


def crossover_radps(prior: Prior, plane: Plane, gains: Gains | None = None) -> float:
    """Return the crossover frequency of a plane's loop with the prior vehicle, rad/s.

    Parameters
    ----------
    prior : Prior
        Prior, whose mean gives the vehicle.
    plane : Plane
        Plane.
    gains : mapping of str to float, optional
        Gains by parameter name; by default those of `validation.crossover.gains_for`.

    Returns
    -------
    float
        Crossover frequency, rad/s.
    """
    vehicle = parameters.candidate_vehicle(prior.config, prior.biases_rad, prior.mean)
    loop = crossover.loop(vehicle, plane, gains or crossover.gains_for(vehicle))
    return loop_transfer.margins(loop).crossover_radps


def _with_sds(
    prior: Prior, z: Array, covariance: Array, plane: Plane, crossover_radps: float
) -> tuple[Array, Array]:
    """Return the numbers at z, and their standard deviations by the covariance of z."""
    values, gradients = _derived(prior, z, plane, crossover_radps)
    sds = np.sqrt(np.einsum("ij,jk,ik->i", gradients, covariance, gradients))
    slow = NAMES.index("p_slow_per_s")
    if not linear_planes.static_gain_is_bounded(values[slow], sds[slow]):
        sds[NAMES.index("static_gain_per_s")] = math.inf
    return values, sds


def _derived(prior: Prior, z: Array, plane: Plane, crossover_radps: float) -> tuple[Array, Array]:
    """Return NAMES, gain (dB) and phase (deg) at a frequency, and their gradients by z."""
    values = numbers(
        parameters.candidate_vehicle(prior.config, prior.biases_rad, z), plane, crossover_radps
    )
    gradients = np.zeros((values.size, z.size))
    for i in parameters.parameters_of_planes([plane]):
        perturbed_z = z.copy()
        perturbed_z[i] += DIFFERENCE
        perturbed = numbers(
            parameters.candidate_vehicle(prior.config, prior.biases_rad, perturbed_z),
            plane,
            crossover_radps,
        )
        gradients[:, i] = (perturbed - values) / DIFFERENCE
    return values, gradients


def numbers(vehicle: CandidateVehicle, plane: Plane, crossover_radps: float) -> Array:
    """Return the reported numbers of one plane of a vehicle, for small motion.

    Parameters
    ----------
    vehicle : CandidateVehicle
        Vehicle configuration and actuators.
    plane : Plane
        Plane.
    crossover_radps : float
        Frequency of the response, in rad/s.

    Returns
    -------
    ndarray
        Values of NAMES; then gain (dB) and phase (deg) from command to rate.

    Notes
    -----
    The response is C (s I - A)^-1 B e^(-tau s) wn^2 / (s^2 + 2 zeta wn s + wn^2) at s = j
    ``crossover_radps``.
    """
    linear, actuator = steady_state.linear_plane(vehicle, plane), vehicle.actuators[plane]
    small_signal, s = linear_planes.small_signal(linear), 1j * crossover_radps
    rate = np.linalg.solve(s * np.eye(linear.A.shape[0]) - linear.A, linear.B)[1]
    wn, zeta = actuator.natural_frequency_radps, actuator.damping_ratio
    command_to_rate = (
        rate * np.exp(-s * actuator.delay_s) * wn**2 / (s**2 + 2.0 * zeta * wn * s + wn**2)
    )
    return np.array(
        [
            small_signal.static_gain_per_s,
            small_signal.b1_per_s2,
            small_signal.p_fast_per_s,
            small_signal.p_slow_per_s,
            actuator.delay_s,
            math.degrees(actuator.bias_rad),
            20.0 * math.log10(abs(command_to_rate)),
            math.degrees(float(np.angle(command_to_rate))),
        ]
    )
