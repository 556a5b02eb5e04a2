"""Lower bound of the errors that any linear controller leaves in the identified disturbance.

The bound has the delay, tailcone and sensors of the model and no limit of margins, travel or rate.
The disturbance is that of a prediction (`disturbance_response`), without the white force on sway
and heave that the fit allows for. The bound is the optimum of stochastic control with a quadratic
cost of one error and a control weight that vanishes: by the separation principle a Kalman filter
and a linear regulator (Astrom 1970, Introduction to Stochastic Control Theory, ch. 6 and 8;
Kwakernaak and Sivan 1972, section 3.8).
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, expm, solve_discrete_are, solve_discrete_lyapunov

from mavlink_io.tick import TICK_S
from sysid.design.design_model import DesignModel, outputs
from sysid.design.disturbance_response import DEPTH_RATE_S, NOISE_STEP_S
from sysid.design.specification import MinimumVariance, Response
from sysid.models import noise
from sysid.models.noise import DISTURBANCE_STATES
from sysid.planes import PLANES, Plane

Array = NDArray[np.float64]

MIN_WEIGHT, MAX_WEIGHT = 1e-8, 1e4
"""Weights of the command: that of the bound, and the largest (rad^2 or m^2 per rad^2)."""
BISECTIONS = 20
DEPTH_WEIGHT = 1e-8
"""Weight of depth where pitch is minimised (rad^2 per m^2): without it the depth drifts away."""
PITCH, HEADING, DEPTH = 2, 2, 3
"""Indices of the states whose error is minimised."""


class _SampledPlane(NamedTuple):
    """Plane, sea, tailcone and delay x[k+1] = A x[k] + B u[k], and the estimate of its state.

    States: plane, disturbance, duct angle and rate, and the commands of the delay.
    """

    A: Array
    B: Array
    innovation: Array
    """Covariance of the change of the estimate by a measurement, (states, states)."""
    uncertainty: Array
    """Covariance of the error of the estimate, (states, states)."""
    in_pitch: bool


def minimum_variance(vehicle: DesignModel, reached: Response) -> MinimumVariance | None:
    """Return the lower bound of the errors, each error minimised by itself.

    The pressure of waves, which only increases them, is left out.

    Parameters
    ----------
    vehicle : DesignModel
        Planes, tailcones and disturbance.
    reached : Response
        Response of a design; also its errors with an optimal controller of the same command rms
        are computed.

    Returns
    -------
    MinimumVariance or None
        Standard deviations; None if a Riccati equation has no numerical solution.
    """
    try:
        return _bounds(vehicle, reached)
    except ValueError:  # of scipy's solvers, LinAlgError included
        return None


def _bounds(vehicle: DesignModel, reached: Response) -> MinimumVariance:
    """Return the lower bounds. Raises LinAlgError."""
    yaw, pitch = _sampled_plane(vehicle, Plane.YAW), _sampled_plane(vehicle, Plane.PITCH)
    rudder_rad, elevator_rad = map(math.radians, (reached.rudder_deg, reached.elevator_deg))
    return MinimumVariance(
        heading_deg=math.degrees(_errors(yaw, HEADING, MIN_WEIGHT)[0]),
        pitch_deg=math.degrees(_errors(pitch, PITCH, MIN_WEIGHT)[0]),
        depth_m=_errors(pitch, DEPTH, MIN_WEIGHT)[0],
        same_rudder_heading_deg=math.degrees(_with_command(yaw, HEADING, rudder_rad)),
        same_elevator_depth_m=_with_command(pitch, DEPTH, elevator_rad),
    )


def _sampled_plane(vehicle: DesignModel, plane: Plane) -> _SampledPlane:
    """Return a plane in discrete time with the period of the tick, and its Kalman filter.

    With P the covariance before a measurement, S = C P C^T + R and L = P C^T S^-1: the estimate
    changes by L S L^T, and P - L S L^T remains. Sensor noise is white with sd^2 `NOISE_STEP_S`.
    """
    index = PLANES[plane].index
    linear, lag = vehicle.planes[index], (vehicle.yaw_lag, vehicle.pitch_lag)[index]
    levels = noise.from_model(vehicle.disturbance[plane])._replace(force_mps15=0.0)
    sea_A, sea_density, *_ = noise.system(linear, levels)
    known, duct = len(linear.B), len(linear.B) + DISTURBANCE_STATES
    size, delay = duct + 2, max(1, round(lag.delay_s / TICK_S))
    wn, zeta = lag.natural_frequency_radps, lag.damping_ratio
    A, density, B = np.zeros((size, size)), np.zeros((size, size)), np.zeros(size)
    A[:duct, :duct], density[:duct, :duct] = sea_A[:duct, :duct], sea_density[:duct, :duct]
    A[:known, duct], A[duct, duct + 1] = linear.B, 1.0
    A[duct + 1, duct:], B[duct + 1] = (-(wn**2), -2.0 * zeta * wn), wn**2
    transition, process = noise.discrete(A, density, TICK_S)
    held = expm(np.block([[A, B[:, None]], [np.zeros((1, size + 1))]]) * TICK_S)[:size, size]
    measured = outputs(linear)
    C = np.hstack([measured, np.zeros((len(measured), size - known))])
    depth_rate_mps = levels.depth_m / DEPTH_RATE_S
    sd = np.array([levels.rate_radps, levels.angle_rad, levels.depth_m, depth_rate_mps])[: len(C)]
    R = np.diag(sd**2) * NOISE_STEP_S / TICK_S
    P = solve_discrete_are(transition.T, C.T, process, R)
    S = C @ P @ C.T + R
    L = P @ C.T @ np.linalg.inv(S)
    total = size + delay
    whole, command = np.eye(total, k=1), np.zeros(total)
    whole[:size], command[-1] = 0.0, 1.0
    whole[:size, :size], whole[:size, size] = transition, held
    innovation, uncertainty = np.zeros((total, total)), np.zeros((total, total))
    innovation[:size, :size] = L @ S @ L.T
    uncertainty[:size, :size] = P - innovation[:size, :size]
    return _SampledPlane(whole, command, innovation, uncertainty, plane == Plane.PITCH)


def _errors(plane: _SampledPlane, state: int, weight: float) -> tuple[float, float]:
    """Return the standard deviations of a state and of the command under optimal control.

    The regulator u = -K x minimises E[x_state^2 + weight u^2]; with the closed transition
    F = A - B K the estimate has the covariance X = F X F^T + innovation.
    """
    A, B = plane.A, plane.B
    Q = np.zeros_like(A)
    if plane.in_pitch:
        Q[DEPTH, DEPTH] = DEPTH_WEIGHT
    Q[state, state] = 1.0
    X = solve_discrete_are(A, B[:, None], Q, np.array([[weight]]))
    K = (B @ X @ A) / (weight + B @ X @ B)
    estimate = solve_discrete_lyapunov(A - np.outer(B, K), plane.innovation)
    error = estimate[state, state] + plane.uncertainty[state, state]
    if not (error > 0.0 and K @ estimate @ K > 0.0):
        raise LinAlgError("the optimal regulator has no stationary covariance")
    return math.sqrt(error), math.sqrt(K @ estimate @ K)


def _with_command(plane: _SampledPlane, state: int, command_rad: float) -> float:
    """Return the least standard deviation of a state with this rms of the command (rad)."""
    low, high = math.log(MIN_WEIGHT), math.log(MAX_WEIGHT)
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        if _errors(plane, state, math.exp(middle))[1] > command_rad:
            low = middle
        else:
            high = middle
    return _errors(plane, state, math.exp(high))[0]
