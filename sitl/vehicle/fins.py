"""All-moving fins at the tail, cruciform or X, each modelled as a plane wing. Body FLU axes."""

from __future__ import annotations

from math import atan2, cos, sin, sqrt

from mavlink_io.jit import kernel
from sitl.vehicle import wing
from sitl.vehicle.model import Fins
from sitl.vehicle.vectors import Wrench


@kernel
def wrench(nu: Wrench, rudder_rad: float, elevator_rad: float, fins: Fins) -> Wrench:
    """Return lift and drag of all fins, N and N m about the origin, FLU.

    ``nu`` is the velocity of the body through the water, m/s and rad/s. Rudder and elevator are in
    radians; positive turns the nose to starboard and up.
    """
    # Fin i has its centre at (x_m, out_m span_y, out_m span_z) and turns about its span
    # (0, span_y, span_z) by
    #     turn = rudder_i dR + elevator_i dE, limited to +-travel_rad,
    # leading edge towards the fin normal n = (0, -span_z, span_y). Velocity through the water at
    # the centre: (along, normal) = components on x and n. In the axes of the turned fin:
    #     chordwise = c along + s normal,   across = c normal - s along   (c, s = cos, sin of turn).
    # Lift is perpendicular to the flow in the plane of chord and normal, drag is opposite to it;
    # flow along the span has no effect. For chordwise < 0 the lift changes sign: a fin that moves
    # backwards is a fin with a reversed chord.
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
        # C_L V^2 = (C_L / sin alpha) V |across|, since sin alpha = |across| / V.
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
