"""Duct frame and actuator of the paper, against its statements.

Axes and symbols are the paper's (x forward, y port, z up).
"""

import cmath
import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from sysid.control_analysis import loop_state_space
from sysid.control_analysis.loop_transfer import Lag
from sysid.reproduction import paper_poles
from sysid.reproduction.discrepancies.record import Discrepancy
from sysid.reproduction.paper_poles.search import LAGS
from sysid.reproduction.paper_tables import (
    TABLE_3_IMPROVED,
    TABLE_3_INITIAL,
)

Array = NDArray[np.float64]

DELAY_S = 0.3
"""Delay that the paper's text gives."""
PRINTED_CUTOFF_RADPS = (1.5, 4.0)
"""Range of the measured cut-off frequency of the tailcone (rad/s)."""


def places() -> list[Discrepancy]:
    """Return the places with their evidence.

    Returns
    -------
    list of Discrepancy
        In the order of the paper.
    """
    return [_angle_of_attack(), _duct_frame(), _actuator(), _delay(), _rate_limits()]


def _angle_of_attack() -> Discrepancy:
    """Check the angle of attack by the arc sine."""
    alpha = math.radians(120.0)
    velocity = np.array([math.cos(alpha), math.sin(alpha), 0.0])
    axis = np.array([1.0, 0.0, 0.0])
    across = float(np.linalg.norm(np.cross(velocity, axis)))
    by_sine = math.degrees(math.asin(min(1.0, across)))
    by_tangent = math.degrees(math.atan2(across, float(velocity @ axis)))
    return Discrepancy(
        place="Tailcone: alpha = arcsin(|v x r_1| / |v|)",
        printed="arc sine of a magnitude",
        reading="valid up to 90 deg and not at v = 0; atan2(|v x r_1|, v . r_1) holds everywhere",
        evidence=(
            f"at an incidence of 120 deg the arc sine gives {by_sine:.0f} deg, atan2"
            f" {by_tangent:.0f} deg; at v = 0 the quotient is 0/0"
        ),
        values={"arcsine_deg": by_sine, "atan2_deg": by_tangent},
        confirmed=abs(by_tangent - 120.0) < 1e-6 < abs(by_sine - 120.0),
    )


def _lift_direction(rudder_rad: float, elevator_rad: float, velocity: Array) -> Array:
    """Return the unit vector of the ring's lift in the body frame by the printed matrices."""
    sr, cr = math.sin(rudder_rad), math.cos(rudder_rad)
    se, ce = math.sin(elevator_rad), math.cos(elevator_rad)
    to_ring = np.array([[cr * ce, sr, -cr * se], [-sr * ce, cr, sr * se], [se, 0.0, ce]])
    in_ring = to_ring @ velocity
    t_2 = np.cross(in_ring, [1.0, 0.0, 0.0])
    axes = [in_ring, t_2, np.cross(in_ring, t_2)]
    to_wind = np.column_stack([axis / np.linalg.norm(axis) for axis in axes])
    return np.asarray(to_ring.T @ to_wind @ np.array([0.0, 0.0, -1.0]))


def _duct_frame() -> Discrepancy:
    """Check the frames and sign of the duct's lift."""
    ahead, slip = np.array([1.3, 0.0, 0.0]), np.array([1.3, 0.1, 0.0])
    steering = float(_lift_direction(0.1, 0.0, ahead)[1])
    nose_up = float(_lift_direction(0.0, 0.1, ahead)[2])
    damping = float(_lift_direction(0.0, 0.0, slip)[1])
    return Discrepancy(
        place="Tailcone: T_R/B, T_R/LD and F_LD = [-D, 0, -L]",
        printed="matrices and signs; t_2 and t_3 are undefined at alpha = 0",
        reading="correct as printed for alpha > 0",
        evidence=(
            f"direction of the lift: rudder +0.1 rad gives Y {steering:+.2f}, elevator +0.1 rad"
            f" Z {nose_up:+.2f} (tail to port and down, as N_dr and M_de need), sway +0.1 m/s"
            f" Y {damping:+.2f} (damping)"
        ),
        values={"rudder_y": steering, "elevator_z": nose_up, "sway_y": damping},
        confirmed=steering > 0.9 and nose_up < -0.9 and damping < -0.9,
    )


def _cutoff_radps(lag: Lag) -> float:
    """Return the frequency (rad/s) at which a second-order lag has fallen by 3 dB."""
    # |G| = 1/sqrt(2): x^2 + (4 zeta^2 - 2) x - 1 = 0 with x = (w / wn)^2.
    half = 1.0 - 2.0 * lag.damping_ratio**2
    return lag.natural_frequency_radps * math.sqrt(half + math.sqrt(half * half + 1.0))


def _largest_real_part(lag: Lag, gains: Mapping[str, float], model: str) -> float:
    """Return the largest real part of the heading loop's poles (rad/s) with a delay of 0.3 s."""
    closed = paper_poles.close_loop(
        "heading", paper_poles.models()[model], lag._replace(delay_s=DELAY_S), gains
    )
    return float(np.max(loop_state_space.poles(closed).real))


def _actuator() -> Discrepancy:
    """Check the denominator of the actuator's transfer function."""
    printed, read = LAGS["3s^2 + 4s/10 + 1"], LAGS["s^2/9 + 4s/10 + 1"]
    gain_sets = (TABLE_3_INITIAL, TABLE_3_IMPROVED)
    growth = [max(_largest_real_part(lag, g, "I") for g in gain_sets) for lag in (printed, read)]
    cutoff = [_cutoff_radps(lag) for lag in (printed, read)]
    low, high = PRINTED_CUTOFF_RADPS
    return Discrepancy(
        place="Tailcone dynamics modeling: G(s)",
        printed="1 / (3 s^2 + 4 s/10 + 1)",
        reading="1 / (s^2/9 + 4 s/10 + 1): 3 rad/s, damping 0.6",
        evidence=(
            f"cut-off {cutoff[0]:.2f} rad/s as printed and {cutoff[1]:.2f} as read (measured:"
            f" {low:g} to {high:g}); the heading loop with Table 3's gains has a pole at"
            f" {growth[0]:+.2f} as printed and none right of {growth[1]:+.3f} as read"
        ),
        values={
            "printed_cutoff_radps": cutoff[0],
            "read_cutoff_radps": cutoff[1],
            "printed_growth_per_s": growth[0],
            "read_growth_per_s": growth[1],
        },
        confirmed=low <= cutoff[1] <= high and not low <= cutoff[0] and growth[1] < 0.0 < growth[0],
    )


def _delay() -> Discrepancy:
    """Check the rational approximation of the delay."""

    def lag_deg(coefficients: tuple[float, float, float], frequency_radps: float) -> float:
        """Return the phase lag (deg) of q(-T s) / q(T s)."""
        s = 1j * frequency_radps * DELAY_S
        c_0, c_1, c_2 = coefficients
        return -math.degrees(
            cmath.phase((c_0 - c_1 * s + c_2 * s * s) / (c_0 + c_1 * s + c_2 * s * s))
        )

    printed, pade, ogata = (
        lag_deg(form, 2.0)
        for form in ((9 / 2, 1 / 9, 1 / 20), (1.0, 1 / 2, 1 / 12), (1.0, 1 / 2, 1 / 8))
    )
    exact = math.degrees(2.0 * DELAY_S)
    return Discrepancy(
        place="Tailcone dynamics modeling: delay in G(s)",
        printed="(9/2 - T s/9 + (T s)^2/20) / (9/2 + T s/9 + (T s)^2/20)",
        reading="a second-order form of exp(-T s): Pade (1, 1/2, 1/12), or Ogata (1, 1/2, 1/8)",
        evidence=(
            f"at 2 rad/s a delay of 0.3 s lags by {exact:.1f} deg; as printed {printed:.1f}, Pade"
            f" {pade:.1f}, Ogata {ogata:.1f} deg; the text says that the delay is 0.3 s"
        ),
        values={"printed_deg": printed, "pade_deg": pade, "ogata_deg": ogata, "exact_deg": exact},
        confirmed=max(abs(pade - exact), abs(ogata - exact)) < 1.0 < abs(printed - exact) / 10.0,
    )


def _rate_limits() -> Discrepancy:
    """Check the frequencies that the rate limit allows."""
    highest = {peak: 15.0 / (2.0 * peak) for peak in (30.0, 10.0)}
    sine = {peak: 15.0 / (math.pi * peak) for peak in (30.0, 10.0)}
    return Discrepancy(
        place="Tailcone dynamics modeling: 0.25 Hz and 0.75 Hz",
        printed="highest frequency passed without attenuation",
        reading="that of a triangle wave; a sine has its largest slope at a lower frequency",
        evidence=(
            f"rate / (2 A) is {highest[30.0]:.2f} and {highest[10.0]:.2f} Hz, rate / (pi A) of a"
            f" sine {sine[30.0]:.2f} and {sine[10.0]:.2f} Hz"
        ),
        values={
            **{f"triangle_{peak:g}deg_hz": value for peak, value in highest.items()},
            **{f"sine_{peak:g}deg_hz": value for peak, value in sine.items()},
        },
        confirmed=highest == {30.0: 0.25, 10.0: 0.75},
    )
