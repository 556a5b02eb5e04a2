"""Random vehicles that could be built: for what must hold for any vehicle, not for one.

Each is a point in the unit cube, so that hypothesis can shrink it and a table can draw a hundred by number. Geometry is
drawn; coefficients follow from it by the formulas of slender-body theory, with the hull's lift as one force behind
mid-length. Half steer by a ring duct, the others by four fins, upright or diagonal.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, pi, sin

import msgspec
import numpy as np
from hypothesis import strategies as st

from sitl.vehicle import calibrate, config, duct, hull
from sitl.vehicle.model import Fins, Model
from tests.reference.bodies import lamb_factors

DIMENSIONS = 14
RANDOM_SEED = 2026


def random_vehicles() -> st.SearchStrategy[Model]:
    """Any of them."""
    return st.tuples(*[st.floats(0.0, 1.0)] * DIMENSIONS).map(vehicle)


def numbered(count: int) -> list[Model]:
    """The first ``count``, always the same."""
    return [vehicle(point) for point in np.random.default_rng(RANDOM_SEED).random((count, DIMENSIONS)).tolist()]


def vehicle(point: Sequence[float]) -> Model:
    """The vehicle at a point of the unit cube."""
    length, slenderness, middle, aft, low, net, diameter, chord, lift, behind, cd, ballast, speed, tail = point
    model = calibrate.build(
        _described(
            length_m=1.2 + 4.0 * length, slenderness=4.5 + 5.0 * slenderness, midbody=0.6 * middle,
            x_cm=0.02 * (2 * aft - 1), z_cm=-0.01 - 0.05 * low, net_buoyancy=0.02 * (2 * net - 1),
            duct_diameter=0.5 + 0.4 * diameter, aspect=1.5 + 3.0 * chord, hull_lift=0.05 + 0.25 * lift,
            lift_at=-0.25 - 0.25 * behind, crossflow_cd=0.5 + 0.7 * cd, inertia=0.8 + 0.4 * ballast,
            speed_mps=0.7 + 1.5 * speed,
        )
    )  # fmt: skip
    return model if tail < 0.5 else _finned(model, turned_rad=0.0 if tail < 0.75 else pi / 4)


def _described(
    *, length_m: float, slenderness: float, midbody: float, x_cm: float, z_cm: float, net_buoyancy: float,
    duct_diameter: float, aspect: float, hull_lift: float, lift_at: float, crossflow_cd: float, inertia: float,
    speed_mps: float,
) -> config.VehicleConfig:  # fmt: skip
    """The vehicle file: lengths in parts of hull length or diameter, forces in parts of weight."""
    base = config.load("bench")
    d, x, U, rho = length_m / slenderness, -0.5 * length_m, speed_mps, base.water.density_kgpm3
    shape = msgspec.structs.replace(
        base.hull, base_length_m=(1 - midbody) * length_m, diameter_m=d, midbody_length_m=midbody * length_m
    )
    size = hull.integrals(shape)
    mass = rho * size.volume_m3
    ring = msgspec.structs.replace(
        base.duct, x_m=x, diameter_m=duct_diameter * d, chord_m=duct_diameter * d / aspect,
        lift_slope_per_rad=duct.ring_wing_lift_slope_per_rad(aspect),
    )  # fmt: skip
    thrust = rho / 2 * U**2 * (0.15 * size.frontal_m2 + ring.area_m2 * ring.drag_zero_lift)
    A_u = lamb_factors(slenderness).k_1 * rho * pi / 6 * length_m * d**2
    k = rho / 2 * ring.area_m2 * ring.lift_slope_per_rad
    linear = _column(
        U, thrust, k, k + rho / 2 * ring.area_m2 * ring.drag_zero_lift, x,
        side=rho / 2 * length_m * d * hull_lift, x_side=lift_at * length_m, A_u=A_u, A_v=mass,
        turning=rho * size.section_moment_m5, I_zz=inertia * rho * size.pitch_inertia_m5, z_cm=z_cm * d,
    )  # fmt: skip
    return msgspec.structs.replace(
        base,
        hull=shape,
        ballast=msgspec.structs.replace(
            base.ballast, mass_kg=mass, net_buoyancy_n=net_buoyancy * mass * base.water.gravity_mps2,
            x_cm_m=x_cm * length_m, x_cb_m=x_cm * length_m,
        ),
        operating_point=msgspec.structs.replace(base.operating_point, speed_mps=U, thrust_n=thrust),
        linear=linear,
        duct=ring,
        propeller=msgspec.structs.replace(base.propeller, diameter_m=0.9 * ring.diameter_m),
        damping=config.Damping(crossflow_cd, 0.02 * mass * d**2, 0.05 * mass * d**2),
    )  # fmt: skip


def _column(
    U: float, thrust: float, k: float, k_and_drag: float, x: float, *, side: float, x_side: float, A_u: float,
    A_v: float, turning: float, I_zz: float, z_cm: float,
) -> config.Coefficients:  # fmt: skip
    """The linear coefficients at speed ``U``: duct and hull lift as forces at x and ``x_side``, and the Munk moment."""
    Y_v = -U * (k_and_drag + side)
    N_v = -U * (k_and_drag * x + side * x_side + A_v - A_u)
    Y_r = -U * (k_and_drag * x + side * x_side + A_u)
    N_r = -U * (k_and_drag * x**2 + side * x_side**2)
    Y_dr = k * U**2 + thrust
    return config.Coefficients(
        Y_v, N_v, Y_r, N_r, Y_dr, x * Y_dr, -A_v, I_zz, -turning,
        Y_v, -N_v, -Y_r, N_r, -Y_dr, x * Y_dr, -A_v, I_zz, -turning, z_cm,
    )  # fmt: skip


def _finned(model: Model, turned_rad: float) -> Model:
    """The same vehicle with a bare propeller and four fins of the ring's area in all."""
    ring = model.duct
    angles = turned_rad + pi / 2 * np.arange(4)
    span_y, span_z = np.array([cos(a) for a in angles]), np.array([sin(a) for a in angles])
    fins = Fins(
        x_m=ring.x_m,
        out_m=1.5 * ring.radius_m,
        half_rho_area_kgpm=ring.half_rho_area_kgpm / 2,
        polar=ring.polar,
        span_y=span_y,
        span_z=span_z,
        rudder=-span_z,
        elevator=-span_y,
    )
    return model._replace(duct=ring._replace(half_rho_area_kgpm=0.0, vectored=0.0), fins=fins)
