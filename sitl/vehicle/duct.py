"""Ring duct as a wing: lift, drag and stall at any incidence, in body FLU axes."""

from __future__ import annotations

from math import atan2, cos, exp, log, pi, sin, sqrt

from mavlink_io.jit import kernel
from sitl.vehicle import wing
from sitl.vehicle.model import Duct
from sitl.vehicle.vectors import Vector3

SLOPE_SCALE_PER_RAD = 5.927
"""Constant 2 pi r of the paper's ring-wing formula, 1/rad."""
ASPECT_SCALE = 4.305
"""Constant s of the paper's ring-wing formula, dimensionless."""


def ring_wing_lift_slope_per_rad(aspect_ratio: float) -> float:
    """Return the lift slope dC_L/dalpha of a ring wing, per radian.

    Parameters
    ----------
    aspect_ratio : float
        Diameter over chord, dimensionless.

    Returns
    -------
    float
        Lift slope on the area diameter times chord, 1/rad.

    Notes
    -----
    dC_L/dalpha = 2 pi r / (1 + 2/(s AR) + 16/(pi (s AR)^2) ln(1 + pi e^(-9/8) s AR)): van Dyke's
    form, fitted by McEwen and Streitlien to the points of Milewski and of the DSRV report, as
    printed in the paper ("Tailcone"). The logarithm is natural.
    """
    a = ASPECT_SCALE * aspect_ratio
    return SLOPE_SCALE_PER_RAD / (1 + 2 / a + 16 / (pi * a**2) * log(1 + pi * exp(-9 / 8) * a))


@kernel
def ring_axis(rudder_rad: float, elevator_rad: float) -> Vector3:
    """Return the unit vector along the ring axis, forward; thrust acts along it.

    Parameters
    ----------
    rudder_rad, elevator_rad : float
        Duct angles dR and dE, rad; positive turns the nose to starboard and up.

    Returns
    -------
    tuple of 3 floats
        Unit vector in body FLU axes.

    Notes
    -----
    First row of the paper's T_R/B: (cos dE cos dR, sin dR, -cos dR sin dE).
    """
    cos_r = cos(rudder_rad)
    return cos_r * cos(elevator_rad), sin(rudder_rad), -cos_r * sin(elevator_rad)


@kernel
def force(velocity: Vector3, axis: Vector3, duct: Duct) -> Vector3:
    """Return lift and drag of the ring, N, body FLU axes.

    ``velocity`` is that of the ring through the water, m/s, and ``axis`` the unit vector along the
    ring, both in body axes.
    """
    # V: velocity, e: ring axis, alpha = atan2(|e x V|, |e . V|): incidence, 0 to pi/2.
    #     lift = +-1/2 rho A (C_L / sin alpha) V x (e x V),   drag = -1/2 rho A C_D |V| V.
    # The lift is the paper's -L t3 ("Tailcone") as a double cross product, because the paper's unit
    # vectors are undefined at zero incidence. The sign is that of e . V: a ring that moves
    # backwards is a ring with the opposite axis.
    vx, vy, vz = velocity
    ex, ey, ez = axis
    along = vx * ex + vy * ey + vz * ez
    cx = ey * vz - ez * vy
    cy = ez * vx - ex * vz
    cz = ex * vy - ey * vx
    across = sqrt(cx * cx + cy * cy + cz * cz)
    lift_over_sin, drag = wing.coefficients(atan2(across, abs(along)), duct.polar)
    lift = duct.half_rho_area_kgpm * (lift_over_sin if along >= 0.0 else -lift_over_sin)
    resist = duct.half_rho_area_kgpm * drag * sqrt(vx * vx + vy * vy + vz * vz)
    return (
        lift * (vy * cz - vz * cy) - resist * vx,
        lift * (vz * cx - vx * cz) - resist * vy,
        lift * (vx * cy - vy * cx) - resist * vz,
    )
