"""From a vehicle file to a model: geometry and physics first, then hull lift as what remains of the
linear column.

Added mass and its Coriolis terms, the isolated duct and the thrust are taken in full. What they
give at the operating point is subtracted from the column of coefficients asked for; the remainder,
divided by speed, is the hull's lift. The linearised model then equals the column, and every other
speed follows from physics."""

from __future__ import annotations

from math import pi, radians, sqrt
from typing import NamedTuple

import numpy as np

from sitl.vehicle import empirical, wall_effects
from sitl.vehicle import hull as geometry
from sitl.vehicle.file_schema import (
    DuctGeometry,
    FinGeometry,
    VehicleConfig,
    VehicleFileError,
)
from sitl.vehicle.model import (
    Duct,
    Fins,
    Hull,
    Hydrostatics,
    Inertia,
    Polar,
    Propeller,
    Stations,
    VehicleModel,
)

STATION_NODES = (6, 4, 6)
"""Stations on nose, mid-body and tail."""


def build(config: VehicleConfig, source: str | None = None) -> VehicleModel:
    """Make the model of ``config``.

    Raises:
        VehicleError: the mass matrix or the thrust is impossible; named after ``source``, else
        after the vehicle.
    """
    duct, fins = _duct(config), _fins(config)
    try:
        inertia = _inertia(config)
        lift = _hull(config, inertia, duct, fins)
    except VehicleFileError as error:
        raise VehicleFileError(f"{source or config.name}: {error}") from None
    return VehicleModel(
        inertia=inertia,
        stations=_stations(config),
        hull=lift,
        duct=duct,
        fins=fins,
        propeller=_propeller(config),
        hydrostatics=_hydrostatics(config),
        walls=wall_effects.build(config.hull, config.water.density_kgpm3),
    )


def _inertia(config: VehicleConfig) -> Inertia:
    """Mass matrices; roll inertia is the homogeneous hull's, roll added mass that of the fins
    alone."""
    m, linear, ballast = config.ballast.mass_kg, config.linear, config.ballast
    x, y, z = ballast.x_cm_m, ballast.y_cm_m, linear.z_CM_m
    shape = geometry.integrals(config.hull)
    I_xx = m * shape.roll_inertia_m5 / shape.volume_m3
    M_RB = np.diag([m, m, m, I_xx, linear.I_yy_kgm2, linear.I_zz_kgm2])
    offset = m * np.array([[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]])
    M_RB[:3, 3:] = offset
    M_RB[3:, :3] = offset.T
    length, rho = geometry.length_m(config.hull), config.water.density_kgpm3
    X_udot, K_pdot = (
        -empirical.axial_added_mass_kg(length, config.hull.diameter_m, rho),
        -_roll_added_kgm2(config),
    )
    M_A = -np.diag(
        [X_udot, linear.Y_vdot_kg, linear.Z_wdot_kg, K_pdot, linear.M_qdot_kgm2, linear.N_rdot_kgm2]
    )
    smallest = float(np.linalg.eigvalsh(M_RB).min())
    if smallest <= 0:
        raise VehicleFileError(
            f"ballast.x_cm_m, y_cm_m, linear.z_CM_m = {x:.4g}, {y:.4g}, {z:.4g}: expected nearer to"
            " mid-length, or larger I_yy_kgm2, I_zz_kgm2: the rigid-body mass matrix has an"
            f" eigenvalue {smallest:.3g}"
        )
    M = M_RB + M_A
    return Inertia(mass_kg=m, M_RB=M_RB, M_A=M_A, M=M, M_inverse=np.linalg.inv(M))


def _roll_added_kgm2(config: VehicleConfig) -> float:
    fins = config.fins
    if fins is None:
        return 0.0
    chord_m = (fins.root_chord_m + fins.tip_chord_m) / 2
    return (
        empirical.finned_section_roll_kgm(fins.tip_radius_m, config.water.density_kgpm3) * chord_m
    )


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
    """The ring; without one, the place of the bare propeller at the tail end."""
    ring = config.duct
    if ring is None:
        nothing = Polar(0.0, 0.0, 0.0, 0.0, pi / 4, pi / 2, 0.0)
        return Duct(
            -geometry.length_m(config.hull) / 2, config.propeller.diameter_m / 2, 0.0, 0.0, nothing
        )
    return Duct(
        x_m=ring.x_m,
        radius_m=ring.diameter_m / 2,
        half_rho_area_kgpm=config.water.density_kgpm3 / 2 * ring.area_m2,
        vectored=float(ring.vectored),
        polar=_polar(ring),
    )


def _polar(wing: DuctGeometry | FinGeometry) -> Polar:
    return Polar(
        lift_slope_per_rad=wing.lift_slope_per_rad,
        lift_quadratic_per_rad2=wing.lift_quadratic_per_rad2,
        drag_zero_lift=wing.drag_zero_lift,
        induced_drag=1 / (pi * wing.aspect_ratio * wing.oswald),
        stall_rad=radians(wing.stall_deg),
        separated_rad=radians(wing.separated_deg),
        separated_normal=wing.separated_normal,
    )


_SPANS = {
    "cruciform": (np.array([1.0, 0.0, -1.0, 0.0]), np.array([0.0, 1.0, 0.0, -1.0])),
    "x": (np.array([1.0, -1.0, -1.0, 1.0]) / sqrt(2), np.array([1.0, 1.0, -1.0, -1.0]) / sqrt(2)),
}
"""(span_y, span_z) of the fins, by layout; to rounding, opposite fins are opposite."""


def _fins(config: VehicleConfig) -> Fins:
    """Fins that push the tail to port under positive rudder and down under positive elevator."""
    fins, none = config.fins, np.empty(0)
    if fins is None:
        return Fins(
            -geometry.length_m(config.hull) / 2,
            0.0,
            0.0,
            Polar(0.0, 0.0, 0.0, 0.0, pi / 4, pi / 2, 0.0),
            none,
            none,
            none,
            none,
        )
    span_y, span_z = _SPANS[fins.layout]
    return Fins(
        x_m=fins.x_m,
        out_m=fins.centre_radius_m,
        half_rho_area_kgpm=config.water.density_kgpm3 / 2 * fins.area_m2,
        polar=_polar(fins),
        span_y=span_y,
        span_z=span_z,
        rudder=-fins.command_gain * span_z,
        elevator=-fins.command_gain * span_y,
        travel_rad=radians(config.tailcone.travel_deg),
    )


def _propeller(config: VehicleConfig) -> Propeller:
    """The shaft speed at the operating point is the positive root of thrust_nn n^2 - thrust_nv V n
    = T."""
    rho, D, point = config.water.density_kgpm3, config.propeller.diameter_m, config.operating_point
    thrust_nn = rho * D**4 * config.propeller.kt_bollard
    thrust_nv = rho * D**3 * config.propeller.kt_slope * (1 - config.propeller.wake_fraction)
    lost = thrust_nv * point.speed_mps
    shaft_rps = (lost + sqrt(lost**2 + 4 * thrust_nn * point.thrust_n)) / (2 * thrust_nn)
    return Propeller(
        thrust_nn_kgm=thrust_nn, thrust_nv_kg=thrust_nv, full_rps=shaft_rps / point.thrust_fraction
    )


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


class _TailLift(NamedTuple):
    """What duct and fins do by themselves in straight flight, per unit of speed, with moments of
    place."""

    drag_kgpm: float
    side: tuple[float, float, float]
    """Side force per m/s of sway, k, then x k and x^2 k summed."""
    steer: tuple[float, float]
    """Side force per radian of command over speed squared, and its moment."""


def _tail(duct: Duct, fins: Fins, thrust_n: float, speed_mps: float) -> _TailLift:
    """k is lift slope and drag; thrust that turns with the command steers too."""
    lift = duct.half_rho_area_kgpm * duct.polar.lift_slope_per_rad
    drag = duct.half_rho_area_kgpm * duct.polar.drag_zero_lift
    k, turned, x = lift + drag, duct.vectored * (lift + thrust_n / speed_mps**2), duct.x_m
    standing, answering = float(np.sum(fins.span_z**2)), -float(np.sum(fins.span_z * fins.rudder))
    fin_lift = fins.half_rho_area_kgpm * fins.polar.lift_slope_per_rad
    fin_drag = fins.half_rho_area_kgpm * fins.polar.drag_zero_lift
    k_f, turned_f, x_f = standing * (fin_lift + fin_drag), answering * fin_lift, fins.x_m
    # A turning vehicle drags one fin faster than its twin on the other side.
    uneven = 2 * standing * fin_drag * fins.out_m**2
    return _TailLift(
        drag_kgpm=drag + fins.span_y.size * fin_drag,
        side=(k + k_f, k * x + k_f * x_f, k * x**2 + k_f * x_f**2 + uneven),
        steer=(turned + turned_f, turned * x + turned_f * x_f),
    )


def _hull(config: VehicleConfig, inertia: Inertia, duct: Duct, fins: Fins) -> Hull:
    """Lift coefficients: (column - added mass - tail) / U, or / U^2 for the angles of duct and
    fins.

    In straight flight the tail's side force is -k U (v + x r); added mass gives Y_r = X_udot U and
    the Munk moment N_v = (Y_vdot - X_udot) U, and their twins in pitch. Four equal fins stand alike
    in both planes."""
    linear, U, T = config.linear, config.operating_point.speed_mps, config.operating_point.thrust_n
    tail = _tail(duct, fins, T, U)
    (k, k_x, k_xx), (steer, steer_x) = tail.side, tail.steer
    A_u, A_v, A_w = (float(added) for added in np.diag(inertia.M_A)[:3])
    X_uu = T / U**2 - tail.drag_kgpm
    if X_uu <= 0:
        raise VehicleFileError(
            f"operating_point.thrust_n = {T:.4g}: expected more than the"
            f" {'duct' if config.fins is None else 'tail'}'s own drag, {T - X_uu * U**2:.3g} N"
        )
    return Hull(
        X_uu_kgpm=X_uu,
        Y_uv_kgpm=linear.Y_v_kgps / U + k,
        Y_ur_kg=linear.Y_r_kgmps / U + k_x + A_u,
        N_uv_kg=linear.N_v_kgmps / U + k_x + (A_v - A_u),
        N_ur_kgm=linear.N_r_kgm2ps / U + k_xx,
        Z_uw_kgpm=linear.Z_w_kgps / U + k,
        Z_uq_kg=linear.Z_q_kgmps / U - k_x - A_u,
        M_uw_kg=linear.M_w_kgmps / U - k_x - (A_w - A_u),
        M_uq_kgm=linear.M_q_kgm2ps / U + k_xx,
        Y_uudr_kgpm=linear.Y_dr_nprad / U**2 - steer,
        N_uudr_kg=linear.N_dr_nmprad / U**2 - steer_x,
        Z_uude_kgpm=linear.Z_de_nprad / U**2 + steer,
        M_uude_kg=linear.M_de_nmprad / U**2 - steer_x,
        K_p_nms=config.damping.roll_linear_nms,
        K_pp_nms2=config.damping.roll_quadratic_nms2,
    )
