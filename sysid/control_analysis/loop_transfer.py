"""The autopilot's loops round a linear plane: frequency responses with the true delay, poles with a
Pade delay.

The laws, angles in radians, depth in metres (e is set-point less measurement):

    rudder   = HDG_P e_psi - HDG_D r + I_psi                       I_psi' = HDG_I e_psi elevator =
    PTCH_P (theta_c - theta) - PTCH_D q + I_theta       I_theta' = PTCH_I (theta_c - theta) theta_c
    = -(DPT_P e_z + I_z) + DPT_D depth'                   I_z' = DPT_I e_z

With ACT_LEAD_W, rudder and elevator pass through the tailcone's believed lag undone and a faster
one: (s^2 + 2 z w s + w^2) / (s^2 + 2 z' w' s + w'^2) w'^2 / w^2, w = ACT_LAG_W, z = ACT_LAG_Z, w' =
ACT_LEAD_W, z' = 0.7."""

import cmath
import math
from collections.abc import Mapping
from functools import cache, lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.models.linear_planes import LinearPlane

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
Gains = Mapping[str, float]
"""By parameter name, as in Table 3."""
Approximation = int | tuple[float, ...]
"""Of a delay T: the order of Pade's, or the coefficients of q in rising powers for q(-T s) / q(T
s)."""

TICK_S = 0.02
SAMPLING_S = 1.5 * TICK_S
"""What sampling at 50 Hz adds: half a tick of hold and one tick to compute."""


class Lag(NamedTuple):
    """Tailcone between command and duct angle."""

    delay_s: float
    natural_frequency_radps: float = 3.0
    damping_ratio: float = 0.6


class Lead(NamedTuple):
    """The tailcone's lag as the autopilot believes it, and the faster one that it is to seem to
    have."""

    lag_radps: float
    lag_damping: float
    lead_radps: float


LEAD_DAMPING = 0.7


class Margins(NamedTuple):
    gm_db: float
    """Smallest factor, up or down, that the loop gain may take; infinite when no factor
    destabilises."""
    pm_deg: float
    """Smallest over all crossings of unit gain; infinite without one."""
    ms: float
    """Largest sensitivity |1/(1+L)|."""
    crossover_radps: float
    """Highest frequency of unit gain; not a number without one."""


GRID_RADPS: Array = np.geomspace(1e-3, 60.0, 480)
"""Frequencies on which loops are judged."""


class Responses(NamedTuple):
    """A plane on ``GRID_RADPS``: from command, through delay and lag, and from a unit of angular
    acceleration."""

    states: tuple[str, ...]
    command: ComplexArray
    """(frequencies, states)."""
    moment: ComplexArray
    """(frequencies, states)."""


def responses(plane: LinearPlane, lag: Lag) -> Responses:
    s = 1j * GRID_RADPS
    resolvent = np.linalg.inv(s[:, None, None] * np.eye(plane.A.shape[0]) - plane.A)
    wn, zeta = lag.natural_frequency_radps, lag.damping_ratio
    duct = np.exp(-s * lag.delay_s) * wn**2 / (s**2 + 2.0 * zeta * wn * s + wn**2)
    return Responses(plane.states, (resolvent @ plane.B) * duct[:, None], resolvent @ plane.moment)


def actuator_lead(gains: Gains) -> Lead | None:
    """What the gains make of the tailcone's lag; None where they leave it as it is."""
    if not gains.get("ACT_LEAD_W"):
        return None
    return Lead(gains["ACT_LAG_W"], gains["ACT_LAG_Z"], gains["ACT_LEAD_W"])


def lead_response(gains: Gains) -> ComplexArray:
    """From what the loops want to what the tailcone is told, on ``GRID_RADPS``."""
    lead = actuator_lead(gains)
    return np.ones(GRID_RADPS.size, dtype=np.complex128) if lead is None else _lead_response(lead)


@lru_cache(maxsize=16)
def _lead_response(lead: Lead) -> ComplexArray:
    s, w, faster = 1j * GRID_RADPS, lead.lag_radps, lead.lead_radps
    undone = (s**2 + 2.0 * lead.lag_damping * w * s + w**2) / w**2
    return np.asarray(undone * faster**2 / (s**2 + 2.0 * LEAD_DAMPING * faster * s + faster**2))


def with_lead(plant: Responses, gains: Gains) -> Responses:
    """``plant`` from what the loops want instead of from what the tailcone is told."""
    if actuator_lead(gains) is None:
        return plant
    return plant._replace(command=plant.command * lead_response(gains)[:, None])


def heading_loops(plant: Responses, gains: Gains) -> dict[str, ComplexArray]:
    """Loop transfer functions, opened at the rudder and at the heading error."""
    s, command = 1j * GRID_RADPS, with_lead(plant, gains).command
    r, psi = command[:, 1], command[:, 2]
    forward = gains["HDG_P"] + gains["HDG_I"] / s
    inner = gains["HDG_D"] * r
    return {"rudder": inner + forward * psi, "heading": forward * psi / (1.0 + inner)}


def depth_loops(plant: Responses, gains: Gains) -> dict[str, ComplexArray]:
    """Loop transfer functions, opened at the elevator and at the pitch command; "pitch" has no
    depth loop round it."""
    s, command = 1j * GRID_RADPS, with_lead(plant, gains).command
    q, theta = command[:, 1], command[:, 2]
    forward = gains["PTCH_P"] + gains["PTCH_I"] / s
    pitch = gains["PTCH_D"] * q + forward * theta
    outer = -forward * pitch_command(command, gains)
    return {
        "elevator": pitch + outer,
        "depth": outer / (1.0 + pitch),
        "pitch": pitch,
    }


def pitch_command(plant: ComplexArray, gains: Gains) -> ComplexArray:
    """theta_c per unit of what drives ``plant``, the set-point held."""
    s = 1j * GRID_RADPS
    return (gains["DPT_P"] + gains["DPT_I"] / s + gains["DPT_D"] * s) * plant[:, 3]


def margins(loop: ComplexArray) -> Margins:
    """Classical margins of a loop given on ``GRID_RADPS``, crossings found by linear
    interpolation."""
    log_gain = np.log(np.abs(loop))
    unit = _crossings(log_gain)
    distances = [abs(_wrap(_phase(loop, at) + math.pi)) for at in unit]
    # Phase crossings of any odd multiple of -180 degrees are zeros of the imaginary part on the
    # negative real axis.
    real_axis = [at for at in _crossings(loop.imag) if _interpolate(loop.real, at) < 0.0]
    factors = [abs(_interpolate(log_gain, at)) for at in real_axis]
    return Margins(
        gm_db=20.0 * min(factors, default=math.inf) / math.log(10.0),
        pm_deg=math.degrees(min(distances, default=math.inf)),
        ms=1.0 / float(np.min(np.abs(1.0 + loop))),
        crossover_radps=_interpolate(GRID_RADPS, unit[-1]) if unit else math.nan,
    )


def _crossings(values: Array) -> list[float]:
    """Fractional indices at which ``values`` changes sign."""
    at = np.flatnonzero(values[:-1] * values[1:] < 0.0)
    return [float(i + values[i] / (values[i] - values[i + 1])) for i in at]


def _interpolate(values: Array, at: float) -> float:
    """The value at a fractional index."""
    i = min(int(at), values.size - 2)
    return float(values[i] + (at - i) * (values[i + 1] - values[i]))


def _phase(loop: ComplexArray, at: float) -> float:
    """The phase at a fractional index, by the shorter way round from one frequency to the next."""
    i = min(int(at), loop.size - 2)
    first = cmath.phase(loop[i])
    return first + (at - i) * _wrap(cmath.phase(loop[i + 1]) - first)


def _wrap(angle_rad: float) -> float:
    return (angle_rad + math.pi) % (2.0 * math.pi) - math.pi


class ClosedLoop(NamedTuple):
    """x' = A x + reference * set-point; the plane's states come first."""

    A: Array
    reference: Array


@cache
def delay_state_space(
    delay_s: float, approximation: Approximation
) -> tuple[Array, Array, Array, float]:
    """State space (A, B, C, D) of a delay's rational approximation, by python-control."""
    if delay_s <= 0.0:
        return np.zeros((0, 0)), np.zeros(0), np.zeros(0), 1.0
    import control

    if isinstance(approximation, int):
        ratio = control.pade(delay_s, approximation)
    else:
        denominator = [c * delay_s**power for power, c in enumerate(approximation)]
        ratio = (
            [c * (-1.0) ** power for power, c in enumerate(denominator)][::-1],
            denominator[::-1],
        )
    system = control.tf2ss(*ratio)
    return system.A, system.B[:, 0], system.C[0], float(system.D[0, 0])


def plane_with_tailcone(
    plane: LinearPlane, lag: Lag, order: Approximation, lead: Lead | None = None
) -> tuple[Array, Array]:
    """(A, B) from what is wanted to the states of plane, lag (angle, its rate), delay and lead
    (angle, its rate)."""
    A, B = _plane_with_lag(plane, lag, order)
    if lead is None:
        return A, B
    n, w, faster = len(B), lead.lag_radps, lead.lead_radps
    wide, drive = np.zeros((n + 2, n + 2)), np.zeros(n + 2)
    stiffness, drag = -(faster**2), -2.0 * LEAD_DAMPING * faster
    wide[:n, :n], wide[n, n + 1], wide[n + 1, n:], drive[n + 1] = (
        A,
        1.0,
        (stiffness, drag),
        faster**2,
    )
    # command = angle + 2 z/w rate + acceleration/w^2 of the lead's own motion.
    wide[:n, n] = B * (1.0 + stiffness / w**2)
    wide[:n, n + 1] = B * (2.0 * lead.lag_damping / w + drag / w**2)
    drive[:n] = B * (faster / w) ** 2
    return wide, drive


def _plane_with_lag(plane: LinearPlane, lag: Lag, order: Approximation) -> tuple[Array, Array]:
    """(A, B) from command to the states of plane, lag (angle, its rate) and delay."""
    n = plane.A.shape[0]
    wn, zeta = lag.natural_frequency_radps, lag.damping_ratio
    Ad, Bd, Cd, Dd = delay_state_space(lag.delay_s, order)
    size = n + 2 + Ad.shape[0]
    A, B = np.zeros((size, size)), np.zeros(size)
    A[:n, :n], A[:n, n] = plane.A, plane.B
    A[n, n + 1], A[n + 1, n], A[n + 1, n + 1] = 1.0, -(wn**2), -2.0 * zeta * wn
    A[n + 1, n + 2 :], B[n + 1] = wn**2 * Cd, wn**2 * Dd
    A[n + 2 :, n + 2 :], B[n + 2 :] = Ad, Bd
    return A, B


def close_heading(
    plane: LinearPlane, lag: Lag, gains: Gains, order: Approximation = 4
) -> ClosedLoop:
    """Heading loop; its integrator is the last state and is left out when HDG_I is zero."""
    A, B = plane_with_tailcone(plane, lag, order, actuator_lead(gains))
    error = _row(A, {2: -1.0})
    feedback = gains["HDG_P"] * error + _row(A, {1: -gains["HDG_D"]})
    return _close(A, B, feedback, gains["HDG_P"], [(gains["HDG_I"] * error, gains["HDG_I"], 1.0)])


def close_pitch(plane: LinearPlane, lag: Lag, gains: Gains, order: Approximation = 4) -> ClosedLoop:
    """Pitch loop alone, its set-point held by hand; depth, which it does not feed back, is left
    out."""
    A, B = plane_with_tailcone(
        LinearPlane(plane.A[:3, :3], plane.B[:3], plane.states[:3], plane.moment[:3]),
        lag,
        order,
        actuator_lead(gains),
    )
    error = _row(A, {2: -1.0})
    feedback = gains["PTCH_P"] * error + _row(A, {1: -gains["PTCH_D"]})
    return _close(
        A, B, feedback, gains["PTCH_P"], [(gains["PTCH_I"] * error, gains["PTCH_I"], 1.0)]
    )


def close_depth(plane: LinearPlane, lag: Lag, gains: Gains, order: Approximation = 4) -> ClosedLoop:
    """Depth loop round the pitch loop; integrators as close_heading."""
    A, B = plane_with_tailcone(plane, lag, order, actuator_lead(gains))
    p = gains["PTCH_P"]
    # theta_c from depth and its rate (a combination of states), with the set-point's part apart.
    wanted = _row(A, {3: gains["DPT_P"]}) + gains["DPT_D"] * _row(A, dict(enumerate(plane.A[3])))
    error = wanted + _row(A, {2: -1.0})
    feedback = p * error + _row(A, {1: -gains["PTCH_D"]})
    depth_integral = (_row(A, {3: -gains["DPT_I"]}), gains["DPT_I"], -p)
    pitch_integral = (gains["PTCH_I"] * error, -gains["PTCH_I"] * gains["DPT_P"], 1.0)
    if gains["PTCH_I"] != 0.0 and gains["DPT_I"] != 0.0:
        raise ValueError(
            "PTCH_I and DPT_I are both set; two integrators in series have no use in this analysis"
        )
    return _close(A, B, feedback, -p * gains["DPT_P"], [depth_integral, pitch_integral])


def _row(A: Array, entries: dict[int, float]) -> Array:
    row = np.zeros(A.shape[0])
    for index, value in entries.items():
        row[index] = value
    return row


def _close(
    A: Array,
    B: Array,
    feedback: Array,
    forward: float,
    integrators: list[tuple[Array, float, float]],
) -> ClosedLoop:
    """Close ``command = feedback x + forward * set-point + sum(weight * I)``; each I' = row x +
    gain * set-point."""
    used = [i for i in integrators if i[1] != 0.0 or np.any(i[0])]
    n, k = A.shape[0], len(used)
    closed, reference = np.zeros((n + k, n + k)), np.zeros(n + k)
    closed[:n, :n] = A + np.outer(B, feedback)
    reference[:n] = B * forward
    for number, (row, gain, weight) in enumerate(used):
        closed[n + number, :n] = row
        reference[n + number] = gain
        closed[:n, n + number] = B * weight
    return ClosedLoop(closed, reference)


def poles(loop: ClosedLoop) -> ComplexArray:
    """Eigenvalues, slowest first."""
    found = np.linalg.eigvals(loop.A).astype(np.complex128)
    return found[np.argsort(np.abs(found), kind="stable")]


def step_response(loop: ClosedLoop, state: int, seconds: float, dt: float = 0.1) -> Array:
    """Response of one state to a unit step of the set-point, starting at zero."""
    values, vectors = np.linalg.eig(loop.A)
    drive = np.linalg.solve(vectors, loop.reference.astype(np.complex128))
    times = np.arange(0.0, seconds, dt)
    grown = (np.exp(np.outer(times, values)) - 1.0) / values
    return np.asarray((grown * (vectors[state] * drive)).sum(axis=1).real)
