"""The two linear planes of motion at one speed, and the few numbers that control design rests on.

Equations in the paper's axes (x forward, y port, z up) and symbols:

    (m - Y_vdot) v' = Y_v v + (Y_r - m U) r + Y_dr dr         (I_zz - N_rdot) r' = N_v v + N_r r +
    N_dr dr (m - Z_wdot) w' = Z_w w + (Z_q + m U) q + Z_de de         (I_yy - M_qdot) q' = M_w w +
    M_q q + m g z_CM theta + M_de de

with x_CM = 0 (the paper, "Vehicle Yaw and Pitch Models"). Everything that leaves this file is in
MAVLink's axes (FRD, NED), where both surfaces have a positive effect: the two axes differ by half a
turn about x, which changes the sign of v, w, q, r, psi, theta and depth together."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.reproduction.paper_tables import (
    CRUISE_SPEED_MPS,
    GRAVITY_MPS2,
    MASS_KG,
    Table1Column,
)

Array = NDArray[np.float64]


class LinearPlane(NamedTuple):
    """x' = A x + B delta in FRD/NED axes; delta in radians."""

    A: Array
    B: Array
    states: tuple[str, ...]
    """("v", "r", "psi") or ("w", "q", "theta", "depth")."""
    moment: Array
    """Unit angular acceleration as an input: how a disturbing moment enters."""


class SmallSignal(NamedTuple):
    """Rate over angle of one plane, K (...)/(...), without pitch's restoring moment, so that both
    planes compare.

    r/delta = (b1 s + b0) / (s^2 + a1 s + a0), and q/delta likewise once the restoring moment is
    taken out."""

    static_gain_per_s: float
    """b0/a0: steady rate per unit of angle."""
    b1_per_s2: float
    """Initial angular acceleration per unit of angle."""
    p_fast_per_s: float
    """Real poles; for a complex pair both hold its real part."""
    p_slow_per_s: float
    restoring_per_s2: float
    """m g z_CM / (I_yy - M_qdot): angular acceleration per radian of pitch; 0 in yaw."""


def yaw_plane(
    c: Table1Column, speed_mps: float = CRUISE_SPEED_MPS, mass_kg: float = MASS_KG
) -> LinearPlane:
    """Sway, yaw rate, heading; A (3, 3), B (3,)."""
    across, about = mass_kg - c.Y_vdot, c.I_zz - c.N_rdot
    A = np.array(
        [
            [c.Y_v / across, (c.Y_r - mass_kg * speed_mps) / across, 0.0],
            [c.N_v / about, c.N_r / about, 0.0],
            [0.0, 1.0, 0.0],
        ]
    )
    # Half a turn about x changes the sign of every state here and of none of the angles' effects.
    B = -np.array([c.Y_dr / across, c.N_dr / about, 0.0])
    return LinearPlane(A, B, ("v", "r", "psi"), np.array([0.0, 1.0, 0.0]))


def pitch_plane(
    c: Table1Column,
    speed_mps: float = CRUISE_SPEED_MPS,
    mass_kg: float = MASS_KG,
    gravity_mps2: float = GRAVITY_MPS2,
) -> LinearPlane:
    """Heave, pitch rate, pitch, depth; A (4, 4), B (4,)."""
    across, about = mass_kg - c.Z_wdot, c.I_yy - c.M_qdot
    A = np.array(
        [
            [c.Z_w / across, (c.Z_q + mass_kg * speed_mps) / across, 0.0, 0.0],
            [c.M_w / about, c.M_q / about, mass_kg * gravity_mps2 * c.z_CM / about, 0.0],
            [0.0, 1.0, 0.0, 0.0],
            [1.0, 0.0, -speed_mps, 0.0],
        ]
    )
    B = -np.array([c.Z_de / across, c.M_de / about, 0.0, 0.0])
    return LinearPlane(A, B, ("w", "q", "theta", "depth"), np.array([0.0, 1.0, 0.0, 0.0]))


def small_signal(plane: LinearPlane) -> SmallSignal:
    """The transfer function from angle to rate, by its defining numbers."""
    A, B = plane.A[:2, :2], plane.B[:2]
    a0 = float(np.linalg.det(A))
    b0 = float(A[1, 0] * B[0] - A[0, 0] * B[1])
    slow, fast = sorted(np.linalg.eigvals(A).real, key=abs)
    restoring = float(plane.A[1, 2])
    return SmallSignal(b0 / a0, float(B[1]), float(fast), float(slow), restoring)
