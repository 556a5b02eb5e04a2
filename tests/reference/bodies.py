"""Models of simple bodies whose motion is known in closed form."""

from __future__ import annotations

from math import inf, pi
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import quad

from sitl.vehicle.model import Inertia, VehicleModel
from tests.sitl.vehicle import flight

Array = NDArray[np.float64]

RHO_KGPM3 = 1025.0
GRAVITY_MPS2 = 9.80665
STATIONS = 16


class LambFactors(NamedTuple):
    """Added mass of a prolate spheroid along and across its axis and in rotation, over the mass and
    inertia of the displaced water.
    """

    k_1: float
    k_2: float
    k_rotation: float


def lamb_factors(slenderness: float) -> LambFactors:
    """Return the added mass of a spheroid (Lamb 1932, secs. 114, 115), by quadrature.

    ``slenderness`` is length over diameter.
    """
    if slenderness == 1.0:
        return LambFactors(0.5, 0.5, 0.0)
    aa, bb = slenderness**2, 1.0
    alpha = slenderness * quad(lambda s: (aa + s) ** -1.5 / (bb + s), 0, inf, epsabs=1e-13)[0]
    beta = slenderness * quad(lambda s: (aa + s) ** -0.5 / (bb + s) ** 2, 0, inf, epsabs=1e-13)[0]
    # Lamb's rotational moment, over the spheroid's own moment of inertia m (a^2 + b^2)/5.
    turning = (
        (aa - bb) ** 2 * (beta - alpha) / (2 * (aa - bb) + (aa + bb) * (alpha - beta)) / (aa + bb)
    )
    return LambFactors(alpha / (2 - alpha), beta / (2 - beta), turning)


def rigid_body(mass_kg: float, cm_m: ArrayLike, inertia_kgm2: Array) -> VehicleModel:
    """Return a rigid body in vacuum; moments of inertia are about the origin."""
    x, y, z = np.asarray(cm_m, float)
    M = np.zeros((6, 6))
    M[:3, :3] = mass_kg * np.eye(3)
    M[:3, 3:] = mass_kg * np.array([[0, z, -y], [-z, 0, x], [y, -x, 0]])
    M[3:, :3] = M[:3, 3:].T
    M[3:, 3:] = inertia_kgm2
    return _alone(mass_kg, M, np.zeros((6, 6)))


def spheroid(length_m: float, diameter_m: float, mass_ratio: float = 1.0) -> VehicleModel:
    """Return a homogeneous prolate spheroid in inviscid water.

    ``mass_ratio`` is its density over the density of the water.
    """
    displaced_kg = RHO_KGPM3 * pi / 6 * length_m * diameter_m**2
    across = (length_m**2 + diameter_m**2) / 20
    k = lamb_factors(length_m / diameter_m)
    body = displaced_kg * np.array([1, 1, 1, diameter_m**2 / 10, across, across])
    entrained = displaced_kg * np.array(
        [k.k_1, k.k_2, k.k_2, 0, k.k_rotation * across, k.k_rotation * across]
    )
    model = _alone(mass_ratio * displaced_kg, np.diag(mass_ratio * body), np.diag(entrained))
    x, weights = np.polynomial.legendre.leggauss(STATIONS)
    radius = diameter_m / 2 * np.sqrt(1 - x**2)
    return _floating(model, displaced_kg, x * length_m / 2, radius, weights * length_m / 2)


def cylinder(
    length_m: float, diameter_m: float, crossflow_cd: float, mass_ratio: float = 1.0
) -> VehicleModel:
    """Return a homogeneous circular cylinder with added mass by strips and crossflow drag."""
    displaced_kg = RHO_KGPM3 * pi / 4 * length_m * diameter_m**2
    across = length_m**2 / 12
    body = displaced_kg * np.array(
        [1, 1, 1, diameter_m**2 / 8, across + diameter_m**2 / 16, across + diameter_m**2 / 16]
    )
    entrained = displaced_kg * np.array([0, 1, 1, 0, across, across])
    model = _alone(mass_ratio * displaced_kg, np.diag(mass_ratio * body), np.diag(entrained))
    x, weights = np.polynomial.legendre.leggauss(STATIONS)
    dx = weights * length_m / 2
    model = _floating(model, displaced_kg, x * length_m / 2, np.full(STATIONS, diameter_m / 2), dx)
    drag = RHO_KGPM3 / 2 * crossflow_cd * diameter_m * dx
    return model._replace(stations=model.stations._replace(drag_kgpm=drag))


def _alone(mass_kg: float, M_RB: Array, M_A: Array) -> VehicleModel:
    """Return a model with inertia only."""
    M = M_RB + M_A
    model = flight.without_weight(flight.without_fluid_forces(flight.model("caribou_nominal")))
    return model._replace(inertia=Inertia(mass_kg, M_RB, M_A, M, np.linalg.inv(M).astype(float)))


def _floating(
    model: VehicleModel,
    displaced_kg: float,
    x_m: Array,
    radius_m: Array,
    dx_m: Array,
) -> VehicleModel:
    """Return the body with weight, buoyancy and sections; both centres are at the origin."""
    share = radius_m**2 * dx_m / float(radius_m**2 @ dx_m)
    hydrostatics = model.hydrostatics._replace(
        weight_n=model.inertia.mass_kg * GRAVITY_MPS2,
        buoyancy_n=displaced_kg * GRAVITY_MPS2,
        x_cm_m=0.0,
        y_cm_m=0.0,
        z_cm_m=0.0,
        x_cb_m=0.0,
        z_cb_m=0.0,
        gravity_mps2=GRAVITY_MPS2,
        half_length_m=float(x_m.max()),
        radius_m=float(radius_m.max()),
    )
    stations = model.stations._replace(
        x_m=x_m,
        radius_m=radius_m,
        drag_kgpm=np.zeros_like(x_m),
        buoyancy_share=share,
        lever_m=x_m.copy(),
    )
    return model._replace(hydrostatics=hydrostatics, stations=stations)
