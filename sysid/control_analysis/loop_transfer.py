"""Frequency responses and closed-loop poles of the autopilot's loops around a linear plane.

Frequency responses use the true delay exp(-s T); poles use a rational (Pade) approximation.

Control laws, angles in rad, depth in m positive down, e = set-point minus measurement::

    rudder   = HDG_P e_psi - HDG_D r + I_psi                     I_psi'   = HDG_I e_psi
    elevator = PTCH_P (theta_c - theta) - PTCH_D q + I_theta     I_theta' = PTCH_I (theta_c - theta)
    theta_c  = -(DPT_P e_z + I_z) + DPT_D depth'                 I_z'     = DPT_I e_z

r and q are the yaw and pitch rates (rad/s), psi the heading, theta the pitch, theta_c the commanded
pitch.

With ACT_LEAD_W set, rudder and elevator commands pass through the actuator lead, which cancels the
assumed lag of the tailcone and replaces it by a faster one::

    F(s) = (s^2 + 2 z w s + w^2) / (s^2 + 2 z' w' s + w'^2) * w'^2 / w^2

with w = ACT_LAG_W, z = ACT_LAG_Z, w' = ACT_LEAD_W (rad/s) and z' = ACT_LEAD_Z.

With HDG_PEAK_W or PTCH_PEAK_W set, the command of that plane passes through a peak filter before::

    C(s) = (s^2 + 2 z g w s + w^2) / (s^2 + 2 z w s + w^2)

with w = _PEAK_W (rad/s), z = _PEAK_Z and g = _PEAK_GAIN.
"""

import cmath
import math
from collections.abc import Callable, Mapping, Sequence
from functools import cache, lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mavlink_io.jit import kernel
from sysid.models.linear_planes import LinearPlane
from sysid.planes import PLANES, Plane

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
Gains = Mapping[str, float]
"""Loop gains by parameter name, as in Table 3 of the paper."""
Approximation = int | tuple[float, ...]
"""Rational approximation of a delay T.

An integer is the order of the Pade approximation. A tuple holds the coefficients of q in rising
powers, for q(-T s) / q(T s).
"""

TICK_S = 0.02
SAMPLING_S = 1.5 * TICK_S
"""Extra delay (s) from sampling at 50 Hz: half a tick of hold and one tick of computation."""


class Lag(NamedTuple):
    """Second-order lag and delay of the tailcone between command and duct angle."""

    delay_s: float
    natural_frequency_radps: float = 3.0
    damping_ratio: float = 0.6


class Lead(NamedTuple):
    """Assumed lag of the tailcone, and the faster lag that replaces it."""

    lag_radps: float
    lag_damping: float
    lead_radps: float
    lead_damping: float


class Peak(NamedTuple):
    """Peak filter of one surface's command."""

    frequency_radps: float
    damping: float
    gain: float


class CommandFilters(NamedTuple):
    """Filters between the output of a loop and the command; None where one is off."""

    peak: Peak | None = None
    lead: Lead | None = None


NO_FILTERS = CommandFilters()
LEAD_DAMPING = 0.7
"""Damping ratio of the faster lag without ACT_LEAD_Z: the default of this parameter."""


class Margins(NamedTuple):
    """Classical stability margins of one loop."""

    gm_db: float
    """Smallest destabilising gain factor, up or down (dB); infinite if there is none."""
    pm_deg: float
    """Smallest phase margin over all crossings of unit gain (deg); infinite without a crossing."""
    max_sensitivity: float
    """Largest sensitivity, max |1 / (1 + L)|."""
    crossover_radps: float
    """Highest frequency of unit gain (rad/s); NaN without a crossing."""


GRID_RADPS: Array = np.geomspace(1e-3, 60.0, 480)
"""Frequency grid (rad/s) on which loops are evaluated."""
MAX_EXTREMUM = 0.05
"""Distance from zero within which the samples beside an extremum can hide a pair of crossings."""
THROUGH_FIVE: Array = np.linalg.inv(np.vander(np.arange(-2.0, 3.0), increasing=True))
"""Coefficients, in rising powers of the index, of the polynomial through five samples."""


class Responses(NamedTuple):
    """Frequency responses of a plane's states."""

    states: tuple[str, ...]
    command: ComplexArray
    """Response to the command through delay and lag, (frequencies, states)."""
    moment: ComplexArray
    """Response to a unit of disturbing angular acceleration, (frequencies, states)."""


def responses(plane: LinearPlane, lag: Lag, frequency_radps: Array = GRID_RADPS) -> Responses:
    """Return the frequency responses of a plane behind a tailcone.

    Parameters
    ----------
    plane : LinearPlane
        Linear yaw or pitch plane, x' = A x + B delta, in FRD axes.
    lag : Lag
        Lag and delay of the tailcone, with the delay of sampling.
    frequency_radps : ndarray
        Frequencies, rad/s.

    Returns
    -------
    Responses
        Complex responses of all states at the frequencies.

    Notes
    -----
    With the duct response G(s) = exp(-s T) wn^2 / (s^2 + 2 zeta wn s + wn^2)::

        command = (sI - A)^-1 B G(s)      moment = (sI - A)^-1 m

    m is the unit vector of angular acceleration about the axis of the plane.
    """
    s = 1j * frequency_radps
    resolvent = np.linalg.inv(s[:, None, None] * np.eye(plane.A.shape[0]) - plane.A)
    wn, zeta = lag.natural_frequency_radps, lag.damping_ratio
    duct = np.exp(-s * lag.delay_s) * wn**2 / (s**2 + 2.0 * zeta * wn * s + wn**2)
    return Responses(plane.states, (resolvent @ plane.B) * duct[:, None], resolvent @ plane.moment)


def actuator_lead(gains: Gains) -> Lead | None:
    """Return the actuator lead that the gains ask for, or None if it is off."""
    if not gains.get("ACT_LEAD_W"):
        return None
    return Lead(
        gains["ACT_LAG_W"],
        gains["ACT_LAG_Z"],
        gains["ACT_LEAD_W"],
        gains.get("ACT_LEAD_Z", LEAD_DAMPING),
    )


def command_filters(plane: Plane, gains: Gains) -> CommandFilters:
    """Return the filters that the gains ask for in a plane.

    Parameters
    ----------
    plane : Plane
        Yaw or pitch.
    gains : Gains
        Parameters of the loops by name.

    Returns
    -------
    CommandFilters
        Peak filter and actuator lead.
    """
    prefix = PLANES[plane].gain_prefix
    if not gains.get(f"{prefix}_PEAK_W"):
        return CommandFilters(lead=actuator_lead(gains))
    return CommandFilters(
        Peak(*(gains[f"{prefix}_PEAK_{name}"] for name in ("W", "Z", "GAIN"))), actuator_lead(gains)
    )


@lru_cache(maxsize=4)
def filter_response(filters: CommandFilters) -> ComplexArray:
    """Return the response of peak filter and actuator lead on `GRID_RADPS`, one where both are off.

    Parameters
    ----------
    filters : CommandFilters
        Filters of a plane.

    Returns
    -------
    ndarray
        C(s) F(s) of the module docstring.
    """
    response = np.ones(GRID_RADPS.size, dtype=np.complex128)
    if filters.peak is not None:
        s, (w, z, gain) = 1j * GRID_RADPS, filters.peak
        response *= (s**2 + 2.0 * z * gain * w * s + w**2) / (s**2 + 2.0 * z * w * s + w**2)
    if filters.lead is not None:
        response *= _lead_response(filters.lead)
    return response


def _lead_response(lead: Lead) -> ComplexArray:
    """Return F(s) of the module docstring on `GRID_RADPS`."""
    s, lag_radps, lead_radps = 1j * GRID_RADPS, lead.lag_radps, lead.lead_radps
    cancelled = (s**2 + 2.0 * lead.lag_damping * lag_radps * s + lag_radps**2) / lag_radps**2
    faster = s**2 + 2.0 * lead.lead_damping * lead_radps * s + lead_radps**2
    return np.asarray(cancelled * lead_radps**2 / faster)


def with_filters(plant: Responses, gains: Gains) -> Responses:
    """Return `plant` with the filters of its plane's command in front of the tailcone."""
    plane = Plane.PITCH if "depth" in plant.states else Plane.YAW
    filters = command_filters(plane, gains)
    if filters == NO_FILTERS:
        return plant
    return plant._replace(command=plant.command * filter_response(filters)[:, None])


def heading_loops(plant: Responses, gains: Gains) -> dict[str, ComplexArray]:
    """Return the open-loop transfer functions of the heading loop.

    Parameters
    ----------
    plant : Responses
        Responses of the yaw plane.
    gains : Gains
        HDG_P, HDG_D, HDG_I and, where used, the HDG_PEAK_ and ACT_ parameters.

    Returns
    -------
    dict
        "rudder": the loop opened at the rudder; "heading": opened at the heading error. Each on
        `GRID_RADPS`.

    Notes
    -----
    With C = HDG_P + HDG_I / s and the plant's responses r and psi to the rudder::

        L_rudder = HDG_D r + C psi        L_heading = C psi / (1 + HDG_D r)
    """
    s, command = 1j * GRID_RADPS, with_filters(plant, gains).command
    r, psi = command[:, 1], command[:, 2]
    forward = gains["HDG_P"] + gains["HDG_I"] / s
    inner = gains["HDG_D"] * r
    return {"rudder": inner + forward * psi, "heading": forward * psi / (1.0 + inner)}


def depth_loops(plant: Responses, gains: Gains) -> dict[str, ComplexArray]:
    """Return the open-loop transfer functions of the pitch and depth loops.

    Parameters
    ----------
    plant : Responses
        Responses of the pitch plane.
    gains : Gains
        PTCH_ and DPT_ gains and, where used, the ACT_ parameters.

    Returns
    -------
    dict
        "elevator": opened at the elevator; "depth": opened at the pitch command; "pitch": opened at
        the elevator without a depth loop. Each on `GRID_RADPS`.

    Notes
    -----
    With C = PTCH_P + PTCH_I / s, K = DPT_P + DPT_I / s + DPT_D s and the plant's responses q, theta
    and depth to the elevator::

        L_pitch = PTCH_D q + C theta      L_elevator = L_pitch - C K depth
        L_depth = -C K depth / (1 + L_pitch)
    """
    s, command = 1j * GRID_RADPS, with_filters(plant, gains).command
    q, theta = command[:, 1], command[:, 2]
    forward = gains["PTCH_P"] + gains["PTCH_I"] / s
    pitch = gains["PTCH_D"] * q + forward * theta
    outer = -forward * pitch_command(command, gains)
    return {
        "elevator": pitch + outer,
        "depth": outer / (1.0 + pitch),
        "pitch": pitch,
    }


def open_loops(plane: Plane, plant: Responses, gains: Gains) -> dict[str, ComplexArray]:
    """Return the open-loop transfer functions of a plane.

    Parameters
    ----------
    plane : Plane
        Yaw or pitch.
    plant : Responses
        Responses of that plane.
    gains : Gains
        Gains of its loops and, where used, the ACT_ parameters.

    Returns
    -------
    dict
        Transfer functions by the point where the loop is opened, on `GRID_RADPS`.
    """
    return (heading_loops, depth_loops)[PLANES[plane].index](plant, gains)


def surface_loop(plane: Plane, plant: Responses, gains: Gains) -> ComplexArray:
    """Return the loop of a plane opened at its surface."""
    return open_loops(plane, plant, gains)[PLANES[plane].surface]


def pitch_command(plant: ComplexArray, gains: Gains) -> ComplexArray:
    """Return the pitch command (rad) per unit of the input of `plant`, with a constant set-point.

    Parameters
    ----------
    plant : ndarray
        Response of the pitch plane's states to that input, (frequencies, states); column 3 is
        depth.
    gains : Gains
        DPT_P, DPT_I and DPT_D.

    Returns
    -------
    ndarray
        (DPT_P + DPT_I / s + DPT_D s) depth(s) on `GRID_RADPS`.
    """
    s = 1j * GRID_RADPS
    return (gains["DPT_P"] + gains["DPT_I"] / s + gains["DPT_D"] * s) * plant[:, 3]


def margins(loop: ComplexArray) -> Margins:
    """Return the gain and phase margins of a loop.

    Parameters
    ----------
    loop : ndarray
        Open-loop transfer function L on `GRID_RADPS`.

    Returns
    -------
    Margins
        Margins over all crossings. Crossings are found by linear interpolation between frequencies,
        and by a polynomial of fourth degree where a loop crosses unit gain twice between them.

    Notes
    -----
    Phase margin: |arg L + pi| where |L| = 1. Gain margin: |20 log10 |L|| where L is real and
    negative. Ms = 1 / min |1 + L|.
    """
    log_gain = np.log(np.abs(loop))
    unit_crossings = _crossings(log_gain)
    phase_margins_rad = [abs(_wrap(_phase(loop, index) + math.pi)) for index in unit_crossings]
    # Phase crossings of any odd multiple of -180 degrees are zeros of the imaginary part on the
    # negative real axis.
    phase_crossings = [
        index for index in _crossings(loop.imag) if _interpolate(loop.real, index) < 0.0
    ]
    log_gain_margins = [abs(_interpolate(log_gain, index)) for index in phase_crossings]
    return Margins(
        gm_db=20.0 * min(log_gain_margins, default=math.inf) / math.log(10.0),
        pm_deg=math.degrees(min(phase_margins_rad, default=math.inf)),
        max_sensitivity=1.0 / float(np.min(np.abs(1.0 + loop))),
        crossover_radps=_interpolate(GRID_RADPS, unit_crossings[-1])
        if unit_crossings
        else math.nan,
    )


def _crossings(values: Array) -> list[float]:
    """Return the fractional indices at which `values` changes sign, in rising order."""
    crossings, extrema = _sign_changes(values)
    for i in extrema:
        crossings += _roots_beside(values, i).tolist()
    return sorted(crossings)


@kernel
def _sign_changes(values: Array) -> tuple[list[float], list[int]]:
    """Return the fractional indices of sign changes, and the samples at extrema near zero.

    Beside such an extremum the samples have one sign, and can hide a pair of crossings.
    """
    crossings = [
        i + values[i] / (values[i] - values[i + 1])
        for i in range(len(values) - 1)
        if values[i] * values[i + 1] < 0.0
    ]
    extrema = []
    for i in range(1, len(values) - 1):
        before, value, after = values[i - 1], values[i], values[i + 1]
        one_sign = before * value > 0.0 and value * after > 0.0
        if one_sign and abs(value) < MAX_EXTREMUM and abs(value) <= min(abs(before), abs(after)):
            extrema.append(i)
    return crossings, extrema


def _roots_beside(values: Array, i: int) -> Array:
    """Return the fractional indices of crossings, in pairs, beside the extremum at sample `i`.

    They are the roots of the polynomial of fourth degree through five samples, `i` in the middle.
    """
    middle = int(np.clip(i, 2, values.size - 3))
    roots = np.roots((THROUGH_FIVE @ values[middle - 2 : middle + 3])[::-1])
    real = roots.real[roots.imag == 0.0] + (middle - i)
    return np.asarray(i + real[np.abs(real) < 1.0])


def _interpolate(values: Array, index: float) -> float:
    """Return the value at a fractional index."""
    i = min(int(index), values.size - 2)
    return float(values[i] + (index - i) * (values[i + 1] - values[i]))


def _phase(loop: ComplexArray, index: float) -> float:
    """Return the phase (rad) at a fractional index, interpolated along the shorter arc."""
    i = min(int(index), loop.size - 2)
    lower_phase = cmath.phase(loop[i])
    return lower_phase + (index - i) * _wrap(cmath.phase(loop[i + 1]) - lower_phase)


def _wrap(angle_rad: float) -> float:
    """Wrap an angle (rad) to [-pi, pi)."""
    return (angle_rad + math.pi) % (2.0 * math.pi) - math.pi


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
    A_lead[:n, :n], A_lead[n, n + 1], A_lead[n + 1, n:], B_lead[n + 1] = (
        A,
        1.0,
        (stiffness, drag),
        lead_radps**2,
    )
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
    A, B = plane_with_tailcone(
        LinearPlane(
            A=plane.A[:3, :3], B=plane.B[:3], states=plane.states[:3], moment=plane.moment[:3]
        ),
        lag,
        order,
        command_filters(Plane.PITCH, gains),
    )
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
    closed, reference = (
        np.zeros((n_states + n_integrators, n_states + n_integrators)),
        np.zeros(n_states + n_integrators),
    )
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
