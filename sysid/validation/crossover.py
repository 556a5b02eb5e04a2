"""Crossover of a model's loops, with standard deviations of gain and phase there."""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.control_analysis import loop_transfer
from sysid.control_analysis.loop_transfer import GRID_RADPS, Gains, Lag
from sysid.estimation.map import steady_state
from sysid.models import delta_method, linear_planes
from sysid.models.parameters import CandidateVehicle
from sysid.planes import PLANES, Plane
from sysid.reproduction.paper_tables import CARIBOU_TURN_PER_S2, TABLE_3_INITIAL
from sysid.validation.results import Crossover

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

LAG_RAD = math.radians(120.0)
"""Phase lag of the rate at which a rate feedback loop has a phase margin of 60 deg."""
MIN_RADPS, MAX_RADPS = 0.1, 20.0
"""Range of the crossover frequency (rad/s)."""
CARIBOU_FEASIBLE_RADPS = {Plane.YAW: 1.18, Plane.PITCH: 1.24}
"""`highest_feasible_radps` of the vehicle for which Table 3's initial gains were designed."""


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
    """Return the responses of a plane with an additional delay (s)."""
    actuator = vehicle.actuators[plane]
    lag = Lag(
        actuator.delay_s + additional_delay_s,
        actuator.natural_frequency_radps,
        actuator.damping_ratio,
    )
    return loop_transfer.responses(steady_state.linear_plane(vehicle, plane), lag, frequency_radps)


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
        The paper's initial gains (Table 3), scaled to the vehicle.

    Notes
    -----
    With s the highest feasible crossover frequency over Caribou's, and b1 the control
    effectiveness, a loop keeps its shape, L(j w) = L_Caribou(j w / s), as far as the planes are
    alike, with

        D ~ s / b1,   P ~ s^2 / b1,   I ~ s^3 / b1.
    """
    gains = dict(TABLE_3_INITIAL)
    for plane, traits in PLANES.items():
        linear = steady_state.linear_plane(prior_vehicle, plane)
        b1_per_s2 = linear_planes.small_signal(linear).b1_per_s2
        speed_ratio = highest_feasible_radps(prior_vehicle, plane) / CARIBOU_FEASIBLE_RADPS[plane]
        for term, power in (("D", 1), ("P", 2), ("I", 3)):
            gains[f"{traits.gain_prefix}_{term}"] *= (
                speed_ratio**power * CARIBOU_TURN_PER_S2 / b1_per_s2
            )
    return gains


def highest_feasible_radps(vehicle: CandidateVehicle, plane: Plane) -> float:
    """Return the highest frequency at which the rate lags the command by at most `LAG_RAD`.

    Parameters
    ----------
    vehicle : CandidateVehicle
        Vehicle configuration and actuators.
    plane : Plane
        Plane.

    Returns
    -------
    float
        Frequency between MIN_RADPS and MAX_RADPS, in rad/s.
    """
    phase_rad = _gain_and_phase(vehicle, plane)[1]
    feasible = (phase_rad >= -LAG_RAD) & (GRID_RADPS > MIN_RADPS) & (GRID_RADPS < MAX_RADPS)
    indices = np.flatnonzero(feasible)
    return float(GRID_RADPS[indices[-1]]) if indices.size else MIN_RADPS


def gain_and_phase(vehicle: CandidateVehicle, plane: Plane, frequency_radps: float) -> Array:
    """Return ln gain (gain in 1/s) and phase (rad) from command to rate at one frequency.

    Parameters
    ----------
    vehicle : CandidateVehicle
        Vehicle configuration and actuators.
    plane : Plane
        Plane.
    frequency_radps : float
        Frequency, rad/s.

    Returns
    -------
    ndarray, shape (2,)
        ln gain and phase.
    """
    return np.array(
        [
            np.interp(frequency_radps, GRID_RADPS, values)
            for values in _gain_and_phase(vehicle, plane)
        ]
    )


def _gain_and_phase(vehicle: CandidateVehicle, plane: Plane) -> tuple[Array, Array]:
    """Return ln gain and phase from command to rate on the grid.

    The phase at 1 rad/s is taken between -3/2 pi and pi/2: an unstable plane starts at half a turn.
    """
    rate_response = response(vehicle, plane)
    phase = np.unwrap(np.angle(rate_response))
    at_one = float(np.interp(1.0, GRID_RADPS, phase))
    turns = math.floor((at_one + 1.5 * math.pi) / (2.0 * math.pi))
    return np.log(np.abs(rate_response)), phase - 2.0 * math.pi * turns


class LoopAtCrossover(NamedTuple):
    """Loop of a plane at its crossover, with derivatives by the parameters of the vehicle."""

    plane: Plane
    margins: loop_transfer.Margins
    slopes: Array | None
    """(p, 4), derivatives of crossover (rad/s), phase margin (deg), gain (dB) and phase (deg) at
    the nominal crossover; None if the covariance of the parameters is unknown."""

    def record(self, covariance: Array | None) -> Crossover:
        """Return crossover and margins for the model file, with sds for a covariance of z."""
        sds: list[float] | list[None] = [None] * 4
        if covariance is not None and self.slopes is not None:
            sds = delta_method.propagate_sd(self.slopes, covariance).tolist()
        return Crossover(
            loop=PLANES[self.plane].surface,
            crossover_radps=self.margins.crossover_radps,
            crossover_sd_radps=sds[0],
            gain_sd_db=sds[2],
            phase_sd_deg=sds[3],
            pm_deg=self.margins.pm_deg,
            pm_sd_deg=sds[1],
        )


def at_crossover(uncertain: UncertainVehicle, plane: Plane, gains: Gains) -> LoopAtCrossover | None:
    """Return the loop of a plane at its crossover.

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
    LoopAtCrossover or None
        None if the loop gain never crosses one.
    """
    nominal = loop(uncertain.vehicle(uncertain.z), plane, gains)
    margins = loop_transfer.margins(nominal)
    if not (math.isfinite(margins.crossover_radps) and math.isfinite(margins.pm_deg)):
        return None
    nominal_phase = np.unwrap(np.angle(nominal))

    def numbers(z: Array) -> Array:
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

    is_known = uncertain.covariance is not None
    slopes = delta_method.slopes(numbers, uncertain.z) if is_known else None
    return LoopAtCrossover(plane, margins, slopes)


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

    slopes = delta_method.slopes(quantities, uncertain.z)
    gain_db, phase_deg = np.split(delta_method.propagate_sd(slopes, uncertain.covariance), 2)
    return gain_db, phase_deg
