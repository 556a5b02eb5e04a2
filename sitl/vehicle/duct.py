"""The ring duct as a wing: lift, drag and stall at any incidence, in FLU axes."""

from __future__ import annotations

from math import atan2, cos, exp, log, pi, sin, sqrt

from sitl.vehicle import wing
from sitl.vehicle.jit import Vector3, kernel
from sitl.vehicle.model import Duct

SLOPE_SCALE_PER_RAD = 5.927
"""2 pi r of the paper's ring-wing formula."""
ASPECT_SCALE = 4.305
"""s of the paper's ring-wing formula."""


def ring_wing_lift_slope_per_rad(aspect_ratio: float) -> float:
    """dC_L/dalpha of a ring wing of ``aspect_ratio`` = diameter / chord, per radian.

    Van Dyke's form fitted by McEwen and Streitlien to Milewski's and the DSRV report's points, as
    printed in the paper ("Tailcone"); the logarithm is natural."""
    a = ASPECT_SCALE * aspect_ratio
    return SLOPE_SCALE_PER_RAD / (1 + 2 / a + 16 / (pi * a**2) * log(1 + pi * exp(-9 / 8) * a))


@kernel
def ring_axis(rudder_rad: float, elevator_rad: float) -> Vector3:
    """Unit vector along the ring, forward; first row of the paper's T_R/B. Thrust acts along it."""
    cos_r = cos(rudder_rad)
    return cos_r * cos(elevator_rad), sin(rudder_rad), -cos_r * sin(elevator_rad)


@kernel
def force(velocity: Vector3, axis: Vector3, duct: Duct) -> Vector3:
    """Lift and drag of the ring moving at ``velocity`` (m/s, through the water) with its axis along
    ``axis``, N.

    Lift is 1/2 rho A (C_L/sin alpha) V x (e x V), which is the paper's -L t3 without its unit
    vectors, undefined at zero incidence. A ring moving backwards is a ring whose axis points the
    other way."""
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
