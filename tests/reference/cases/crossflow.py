"""Crossflow drag.

Verifies: strip drag of a cylinder in pure sway, pure yaw and both together, in the plane and out of
it, also with drag that is uncoupled in whole or in part; the stations of the shipped hulls against
adaptive quadrature over their profile. Leaves out: how C_d depends on Reynolds number and
incidence; ends. Reference: integrals of 1/2 rho C_d d (v + x r)|v + x r| over the length in closed
form; scipy's adaptive quadrature. Tolerance: the Gauss rule
is exact for polynomials and loses where the flow turns round within the length, at a kink: up to 2
% of the force in the worst place shown. Half a percent for hulls.
"""

from collections.abc import Iterator
from math import hypot

import numpy as np
from scipy.integrate import quad

from sitl.vehicle import config, hull, hydrodynamics
from sitl.vehicle.model import Stations
from tests.reference import bodies
from tests.reference.check import Check, relative
from tests.sitl.vehicle import flight

LENGTH_M, DIAMETER_M, CD = 3.0, 0.5, 1.1
K = bodies.RHO_KGPM3 / 2 * CD * DIAMETER_M
"""Drag per metre of length and (m/s)^2."""


def checks() -> Iterator[Check]:
    """Yield the checks of a cylinder, then of the shipped hulls."""
    stations = bodies.cylinder(LENGTH_M, DIAMETER_M, CD).stations
    v, r, L = 0.4, 0.3, LENGTH_M
    _, Y, *_ = hydrodynamics.crossflow_drag(v, 0.0, 0.0, 0.0, stations)
    yield relative("pure sway, force", "N", Y, -K * L * v**2, 1e-12, "k L v^2")
    *_, N = hydrodynamics.crossflow_drag(0.0, 0.0, 0.0, r, stations)
    yield relative("pure yaw, moment", "N m", N, -K * r**2 * L**4 / 32, 2e-3, "k r^2 L^4 / 32")
    v = 0.6  # more than r L/2: the flow nowhere turns round
    _, Y, *_, N = hydrodynamics.crossflow_drag(v, 0.0, 0.0, r, stations)
    yield relative(
        "sway over yaw, force",
        "N",
        Y,
        -K * (v**2 * L + r**2 * L**3 / 12),
        1e-12,
        "k (v^2 L + r^2 L^3/12)",
    )
    yield relative("sway over yaw, moment", "N m", N, -K * v * r * L**3 / 6, 1e-12, "k v r L^3 / 6")
    v = 0.1  # the flow turns round at x = -v/r
    a, b = (v + r * L / 2) ** 3, (r * L / 2 - v) ** 3
    _, Y, *_, N = hydrodynamics.crossflow_drag(v, 0.0, 0.0, r, stations)
    yield relative(
        "yaw over sway, force", "N", Y, -K * (a - b) / (3 * r), 0.02, "k (a^3 - b^3) / 3r"
    )
    yield relative("yaw over sway, moment", "N m", N, -K * _moment(v, r), 0.02, "closed form")
    _, Y, Z, *_ = hydrodynamics.crossflow_drag(0.3, 0.4, 0.0, 0.0, stations)
    yield relative(
        "oblique, size of force", "N", hypot(Y, Z), K * L * 0.25, 1e-12, "k L (v^2 + w^2)"
    )
    yield from _uncoupled(stations)
    for name in config.SHIPPED:
        yield from _hull(name)


def _uncoupled(stations: Stations) -> Iterator[Check]:
    """Yield the checks of drag of which a share is that of drift plus that of rotation."""
    v, w, q, r, L = 0.6, -0.3, 0.2, 0.3, LENGTH_M
    drift, rotation = hypot(v, w), hypot(q, r)
    whole = stations._replace(uncoupled=1.0)
    _, Y, Z, _, M, N = hydrodynamics.crossflow_drag(v, w, q, r, whole)
    yield relative("uncoupled, side force", "N", Y, -K * L * drift * v, 1e-12, "k L |v| v")
    yield relative("uncoupled, heave force", "N", Z, -K * L * drift * w, 1e-12, "k L |v| w")
    turn = K * L**4 / 32 * rotation
    yield relative("uncoupled, pitch moment", "N m", M, -turn * q, 2e-3, "k |r| q L^4 / 32")
    yield relative("uncoupled, yaw moment", "N m", N, -turn * r, 2e-3, "k |r| r L^4 / 32")
    *_, N = hydrodynamics.crossflow_drag(v, 0.0, 0.0, r, stations._replace(uncoupled=0.25))
    strip, apart = -K * v * r * L**3 / 6, -K * r**2 * L**4 / 32
    yield relative("a quarter uncoupled", "N m", N, 0.75 * strip + 0.25 * apart, 1e-3, "the sum")


def _moment(v: float, r: float) -> float:
    """Return the integral of x (v + x r)|v + x r| over the length.

    With s = v + x r it is r^-2 [ s^3|s|/4 - v s^2|s|/3 ] between the ends.
    """

    def antiderivative(s: float) -> float:
        return (abs(s) * s**3 / 4 - v * abs(s) ** 3 / 3) / r**2

    return antiderivative(v + r * LENGTH_M / 2) - antiderivative(v - r * LENGTH_M / 2)


def _hull(name: str) -> Iterator[Check]:
    vehicle, model = config.load(name), flight.model(name)
    half = hull.length_m(vehicle.hull) / 2
    k = vehicle.water.density_kgpm3 / 2 * vehicle.damping.crossflow_cd
    v, r = 0.2, 0.25

    def strip(x: float, lever: float) -> float:
        s = v + x * r
        return -k * 2 * float(hull.radius_m(vehicle.hull, np.array([x]))[0]) * s * abs(s) * lever

    _, Y, *_, N = hydrodynamics.crossflow_drag(v, 0.0, 0.0, r, model.stations)
    turns = [-v / r]
    force = quad(lambda x: strip(x, 1.0), -half, half, points=turns, limit=400)[0]
    moment = quad(lambda x: strip(x, x), -half, half, points=turns, limit=400)[0]
    yield relative(f"{name}, force", "N", Y, force, 5e-3, "adaptive quadrature")
    yield relative(f"{name}, moment", "N m", N, moment, 5e-3, "adaptive quadrature")
