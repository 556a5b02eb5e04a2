"""Build the numeric model of a vehicle from its file.

Added mass with its Coriolis terms, the isolated duct, the fins and the thrust follow from geometry.
Their linear coefficients at the operating point are subtracted from the ``linear`` table of the
file (Table 1's column); the remainder, divided by the speed U, is the hull's lift:

    Y_uv = Y_v/U + k                  N_uv = N_v/U + x k + (A_v - A_u)
    Y_ur = Y_r/U + x k + A_u          N_ur = N_r/U + x^2 k
    Y_uudr = Y_dr/U^2 - steer         N_uudr = N_dr/U^2 - x steer

Here k is the tail's side force per m/s of speed and m/s of sway (kg/m), x its position (m), steer
its side force per speed squared and radian of rudder (kg/m), A_u = -X_udot and A_v = -Y_vdot (kg).
The pitch plane follows by rotation about x. The linearised model then equals the table, and other
speeds follow from the nonlinear equations. Axes: body FLU, origin on the hull axis at mid-length.
"""

from __future__ import annotations

from functools import lru_cache
from math import pi, radians, sqrt
from typing import NamedTuple

import numpy as np

from sitl.vehicle import empirical, wall_effects
from sitl.vehicle import hull as geometry
from sitl.vehicle.file_schema import (
    DuctGeometry,
    FinGeometry,
    HullGeometry,
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
from sitl.vehicle.vectors import Vector

STATION_NODES = (6, 4, 6)
"""Number of stations on nose, mid-body and tail."""


def build(config: VehicleConfig, source: str | None = None) -> VehicleModel:
    """Return the numeric model of a vehicle.

    Parameters
    ----------
    config : VehicleConfig
        The complete vehicle file.
    source : str, optional
        Name of the file in error messages; the name of the vehicle if left out.

    Returns
    -------
    VehicleModel
        The model for ``dynamics``; its linearisation at the operating point equals
        ``config.linear``.

    Raises
    ------
    VehicleFileError
        The rigid-body mass matrix is not positive definite, or the thrust is less than the drag of
        the tail.
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
    """Return the mass matrices about the origin.

    Roll inertia is that of the homogeneous hull; added roll inertia is that of the fins alone.
    """
    m, linear, ballast = config.ballast.mass_kg, config.linear, config.ballast
    shape = geometry.integrals(config.hull)
    length, rho = geometry.length_m(config.hull), config.water.density_kgpm3
    return _mass_matrices(
        m,
        (ballast.x_cm_m, ballast.y_cm_m, linear.z_CM_m),
        (m * shape.roll_inertia_m5 / shape.volume_m3, linear.I_yy_kgm2, linear.I_zz_kgm2),
        (
            -empirical.axial_added_mass_kg(length, config.hull.diameter_m, rho),
            linear.Y_vdot_kg,
            linear.Z_wdot_kg,
            -_roll_added_kgm2(config),
            linear.M_qdot_kgm2,
            linear.N_rdot_kgm2,
        ),
    )


@lru_cache(maxsize=64)
def _mass_matrices(
    m: float,
    r_CM: tuple[float, float, float],
    inertias: tuple[float, float, float],
    added: tuple[float, float, float, float, float, float],
) -> Inertia:
    """Return the mass matrices, cached: identification builds many vehicles of the same inertia.

    Mass (kg), centre of mass (m), diagonal of I_o (kg m2), X_udot to N_rdot (kg and kg m2).
    """
    # Fossen 2021, ch. 3, with r = r_CM = (x, y, z):  M_RB = [[m I, -m S(r)], [m S(r), I_o]],
    # S(r) a = r x a; I_o (diagonal) are the moments of inertia about the origin.
    # M_A = -diag(X_udot, Y_vdot, Z_wdot, K_pdot, M_qdot, N_rdot).
    x, y, z = r_CM
    M_RB = np.diag([m, m, m, *inertias])
    offset = m * np.array([[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]])
    M_RB[:3, 3:] = offset
    M_RB[3:, :3] = offset.T
    M_A = -np.diag(added)
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
    """Return -K_pdot of the fins, kg m2; zero without fins."""
    fins = config.fins
    if fins is None:
        return 0.0
    chord_m = (fins.root_chord_m + fins.tip_chord_m) / 2
    return (
        empirical.finned_section_roll_kgm(fins.tip_radius_m, config.water.density_kgpm3) * chord_m
    )


def _stations(config: VehicleConfig) -> Stations:
    """Return the stations of the hull with crossflow drag 1/2 rho C_d 2R dx and buoyancy shares."""
    stations, dx = _stations_of_hull(config.hull)
    drag = config.water.density_kgpm3 / 2 * config.damping.crossflow_cd * 2 * stations.radius_m * dx
    return stations._replace(drag_kgpm=drag)


@lru_cache(maxsize=16)
def _stations_of_hull(hull: HullGeometry) -> tuple[Stations, Vector]:
    """Return the stations of a hull without drag, and their lengths dx (m); cached by hull."""
    # share_i = R_i^2 dx_i / sum R^2 dx,   lever_i = x_i - sum share x   (m, forward).
    x, dx = geometry.quadrature(hull, STATION_NODES)
    radius = geometry.radius_m(hull, x)
    volume_fraction = radius**2 * dx / float(radius**2 @ dx)
    stations = Stations(
        x_m=x,
        radius_m=radius,
        drag_kgpm=np.zeros(x.size),
        buoyancy_share=volume_fraction,
        lever_m=x - float(volume_fraction @ x),
    )
    return stations, dx


def _duct(config: VehicleConfig) -> Duct:
    """Return the ring; without one, a ring without area at the tail end, for the propeller."""
    ring = config.duct
    if ring is None:
        return Duct(
            x_m=-geometry.length_m(config.hull) / 2,
            radius_m=config.propeller.diameter_m / 2,
            half_rho_area_kgpm=0.0,
            vectored=0.0,
            polar=_NO_WING,
        )
    return Duct(
        x_m=ring.x_m,
        radius_m=ring.diameter_m / 2,
        half_rho_area_kgpm=config.water.density_kgpm3 / 2 * ring.area_m2,
        vectored=float(ring.vectored),
        polar=_polar(ring),
    )


_NO_WING = Polar(
    lift_slope_per_rad=0.0,
    lift_quadratic_per_rad2=0.0,
    drag_zero_lift=0.0,
    induced_drag=0.0,
    stall_rad=pi / 4,
    separated_rad=pi / 2,
    separated_normal=0.0,
)
"""Coefficients of an absent wing; the two angles only have to differ."""


def _polar(wing: DuctGeometry | FinGeometry) -> Polar:
    """Return lift and drag coefficients of ring or fin."""
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
"""(span_y, span_z) of the unit span vectors of the four fins, by layout."""


def _fins(config: VehicleConfig) -> Fins:
    """Return the fins; positive rudder pushes the tail to port, positive elevator down."""
    fins, none = config.fins, np.empty(0)
    if fins is None:
        return Fins(
            x_m=-geometry.length_m(config.hull) / 2,
            out_m=0.0,
            half_rho_area_kgpm=0.0,
            polar=_NO_WING,
            span_y=none,
            span_z=none,
            rudder=none,
            elevator=none,
        )
    # Fin angle = -gain (span_z dR + span_y dE), leading edge towards (0, -span_z, span_y), FLU.
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
    """Return the thrust coefficients and the shaft speed at 100 % thrust."""
    # thrust_nn = rho D^4 K_T0, thrust_nv = rho D^3 (-dK_T/dJ) (1 - w). The shaft speed n at the
    # operating point (speed V, thrust T) is the positive root of thrust_nn n^2 - thrust_nv V n = T.
    rho, D, point = config.water.density_kgpm3, config.propeller.diameter_m, config.operating_point
    thrust_nn = rho * D**4 * config.propeller.kt_bollard
    thrust_nv = rho * D**3 * config.propeller.kt_slope * (1 - config.propeller.wake_fraction)
    nv_times_speed = thrust_nv * point.speed_mps
    shaft_rps = (nv_times_speed + sqrt(nv_times_speed**2 + 4 * thrust_nn * point.thrust_n)) / (
        2 * thrust_nn
    )
    return Propeller(
        thrust_nn_kgm=thrust_nn, thrust_nv_kg=thrust_nv, full_rps=shaft_rps / point.thrust_fraction
    )


def _hydrostatics(config: VehicleConfig) -> Hydrostatics:
    """Return weight, buoyancy and their centres in body FLU."""
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
    """Linear forces of duct and fins in straight motion, per unit of speed."""

    drag_kgpm: float
    """Axial drag per speed squared."""
    side: tuple[float, float, float]
    """Sums of k, x k and x^2 k; k is the side force per m/s of speed and m/s of sway."""
    steer: tuple[float, float]
    """Side force per speed squared and radian of command, and its moment about the origin."""


def _tail(duct: Duct, fins: Fins, thrust_n: float, speed_mps: float) -> _TailLift:
    """Return the linear forces of duct and fins; thrust that turns with the command steers too."""
    # k = 1/2 rho A (dC_L/dalpha + C_do), in straight motion at small angles. Fins of span z
    # component s_z carry side force in proportion to s_z^2.
    lift = duct.half_rho_area_kgpm * duct.polar.lift_slope_per_rad
    drag = duct.half_rho_area_kgpm * duct.polar.drag_zero_lift
    k, ring_steer, x = lift + drag, duct.vectored * (lift + thrust_n / speed_mps**2), duct.x_m
    sum_span_z2, rudder_effect = (
        float(np.sum(fins.span_z**2)),
        -float(np.sum(fins.span_z * fins.rudder)),
    )
    fin_lift = fins.half_rho_area_kgpm * fins.polar.lift_slope_per_rad
    fin_drag = fins.half_rho_area_kgpm * fins.polar.drag_zero_lift
    k_f, fin_steer, x_f = sum_span_z2 * (fin_lift + fin_drag), rudder_effect * fin_lift, fins.x_m
    # In a turn with yaw rate r, a fin at y moves forward at U - r y. Its drag gives the yaw moment
    # -2 (1/2 rho A C_do) y^2 U r.
    drag_difference = 2 * sum_span_z2 * fin_drag * fins.out_m**2
    return _TailLift(
        drag_kgpm=drag + fins.span_y.size * fin_drag,
        side=(k + k_f, k * x + k_f * x_f, k * x**2 + k_f * x_f**2 + drag_difference),
        steer=(ring_steer + fin_steer, ring_steer * x + fin_steer * x_f),
    )


def _hull(config: VehicleConfig, inertia: Inertia, duct: Duct, fins: Fins) -> Hull:
    """Return the hull's coefficients: (table - added mass - tail) / U, or / U^2 for commands.

    Four equal fins have the same effect in both planes.
    """
    # In straight motion at speed U the tail's side force is -k U (v + x r). Added mass gives
    # Y_r = X_udot U and the Munk moment N_v = (Y_vdot - X_udot) U, and their equals in pitch.
    # A_u, A_v, A_w: added masses -X_udot, -Y_vdot, -Z_wdot, kg. X_uu = T / U^2 - drag of the tail.
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
