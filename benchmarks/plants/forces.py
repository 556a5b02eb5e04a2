"""Equations of motion of the plants, each with hydrodynamics of its own.

Symbols (FRD, body axes, origin at the centre of buoyancy): u, v, w velocity through the water
(m/s), p, q, r rates (rad/s), phi, theta, psi Euler angles (rad), z depth (m), x position along the
hull (m, forward), delta_r and delta_e surface angles (rad, positive turns the nose to starboard and
up). State: (u, v, w, p, q, r, phi, theta, psi, z).

    m_i velocity' = force - omega x (m_i velocity)            Kirchhoff's equations with the
    J_i omega' = moment - omega x (J_i omega) - velocity x (m_i velocity)   added masses in m_i, J_i

(Lamb 1932, sec. 124). Every force below is written for these plants. The linear hull coefficients
are what remains between the specified small-signal behaviour and the other forces at the design
speed (``small_signal.calibrate``).
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]

RACE, STALL, LUMPED, VORTEX = range(4)
"""Kinds of hydrodynamics."""
STATES = 10
"""Number of states of the body."""
RHO = 1025.0
"""Density of sea water, kg/m3."""
GRAVITY = 9.81
STRIPS = 21
"""Number of strips of the crossflow of plant "race"."""
RACE_DIAMETER_M = 0.36
"""Propeller diameter of plant "race"."""


class Body(NamedTuple):
    """Numbers of one plant; SI units."""

    kind: int
    length_m: float
    mass_kg: float
    m_kg: tuple[float, float, float]
    """Body and added mass along x, y, z."""
    j_kgm2: tuple[float, float, float]
    """Body and added inertia about x, y, z."""
    net_buoyancy_n: float
    z_g_m: float
    """Centre of mass below the centre of buoyancy."""
    x_tail_m: float
    tail_kgpm: float
    """Tail force per angle and squared speed: N s2/(m2 rad)."""
    stall_rad: float
    """Angle at which the tail force has clearly left the straight line."""
    crossflow_kgpm: float
    """Total crossflow force per squared cross velocity: N s2/m2."""
    surge_drag_kgpm: float
    """Drag of the straight run over squared speed."""
    turn_drag: float
    """Size of the drag that drift and deflection add; 1 is typical."""
    thrust_n: float
    """Thrust at the design speed."""
    design_speed_mps: float
    hull_yaw: tuple[float, float, float, float]
    """Linear hull coefficients over u: Y_v, Y_r, N_v, N_r."""
    hull_pitch: tuple[float, float, float, float]
    """Linear hull coefficients over u: Z_w, Z_q, M_w, M_q."""


@njit(cache=True)
def slopes(x: Array, rudder: float, elevator: float, thrust: float, body: Body, out: Array) -> None:
    """Write the derivative of the state into ``out``; ``thrust`` is relative to the design's."""
    u, v, w, p, q, r, phi, theta = x[0], x[1], x[2], x[3], x[4], x[5], x[6], x[7]
    X, Y, Z, K, M, N = _hydrodynamic(u, v, w, p, q, r, rudder, elevator, thrust, body)
    yv, yr, nv, nr = body.hull_yaw
    zw, zq, mw, mq = body.hull_pitch
    Y += u * (yv * v + yr * r)
    N += u * (nv * v + nr * r)
    Z += u * (zw * w + zq * q)
    M += u * (mw * w + mq * q)
    # Net buoyancy acts upwards at the origin, weight at z_g below it.
    weight = body.mass_kg * GRAVITY
    lift = body.net_buoyancy_n
    sp, cp, st, ct = math.sin(phi), math.cos(phi), math.sin(theta), math.cos(theta)
    X += lift * st
    Y -= lift * ct * sp
    Z -= lift * ct * cp
    K -= weight * body.z_g_m * ct * sp
    M -= weight * body.z_g_m * st
    m1, m2, m3 = body.m_kg
    j1, j2, j3 = body.j_kgm2
    out[0] = (X - (q * m3 * w - r * m2 * v)) / m1
    out[1] = (Y - (r * m1 * u - p * m3 * w)) / m2
    out[2] = (Z - (p * m2 * v - q * m1 * u)) / m3
    out[3] = (K - (q * j3 * r - r * j2 * q) - (v * m3 * w - w * m2 * v)) / j1
    out[4] = (M - (r * j1 * p - p * j3 * r) - (w * m1 * u - u * m3 * w)) / j2
    out[5] = (N - (p * j2 * q - q * j1 * p) - (u * m2 * v - v * m1 * u)) / j3
    out[6] = p + (q * sp + r * cp) * st / ct
    out[7] = q * cp - r * sp
    out[8] = (q * sp + r * cp) / ct
    out[9] = -u * st + v * sp * ct + w * cp * ct


@njit(cache=True)
def _hydrodynamic(
    u: float,
    v: float,
    w: float,
    p: float,
    q: float,
    r: float,
    rudder: float,
    elevator: float,
    thrust: float,
    body: Body,
) -> tuple[float, float, float, float, float, float]:
    """Return the hydrodynamic wrench without the linear hull coefficients, N and N m."""
    speed = max(u, 0.05)
    if body.kind == RACE:
        X, Y, Z, M, N = _race(speed, v, w, q, r, rudder, elevator, thrust, body)
    elif body.kind == STALL:
        X, Y, Z, M, N = _stall(speed, v, w, q, r, rudder, elevator, thrust, body)
    elif body.kind == LUMPED:
        X, Y, Z, M, N = _lumped(speed, v, w, q, r, rudder, elevator, thrust, body)
    else:
        X, Y, Z, M, N = _vortex(speed, v, w, q, r, rudder, elevator, thrust, body)
    K = -0.9 * body.j_kgm2[0] * p - 0.5 * body.j_kgm2[0] * p * abs(p)
    return X, Y, Z, K, M, N


@njit(cache=True)
def _race(u, v, w, q, r, rudder, elevator, thrust, body):  # type: ignore[no-untyped-def]
    """Return X, Y, Z, M, N of a vehicle with rudder and elevator in the propeller race.

    Manoeuvring Modeling Group's form (Yasukawa and Yoshimura 2015): wake fraction that decreases
    with drift, thrust deduction, race velocity by momentum theory, flow straightening at the tail.
    """
    drift2 = (v * v + w * w) / (u * u)
    inflow = u * (1.0 - 0.25 * math.exp(-4.0 * drift2))
    shaft = math.sqrt(max(thrust, 0.0))  # shaft speed over that of the design point
    ahead = inflow / (0.75 * body.design_speed_mps)
    T = body.thrust_n / 0.88 * (2.1 * shaft * shaft - 0.7 * shaft * ahead - 0.4 * ahead * ahead)
    race2 = inflow * inflow + 0.8 * 2.0 * max(T, 0.0) / (RHO * 0.25 * math.pi * RACE_DIAMETER_M**2)
    v_tail, w_tail = v + body.x_tail_m * r, w - body.x_tail_m * q
    top = body.stall_rad
    side = top * math.tanh((rudder + 0.55 * v_tail / inflow) / top)
    down = top * math.tanh((elevator - 0.55 * w_tail / inflow) / top)
    Y, Z = -body.tail_kgpm * race2 * side, body.tail_kgpm * race2 * down
    X = 0.88 * T - body.surge_drag_kgpm * u * abs(u)
    X -= body.turn_drag * (0.5 * body.tail_kgpm * race2 * (side * side + down * down))
    X -= body.turn_drag * 0.25 * body.crossflow_kgpm * (v * v + w * w)
    N, M = body.x_tail_m * Y, -body.x_tail_m * Z
    step = body.length_m / STRIPS
    for k in range(STRIPS):
        x = -0.5 * body.length_m + (k + 0.5) * step
        heavy = 1.0 - 1.2 * x / body.length_m  # 0.4 at the bow, 1.6 at the stern
        vx, wx = v + x * r, w - x * q
        drag = heavy * body.crossflow_kgpm / STRIPS * math.sqrt(vx * vx + wx * wx)
        Y -= drag * vx
        Z -= drag * wx
        N -= drag * vx * x
        M += drag * wx * x
    return X, Y, Z, M, N


@njit(cache=True)
def _fin(angle, stall):  # type: ignore[no-untyped-def]
    """Return the lift of a fin over its slope: straight, then a flat plate behind the stall."""
    beyond = 1.0 / (1.0 + math.exp(-(abs(angle) - stall) / (0.12 * stall)))
    return (1.0 - beyond) * angle + beyond * 0.5 * stall * math.sin(2.0 * angle) / math.sin(
        2.0 * stall
    )


@njit(cache=True)
def _stall(u, v, w, q, r, rudder, elevator, thrust, body):  # type: ignore[no-untyped-def]
    """Return X, Y, Z, M, N of a vehicle with four fins in an X, each of which can stall.

    Crossflow acts at three points; the drag of a fin is that of its normal force.
    """
    x_tail = body.x_tail_m
    v_tail, w_tail = (v + x_tail * r) / u, (w - x_tail * q) / u
    root = math.sqrt(0.5)
    one = _fin((elevator - rudder) * root - (v_tail + w_tail) * root, body.stall_rad)
    other = _fin(-(elevator + rudder) * root - (v_tail - w_tail) * root, body.stall_rad)
    pressure = body.tail_kgpm * u * u
    Y, Z = pressure * root * (one + other), pressure * root * (one - other)
    N, M = x_tail * Y, -x_tail * Z
    slowing = thrust * (1.6 - 0.6 * u / body.design_speed_mps)
    X = body.thrust_n * slowing - body.surge_drag_kgpm * u * u
    X -= body.turn_drag * 0.7 * pressure * (one * one + other * other)
    across2 = v * v + w * w
    hull_drag = 0.15 * body.crossflow_kgpm * u * (abs(v) + abs(w))
    X -= body.turn_drag * hull_drag * across2 / (across2 + 0.01 * u * u)
    for share, place in ((0.2, 0.38), (0.45, 0.0), (0.35, -0.36)):
        x = place * body.length_m
        vx, wx = v + x * r, w - x * q
        drag = share * body.crossflow_kgpm * math.sqrt(vx * vx + wx * wx)
        Y -= drag * vx
        Z -= drag * wx
        N -= drag * vx * x
        M += drag * wx * x
    return X, Y, Z, M, N


@njit(cache=True)
def _lumped(u, v, w, q, r, rudder, elevator, thrust, body):  # type: ignore[no-untyped-def]
    """Return X, Y, Z, M, N with quadratic coefficients, after Prestero (2001).

    The planes are independent; the thrust does not depend on the speed.
    """
    c, length = body.crossflow_kgpm, body.length_m
    v_tail, w_tail = v + body.x_tail_m * r, w - body.x_tail_m * q
    side = rudder + v_tail / u
    down = elevator - w_tail / u
    loss = 0.5 / body.stall_rad**2 / 3.0
    Y = -body.tail_kgpm * u * u * side * max(1.0 - loss * side * side, 0.3)
    Z = body.tail_kgpm * u * u * down * max(1.0 - loss * down * down, 0.3)
    N, M = body.x_tail_m * Y, -body.x_tail_m * Z
    Y += -c * v * abs(v) + 0.004 * c * length**2 * r * abs(r)
    Z += -c * w * abs(w) - 0.004 * c * length**2 * q * abs(q)
    N += 0.012 * c * length * v * abs(v) - 0.05 * c * length**3 * r * abs(r)
    M += -0.012 * c * length * w * abs(w) - 0.05 * c * length**3 * q * abs(q)
    X = body.thrust_n * thrust - body.surge_drag_kgpm * u * u
    X -= body.turn_drag * 0.9 * body.tail_kgpm * u * u * (rudder * rudder + elevator * elevator)
    X -= body.turn_drag * 0.2 * c * (v * v + w * w + 0.05 * length**2 * (q * q + r * r))
    return X, Y, Z, M, N


@njit(cache=True)
def _vortex(u, v, w, q, r, rudder, elevator, thrust, body):  # type: ignore[no-untyped-def]
    """Return X, Y, Z, M, N with vortex lift off the after body and a motor of constant power.

    Vortices leave the hull behind its middle: their force grows with the squared angle of drift at
    15 % of the length behind it. Damping of rotation is quadratic in the rate alone.
    """
    c, length = body.crossflow_kgpm, body.length_m
    across = math.sqrt(v * v + w * w)
    v_tail, w_tail = v + body.x_tail_m * r, w - body.x_tail_m * q
    side, down = rudder + 0.85 * v_tail / u, elevator - 0.85 * w_tail / u
    top = body.stall_rad
    side = side / math.sqrt(1.0 + (side / top) ** 2)
    down = down / math.sqrt(1.0 + (down / top) ** 2)
    tail_y, tail_z = -body.tail_kgpm * u * u * side, body.tail_kgpm * u * u * down
    hull_y, hull_z = -c * across * v, -c * across * w
    place = -0.15 * length
    Y, Z = tail_y + hull_y, tail_z + hull_z
    N = body.x_tail_m * tail_y + place * hull_y - 0.03 * c * length**3 * r * abs(r)
    M = -body.x_tail_m * tail_z - place * hull_z - 0.03 * c * length**3 * q * abs(q)
    U = body.design_speed_mps
    X = body.thrust_n * thrust * 1.5 * U / (u + 0.5 * U) - body.surge_drag_kgpm * u * u
    X -= body.turn_drag * 0.6 * body.tail_kgpm * u * u * (side * side + down * down)
    X -= body.turn_drag * 0.35 * c * across * across
    return X, Y, Z, M, N
