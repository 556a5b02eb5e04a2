"""Frequency responses and margins of the autopilot's loops around a linear plane.

They use the true delay exp(-s T); `loop_state_space` closes the same loops with a rational one.

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
from collections.abc import Mapping
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mavlink_io.frames import wrap_pi
from mavlink_io.jit import entry_point
from mavlink_io.tick import TICK_S
from sysid.models.linear_planes import LinearPlane
from sysid.planes import PLANES, Plane

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
Gains = Mapping[str, float]
"""Loop gains by parameter name, as in Table 3 of the paper."""

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
    phase_margins_rad = [abs(wrap_pi(_phase(loop, index) + math.pi)) for index in unit_crossings]
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


@entry_point
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
    return lower_phase + (index - i) * wrap_pi(cmath.phase(loop[i + 1]) - lower_phase)
