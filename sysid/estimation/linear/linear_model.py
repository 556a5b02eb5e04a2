"""What the linear estimators look for: one plane's equations of motion and its tailcone, as a
vector of values.

Yaw has four numbers that motion in rate and heading can tell, r/delta = (b1 s + b0)/(s^2 + a1 s +
a0). Pitch has seven, the rows of

    w' = zw w + zq q + zd delta,    q' = mw w + mq q + k theta + md delta,    depth' = w - U theta

with the speed U known, all in MAVLink's axes. Poles may be complex or unstable: no value is a
logarithm."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.data.segments import Plane
from sysid.estimation.map import fit
from sysid.models import linear_planes
from sysid.models.greybox import Actuator
from sysid.models.linear_planes import LinearPlane, SmallSignal
from sysid.models.parameters import PARAMETERS, CandidateVehicle

Array = NDArray[np.float64]

NUMBERS: dict[Plane, tuple[str, ...]] = {
    "yaw": ("b1", "b0", "a1", "a0"),
    "pitch": ("zw", "zq", "mw", "mq", "k", "zd", "md"),
}
TAIL = ("delay_s", "bias_rad", "natural_frequency_radps", "damping_ratio")
LEVEL_PITCH = "level_rad"
"""Pitch of level flight, about which pitch is linear. The bias is then the duct's angle at a
command of zero less its angle in level flight."""
LAG_SD = np.array(
    [p.prior_sd for p in PARAMETERS if p.name in ("natural_frequency", "damping_ratio")]
)
"""Relative, of the tailcone's frequency and damping: what its bench test left unsure. Tests in
water hardly tell the lag from the delay, so the estimators take the bench's word as one more
measurement instead of the lag as known."""

MIN_COUPLING = 1e-6
"""Sway into yaw acceleration, 1/(m s): an uncoupled plane would need an infinite force to have its
b0."""


class LinearModelStructure(NamedTuple):
    """What is known of a plane beforehand."""

    plane: Plane
    speed_mps: float
    sway: tuple[float, float]
    """v' of the prior plane per unit of v and of r. Rate and heading cannot tell them; they place
    the zero through which the sea's moments act, and matter to the noise alone."""
    travel_rad: float
    rate_radps: float
    """Of the duct."""


class LinearModel(NamedTuple):
    """A frame and the values in it, in the order of ``names``."""

    frame: LinearModelStructure
    values: Array


def names(plane: Plane) -> tuple[str, ...]:
    """Of the values; lengths 8 in yaw and 12 in pitch."""
    return NUMBERS[plane] + TAIL + ((LEVEL_PITCH,) if plane == "pitch" else ())


def lag(plane: Plane) -> slice:
    """Where the tailcone's frequency and damping stand among the values."""
    first = names(plane).index("natural_frequency_radps")
    return slice(first, first + 2)


def outputs(plane: Plane) -> int:
    """How many there are: rate and angle, and depth in pitch."""
    return 3 if plane == "pitch" else 2


def of_vehicle(vehicle: CandidateVehicle, plane: Plane) -> LinearModel:
    """The small-signal plant of a candidate, balanced at a duct angle of zero: its bias is that of
    the actuator."""
    return of_plane(
        fit.linear_plane(vehicle, plane),
        vehicle.actuators[plane],
        vehicle.config.operating_point.speed_mps,
    )


def of_plane(linear: LinearPlane, actuator: Actuator, speed_mps: float) -> LinearModel:
    """The plant of a linear plane and its tailcone. A pitch plane flies level at a pitch of
    zero."""
    plane: Plane = "yaw" if "psi" in linear.states else "pitch"
    A, B = linear.A, linear.B
    tail = [
        actuator.delay_s,
        actuator.bias_rad,
        actuator.natural_frequency_radps,
        actuator.damping_ratio,
    ]
    frame = LinearModelStructure(
        plane, speed_mps, (float(A[0, 0]), float(A[0, 1])), actuator.travel_rad, actuator.rate_radps
    )
    if plane == "yaw":
        numbers = [
            B[1],
            A[1, 0] * B[0] - A[0, 0] * B[1],
            -A[0, 0] - A[1, 1],
            np.linalg.det(A[:2, :2]),
        ]
        return LinearModel(frame, np.array([*numbers, *tail]))
    return LinearModel(
        frame, np.array([A[0, 0], A[0, 1], A[1, 0], A[1, 1], A[1, 2], B[0], B[1], *tail, 0.0])
    )


def actuator(plant: LinearModel) -> Actuator:
    delay_s, bias_rad, frequency_radps, damping = plant.values[len(NUMBERS[plant.frame.plane]) :][
        : len(TAIL)
    ].tolist()
    return Actuator(
        delay_s, frequency_radps, damping, bias_rad, plant.frame.travel_rad, plant.frame.rate_radps
    )


def level_rad(plant: LinearModel) -> float:
    """Pitch of level flight; zero in yaw."""
    return float(plant.values[-1]) if plant.frame.plane == "pitch" else 0.0


def equations(frame: LinearModelStructure, numbers: Array) -> tuple[Array, Array]:
    """(A, B) of x' = A x + B delta with x = (xi, r, psi) or (w, q, theta, depth); linear in
    ``numbers``.

    Yaw is the observer's canonical form of its transfer function (Kailath 1980, section 2.1), which
    has no coefficient that a plane could not have; all states but the first are outputs."""
    if frame.plane == "yaw":
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


def linear_plane(plant: LinearModel) -> LinearPlane:
    """The same plane in states that the sea can push: yaw with the prior's sway equation."""
    frame, numbers = plant.frame, plant.values[: len(NUMBERS[plant.frame.plane])]
    moment = np.array([0.0, 1.0, 0.0])
    if frame.plane == "pitch":
        return LinearPlane(
            *equations(frame, numbers), ("w", "q", "theta", "depth"), np.append(moment, 0.0)
        )
    b1, b0, a1, a0 = numbers.tolist()
    yv, yr = frame.sway
    nr = -a1 - yv
    nv = (yv * nr - a0) / yr
    nv = math.copysign(max(abs(nv), MIN_COUPLING), nv)
    A = np.array([[yv, yr, 0.0], [nv, nr, 0.0], [0.0, 1.0, 0.0]])
    return LinearPlane(A, np.array([(b0 + yv * b1) / nv, b1, 0.0]), ("v", "r", "psi"), moment)


def derived_names(plane: Plane) -> tuple[str, ...]:
    """Of ``derived``: what a model file reports, in its units but for the bias, which is in
    radians."""
    restoring = ("restoring_per_s2",) if plane == "pitch" else ()
    return (
        "static_gain_per_s",
        "b1_per_s2",
        "p_fast_per_s",
        "p_slow_per_s",
        *restoring,
        "delay_s",
        "bias_rad",
    )


def derived(frame: LinearModelStructure, values: Array) -> Array:
    """Gain, initial acceleration, poles, restoring moment (pitch), delay and bias."""
    signal, tail = small_signal(LinearModel(frame, values)), values[len(NUMBERS[frame.plane]) :][:2]
    kept = signal if frame.plane == "pitch" else signal[:-1]
    return np.array([*kept, *tail])


def small_signal(plant: LinearModel) -> SmallSignal:
    """The numbers that control design rests on; the real part of both poles where they are
    complex."""
    if plant.frame.plane == "pitch":
        return linear_planes.small_signal(linear_plane(plant))
    b1, b0, a1, a0 = plant.values[:4].tolist()
    slow, fast = sorted(np.roots([1.0, a1, a0]).real, key=abs)
    return SmallSignal(b0 / a0, b1, float(fast), float(slow), 0.0)


def propagate(frame: LinearModelStructure, values: Array, covariance: Array) -> Array:
    """Covariance of ``derived``, first order (delta method), from that of the values."""
    steps = 1e-6 * np.maximum(np.abs(values), 1e-3)
    columns = [(derived(frame, values + h) - derived(frame, values - h)) for h in np.diag(steps)]
    slope = np.column_stack(columns) / (2.0 * steps)
    return np.asarray(slope @ covariance @ slope.T)
