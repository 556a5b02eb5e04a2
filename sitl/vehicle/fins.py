"""All-moving fins round the tail, cruciform or X: each a plane wing that stands out from the hull
axis. FLU axes."""

from __future__ import annotations

from math import atan2, cos, sin, sqrt

from sitl.vehicle import wing
from sitl.vehicle.jit import Wrench, kernel
from sitl.vehicle.model import Fins


@kernel
def wrench(nu: Wrench, rudder_rad: float, elevator_rad: float, fins: Fins) -> Wrench:
    """Lift and drag of all fins for the body moving at ``nu`` through the water, N and N m about
    the origin.

    A fin turns about its span by its share of rudder and elevator, its leading edge towards (0,
    -span_z, span_y). Lift acts across the flow met in the plane of chord and normal; flow along the
    span does nothing. A fin moving backwards is a fin whose chord points the other way."""
    u, v, w, p, q, r = nu
    X = Y = Z = K = M = N = 0.0
    for i in range(fins.span_y.size):
        span_y, span_z = fins.span_y[i], fins.span_z[i]
        x, y, z = fins.x_m, fins.out_m * span_y, fins.out_m * span_z
        turn = fins.rudder[i] * rudder_rad + fins.elevator[i] * elevator_rad
        turn = min(max(turn, -fins.travel_rad), fins.travel_rad)
        c, s = cos(turn), sin(turn)
        along = u + q * z - r * y
        normal = -span_z * (v + r * x - p * z) + span_y * (w + p * y - q * x)
        chordwise = c * along + s * normal
        across = c * normal - s * along
        lift_over_sin, drag = wing.coefficients(atan2(abs(across), abs(chordwise)), fins.polar)
        # C_L V^2 = (C_L / sin alpha) V |across|: the sine's V cancels one of the speed's.
        speed = sqrt(chordwise * chordwise + across * across)
        lift = (
            fins.half_rho_area_kgpm * lift_over_sin * across * (1.0 if chordwise >= 0.0 else -1.0)
        )
        resist = fins.half_rho_area_kgpm * drag * speed
        on_chord = lift * across - resist * chordwise
        on_normal = -lift * chordwise - resist * across
        force_x = c * on_chord - s * on_normal
        force_n = s * on_chord + c * on_normal
        force_y, force_z = -span_z * force_n, span_y * force_n
        X += force_x
        Y += force_y
        Z += force_z
        K += y * force_z - z * force_y
        M += z * force_x - x * force_z
        N += x * force_y - y * force_x
    return X, Y, Z, K, M, N
