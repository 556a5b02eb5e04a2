"""LQG synthesis on an identified plane.

The filter's states are the plane, its tailcone and delay, the disturbance and constant loads. Loads
(an offset of the surface and, in pitch, buoyancy) are modelled as random walks; subtracting their
estimates gives integral action (Pannocchia and Rawlings 2003, AIChE Journal 49). Process noise at
the command input recovers margins (loop transfer recovery; Doyle and Stein 1979, IEEE Trans. AC
24).
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_continuous_are

from sysid.control_analysis import loop_state_space
from sysid.control_analysis.loop_transfer import Lag
from sysid.design.design_model import outputs
from sysid.design.disturbance_response import DEPTH_RATE_S, NOISE_STEP_S
from sysid.design.lqg.controller import ContinuousController
from sysid.models import noise
from sysid.models.linear_planes import LinearPlane
from sysid.models.noise import DISTURBANCE_STATES, Noise

Array = NDArray[np.float64]

PADE_ORDER = 2
"""Order of the Pade delay in the filter's model."""
MIN_ANGLE_RAD = math.radians(0.05)
"""Minimum angle noise that the filter assumes.

The identified one is that from sample to sample, and may be some thousandths of a degree. A filter
that trusts it differentiates the angle in place of the gyro, and an error of 0.2 degrees that the
model does not explain commands full deflection.
"""


class Weights(NamedTuple):
    """Design weights, all positive.

    Errors are weighted relative to one radian of heading, in pitch relative to one metre of depth.
    """

    effort: float
    """Weight of one radian of the surface."""
    rate_s: float
    """Weight of 1 rad/s of turn rate (s)."""
    load: float
    """Random walk of the surface offset (rad in one second)."""
    recovery: float
    """White noise at the command input (rad, mean over one second)."""
    wave: float
    """Share of the identified waves that the filter models."""
    gyro: float
    """Gyro noise as a multiple of the identified one."""
    pitch: float = 1.0
    """Weight of one radian of pitch."""
    buoyancy: float = 0.001
    """Random walk of buoyancy as an acceleration (m/s^2 in one second)."""
    heave: float = 0.001
    """White noise of the heave acceleration (m/s^2, mean over one second)."""
    depth: float = 1.0
    """Noise of depth and its rate as a multiple of the identified one."""


class AugmentedModel(NamedTuple):
    """Filter model x' = A x + B u + w, y = C x + v.

    States: plane, tailcone, disturbance, surface offset and, in pitch, buoyancy.
    """

    A: Array
    B: Array
    C: Array
    process: Array
    """Power spectral density of w, (states, states)."""
    measurement: Array
    """Power spectral density of v, (outputs, outputs)."""
    load: int
    """Index of the surface offset; all states before it are dynamic."""


def controller(
    plane: LinearPlane, lag: Lag, disturbance: Noise, weights: Weights
) -> ContinuousController:
    """Return the LQG controller of one plane.

    Parameters
    ----------
    plane : LinearPlane
        Linear plane, FRD axes.
    lag : Lag
        Tailcone with the delay of sampling.
    disturbance : Noise
        Identified disturbance and sensor noise.
    weights : Weights
        Design weights.

    Returns
    -------
    ContinuousController
        Observer A - L C and feedback F.

    Raises
    ------
    numpy.linalg.LinAlgError
        The Riccati equations have no solution for these weights.
    """
    model = build_model(plane, lag, disturbance, weights)
    L = filter_gains(model)
    return ContinuousController(A=model.A - L @ model.C, B=model.B, L=L, F=feedback(model, weights))


def build_model(
    plane: LinearPlane, lag: Lag, disturbance: Noise, weights: Weights
) -> AugmentedModel:
    """Return the filter model of one plane with disturbance, loads and noise densities.

    Notes
    -----
    With x_p the plane behind its tailcone (A_p, B_p), d the disturbance states (slow moment and
    waves, shaping filter A_d), b the offset of the surface and g the buoyancy::

        x_p' = A_p x_p + B_p (u + b + n_u) + E d (+ g on the heave acceleration)
        d'   = A_d d + w_d        b' = w_b        g' = w_g

    n_u has the density `Weights.recovery`^2, w_b `Weights.load`^2 and w_g `Weights.buoyancy`^2.
    Sensor noise: gyro, angle (at least `MIN_ANGLE_RAD`) and, in pitch, depth and depth rate, each
    sd^2 `NOISE_STEP_S`.
    """
    A_plane, B_plane = loop_state_space.plane_with_tailcone(plane, lag, PADE_ORDER)
    n, load = len(plane.B), len(B_plane) + DISTURBANCE_STATES
    size = load + count_loads(plane)
    A, B, process = np.zeros((size, size)), np.zeros(size), np.zeros((size, size))
    shaping, density, *_ = noise.system(
        plane, disturbance._replace(wave_radps2=disturbance.wave_radps2 * weights.wave)
    )
    disturbance_in, disturbance_states = slice(n, n + DISTURBANCE_STATES), slice(len(B_plane), load)
    A[: len(B_plane), : len(B_plane)] = A_plane
    A[: len(B_plane), load] = B_plane
    B[: len(B_plane)] = B_plane
    A[:n, disturbance_states] = shaping[:n, disturbance_in]
    A[disturbance_states, disturbance_states] = shaping[disturbance_in, disturbance_in]
    process[:n, :n] = density[:n, :n]
    process[disturbance_states, disturbance_states] = density[disturbance_in, disturbance_in]
    process[load, load] = weights.load**2
    process += weights.recovery**2 * np.outer(B, B)
    C_plane = outputs(plane)
    C = np.hstack([C_plane, np.zeros((len(C_plane), size - n))])
    if len(C_plane) == 4:
        process[0, 0] += weights.heave**2
        A[0, load + 1], process[load + 1, load + 1] = 1.0, weights.buoyancy**2
    depth_m = weights.depth * disturbance.depth_m
    noise_sd = [
        weights.gyro * disturbance.rate_radps,
        max(disturbance.angle_rad, MIN_ANGLE_RAD),
        depth_m,
        depth_m / DEPTH_RATE_S,
    ][: len(C_plane)]
    return AugmentedModel(
        A=A, B=B, C=C, process=process, measurement=np.diag(noise_sd) ** 2 * NOISE_STEP_S, load=load
    )


def count_loads(plane: LinearPlane) -> int:
    """Return the number of constant loads in the filter; they are its last states."""
    return 2 if "depth" in plane.states else 1


def filter_gains(model: AugmentedModel) -> Array:
    """Return the steady Kalman gain, (states, outputs).

    With W and V the densities of process and measurement noise::

        A P + P A^T - P C^T V^-1 C P + W = 0        L = P C^T V^-1
    """
    P = solve_continuous_are(model.A.T, model.C.T, model.process, model.measurement)
    return np.asarray(np.linalg.solve(model.measurement, model.C @ P).T)


def feedback(model: AugmentedModel, weights: Weights) -> Array:
    """Return the feedback row F of the optimal regulator with load compensation.

    It minimises the integral of x^T Q x + R u^2::

        A^T X + X A - X B R^-1 B^T X + Q = 0        K = R^-1 B^T X
        u = u_e d - K (x - x_e d)                   F = [-K, u_e + K x_e]

    d are the estimated loads, x_e and u_e the equilibrium per unit of load.
    """
    load, in_pitch = model.load, len(model.C) == 4
    A, B = model.A[:load, :load], model.B[:load, None]
    Q, R = np.zeros_like(A), np.array([[weights.effort**2]])
    weights_held = (weights.rate_s, weights.pitch, 1.0) if in_pitch else (weights.rate_s, 1.0)
    Q[range(1, 1 + len(weights_held)), range(1, 1 + len(weights_held))] = np.square(weights_held)
    F = -np.linalg.solve(R, B.T @ solve_continuous_are(A, B, Q, R))[0]
    state, command = equilibrium(model, held_state=len(weights_held))
    return np.concatenate([F, command - F @ state])


def equilibrium(model: AugmentedModel, held_state: int) -> tuple[Array, Array]:
    """Return states and command per unit of each load that keep `held_state` at zero.

    Solves [A B; e_held 0] [x; u] = [-A_load; 0].
    """
    load, loads = model.load, len(model.B) - model.load
    balance = np.zeros((load + 1, load + 1))
    balance[:load, :load] = model.A[:load, :load]
    balance[:load, load] = model.B[:load]
    balance[load, held_state] = 1.0
    load_inputs = np.vstack([-model.A[:load, load:], np.zeros((1, loads))])
    at_rest = np.asarray(np.linalg.solve(balance, load_inputs), dtype=np.float64)
    return at_rest[:load], at_rest[load]


def pitch_per_metre(controller: ContinuousController) -> float:
    """Return the pitch command per metre of depth error (rad/m): a ratio of feedback gains."""
    return abs(float(controller.F[3] / controller.F[2]))
