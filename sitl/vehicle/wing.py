"""Lift and drag coefficients of a wing at any incidence, for the ring duct and the fins."""

from __future__ import annotations

from math import cos, sin

from mavlink_io.jit import kernel
from sitl.vehicle.model import Polar


@kernel
def coefficients(alpha_rad: float, polar: Polar) -> tuple[float, float]:
    """Return (C_L / sin alpha, C_D) at incidence 0 <= alpha <= pi/2 (rad), both dimensionless.

    Both are finite and continuous in the whole range.
    """
    # Attached flow, up to the stall angle (the paper, after Principles of Naval Architecture):
    #     C_L = a alpha + C_Dc alpha^2,   C_D = C_do + C_L^2 / (pi AR e).
    # Separated flow: a normal force C_n sin alpha on the wing, hence
    #     C_L / sin alpha = C_n cos alpha,   C_D = C_do + C_n sin^2 alpha.
    # Between stall and separated angle the two are blended with the smooth step 3 x^2 - 2 x^3.
    sin_a = sin(alpha_rad)
    lift = (
        polar.lift_slope_per_rad * alpha_rad + polar.lift_quadratic_per_rad2 * alpha_rad * alpha_rad
    )
    lift_over_sin = lift / sin_a if sin_a > 1e-9 else polar.lift_slope_per_rad
    drag = polar.drag_zero_lift + polar.induced_drag * lift * lift
    if alpha_rad <= polar.stall_rad:
        return lift_over_sin, drag
    lift_over_sin_separated = polar.separated_normal * cos(alpha_rad)
    drag_separated = polar.drag_zero_lift + polar.separated_normal * sin_a * sin_a
    x = min(1.0, (alpha_rad - polar.stall_rad) / (polar.separated_rad - polar.stall_rad))
    separated = x * x * (3.0 - 2.0 * x)
    return (
        lift_over_sin + separated * (lift_over_sin_separated - lift_over_sin),
        drag + separated * (drag_separated - drag),
    )
