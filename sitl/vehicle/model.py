"""Numeric model of a vehicle: the records that the compiled kernels read, with units.

Axes are the paper's: body x forward, y port, z up (FLU), origin on the hull axis at mid-length;
inertial x north, y west, z up (NWU). Only ``build_model.build`` makes a ``VehicleModel``.
"""

from __future__ import annotations

from math import inf
from typing import NamedTuple

from sitl.vehicle.vectors import Vector


class Inertia(NamedTuple):
    """Rigid-body and added mass; the generalised velocity is (u, v, w, p, q, r)."""

    mass_kg: float
    """Mass m of the vehicle."""
    M_RB: Vector
    """Rigid-body mass matrix about the origin, (6, 6), kg, kg m, kg m2."""
    M_A: Vector
    """Added mass matrix, (6, 6): diag(-X_udot, -Y_vdot, -Z_wdot, -K_pdot, -M_qdot, -N_rdot)."""
    M: Vector
    """M_RB + M_A."""
    M_inverse: Vector
    """Inverse of M."""


class Stations(NamedTuple):
    """Sections of the hull at Gauss-Legendre abscissae, nose to tail, and their crossflow drag.

    The arrays are of equal length.
    """

    x_m: Vector
    """Distance of the station forward of mid-length."""
    radius_m: Vector
    """Hull radius at the station."""
    drag_kgpm: Vector
    """1/2 rho C_d 2R dx of each station: crossflow drag in N per (m/s)^2."""
    buoyancy_share: Vector
    """Fraction of the displaced volume at each station; the sum is one."""
    lever_m: Vector
    """Distance of the station forward of the centroid of the hull's volume."""
    uncoupled: float = 0.0
    """Share of the crossflow drag in which drift does not damp rotation; 0 is strip theory."""


class Hull(NamedTuple):
    """Coefficients of hull forces other than added mass; ``hydrodynamics`` has their equations.

    The lift coefficients are what remains of Table 1 after added mass and tail are subtracted
    (``build_model``).
    """

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
    """Side force per u|u| and radian of rudder, beyond that of the isolated duct."""
    N_uudr_kg: float
    Z_uude_kgpm: float
    M_uude_kg: float
    K_p_nms: float
    """Linear roll damping moment is -K_p p."""
    K_pp_nms2: float
    """Quadratic roll damping moment is -K_pp p|p|."""


class Polar(NamedTuple):
    """Lift and drag of a wing as functions of incidence; ``wing`` has the equations."""

    lift_slope_per_rad: float
    """Lift slope a = dC_L/dalpha at zero incidence."""
    lift_quadratic_per_rad2: float
    """Quadratic lift coefficient C_Dc."""
    drag_zero_lift: float
    """Drag coefficient C_do at zero lift."""
    induced_drag: float
    """1 / (pi AR e)."""
    stall_rad: float
    """Incidence above which the flow begins to separate."""
    separated_rad: float
    """Incidence from which the flow is fully separated."""
    separated_normal: float
    """Normal force coefficient of the fully separated wing at 90 degrees of incidence."""


class Duct(NamedTuple):
    """Ring wing on the hull axis, deflected by rudder and elevator, with the propeller inside."""

    x_m: float
    """Distance forward of mid-length at which ring and thrust act; negative."""
    radius_m: float
    """Radius of the ring."""
    half_rho_area_kgpm: float
    """1/2 rho A_eff, A_eff = diameter times chord; zero for a propeller without a duct."""
    vectored: float
    """1 where ring and thrust turn with the commands, 0 where they are fixed to the hull."""
    polar: Polar
    """Lift and drag of the ring on the area A_eff."""


class Fins(NamedTuple):
    """Equal fins around the hull axis at one station; arrays have one entry per fin, or none."""

    x_m: float
    """Distance of the fins forward of mid-length; negative."""
    out_m: float
    """Distance of a fin's centre of pressure from the hull axis."""
    half_rho_area_kgpm: float
    """1/2 rho A of one fin."""
    polar: Polar
    """Lift and drag of one fin on its planform area."""
    span_y: Vector
    """y component of the unit vector (0, span_y, span_z) along the span of each fin."""
    span_z: Vector
    """z component of the unit vector (0, span_y, span_z) along the span of each fin."""
    rudder: Vector
    """Fin angle, leading edge towards (0, -span_z, span_y), per radian of rudder."""
    elevator: Vector
    """Fin angle, leading edge towards (0, -span_z, span_y), per radian of elevator."""
    travel_rad: float = inf
    """Limit on the fin angle, the sum of rudder and elevator parts."""


class Propeller(NamedTuple):
    """Thrust T = K_T rho n|n| D^4 with K_T linear in the advance ratio, by powers of n."""

    thrust_nn_kgm: float
    """rho D^4 K_T0: thrust per n|n|, N per (rev/s)^2."""
    thrust_nv_kg: float
    """rho D^3 (-dK_T/dJ) (1 - wake fraction): thrust lost per |n| and m/s of axial speed."""
    full_rps: float
    """Shaft speed at 100 % thrust."""


class Hydrostatics(NamedTuple):
    """Weight and buoyancy; positions in FLU from the origin.

    ``cm`` is the centre of mass, ``cb`` the centre of buoyancy of the fully submerged hull, which
    lies in the plane y = 0.
    """

    weight_n: float
    buoyancy_n: float
    """Buoyancy of the fully submerged vehicle."""
    x_cm_m: float
    y_cm_m: float
    z_cm_m: float
    x_cb_m: float
    z_cb_m: float
    gravity_mps2: float
    half_length_m: float
    """Half the length of the hull."""
    radius_m: float
    """Largest radius of the hull."""


class Walls(NamedTuple):
    """Suction of walls on the hull, over nearness: hull radius over distance from axis to wall."""

    far_m: float
    """Distance from which on the suction is zero."""
    far_nearness: float
    """Nearness at ``far_m``: the first point of the table."""
    steps_per_nearness: float
    """Number of table intervals per unit of nearness."""
    pull_kgpm: Vector
    """Force towards the wall per u^2, at equal steps of nearness up to 1."""
    moment_kg: Vector
    """Moment of that force about the origin per u^2; positive for a force forward of mid-length."""


class VehicleModel(NamedTuple):
    """Complete model of a vehicle, for ``dynamics.derivative`` and ``dynamics.rk4_step``."""

    inertia: Inertia
    stations: Stations
    hull: Hull
    duct: Duct
    fins: Fins
    propeller: Propeller
    hydrostatics: Hydrostatics
    walls: Walls
