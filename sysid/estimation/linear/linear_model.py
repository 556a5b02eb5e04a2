"""Values of the linear estimators: equations of motion of one plane, and its tailcone.

Yaw has four numbers that rate and heading determine, b1, b0, a1, a0::

    r/delta = (b1 s + b0) / (s^2 + a1 s + a0)

Pitch has seven, with U the known speed (m/s)::

    w' = zw w + zq q + zd delta
    q' = mw w + mq q + k theta + md delta
    depth' = w - U theta

Axes are those of MAVLink (FRD, NED): w heave (m/s, down), q and r rates (rad/s), theta and psi
angles (rad), depth (m, down), delta duct angle (rad). Poles may be complex or unstable, because no
value is a logarithm.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.estimation.map import steady_state
from sysid.models import linear_planes
from sysid.models.greybox import Actuator
from sysid.models.linear_planes import LinearPlane, SmallSignal
from sysid.models.parameters import BENCH_TEST_SD, CandidateVehicle
from sysid.planes import PLANES, Plane

Array = NDArray[np.float64]

NUMBERS: dict[Plane, tuple[str, ...]] = {
    Plane.YAW: ("b1", "b0", "a1", "a0"),
    Plane.PITCH: ("zw", "zq", "mw", "mq", "k", "zd", "md"),
}
"""Names of the coefficients of the equations of motion."""
OFFSETS: dict[Plane, tuple[str, ...]] = {Plane.YAW: (), Plane.PITCH: ("level_rad",)}
"""Names of the values after those of the tailcone.

Level pitch is the pitch of level flight, about which the pitch plane is linear. The bias is then
the duct angle at a command of zero minus the duct angle in level flight.
"""
TAIL = ("delay_s", "bias_rad", "natural_frequency_radps", "damping_ratio")
"""Names of the values of the tailcone."""
MIN_COUPLING = 1e-6
"""Smallest coefficient of sway in yaw acceleration, 1/(m s).

At zero, b0 would need an infinite force.
"""


class LinearModelStructure(NamedTuple):
    """Known quantities of a plane."""

    plane: Plane
    speed_mps: float
    sway: tuple[float, float]
    """Coefficients of v and r in v' of the prior plane, 1/s and m/s.

    Rate and heading do not determine them. They set the zero through which disturbing moments act,
    which only matters for the noise model.
    """
    travel_rad: float
    """Travel of the duct to either side, rad."""
    rate_radps: float
    """Rate limit of the duct, rad/s."""
    lag_relative_sd: float = BENCH_TEST_SD
    """Relative standard deviation of the tailcone's frequency and damping, as by a bench test.

    Tests in water hardly distinguish lag and delay. The estimators therefore use the bench test as
    one more measurement, instead of a known lag.
    """


class LinearModel(NamedTuple):
    """Structure of a plane and its values, in the order of ``names``."""

    frame: LinearModelStructure
    values: Array


def names(plane: Plane) -> tuple[str, ...]:
    """Return the names of the values: 8 in yaw, 12 in pitch.

    Parameters
    ----------
    plane : Plane
        Plane.

    Returns
    -------
    tuple of str
        Coefficients, tailcone values and, in pitch, the level pitch angle.
    """
    return NUMBERS[plane] + TAIL + OFFSETS[plane]


def lag(plane: Plane) -> slice:
    """Return the slice of the tailcone's frequency and damping in the values.

    Parameters
    ----------
    plane : Plane
        Plane.

    Returns
    -------
    slice
        Indices of natural frequency (rad/s) and damping ratio.
    """
    first = names(plane).index("natural_frequency_radps")
    return slice(first, first + 2)


def of_vehicle(vehicle: CandidateVehicle, plane: Plane) -> LinearModel:
    """Return the small-signal plane of a vehicle in trim at duct angle zero, and its actuator.

    Parameters
    ----------
    vehicle : CandidateVehicle
        Vehicle configuration and actuators.
    plane : Plane
        Plane.

    Returns
    -------
    LinearModel
        Structure and values.
    """
    return of_plane(
        steady_state.straight_plane(vehicle, plane),
        vehicle.actuators[plane],
        vehicle.config.operating_point.speed_mps,
    )


def of_plane(linear: LinearPlane, actuator: Actuator, speed_mps: float) -> LinearModel:
    """Return the linear model of a plane and its actuator.

    A pitch plane has a level pitch of zero.
    """
    plane = next(plane for plane in Plane if PLANES[plane].states == linear.states)
    A, B = linear.A, linear.B
    tail = [
        actuator.delay_s,
        actuator.bias_rad,
        actuator.natural_frequency_radps,
        actuator.damping_ratio,
    ]
    frame = LinearModelStructure(
        plane=plane,
        speed_mps=speed_mps,
        sway=(float(A[0, 0]), float(A[0, 1])),
        travel_rad=actuator.travel_rad,
        rate_radps=actuator.rate_radps,
    )
    if PLANES[plane].is_yaw:
        b0, a0 = A[1, 0] * B[0] - A[0, 0] * B[1], np.linalg.det(A[:2, :2])
        numbers = [B[1], b0, -A[0, 0] - A[1, 1], a0]
    else:
        numbers = [A[0, 0], A[0, 1], A[1, 0], A[1, 1], A[1, 2], B[0], B[1]]
    return LinearModel(frame, np.array([*numbers, *tail, *[0.0] * len(OFFSETS[plane])]))


def actuator(model: LinearModel) -> Actuator:
    """Return the actuator that the values describe.

    Parameters
    ----------
    model : LinearModel
        Structure and values.

    Returns
    -------
    Actuator
        Delay (s), bias (rad), natural frequency (rad/s), damping ratio and limits.
    """
    delay_s, bias_rad, frequency_radps, damping = model.values[len(NUMBERS[model.frame.plane]) :][
        : len(TAIL)
    ].tolist()
    return Actuator(
        delay_s=delay_s,
        natural_frequency_radps=frequency_radps,
        damping_ratio=damping,
        bias_rad=bias_rad,
        travel_rad=model.frame.travel_rad,
        rate_radps=model.frame.rate_radps,
    )


def level_rad(model: LinearModel) -> float:
    """Return the pitch of level flight, rad; zero in yaw."""
    return float(model.values[-1]) if OFFSETS[model.frame.plane] else 0.0


def equations(frame: LinearModelStructure, numbers: Array) -> tuple[Array, Array]:
    """Return (A, B) of x' = A x + B delta; both are linear in ``numbers``.

    Parameters
    ----------
    frame : LinearModelStructure
        Plane, speed (m/s) and fixed values.
    numbers : ndarray
        Coefficients, in the order of NUMBERS.

    Returns
    -------
    A : ndarray, shape (n, n)
        System matrix.
    B : ndarray, shape (n,)
        Input vector; delta is the duct angle relative to level flight, in radians.

    Notes
    -----
    States: (xi, r, psi) in yaw, (w, q, theta, depth) in pitch; all but the first are outputs. Yaw
    is the observer canonical form of its transfer function (Kailath 1980, section 2.1), which
    exists for all coefficients.
    """
    if PLANES[frame.plane].is_yaw:
        b1, b0, a1, a0 = numbers.tolist()
        return np.array([[0.0, -a0, 0.0], [1.0, -a1, 0.0], [0.0, 1.0, 0.0]]), np.array(
            [b0, b1, 0.0]
        )
    zw, zq, mw, mq, k, zd, md = numbers.tolist()
    A = [
        [zw, zq, 0.0, 0.0],
        [mw, mq, k, 0.0],
        [0.0, 1.0, 0.0, 0.0],
        [1.0, 0.0, -frame.speed_mps, 0.0],
    ]
    return np.array(A), np.array([zd, md, 0.0, 0.0])


def linear_plane(model: LinearModel) -> LinearPlane:
    """Return the plane in physical states, on which disturbances act.

    Yaw has the sway equation of the prior.

    Parameters
    ----------
    model : LinearModel
        Structure and values.

    Returns
    -------
    LinearPlane
        States (v, r, psi) in yaw, (w, q, theta, depth) in pitch.
    """
    frame, numbers = model.frame, model.values[: len(NUMBERS[model.frame.plane])]
    states = PLANES[frame.plane].states
    moment = np.eye(len(states))[1]
    if not PLANES[frame.plane].is_yaw:
        A, B = equations(frame, numbers)
        return LinearPlane(A=A, B=B, states=states, moment=moment)
    b1, b0, a1, a0 = numbers.tolist()
    yv, yr = frame.sway
    nr = -a1 - yv
    nv = (yv * nr - a0) / yr
    nv = math.copysign(max(abs(nv), MIN_COUPLING), nv)
    A = np.array([[yv, yr, 0.0], [nv, nr, 0.0], [0.0, 1.0, 0.0]])
    return LinearPlane(
        A=A, B=np.array([(b0 + yv * b1) / nv, b1, 0.0]), states=states, moment=moment
    )


def derived_names(plane: Plane) -> tuple[str, ...]:
    """Return the names of ``derived``, with the units of a model file.

    Parameters
    ----------
    plane : Plane
        Plane.

    Returns
    -------
    tuple of str
        Names; unlike in a model file, the bias is in radians.
    """
    return (*linear_planes.small_signal_names(plane), *TAIL[:2])


def derived(frame: LinearModelStructure, values: Array) -> Array:
    """Return the derived numbers of a plane.

    Parameters
    ----------
    frame : LinearModelStructure
        Plane, speed (m/s) and fixed values.
    values : ndarray, shape (p,)
        Values, in the order of `names`.

    Returns
    -------
    ndarray
        Static gain (1/s), initial acceleration (1/s2), poles (1/s), restoring moment (1/s2, pitch
        only), delay (s) and bias (rad), in the order of `derived_names`.
    """
    signal = small_signal(LinearModel(frame, values))
    numbers = signal[: len(linear_planes.small_signal_names(frame.plane))]
    return np.array([*numbers, *values[len(NUMBERS[frame.plane]) :][:2]])


def small_signal(model: LinearModel) -> SmallSignal:
    """Return the numbers that control design uses.

    Parameters
    ----------
    model : LinearModel
        Structure and values.

    Returns
    -------
    SmallSignal
        Static gain (1/s), initial acceleration (1/s2), poles (1/s) and restoring moment (1/s2); of
        complex poles the real part.
    """
    if not PLANES[model.frame.plane].is_yaw:
        return linear_planes.small_signal(linear_plane(model))
    b1, b0, a1, a0 = model.values[:4].tolist()
    slow, fast = sorted(np.roots([1.0, a1, a0]).real, key=abs)
    return SmallSignal(
        static_gain_per_s=b0 / a0,
        b1_per_s2=b1,
        p_fast_per_s=float(fast),
        p_slow_per_s=float(slow),
        restoring_per_s2=0.0,
    )


def propagate(frame: LinearModelStructure, values: Array, covariance: Array) -> Array:
    """Return the covariance of ``derived``.

    Parameters
    ----------
    frame : LinearModelStructure
        Plane, speed (m/s) and fixed values.
    values : ndarray, shape (p,)
        Values, in the order of `names`.
    covariance : ndarray, shape (p, p)
        Covariance P of the values.

    Returns
    -------
    ndarray, shape (d, d)
        Covariance, in the order of `derived_names`.

    Notes
    -----
    Delta method: S P S' with the slope S = d(derived)/d(values) by central differences.
    """
    steps = 1e-6 * np.maximum(np.abs(values), 1e-3)
    columns = [
        (derived(frame, values + step) - derived(frame, values - step)) for step in np.diag(steps)
    ]
    slope = np.column_stack(columns) / (2.0 * steps)
    return np.asarray(slope @ covariance @ slope.T)
