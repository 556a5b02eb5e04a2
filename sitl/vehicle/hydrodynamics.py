"""Hydrodynamic forces on the hull: axial drag, crossflow drag, lift and roll damping.

Symbols, in body FLU axes (x forward, y port, z up) with the origin on the hull axis at mid-length:
u, v, w velocity through the water (m/s); p, q, r angular velocity relative to the water (rad/s);
wrench (X, Y, Z, K, M, N) about the origin (N, N m).
"""

from __future__ import annotations

from math import sqrt

from mavlink_io.jit import kernel
from sitl.vehicle.model import Hull, Stations
from sitl.vehicle.vectors import Wrench


@kernel
def crossflow_drag(v: float, w: float, q: float, r: float, stations: Stations) -> Wrench:
    """Return the crossflow drag of the hull, by strip theory if none of it is uncoupled.

    Parameters
    ----------
    v, w : float
        Sway and heave velocity through the water, FLU, m/s.
    q, r : float
        Pitch and yaw rate relative to the water, FLU, rad/s.
    stations : Stations
        Sections of the hull.

    Returns
    -------
    tuple of 6 floats
        Wrench about the origin, FLU, N and N m.

    Notes
    -----
    Strip theory (Hoerner 1965, ch. 3). Sway and heave combine into one crossflow speed, so the
    force does not depend on the roll angle. With the share e of uncoupled drag (`_uncoupled_drag`)
    the wrench is (1 - e) strip + e uncoupled.
    """
    # Local crossflow at station x:  v_x = v + x r,  w_x = w - x q.
    # Section force, with drag_kgpm = 1/2 rho C_d 2R dx:
    #     (Y, Z) = -drag_kgpm sqrt(v_x^2 + w_x^2) (v_x, w_x),   M = -x Z,   N = x Y.
    Y = Z = M = N = 0.0
    for i in range(stations.x_m.size):
        x = stations.x_m[i]
        v_x = v + x * r
        w_x = w - x * q
        drag = stations.drag_kgpm[i] * sqrt(v_x * v_x + w_x * w_x)
        Y -= drag * v_x
        Z -= drag * w_x
        M += x * (drag * w_x)
        N -= x * (drag * v_x)
    if stations.uncoupled == 0.0:
        return 0.0, Y, Z, 0.0, M, N
    e, other = stations.uncoupled, _uncoupled_drag(v, w, q, r, stations)
    Y, Z = (1.0 - e) * Y + e * other[1], (1.0 - e) * Z + e * other[2]
    M, N = (1.0 - e) * M + e * other[4], (1.0 - e) * N + e * other[5]
    return 0.0, Y, Z, 0.0, M, N


@kernel
def _uncoupled_drag(v: float, w: float, q: float, r: float, stations: Stations) -> Wrench:
    """Return the crossflow drag of drift plus that of rotation, each by itself.

    Models with quadratic coefficients have this form (Prestero 2001): drift does not damp rotation.
    """
    # Section force of drift:     (Y, Z) = -drag_kgpm sqrt(v^2 + w^2) (v, w),
    # and of rotation:            (Y, Z) = -drag_kgpm |x| sqrt(q^2 + r^2) (x r, -x q).
    drift, rotation = sqrt(v * v + w * w), sqrt(q * q + r * r)
    Y = Z = M = N = 0.0
    for i in range(stations.x_m.size):
        x, drag = stations.x_m[i], stations.drag_kgpm[i]
        Y_x = -drag * (drift * v + abs(x) * rotation * x * r)
        Z_x = -drag * (drift * w - abs(x) * rotation * x * q)
        Y += Y_x
        Z += Z_x
        M -= x * Z_x
        N += x * Y_x
    return 0.0, Y, Z, 0.0, M, N


@kernel
def lift_and_drag(u: float, v: float, w: float, p: float, q: float, r: float, hull: Hull) -> Wrench:
    """Return axial drag, hull lift and roll damping.

    Parameters
    ----------
    u, v, w : float
        Velocity through the water, FLU, m/s.
    p, q, r : float
        Angular velocity relative to the water, FLU, rad/s.
    hull : Hull
        Coefficients.

    Returns
    -------
    tuple of 6 floats
        Wrench about the origin, FLU, N and N m.

    Notes
    -----
    The coefficients are what remains of the paper's Table 1 after added mass and tail
    (``build_model``).
    """
    # X = -X_uu u |u|                       K = -K_p p - K_pp p |p|
    # Y =  Y_uv |u| v + Y_ur u r            N =  N_uv u v + N_ur |u| r
    # Z =  Z_uw |u| w + Z_uq u q            M =  M_uw u w + M_uq |u| q
    # Signs for u < 0: a hull that is symmetric fore and aft has the same dynamics astern. When u
    # changes sign, side force keeps its sign for v and changes it for r; the moment does the
    # reverse. Hence |u| v, u r, u v and |u| r.
    speed = abs(u)
    return (
        -hull.X_uu_kgpm * u * speed,
        hull.Y_uv_kgpm * speed * v + hull.Y_ur_kg * u * r,
        hull.Z_uw_kgpm * speed * w + hull.Z_uq_kg * u * q,
        -hull.K_p_nms * p - hull.K_pp_nms2 * p * abs(p),
        hull.M_uw_kg * u * w + hull.M_uq_kgm * speed * q,
        hull.N_uv_kg * u * v + hull.N_ur_kgm * speed * r,
    )


@kernel
def duct_interaction(pressure: float, rudder_rad: float, elevator_rad: float, hull: Hull) -> Wrench:
    """Return the wrench of a deflected duct beyond that of the isolated ring wing.

    Parameters
    ----------
    pressure : float
        u |u| times the immersed fraction of the duct, m2/s2.
    rudder_rad, elevator_rad : float
        Surface angles, rad; positive turns the nose to starboard and up.
    hull : Hull
        Coefficients.

    Returns
    -------
    tuple of 6 floats
        Wrench about the origin, FLU, N and N m.

    Notes
    -----
    The coefficients are what remains of Table 1's Y_dr, N_dr, Z_de and M_de after the isolated duct
    (``build_model``).
    """
    # Y = Y_uudr u|u| dR,  Z = Z_uude u|u| dE,  M = M_uude u|u| dE,  N = N_uudr u|u| dR.
    return (
        0.0,
        hull.Y_uudr_kgpm * pressure * rudder_rad,
        hull.Z_uude_kgpm * pressure * elevator_rad,
        0.0,
        hull.M_uude_kg * pressure * elevator_rad,
        hull.N_uudr_kg * pressure * rudder_rad,
    )
