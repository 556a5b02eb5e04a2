"""From a vehicle file to a model: geometry and physics first, then hull lift as what remains of the linear column.

Added mass and its Coriolis terms, the isolated duct and the thrust are taken in full. What they give at the operating
point is subtracted from the column of coefficients asked for; the remainder, divided by speed, is the hull's lift. The
linearised model then equals the column, and every other speed follows from physics.
"""

from __future__ import annotations

from math import atanh, pi, radians, sqrt

import numpy as np

from sitl.vehicle import hull as geometry
from sitl.vehicle.config import VehicleConfig, VehicleError
from sitl.vehicle.model import Duct, Fins, Hull, Hydrostatics, Inertia, Model, Polar, Propeller, Stations

STATION_NODES = (6, 4, 6)
"""Stations on nose, mid-body and tail."""


def build(config: VehicleConfig) -> Model:
    """Make the model of ``config``. Raises ``VehicleError`` when its mass matrix or its thrust is impossible."""
    inertia = _inertia(config)
    duct = _duct(config)
    return Model(
        inertia=inertia,
        stations=_stations(config),
        hull=_hull(config, inertia, duct),
        duct=duct,
        fins=_no_fins(duct),
        propeller=_propeller(config),
        hydrostatics=_hydrostatics(config),
    )


def axial_added_mass_kg(config: VehicleConfig) -> float:
    """-X_udot of the spheroid on the hull's length and diameter (Lamb 1932, sec. 114; the paper, after Blevins), kg."""
    a, b = geometry.length_m(config.hull) / 2, config.hull.diameter_m / 2
    e = sqrt(1 - (b / a) ** 2)
    alpha_0 = 2 * (1 - e**2) / e**3 * (atanh(e) - e)
    return alpha_0 / (2 - alpha_0) * config.water.density_kgpm3 * 4 / 3 * pi * a * b**2


def _inertia(config: VehicleConfig) -> Inertia:
    """Mass matrices; roll inertia is the homogeneous hull's, roll added mass none (a body of revolution)."""
    m, linear, ballast = config.ballast.mass_kg, config.linear, config.ballast
    x, y, z = ballast.x_cm_m, ballast.y_cm_m, linear.z_CM_m
    shape = geometry.integrals(config.hull)
    I_xx = m * shape.roll_inertia_m5 / shape.volume_m3
    M_RB = np.diag([m, m, m, I_xx, linear.I_yy_kgm2, linear.I_zz_kgm2])
    offset = m * np.array([[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]])
    M_RB[:3, 3:] = offset
    M_RB[3:, :3] = offset.T
    X_udot = -axial_added_mass_kg(config)
    M_A = -np.diag([X_udot, linear.Y_vdot_kg, linear.Z_wdot_kg, 0.0, linear.M_qdot_kgm2, linear.N_rdot_kgm2])
    smallest = float(np.linalg.eigvalsh(M_RB).min())
    if smallest <= 0:
        raise VehicleError(
            f"{config.name}: ballast and linear: the rigid-body mass matrix has an eigenvalue {smallest:.3g}, "
            f"expected all positive; bring the centre of mass ({x}, {y}, {z}) m nearer to the axis"
        )
    M = M_RB + M_A
    return Inertia(mass_kg=m, M_RB=M_RB, M_A=M_A, M=M, M_inverse=np.linalg.inv(M))


def _stations(config: VehicleConfig) -> Stations:
    x, dx = geometry.quadrature(config.hull, STATION_NODES)
    radius = geometry.radius_m(config.hull, x)
    share = radius**2 * dx / float(radius**2 @ dx)
    return Stations(
        x_m=x,
        radius_m=radius,
        drag_kgpm=config.water.density_kgpm3 / 2 * config.damping.crossflow_cd * 2 * radius * dx,
        buoyancy_share=share,
        lever_m=x - float(share @ x),
    )


def _duct(config: VehicleConfig) -> Duct:
    duct = config.duct
    return Duct(
        x_m=duct.x_m,
        radius_m=duct.diameter_m / 2,
        half_rho_area_kgpm=config.water.density_kgpm3 / 2 * duct.area_m2,
        vectored=1.0,
        polar=Polar(
            lift_slope_per_rad=duct.lift_slope_per_rad,
            lift_quadratic_per_rad2=duct.lift_quadratic_per_rad2,
            drag_zero_lift=duct.drag_zero_lift,
            induced_drag=1 / (pi * duct.aspect_ratio * duct.oswald),
            stall_rad=radians(duct.stall_deg),
            separated_rad=radians(duct.separated_deg),
            separated_normal=duct.separated_normal,
        ),
    )


def _no_fins(duct: Duct) -> Fins:
    none = np.empty(0)
    return Fins(duct.x_m, 0.0, 0.0, duct.polar, none, none, none, none)


def _propeller(config: VehicleConfig) -> Propeller:
    """The shaft speed at the operating point is the positive root of thrust_nn n^2 - thrust_nv V n = T."""
    rho, D, point = config.water.density_kgpm3, config.propeller.diameter_m, config.operating_point
    thrust_nn = rho * D**4 * config.propeller.kt_bollard
    thrust_nv = rho * D**3 * config.propeller.kt_slope * (1 - config.propeller.wake_fraction)
    lost = thrust_nv * point.speed_mps
    shaft_rps = (lost + sqrt(lost**2 + 4 * thrust_nn * point.thrust_n)) / (2 * thrust_nn)
    return Propeller(thrust_nn_kgm=thrust_nn, thrust_nv_kg=thrust_nv, full_rps=shaft_rps / point.thrust_fraction)


def _hydrostatics(config: VehicleConfig) -> Hydrostatics:
    ballast = config.ballast
    weight = ballast.mass_kg * config.water.gravity_mps2
    return Hydrostatics(
        weight_n=weight,
        buoyancy_n=weight + ballast.net_buoyancy_n,
        x_cm_m=ballast.x_cm_m,
        y_cm_m=ballast.y_cm_m,
        z_cm_m=config.linear.z_CM_m,
        x_cb_m=ballast.x_cb_m,
        z_cb_m=ballast.z_cb_m,
        gravity_mps2=config.water.gravity_mps2,
        half_length_m=geometry.length_m(config.hull) / 2,
        radius_m=config.hull.diameter_m / 2,
    )


def _hull(config: VehicleConfig, inertia: Inertia, duct: Duct) -> Hull:
    """Lift coefficients: (column - added mass - duct - thrust) / U, or / U^2 for the angles of the duct.

    In straight flight the duct's side force is -k U v_duct with k its lift slope and drag, v_duct = v + x r; added mass
    gives Y_r = X_udot U and the Munk moment N_v = (Y_vdot - X_udot) U, and their twins in pitch.
    """
    linear, U, T = config.linear, config.operating_point.speed_mps, config.operating_point.thrust_n
    x = duct.x_m
    lift = duct.half_rho_area_kgpm * duct.polar.lift_slope_per_rad
    k = lift + duct.half_rho_area_kgpm * duct.polar.drag_zero_lift
    turned = lift + T / U**2
    A_u, A_v, A_w = (float(added) for added in np.diag(inertia.M_A)[:3])
    X_uu = T / U**2 - duct.half_rho_area_kgpm * duct.polar.drag_zero_lift
    if X_uu <= 0:
        raise VehicleError(
            f"{config.name}: operating_point.thrust_n = {T}: "
            f"expected more than the duct's own drag, {T - X_uu * U**2:.3g} N"
        )
    return Hull(
        X_uu_kgpm=X_uu,
        Y_uv_kgpm=linear.Y_v_kgps / U + k,
        Y_ur_kg=linear.Y_r_kgmps / U + k * x + A_u,
        N_uv_kg=linear.N_v_kgmps / U + k * x + (A_v - A_u),
        N_ur_kgm=linear.N_r_kgm2ps / U + k * x**2,
        Z_uw_kgpm=linear.Z_w_kgps / U + k,
        Z_uq_kg=linear.Z_q_kgmps / U - k * x - A_u,
        M_uw_kg=linear.M_w_kgmps / U - k * x - (A_w - A_u),
        M_uq_kgm=linear.M_q_kgm2ps / U + k * x**2,
        Y_uudr_kgpm=linear.Y_dr_nprad / U**2 - turned,
        N_uudr_kg=linear.N_dr_nmprad / U**2 - turned * x,
        Z_uude_kgpm=linear.Z_de_nprad / U**2 + turned,
        M_uude_kg=linear.M_de_nmprad / U**2 - turned * x,
        K_p_nms=config.damping.roll_linear_nms,
        K_pp_nms2=config.damping.roll_quadratic_nms2,
    )
