"""Weight and buoyancy, with the free surface: what stands out of the water displaces none."""

from __future__ import annotations

from math import asin, pi, sqrt

from sitl.vehicle.jit import Vector3, Wrench, kernel
from sitl.vehicle.model import Hydrostatics, Stations


@kernel
def immersion(z_up_m: float, radius_m: float) -> float:
    """Fraction of a section under water, its axis ``z_up_m`` above the surface: a circular
    segment's area."""
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
    """(buoyancy lost in N, its first moment along x in N m) of the stations that stand out of the
    water.

    ``z_m`` is the origin's height above the surface, ``climb`` what a metre forward adds to it.
    """
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
    """Weight at the centre of mass and buoyancy at the centre of volume, N and N m.

    Both act along ``up``, opposite to gravity as felt in the water's own frame: the inertial z axis
    in body axes, plus the water's acceleration in units of g (Froude-Krylov force). ``z_m`` and
    ``climb`` as for ``lost_buoyancy``."""
    up_x, up_y, up_z = up
    h = hydrostatics
    lost, lost_moment = lost_buoyancy(z_m, climb, h, stations)
    buoyancy = density_ratio * (h.buoyancy_n - lost)
    net = buoyancy - h.weight_n
    # First moments of the vertical forces; crossed with "up" they give the moment about the origin.
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
