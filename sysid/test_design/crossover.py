"""Where a loop round a plane can cross unit gain, and what the plane answers there: what control
design rests on."""

import math

import numpy as np
from numpy.typing import NDArray

from sysid.control_analysis.loop_transfer import GRID_RADPS
from sysid.data.segments import Plane
from sysid.models.parameters import CandidateVehicle
from sysid.validation.crossover import response

Array = NDArray[np.float64]

LAG_RAD = math.radians(120.0)
"""A loop that feeds back the rate keeps 60 deg of phase margin where the rate lags the command by
this."""
MIN_RADPS, MAX_RADPS = 0.1, 20.0


def frequency_radps(vehicle: CandidateVehicle, plane: Plane) -> float:
    """The highest frequency at which the rate lags the command by no more than LAG_RAD."""
    gain_phase = _gain_and_phase(vehicle, plane)
    low = (gain_phase[1] >= -LAG_RAD) & (GRID_RADPS > MIN_RADPS) & (GRID_RADPS < MAX_RADPS)
    found = np.flatnonzero(low)
    return float(GRID_RADPS[found[-1]]) if found.size else MIN_RADPS


def gain_and_phase(vehicle: CandidateVehicle, plane: Plane, frequency: float) -> Array:
    """Gain (natural logarithm of 1/s) and phase (rad) of rate over command at a frequency in
    rad/s."""
    return np.array(
        [np.interp(frequency, GRID_RADPS, values) for values in _gain_and_phase(vehicle, plane)]
    )


def _gain_and_phase(vehicle: CandidateVehicle, plane: Plane) -> tuple[Array, Array]:
    """The phase lies between -3/2 pi and pi/2 at 1 rad/s: an unstable plane begins at half a
    turn."""
    found = response(vehicle, plane)
    phase = np.unwrap(np.angle(found))
    at_one = float(np.interp(1.0, GRID_RADPS, phase))
    turns = math.floor((at_one + 1.5 * math.pi) / (2.0 * math.pi))
    return np.log(np.abs(found)), phase - 2.0 * math.pi * turns
