"""Munk moment on a spheroid.

Verifies: that added mass, as momentum in the equations, gives the moment of ideal flow that turns a
drifting body broadside, and no force (d'Alembert); the spheroid's factors for the axial added mass
of a hull. Leaves out: lift and drag, which do not exist in ideal flow.
Reference: 1/2 rho V U^2 (k_2 - k_1) sin 2 alpha (Munk 1924, NACA report 184) with k_1, k_2 as Lamb
tabulates them for a spheroid of slenderness 6.01 (Lamb 1932, sec. 114); the factors of the shipped
hulls by quadrature of Lamb's integrals. Tolerance: 0.0015, Lamb's third decimal as his table has
it, and 1e-9 for quadrature against closed form.
"""

from collections.abc import Iterator
from math import cos, pi, sin

import numpy as np

from sitl.vehicle import build_model, config, hull
from tests.reference import bodies
from tests.reference.check import Check, relative, worst
from tests.sitl.vehicle import flight

LENGTH_M, SLENDERNESS = 3.0, 6.01
LAMB = bodies.LambFactors(k_1=0.045, k_2=0.918, k_rotation=0.764)
"""Lamb's factors as printed for a/b = 6.01."""
SPEED_MPS = 1.3


def checks() -> Iterator[Check]:
    """Factors, moment over incidence, and no force."""
    factors = bodies.lamb_factors(SLENDERNESS)
    for name, found, printed in zip(("k_1", "k_2", "k'"), factors, LAMB, strict=True):
        yield Check(
            f"{name} of a 6.01:1 spheroid", "-", found, printed, 0.0015, "Lamb 1932, secs. 114, 115"
        )
    model = bodies.spheroid(LENGTH_M, LENGTH_M / SLENDERNESS)
    volume = pi / 6 * LENGTH_M * (LENGTH_M / SLENDERNESS) ** 2
    for degrees in (2.0, 10.0, 45.0):
        alpha = np.radians(degrees)
        state = flight.cruising(SPEED_MPS * cos(alpha))
        state[8] = SPEED_MPS * sin(alpha)
        X, Y, *_, N = model.inertia.M @ flight.rate(model, state)[7:13]
        reference = (
            -bodies.RHO_KGPM3 / 2 * volume * SPEED_MPS**2 * (LAMB.k_2 - LAMB.k_1) * sin(2 * alpha)
        )
        yield relative(
            f"moment at {degrees:.0f} deg", "N m", N, reference, 0.0015, "Munk 1924, Lamb's factors"
        )
    yield worst("force at 45 deg", "N", [X, Y], 0.0, 1e-10, "d'Alembert")
    yield from _axial_added_mass()


def _axial_added_mass() -> Iterator[Check]:
    for name in config.SHIPPED:
        vehicle = config.load(name)
        length, diameter = hull.length_m(vehicle.hull), vehicle.hull.diameter_m
        spheroid_kg = vehicle.water.density_kgpm3 * pi / 6 * length * diameter**2
        reference = bodies.lamb_factors(length / diameter).k_1 * spheroid_kg
        found = build_model.build(vehicle).inertia.M_A[0, 0]
        yield relative(f"{name}, -X_udot", "kg", found, reference, 1e-9, "Lamb's integrals")
