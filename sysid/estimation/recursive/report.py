"""The estimate as an engineer reads it under way: design numbers, how sure they are, and whether
that is enough."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.control_analysis import loop_transfer
from sysid.control_analysis.loop_transfer import Gains
from sysid.data.segments import Plane
from sysid.estimation.map import fit
from sysid.estimation.map.fit import DIFFERENCE, Prior
from sysid.estimation.recursive import square_root_information
from sysid.estimation.recursive.square_root_information import Information
from sysid.models import linear_planes, parameters
from sysid.models.parameters import CandidateVehicle
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
"""As in `model.PlaneModel`."""
ENOUGH_PHASE_SD_DEG, ENOUGH_GAIN_SD_DB = 1.5, 0.25
"""Standard deviations of the plant's phase and gain at crossover that a redesign can rest on: two
of them are 3 deg and half a decibel, small beside the margins that it keeps."""


class Number(NamedTuple):
    value: float
    sd: float
    before: float
    """Its standard deviation before the first test."""


class PlaneReport(NamedTuple):
    """One plane, as things stand."""

    plane: Plane
    numbers: dict[str, Number]
    """By NAMES."""
    crossover_radps: float
    gain_db: Number
    """Rate over command at crossover."""
    phase_deg: Number

    @property
    def enough(self) -> bool:
        return self.phase_deg.sd <= ENOUGH_PHASE_SD_DEG and self.gain_db.sd <= ENOUGH_GAIN_SD_DB


def read(prior: Prior, known: Information, plane: Plane, crossover_radps: float) -> PlaneReport:
    """What is known of a plane, to first order."""
    z, covariance = square_root_information.mean(known), square_root_information.covariance(known)
    values, slopes = _derived(prior, z, plane, crossover_radps)
    sds = np.sqrt(np.einsum("ij,jk,ik->i", slopes, covariance, slopes))
    first = _derived(prior, prior.mean, plane, crossover_radps)[1]
    before = np.sqrt(np.einsum("ij,jk,ik->i", first, prior.covariance, first))
    found = [Number(*map(float, row)) for row in zip(values, sds, before, strict=True)]
    return PlaneReport(
        plane, dict(zip(NAMES, found, strict=False)), crossover_radps, *found[len(NAMES) :]
    )


def crossover_radps(prior: Prior, plane: Plane, gains: Gains | None = None) -> float:
    """Where the loop of a plane crosses unit gain on the prior vehicle; without ``gains`` with
    those made for her."""
    vehicle = parameters.candidate_vehicle(prior.config, prior.biases_rad, prior.mean)
    loop = crossover.loop(vehicle, plane, gains or crossover.gains_for(vehicle))
    return loop_transfer.margins(loop).crossover_radps


def _derived(prior: Prior, z: Array, plane: Plane, crossover_radps: float) -> tuple[Array, Array]:
    """NAMES, gain (dB) and phase (deg) at crossover, and their slopes over z."""
    values = numbers(
        parameters.candidate_vehicle(prior.config, prior.biases_rad, z), plane, crossover_radps
    )
    slopes = np.zeros((values.size, z.size))
    for i in parameters.parameters_of_planes([plane]):
        moved = z.copy()
        moved[i] += DIFFERENCE
        there = numbers(
            parameters.candidate_vehicle(prior.config, prior.biases_rad, moved),
            plane,
            crossover_radps,
        )
        slopes[:, i] = (there - values) / DIFFERENCE
    return values, slopes


def numbers(vehicle: CandidateVehicle, plane: Plane, crossover_radps: float) -> Array:
    """NAMES, and gain (dB) and phase (deg) from command to rate at a frequency (rad/s), for small
    motion."""
    linear, actuator = fit.linear_plane(vehicle, plane), vehicle.actuators[plane]
    small, s = linear_planes.small_signal(linear), 1j * crossover_radps
    rate = np.linalg.solve(s * np.eye(linear.A.shape[0]) - linear.A, linear.B)[1]
    wn, zeta = actuator.natural_frequency_radps, actuator.damping_ratio
    answer = rate * np.exp(-s * actuator.delay_s) * wn**2 / (s**2 + 2.0 * zeta * wn * s + wn**2)
    return np.array(
        [
            small.static_gain_per_s,
            small.b1_per_s2,
            small.p_fast_per_s,
            small.p_slow_per_s,
            actuator.delay_s,
            math.degrees(actuator.bias_rad),
            20.0 * math.log10(abs(answer)),
            math.degrees(float(np.angle(answer))),
        ]
    )
