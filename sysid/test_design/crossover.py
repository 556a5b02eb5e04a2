"""Highest feasible crossover frequency of a plane, and the plane's response there."""

import math

import numpy as np
from numpy.typing import NDArray

from sysid.control_analysis.loop_transfer import GRID_RADPS
from sysid.models.parameters import CandidateVehicle
from sysid.planes import Plane
from sysid.validation.crossover import response

Array = NDArray[np.float64]

LAG_RAD = math.radians(120.0)
"""Phase lag of the rate at which a rate feedback loop has a phase margin of 60 deg."""
MIN_RADPS, MAX_RADPS = 0.1, 20.0
"""Range of the crossover frequency (rad/s)."""


def frequency_radps(vehicle: CandidateVehicle, plane: Plane) -> float:
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
    gain_phase = _gain_and_phase(vehicle, plane)
    feasible = (gain_phase[1] >= -LAG_RAD) & (GRID_RADPS > MIN_RADPS) & (GRID_RADPS < MAX_RADPS)
    indices = np.flatnonzero(feasible)
    return float(GRID_RADPS[indices[-1]]) if indices.size else MIN_RADPS


def gain_and_phase(vehicle: CandidateVehicle, plane: Plane, frequency: float) -> Array:
    """Return ln gain (gain in 1/s) and phase (rad) from command to rate at `frequency` (rad/s)."""
    return np.array(
        [np.interp(frequency, GRID_RADPS, values) for values in _gain_and_phase(vehicle, plane)]
    )


def _gain_and_phase(vehicle: CandidateVehicle, plane: Plane) -> tuple[Array, Array]:
    """Return ln gain and phase on the grid.

    The phase at 1 rad/s is taken between -3/2 pi and pi/2: an unstable plane starts at half a turn.
    """
    rate_response = response(vehicle, plane)
    phase = np.unwrap(np.angle(rate_response))
    at_one = float(np.interp(1.0, GRID_RADPS, phase))
    turns = math.floor((at_one + 1.5 * math.pi) / (2.0 * math.pi))
    return np.log(np.abs(rate_response)), phase - 2.0 * math.pi * turns
