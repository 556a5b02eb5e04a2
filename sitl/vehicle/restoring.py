"""Weight and buoyancy, including the loss of buoyancy of sections above the free surface.

Axes are body FLU with the origin on the hull axis at mid-length; heights are positive up.
"""

from __future__ import annotations

from math import asin, pi, sqrt

from mavlink_io.jit import kernel
from sitl.vehicle.model import Hydrostatics, Stations
from sitl.vehicle.vectors import Vector3, Wrench


@kernel
def immersion(z_up_m: float, radius_m: float) -> float:
    """Return the fraction of a circular section that is under water, 0 to 1.

    ``z_up_m`` is the height of its axis above the surface, ``radius_m`` its radius.
    """
    # Area of a circular segment over that of the circle, with y = -z/R:
    #     0.5 + (y sqrt(1 - y^2) + asin y) / pi.
    y = -z_up_m / radius_m
    if y >= 1.0:
        return 1.0
    if y <= -1.0:
        return 0.0
    return 0.5 + (y * sqrt(1.0 - y * y) + asin(y)) / pi


@kernel
def lost_buoyancy(
    z_m: float, climb: float, hydrostatics: Hydrostatics, stations: Stations
) -> tuple[float, float]:
    """Return (buoyancy lost in N, its first moment along x in N m) of sections above the water.

    ``z_m`` is the height of the origin above the surface, m; ``climb`` is the change of that height
    per metre forward along the hull.
    """
    # Station i at x_i has the share s_i of the buoyancy B: force = sum B s_i dry_i,
    # moment = sum B s_i dry_i x_i, with dry_i = 1 - immersion.
    force = moment = 0.0
    highest = z_m + abs(climb) * hydrostatics.half_length_m + hydrostatics.radius_m
    if highest > 0.0:
        for i in range(stations.x_m.size):
            x = hydrostatics.x_cb_m + stations.lever_m[i]
            dry = 1.0 - immersion(z_m + climb * x, stations.radius_m[i])
            lost = hydrostatics.buoyancy_n * stations.buoyancy_share[i] * dry
            force += lost
            moment += lost * x
    return force, moment


@kernel
def wrench(
    z_m: float,
    climb: float,
    up: Vector3,
    density_ratio: float,
    hydrostatics: Hydrostatics,
    stations: Stations,
) -> Wrench:
    """Return weight at the centre of mass plus buoyancy at the centre of volume.

    Parameters
    ----------
    z_m : float
        Height of the origin above the surface, m.
    climb : float
        Change of that height per metre forward along the hull.
    up : tuple of 3 floats
        Opposite direction of effective gravity in the frame of the water, FLU: the inertial z axis
        plus the acceleration of the water in units of g (Froude-Krylov force).
    density_ratio : float
        Density over that of the water in which the vehicle was ballasted.
    hydrostatics : Hydrostatics
        Weight, buoyancy and their centres.
    stations : Stations
        Sections of the hull, for the buoyancy lost above the surface.

    Returns
    -------
    tuple of 6 floats
        Wrench about the origin, FLU, N and N m.

    Notes
    -----
    Fossen 2021, ch. 4.
    """
    # With weight W at r_CM and buoyancy B at r_CB, both along "up" (Fossen 2021, ch. 4):
    #     force  = (B - W) up,
    #     moment = (B r_CB - W r_CM) x up.
    up_x, up_y, up_z = up
    h = hydrostatics
    lost, lost_moment = lost_buoyancy(z_m, climb, h, stations)
    buoyancy = density_ratio * (h.buoyancy_n - lost)
    net = buoyancy - h.weight_n
    # first = B r_CB - W r_CM, N m.
    first_x = density_ratio * (h.buoyancy_n * h.x_cb_m - lost_moment) - h.weight_n * h.x_cm_m
    first_y = -h.weight_n * h.y_cm_m
    first_z = buoyancy * h.z_cb_m - h.weight_n * h.z_cm_m
    return (
        net * up_x,
        net * up_y,
        net * up_z,
        first_y * up_z - first_z * up_y,
        first_z * up_x - first_x * up_z,
        first_x * up_y - first_y * up_x,
    )
