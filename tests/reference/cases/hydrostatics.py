"""Weight and buoyancy.

Verifies: Archimedes for shipped hulls and simple bodies; the righting moment; how deep a floating
body lies and its heave stiffness. Leaves out: waves; roll of a floating body, which has no effect
on a body of revolution. Reference: rho g V with V by adaptive quadrature of the profile; W
z_CM sin(angle); the area of a circular segment for a cylinder afloat, whose water-plane is its
length times its chord. Tolerance: rounding and 1e-5 of a volume; for bodies afloat a nanometre, and
1e-6 of the stiffness.
"""

from collections.abc import Iterator
from math import acos, cos, pi, sin, sqrt

import numpy as np
from scipy.integrate import quad
from scipy.optimize import brentq

from sitl.core.initial_conditions import float_trim
from sitl.vehicle import config, dynamics, hull
from sitl.vehicle.model import VehicleModel
from tests.reference import bodies
from tests.reference.check import Check, relative, worst
from tests.sitl.vehicle import flight

LENGTH_M, RADIUS_M = 3.0, 0.25
LOADS = (0.1, 0.3, 0.5, 0.8, 0.97)
"""Mass of the floating cylinder over what it displaces when submerged."""


def checks() -> Iterator[Check]:
    """Yield the checks of submerged, then of floating bodies."""
    for name in config.SHIPPED:
        yield from _shipped(name)
    for load in LOADS:
        found, *angles = float_trim(_cylinder(load))
        reference = brentq(_segment_beyond, -RADIUS_M, RADIUS_M, args=(load,))
        yield Check(
            f"cylinder of {load} the density, axis", "m", found, reference, 1e-9, "segment's area"
        )
        yield worst(f"cylinder of {load} the density, heel", "rad", angles, 0.0, 1e-9, "level")
    floating = _cylinder(0.5)
    h = 1e-4
    lift = [
        flight.rate(floating, dynamics.state_at_rest(z))[9] * floating.inertia.M[2, 2]
        for z in (h, -h)
    ]
    stiffness = bodies.RHO_KGPM3 * bodies.GRAVITY_MPS2 * LENGTH_M * 2 * RADIUS_M
    yield relative(
        "half afloat, stiffness in heave",
        "N/m",
        -np.diff(lift[::-1])[0] / (2 * h),
        stiffness,
        1e-6,
        "rho g L d",
    )


def _cylinder(load: float) -> VehicleModel:
    """Return a cylinder of ``load`` times the density of water, with a low centre of mass."""
    body = bodies.cylinder(LENGTH_M, 2 * RADIUS_M, 0.0, mass_ratio=load)
    return body._replace(hydrostatics=body.hydrostatics._replace(z_cm_m=-RADIUS_M / 10))


def _segment_beyond(z_up_m: float, load: float) -> float:
    """Return the fraction of a circle below a line minus ``load``; centre ``z_up_m`` above it."""
    y = z_up_m / RADIUS_M
    return (acos(y) - y * sqrt(1 - y * y)) / pi - load


def _shipped(name: str) -> Iterator[Check]:
    vehicle, model = config.load(name), flight.model(name)
    half = hull.length_m(vehicle.hull) / 2

    def section(x: float) -> float:
        return pi * float(hull.radius_m(vehicle.hull, np.array([x]))[0]) ** 2

    volume = quad(section, -half, half, limit=400, epsabs=1e-10)[0]
    yield relative(
        f"{name}, volume of the hull",
        "m3",
        hull.integrals(vehicle.hull).volume_m3,
        volume,
        1e-5,
        "quad",
    )
    up = dynamics.state_at_rest(-50.0)
    net = (flight.rotation(up) @ (model.inertia.M @ flight.rate(model, up)[7:13])[:3])[2]
    yield relative(
        f"{name}, net buoyancy", "N", net, vehicle.ballast.net_buoyancy_n, 1e-9, "vehicle file"
    )
    h = model.hydrostatics
    for label, component, at in (("roll", 3, 4), ("pitch", 4, 5)):
        tilted, angle = dynamics.state_at_rest(-50.0), 0.2
        tilted[3], tilted[at] = np.cos(angle / 2), sin(angle / 2)
        moment = (model.inertia.M @ flight.rate(model, tilted)[7:13])[component]
        reference = (h.weight_n * h.z_cm_m - h.buoyancy_n * h.z_cb_m) * sin(angle)
        reference += (
            (h.weight_n * h.x_cm_m - h.buoyancy_n * h.x_cb_m) * cos(angle) * (label == "pitch")
        )
        yield relative(
            f"{name}, righting moment in {label}", "N m", moment, reference, 1e-9, "W z sin(angle)"
        )
