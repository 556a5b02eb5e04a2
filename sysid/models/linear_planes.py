"""Linear yaw and pitch plane at one speed, and the numbers on which control design is based.

Equations in the paper's axes (x forward, y port, z up), with speed U (m/s), mass m (kg), rudder dr
and elevator de (rad), x_CM = 0 (the paper, "Vehicle Yaw and Pitch Models"):

    (m - Y_vdot) v'    = Y_v v + (Y_r - m U) r + Y_dr dr
    (I_zz - N_rdot) r' = N_v v + N_r r + N_dr dr,                        psi' = r
    (m - Z_wdot) w'    = Z_w w + (Z_q + m U) q + Z_de de
    (I_yy - M_qdot) q' = M_w w + M_q q + m g z_CM theta + M_de de,       theta' = q
    depth'             = w - U theta   (FRD)

All results are in MAVLink's axes (FRD, NED), in which both surfaces have a positive effect. The two
systems of axes differ by a rotation of 180 degrees about x, which changes the signs of v, w, q, r,
psi and theta together: A is the same in both, B has the opposite sign.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from sysid.planes import PLANES, Plane
from sysid.reproduction.paper_tables import (
    CRUISE_SPEED_MPS,
    GRAVITY_MPS2,
    MASS_KG,
    Table1Column,
)

Array = NDArray[np.float64]

QUANTILE = float(ndtri(0.975))
"""Half-width of a 95 % interval in standard deviations."""


class LinearPlane(NamedTuple):
    """x' = A x + B delta in FRD/NED axes; delta in radians."""

    A: Array
    B: Array
    states: tuple[str, ...]
    """Names of the states: ("v", "r", "psi") or ("w", "q", "theta", "depth")."""
    moment: Array
    """Input vector of an angular acceleration (rad/s^2) by a disturbance moment."""


class SmallSignal(NamedTuple):
    """Transfer function from surface angle to rate of one plane, without the restoring moment.

    rate/delta = (b1 s + b0) / (s^2 + a1 s + a0), with rate r in yaw and q in pitch, FRD axes. The
    restoring moment of pitch is excluded, so that both planes are comparable.
    """

    static_gain_per_s: float
    """b0/a0: steady rate per unit of angle."""
    b1_per_s2: float
    """Initial angular acceleration per unit of angle."""
    p_fast_per_s: float
    """Pole of larger magnitude (its real part)."""
    p_slow_per_s: float
    """Pole of smaller magnitude (its real part)."""
    restoring_per_s2: float
    """m g z_CM / (I_yy - M_qdot): angular acceleration per radian of pitch; 0 in yaw."""


def static_gain_is_bounded(p_slow_per_s: float, sd_per_s: float) -> bool:
    """Return whether the static gain has a bounded interval.

    The slow pole is its denominator. If that may be zero (95 %), no interval of the gain is bounded
    (Fieller 1954).

    Parameters
    ----------
    p_slow_per_s, sd_per_s : float
        Slow pole and its standard deviation.

    Returns
    -------
    bool
        True if the pole differs from zero.
    """
    return abs(p_slow_per_s) >= QUANTILE * sd_per_s


def yaw_plane(
    c: Table1Column, speed_mps: float = CRUISE_SPEED_MPS, mass_kg: float = MASS_KG
) -> LinearPlane:
    """Return the yaw plane in FRD axes.

    Parameters
    ----------
    c : Table1Column
        Coefficients in the paper's axes, SI units and radians.
    speed_mps : float
        Speed U at which they hold, m/s.
    mass_kg : float
        Mass m, kg.

    Returns
    -------
    LinearPlane
        States (v, r, psi), input rudder; A (3, 3), B (3,).

    Notes
    -----
    The module docstring has the equations (the paper, "Vehicle Yaw and Pitch Models").
    """
    total_mass_kg, total_inertia_kgm2 = mass_kg - c.Y_vdot, c.I_zz - c.N_rdot
    A = np.array(
        [
            [c.Y_v / total_mass_kg, (c.Y_r - mass_kg * speed_mps) / total_mass_kg, 0.0],
            [c.N_v / total_inertia_kgm2, c.N_r / total_inertia_kgm2, 0.0],
            [0.0, 1.0, 0.0],
        ]
    )
    # From FLU to FRD every state changes its sign and the rudder angle does not: B changes sign.
    B = -np.array([c.Y_dr / total_mass_kg, c.N_dr / total_inertia_kgm2, 0.0])
    return LinearPlane(A=A, B=B, states=PLANES[Plane.YAW].states, moment=np.array([0.0, 1.0, 0.0]))


def pitch_plane(
    c: Table1Column,
    speed_mps: float = CRUISE_SPEED_MPS,
    mass_kg: float = MASS_KG,
    gravity_mps2: float = GRAVITY_MPS2,
) -> LinearPlane:
    """Return the pitch plane in FRD axes.

    Parameters
    ----------
    c : Table1Column
        Coefficients in the paper's axes, SI units and radians.
    speed_mps : float
        Speed U at which they hold, m/s.
    mass_kg : float
        Mass m, kg.
    gravity_mps2 : float
        Gravity g, m/s^2.

    Returns
    -------
    LinearPlane
        States (w, q, theta, depth), input elevator; A (4, 4), B (4,); theta positive nose up.

    Notes
    -----
    The module docstring has the equations (the paper, "Vehicle Yaw and Pitch Models").
    """
    total_mass_kg, total_inertia_kgm2 = mass_kg - c.Z_wdot, c.I_yy - c.M_qdot
    A = np.array(
        [
            [c.Z_w / total_mass_kg, (c.Z_q + mass_kg * speed_mps) / total_mass_kg, 0.0, 0.0],
            [
                c.M_w / total_inertia_kgm2,
                c.M_q / total_inertia_kgm2,
                mass_kg * gravity_mps2 * c.z_CM / total_inertia_kgm2,
                0.0,
            ],
            [0.0, 1.0, 0.0, 0.0],
            [1.0, 0.0, -speed_mps, 0.0],
        ]
    )
    B = -np.array([c.Z_de / total_mass_kg, c.M_de / total_inertia_kgm2, 0.0, 0.0])
    return LinearPlane(
        A=A, B=B, states=PLANES[Plane.PITCH].states, moment=np.array([0.0, 1.0, 0.0, 0.0])
    )


def linear_plane(
    plane: Plane,
    c: Table1Column,
    speed_mps: float = CRUISE_SPEED_MPS,
    mass_kg: float = MASS_KG,
    gravity_mps2: float = GRAVITY_MPS2,
) -> LinearPlane:
    """Return one of the planes; arguments as for ``pitch_plane``."""
    if PLANES[plane].is_yaw:
        return yaw_plane(c, speed_mps, mass_kg)
    return pitch_plane(c, speed_mps, mass_kg, gravity_mps2)


def without_depth(plane: LinearPlane) -> LinearPlane:
    """Return the pitch plane without depth, which no other state depends on.

    Parameters
    ----------
    plane : LinearPlane
        Linear pitch plane.

    Returns
    -------
    LinearPlane
        Plane with the states w, q, theta.
    """
    return LinearPlane(plane.A[:3, :3], plane.B[:3], plane.states[:3], plane.moment[:3])


def small_signal_names(plane: Plane) -> tuple[str, ...]:
    """Return the fields of ``SmallSignal`` that a plane has: no restoring moment in yaw."""
    return SmallSignal._fields[:-1] if PLANES[plane].is_yaw else SmallSignal._fields


def small_signal(plane: LinearPlane) -> SmallSignal:
    """Return the transfer function from surface angle to rate of a plane.

    Parameters
    ----------
    plane : LinearPlane
        Yaw or pitch plane, FRD axes.

    Returns
    -------
    SmallSignal
        Static gain, initial acceleration, poles and restoring moment.

    Notes
    -----
    From the 2 x 2 block A and B of cross speed and rate: a0 = det A, b1 = B_2,
    b0 = A_21 B_1 - A_11 B_2.
    """
    A, B = plane.A[:2, :2], plane.B[:2]
    a0 = float(np.linalg.det(A))
    b0 = float(A[1, 0] * B[0] - A[0, 0] * B[1])
    slow, fast = sorted(np.linalg.eigvals(A).real, key=abs)
    restoring = float(plane.A[1, 2])
    return SmallSignal(
        static_gain_per_s=b0 / a0,
        b1_per_s2=float(B[1]),
        p_fast_per_s=float(fast),
        p_slow_per_s=float(slow),
        restoring_per_s2=restoring,
    )
