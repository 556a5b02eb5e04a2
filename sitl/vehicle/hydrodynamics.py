"""Forces of the water on the hull: drag along it, drag across it, and lift. FLU axes, speeds
through the water."""

from __future__ import annotations

from math import sqrt

from sitl.vehicle.jit import Wrench, kernel
from sitl.vehicle.model import Hull, Stations


@kernel
def crossflow_drag(v: float, w: float, q: float, r: float, stations: Stations) -> Wrench:
    """Drag of each section in the cross flow it meets (strip theory; Hoerner 1965, ch. 3), N and N
    m.

    The magnitude combines sway and heave, so the force turns with the vehicle: it knows no
    preferred roll angle."""
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
    return 0.0, Y, Z, 0.0, M, N


@kernel
def lift_and_drag(u: float, v: float, w: float, p: float, q: float, r: float, hull: Hull) -> Wrench:
    """Axial drag, hull lift and roll damping, N and N m.

    A hull alike fore and aft must answer alike when it backs: with the sign of u, side force keeps
    its sign for v and changes it for r, the moment the reverse. Hence |u| v, u r, u v and |u| r.
    """
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
    """What a turned duct does beyond the isolated ring wing: its effect on the flow round the tail,
    N and N m.

    ``pressure`` is u|u| in m2/s2, less where the duct is out of the water.
    """
    return (
        0.0,
        hull.Y_uudr_kgpm * pressure * rudder_rad,
        hull.Z_uude_kgpm * pressure * elevator_rad,
        0.0,
        hull.M_uude_kg * pressure * elevator_rad,
        hull.N_uudr_kg * pressure * rudder_rad,
    )
