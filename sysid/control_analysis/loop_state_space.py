"""Closed loops of the autopilot around a linear plane as state spaces: poles and step responses.

The control laws and filters are those of `loop_transfer`; the delay is a rational (Pade)
approximation.
"""

from collections.abc import Callable, Sequence
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.control_analysis.loop_transfer import (
    NO_FILTERS,
    CommandFilters,
    Gains,
    Lag,
    Lead,
    Peak,
    command_filters,
)
from sysid.models.linear_planes import LinearPlane, without_depth
from sysid.planes import PLANES, Plane

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
Approximation = int | tuple[float, ...]
"""Rational approximation of a delay T.

An integer is the order of the Pade approximation. A tuple holds the coefficients of q in rising
powers, for q(-T s) / q(T s).
"""


class ClosedLoop(NamedTuple):
    """Closed loop x' = A x + reference * set-point; the plane's states come first."""

    A: Array
    reference: Array


@cache
def delay_state_space(
    delay_s: float, approximation: Approximation
) -> tuple[Array, Array, Array, float]:
    """Return the state space (A, B, C, D) of a delay's rational approximation."""
    if delay_s <= 0.0:
        return np.zeros((0, 0)), np.zeros(0), np.zeros(0), 1.0
    import control
    from scipy import signal

    if isinstance(approximation, int):
        ratio = control.pade(delay_s, approximation)
    else:
        denominator = [c * delay_s**power for power, c in enumerate(approximation)]
        ratio = (
            [c * (-1.0) ** power for power, c in enumerate(denominator)][::-1],
            denominator[::-1],
        )
    A, B, C, D = signal.tf2ss(*ratio)
    return A, B[:, 0], C[0], float(D[0, 0])


def plane_with_tailcone(
    plane: LinearPlane, lag: Lag, order: Approximation, filters: CommandFilters = NO_FILTERS
) -> tuple[Array, Array]:
    """Return (A, B) of a plane behind tailcone, actuator lead and peak filter.

    Parameters
    ----------
    plane : LinearPlane
        Linear yaw or pitch plane.
    lag : Lag
        Lag and delay of the tailcone.
    order : int or tuple
        Approximation of the delay.
    filters : CommandFilters
        Actuator lead and peak filter.

    Returns
    -------
    tuple of ndarray
        A and B from the loops' output (rad). States: plane, lag (angle, rate), delay, lead (angle,
        rate), peak filter (angle, rate).

    Notes
    -----
    The lead is realised by the faster lag a'' = w'^2 (u - a) - 2 z' w' a'. The command to the
    tailcone is a + (2 z / w) a' + a'' / w^2, which cancels the lag with frequency w and damping z.
    The peak filter is p'' = w^2 (u - p) - 2 z w p' with the output u + (2 z (g - 1) / w) p'.
    """
    A, B = _plane_with_lag(plane, lag, order)
    if filters.lead is not None:
        A, B = _with_lead(A, B, filters.lead)
    if filters.peak is not None:
        A, B = _with_peak(A, B, filters.peak)
    return A, B


def _with_peak(A: Array, B: Array, peak: Peak) -> tuple[Array, Array]:
    """Return (A, B) of a system behind a peak filter."""
    n, w, drag = len(B), peak.frequency_radps, 2.0 * peak.damping * peak.frequency_radps
    A_peak, B_peak = np.zeros((n + 2, n + 2)), np.zeros(n + 2)
    A_peak[:n, :n], A_peak[n, n + 1], A_peak[n + 1, n:] = A, 1.0, (-w * w, -drag)
    A_peak[:n, n + 1] = B * (2.0 * peak.damping * (peak.gain - 1.0) / w)
    B_peak[:n], B_peak[n + 1] = B, w * w
    return A_peak, B_peak


def _with_lead(A: Array, B: Array, lead: Lead) -> tuple[Array, Array]:
    """Return (A, B) of a system behind the actuator lead."""
    n, lag_radps, lead_radps = len(B), lead.lag_radps, lead.lead_radps
    A_lead, B_lead = np.zeros((n + 2, n + 2)), np.zeros(n + 2)
    stiffness, drag = -(lead_radps**2), -2.0 * lead.lead_damping * lead_radps
    A_lead[:n, :n] = A
    A_lead[n, n + 1] = 1.0
    A_lead[n + 1, n:] = (stiffness, drag)
    B_lead[n + 1] = lead_radps**2
    # command = angle + 2 z/w rate + acceleration/w^2 of the lead's own motion.
    A_lead[:n, n] = B * (1.0 + stiffness / lag_radps**2)
    A_lead[:n, n + 1] = B * (2.0 * lead.lag_damping / lag_radps + drag / lag_radps**2)
    B_lead[:n] = B * (lead_radps / lag_radps) ** 2
    return A_lead, B_lead


def _plane_with_lag(plane: LinearPlane, lag: Lag, order: Approximation) -> tuple[Array, Array]:
    """Return (A, B) from the command to the states of plane, lag (angle, rate) and delay."""
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
    """Return the closed heading loop.

    Parameters
    ----------
    plane : LinearPlane
        Yaw plane: states v, r, psi.
    lag : Lag
        Lag and delay of the tailcone.
    gains : Gains
        HDG_ gains and, where used, the ACT_ parameters.
    order : int or tuple
        Approximation of the delay.

    Returns
    -------
    ClosedLoop
        The integrator is the last state; it is left out if HDG_I is zero.
    """
    A, B = plane_with_tailcone(plane, lag, order, command_filters(Plane.YAW, gains))
    error = _row(A, {2: -1.0})
    feedback = gains["HDG_P"] * error + _row(A, {1: -gains["HDG_D"]})
    return _close(A, B, feedback, gains["HDG_P"], [(gains["HDG_I"] * error, gains["HDG_I"], 1.0)])


def close_pitch(plane: LinearPlane, lag: Lag, gains: Gains, order: Approximation = 4) -> ClosedLoop:
    """Return the closed pitch loop with a constant pitch set-point and no depth loop.

    Parameters
    ----------
    plane : LinearPlane
        Pitch plane: states w, q, theta, depth. Depth is removed because this loop does not feed it
        back.
    lag : Lag
        Lag and delay of the tailcone.
    gains : Gains
        PTCH_ gains and, where used, the ACT_ parameters.
    order : int or tuple
        Approximation of the delay.

    Returns
    -------
    ClosedLoop
        The integrator is the last state; it is left out if PTCH_I is zero.
    """
    filters = command_filters(Plane.PITCH, gains)
    A, B = plane_with_tailcone(without_depth(plane), lag, order, filters)
    error = _row(A, {2: -1.0})
    feedback = gains["PTCH_P"] * error + _row(A, {1: -gains["PTCH_D"]})
    return _close(
        A, B, feedback, gains["PTCH_P"], [(gains["PTCH_I"] * error, gains["PTCH_I"], 1.0)]
    )


def close_depth(plane: LinearPlane, lag: Lag, gains: Gains, order: Approximation = 4) -> ClosedLoop:
    """Return the closed depth loop around the pitch loop.

    Parameters
    ----------
    plane : LinearPlane
        Pitch plane: states w, q, theta, depth.
    lag : Lag
        Lag and delay of the tailcone.
    gains : Gains
        PTCH_ and DPT_ gains and, where used, the ACT_ parameters.
    order : int or tuple
        Approximation of the delay.

    Returns
    -------
    ClosedLoop
        Integrators are the last states; one whose gain is zero is left out.

    Notes
    -----
    With both integrators the last two states are those of depth and pitch. The pitch set-point, and
    so the input of the pitch integrator, contains the depth integrator.
    """
    A, B = plane_with_tailcone(plane, lag, order, command_filters(Plane.PITCH, gains))
    p = gains["PTCH_P"]
    # theta_c from depth and its rate (a combination of states), without the set-point's part.
    theta_c = _row(A, {3: gains["DPT_P"]}) + gains["DPT_D"] * _row(A, dict(enumerate(plane.A[3])))
    error = theta_c + _row(A, {2: -1.0})
    feedback = p * error + _row(A, {1: -gains["PTCH_D"]})
    depth_integral = (_row(A, {3: -gains["DPT_I"]}), gains["DPT_I"], -p)
    pitch_integral = (gains["PTCH_I"] * error, -gains["PTCH_I"] * gains["DPT_P"], 1.0)
    closed = _close(A, B, feedback, -p * gains["DPT_P"], [depth_integral, pitch_integral])
    if gains["PTCH_I"] != 0.0 and gains["DPT_I"] != 0.0:
        closed.A[-1, -2] = -gains["PTCH_I"]
    return closed


LOOPS: dict[str, tuple[Plane, Callable[[LinearPlane, Lag, Gains, Approximation], ClosedLoop]]] = {
    "heading": (Plane.YAW, close_heading),
    "pitch": (Plane.PITCH, close_pitch),
    "depth": (Plane.PITCH, close_depth),
}
"""Plane of each loop, and the function that closes it."""


def close_loop(
    loop: str,
    planes: Sequence[LinearPlane],
    lags: Sequence[Lag],
    gains: Gains,
    order: Approximation = 4,
) -> ClosedLoop:
    """Return one of the closed `LOOPS`.

    Parameters
    ----------
    loop : str
        Name in `LOOPS`.
    planes, lags : sequence
        Linear planes, and lags of the tailcone, in the order of `Plane`.
    gains : Gains
        Gains of the loop and, where used, the ACT_ parameters.
    order : int or tuple
        Approximation of the delay.

    Returns
    -------
    ClosedLoop
        Closed loop.
    """
    plane, close = LOOPS[loop]
    index = PLANES[plane].index
    return close(planes[index], lags[index], gains, order)


def _row(A: Array, entries: dict[int, float]) -> Array:
    """Return a row vector over the states of A with the given entries."""
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
    """Close the loop with the command `feedback` x + `forward` * set-point + sum(weight * I).

    Each integrator is I' = row x + gain * set-point; integrators without input are left out.
    """
    active = [i for i in integrators if i[1] != 0.0 or np.any(i[0])]
    n_states, n_integrators = A.shape[0], len(active)
    closed = np.zeros((n_states + n_integrators, n_states + n_integrators))
    reference = np.zeros(n_states + n_integrators)
    closed[:n_states, :n_states] = A + np.outer(B, feedback)
    reference[:n_states] = B * forward
    for number, (row, gain, weight) in enumerate(active):
        closed[n_states + number, :n_states] = row
        reference[n_states + number] = gain
        closed[:n_states, n_states + number] = B * weight
    return ClosedLoop(closed, reference)


def poles(loop: ClosedLoop) -> ComplexArray:
    """Return the poles of a closed loop.

    Parameters
    ----------
    loop : ClosedLoop
        Closed loop.

    Returns
    -------
    ndarray
        Eigenvalues of A (rad/s), slowest first.
    """
    eigenvalues = np.linalg.eigvals(loop.A).astype(np.complex128)
    return eigenvalues[np.argsort(np.abs(eigenvalues), kind="stable")]


def step_response(loop: ClosedLoop, state: int, seconds: float, dt: float = 0.1) -> Array:
    """Return the response of one state to a unit step of the set-point, starting at zero.

    Parameters
    ----------
    loop : ClosedLoop
        Closed loop.
    state : int
        Index of the state.
    seconds : float
        Length of the response (s).
    dt : float
        Sample interval (s).

    Returns
    -------
    ndarray
        Response at 0, dt, 2 dt, ...

    Notes
    -----
    With A = V diag(lambda) V^-1 and d = V^-1 reference:
    x(t) = V diag((exp(lambda t) - 1) / lambda) d.
    """
    values, vectors = np.linalg.eig(loop.A)
    modal_input = np.linalg.solve(vectors, loop.reference.astype(np.complex128))
    times = np.arange(0.0, seconds, dt)
    modes = (np.exp(np.outer(times, values)) - 1.0) / values
    return np.asarray((modes * (vectors[state] * modal_input)).sum(axis=1).real)
