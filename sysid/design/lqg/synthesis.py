"""LQG on an identified plane: its tailcone, its delay, its sea and its constant loads are states of
the filter.

An offset of the surface and, in pitch, buoyancy walk at random; taking off what the filter believes
of them is the integral action (Pannocchia and Rawlings 2003, AIChE Journal 49). White noise at the
command buys margins (loop transfer recovery; Doyle and Stein 1979, IEEE Trans. AC 24)."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_continuous_are

from sysid.control_analysis import loop_transfer
from sysid.control_analysis.loop_transfer import Lag
from sysid.design.design_model import NOISE_STEP_S
from sysid.design.lqg.controller import DiscreteController
from sysid.design.lqg.loop_analysis import outputs
from sysid.models import noise
from sysid.models.linear_planes import LinearPlane
from sysid.models.noise import Noise

Array = NDArray[np.float64]

PADE_ORDER = 2
DEPTH_RATE_S = 0.7
"""The autopilot's depth filter: its vertical speed is as noisy as a depth over this time."""
SEA_STATES = 3
"""A slow moment and waves, as ``noise.system`` has them."""


class Weights(NamedTuple):
    """What is given, positive. Errors count against a radian of heading, in pitch against a metre
    of depth."""

    effort: float
    """Of a radian of the surface."""
    rate_s: float
    """Of a rad/s of turning."""
    load: float
    """How far the surface's offset walks in a second, rad."""
    recovery: float
    """White noise at the command, rad in a second's mean."""
    wave: float
    """Share of the identified waves that the filter reckons with."""
    gyro: float
    """The gyro's noise as a multiple of the identified one."""
    pitch: float = 1.0
    """Of a radian of pitch."""
    buoyancy: float = 0.001
    """How far it walks in a second, as an acceleration, m/s^2."""
    heave: float = 0.001
    """White noise of the heave acceleration, m/s^2 in a second's mean."""
    depth: float = 1.0
    """The noise of depth and its rate as a multiple of the identified one."""


class AugmentedModel(NamedTuple):
    """x' = A x + B u + w, y = C x + v. States: plane, tailcone, sea, load, and in pitch
    buoyancy."""

    A: Array
    B: Array
    C: Array
    process: Array
    """Densities."""
    measurement: Array
    load: int
    """Index of the surface's offset; what comes before it moves."""


def controller(plane: LinearPlane, lag: Lag, sea: Noise, weights: Weights) -> DiscreteController:
    """Raises numpy.linalg.LinAlgError where the weights have no solution."""
    model = build_model(plane, lag, sea, weights)
    L = filter_gains(model)
    return DiscreteController(model.A - L @ model.C, model.B, L, feedback(model, weights))


def build_model(plane: LinearPlane, lag: Lag, sea: Noise, weights: Weights) -> AugmentedModel:
    tail, drive = loop_transfer.plane_with_tailcone(plane, lag, PADE_ORDER)
    n, load = len(plane.B), len(drive) + SEA_STATES
    size = load + count_loads(plane)
    A, B, process = np.zeros((size, size)), np.zeros(size), np.zeros((size, size))
    shaping, density, *_ = noise.system(
        plane, sea._replace(wave_radps2=sea.wave_radps2 * weights.wave)
    )
    felt, own = slice(n, n + SEA_STATES), slice(len(drive), load)
    A[: len(drive), : len(drive)], A[: len(drive), load], B[: len(drive)] = tail, drive, drive
    A[:n, own], A[own, own] = shaping[:n, felt], shaping[felt, felt]
    process[:n, :n], process[own, own] = density[:n, :n], density[felt, felt]
    process[load, load] = weights.load**2
    process += weights.recovery**2 * np.outer(B, B)
    seen = outputs(plane)
    C = np.hstack([seen, np.zeros((len(seen), size - n))])
    if len(seen) == 4:
        process[0, 0] += weights.heave**2
        A[0, load + 1], process[load + 1, load + 1] = 1.0, weights.buoyancy**2
    depth_m = weights.depth * sea.depth_m
    sds = [weights.gyro * sea.rate_radps, sea.angle_rad, depth_m, depth_m / DEPTH_RATE_S][
        : len(seen)
    ]
    return AugmentedModel(A, B, C, process, np.diag(sds) ** 2 * NOISE_STEP_S, load)


def count_loads(plane: LinearPlane) -> int:
    """How many constant loads the filter knows of; they are its last states."""
    return 2 if "depth" in plane.states else 1


def filter_gains(model: AugmentedModel) -> Array:
    """Of the steady Kalman filter, (states, outputs)."""
    P = solve_continuous_are(model.A.T, model.C.T, model.process, model.measurement)
    return np.asarray(np.linalg.solve(model.measurement, model.C @ P).T)


def feedback(model: AugmentedModel, weights: Weights) -> Array:
    """Optimal about the equilibrium that the believed constant loads ask for."""
    load, in_pitch = model.load, len(model.C) == 4
    A, B = model.A[:load, :load], model.B[:load, None]
    Q, R = np.zeros_like(A), np.array([[weights.effort**2]])
    held = (weights.rate_s, weights.pitch, 1.0) if in_pitch else (weights.rate_s, 1.0)
    Q[range(1, 1 + len(held)), range(1, 1 + len(held))] = np.square(held)
    F = -np.linalg.solve(R, B.T @ solve_continuous_are(A, B, Q, R))[0]
    moved, command = equilibrium(model, held=len(held))
    return np.concatenate([F, command - F @ moved])


def equilibrium(model: AugmentedModel, held: int) -> tuple[Array, Array]:
    """States and command at which a unit of each constant load leaves state number ``held`` at
    zero."""
    load, loads = model.load, len(model.B) - model.load
    balance = np.zeros((load + 1, load + 1))
    balance[:load, :load], balance[:load, load], balance[load, held] = (
        model.A[:load, :load],
        model.B[:load],
        1.0,
    )
    pushed = np.vstack([-model.A[:load, load:], np.zeros((1, loads))])
    at_rest = np.asarray(np.linalg.solve(balance, pushed), dtype=np.float64)
    return at_rest[:load], at_rest[load]


def pitch_per_metre(law: DiscreteController) -> float:
    """What a metre of depth asks of the pitch, rad: elevator is the same for either."""
    return abs(float(law.F[3] / law.F[2]))
