"""Crossover frequency of the control loops, and the errors of a model at that frequency."""

import cmath
import math

import numpy as np
from scipy.optimize import brentq

from benchmarks.identification import vehicles
from benchmarks.identification.vehicles import Case
from sysid.estimation.map import steady_state
from sysid.models.parameters import CandidateVehicle
from sysid.planes import PLANES, Plane


def response(vehicle: CandidateVehicle, plane: Plane, omega_radps: float) -> complex:
    """Return the response of the rate to the command: linear plane, actuator lag and delay.

    G(s) = C (s I - A)^-1 B  wn^2 / (s^2 + 2 zeta wn s + wn^2)  exp(-s T).
    """
    linear, actuator = steady_state.linear_plane(vehicle, plane), vehicle.actuators[plane]
    s, wn = 1j * omega_radps, actuator.natural_frequency_radps
    states = np.linalg.solve(s * np.eye(len(linear.A)) - linear.A, linear.B)
    lag = wn**2 / (s**2 + 2.0 * actuator.damping_ratio * wn * s + wn**2)
    return complex(states[1] * lag * cmath.exp(-s * actuator.delay_s))


def crossover_radps(case: Case, plane: Plane) -> float:
    """Return the last unity-gain frequency of the first dive's loop with the prior vehicle."""
    hold, known = case.hold, vehicles.nominal(case.prior)
    gains = (hold.heading_p, hold.heading_d), (hold.pitch_p, hold.pitch_d)
    p, d = gains[PLANES[plane].index]

    def excess(log_omega: float) -> float:
        s = 1j * math.exp(log_omega)
        return math.log(abs((p / s + d) * response(known, plane, math.exp(log_omega))))

    grid = np.linspace(math.log(0.05), math.log(20.0), 400)
    above = [k for k, x in enumerate(grid) if excess(float(x)) > 0.0]
    return math.exp(float(brentq(excess, grid[above[-1]], grid[above[-1] + 1])))


def errors(case: Case, found: CandidateVehicle, plane: Plane) -> tuple[float, float]:
    """Return gain (dB) and phase (deg) of a model over the linearised true vehicle at crossover."""
    return errors_at(found, vehicles.nominal(case.truth), plane, crossover_radps(case, plane))


def errors_at(
    found: CandidateVehicle, truth: CandidateVehicle, plane: Plane, omega_radps: float
) -> tuple[float, float]:
    """Return gain (dB) and phase (deg) of a vehicle over another one at a frequency."""
    ratio = response(found, plane, omega_radps) / response(truth, plane, omega_radps)
    return 20.0 * math.log10(abs(ratio)), math.degrees(cmath.phase(ratio))
