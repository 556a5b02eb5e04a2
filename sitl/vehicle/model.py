"""The numbers the kernels run on, each symbol declared once with its unit.

Axes are the paper's: body x forward, y port, z up (FLU), origin on the hull axis at mid-length;
inertial x north, y west, z up (NWU). ``calibrate.build`` makes a ``VehicleModel`` from a vehicle
file; nothing else should."""

from __future__ import annotations

from math import inf
from typing import NamedTuple

from sitl.vehicle.jit import Vector


class Inertia(NamedTuple):
    """Rigid body plus added mass; generalised velocity is (u, v, w, p, q, r)."""

    mass_kg: float
    M_RB: Vector
    """Rigid-body mass matrix about the origin, (6, 6), kg, kg m, kg m2."""
    M_A: Vector
    """Added mass matrix, (6, 6); diagonal (-X_udot, -Y_vdot, -Z_wdot, -K_pdot, -M_qdot,
    -N_rdot)."""
    M: Vector
    """M_RB + M_A."""
    M_inverse: Vector


class Stations(NamedTuple):
    """Sections of the hull at Gauss-Legendre abscissae, nose to tail; arrays of equal length."""

    x_m: Vector
    radius_m: Vector
    drag_kgpm: Vector
    """1/2 rho C_d 2R dx of each station: crossflow drag in N per (m/s)^2."""
    buoyancy_share: Vector
    """Part of the displaced volume at each station; sums to one."""
    lever_m: Vector
    """Forward distance of the station from the section centroid of the whole hull."""


class Hull(NamedTuple):
    """Hull forces beside added mass; lift is what remains of Table 1 when added mass and duct are
    accounted for."""

    X_uu_kgpm: float
    """Axial drag is -X_uu u|u|."""
    Y_uv_kgpm: float
    Y_ur_kg: float
    N_uv_kg: float
    N_ur_kgm: float
    Z_uw_kgpm: float
    Z_uq_kg: float
    M_uw_kg: float
    M_uq_kgm: float
    Y_uudr_kgpm: float
    """Duct and hull interaction: side force per u|u| and radian of rudder, beyond the isolated
    duct's."""
    N_uudr_kg: float
    Z_uude_kgpm: float
    M_uude_kg: float
    K_p_nms: float
    """Linear roll damping moment is -K_p p."""
    K_pp_nms2: float
    """Quadratic roll damping moment is -K_pp p|p|."""


class Polar(NamedTuple):
    """Lift and drag of a wing over incidence."""

    lift_slope_per_rad: float
    lift_quadratic_per_rad2: float
    drag_zero_lift: float
    induced_drag: float
    """1 / (pi AR e)."""
    stall_rad: float
    separated_rad: float
    separated_normal: float
    """Normal force coefficient of the fully separated wing at 90 degrees of incidence."""


class Duct(NamedTuple):
    """Ring wing on the hull axis, turned by rudder and elevator; the propeller sits in it."""

    x_m: float
    radius_m: float
    half_rho_area_kgpm: float
    """1/2 rho A_eff, A_eff = diameter times chord; zero where the propeller is bare."""
    vectored: float
    """1 where ring and thrust turn with the commands, 0 where they are fixed to the hull."""
    polar: Polar


class Fins(NamedTuple):
    """Equal fins round the hull axis at one station; arrays of one entry a fin, empty where there
    are none."""

    x_m: float
    out_m: float
    """Distance of a fin's centre of pressure from the axis."""
    half_rho_area_kgpm: float
    polar: Polar
    span_y: Vector
    span_z: Vector
    """Direction of each fin's span, (0, span_y, span_z), a unit vector."""
    rudder: Vector
    elevator: Vector
    """Turn of each fin, leading edge towards (0, -span_z, span_y), per radian of rudder and of
    elevator."""
    travel_rad: float = inf
    """Where the sum of the two ends."""


class Propeller(NamedTuple):
    """T = K_T rho n|n| D^4 with K_T linear in the advance ratio, collected in powers of n."""

    thrust_nn_kgm: float
    """rho D^4 K_T0: thrust per n|n|, N per (rev/s)^2."""
    thrust_nv_kg: float
    """rho D^3 (-dK_T/dJ) (1 - wake fraction): thrust lost per |n| and m/s of axial speed."""
    full_rps: float
    """Shaft speed at 100 % thrust."""


class Hydrostatics(NamedTuple):
    """Weight and buoyancy; positions in FLU from the origin."""

    weight_n: float
    buoyancy_n: float
    x_cm_m: float
    y_cm_m: float
    z_cm_m: float
    x_cb_m: float
    z_cb_m: float
    gravity_mps2: float
    half_length_m: float
    radius_m: float


class Walls(NamedTuple):
    """How walls draw the hull, over nearness: hull radius over the distance from axis to wall."""

    far_m: float
    """From this distance on there is no pull."""
    far_nearness: float
    steps_per_nearness: float
    pull_kgpm: Vector
    """Force towards the wall per u^2, at equal steps of nearness up to 1."""
    moment_kg: Vector
    """Moment of that force, forward positive, per u^2."""


class VehicleModel(NamedTuple):
    """A whole vehicle, ready to be stepped."""

    inertia: Inertia
    stations: Stations
    hull: Hull
    duct: Duct
    fins: Fins
    propeller: Propeller
    hydrostatics: Hydrostatics
    walls: Walls
