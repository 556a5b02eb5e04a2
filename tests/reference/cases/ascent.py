"""Buoyant ascent to terminal speed.

Verifies: buoyancy, weight, quadratic drag and apparent mass together: speed and height of a body
that rises from rest, end on (a shipped hull, nose up) and broadside (a cylinder in cross flow).
Leaves out: the surface; attitude, which is upright or level by symmetry; the duct's and propeller's
swirl. Reference: m' w' = F - k w^2 from rest: w = w_t tanh(k w_t t / m'), rise = m'/k ln cosh(k w_t
t / m'), w_t = sqrt(F / k) (Newton 1687, Principia II, prop. 8, in modern form). Tolerance: 1e-9 of
each figure, rounding and the integrator; 1e-6 of terminal speed, which is only approached.
"""

from collections.abc import Iterator
from math import cosh, log, pi, sqrt, tanh

import numpy as np

from sitl.vehicle import dynamics
from sitl.vehicle.model import VehicleModel
from tests.reference import bodies
from tests.reference.check import Check, relative
from tests.sitl.vehicle import flight

SECONDS = 20.0
START_M = -1000.0
SOURCE = "tanh solution"


def checks() -> Iterator[Check]:
    """Yield the checks end on, then broadside."""
    bench = _upright(flight.model("caribou_nominal"))
    drag = bench.hull.X_uu_kgpm + bench.duct.half_rho_area_kgpm * bench.duct.polar.drag_zero_lift
    yield from _rise(
        "nose up",
        bench,
        nose_up=True,
        net_n=22.24,
        k_kgpm=drag,
        mass_kg=float(bench.inertia.M[0, 0]),
    )
    length, diameter, cd = 3.0, 0.5, 1.1
    body = bodies.cylinder(length, diameter, cd, mass_ratio=0.99)
    displaced_kg = bodies.RHO_KGPM3 * pi / 4 * length * diameter**2
    yield from _rise(
        "broadside",
        body,
        nose_up=False,
        net_n=0.01 * displaced_kg * bodies.GRAVITY_MPS2,
        k_kgpm=bodies.RHO_KGPM3 / 2 * cd * diameter * length,
        mass_kg=1.99 * displaced_kg,
    )


def _upright(model: VehicleModel) -> VehicleModel:
    """Return the vehicle with a low centre of mass in the tail, so that it rises upright."""
    inertia = flight.balanced(model).inertia
    centred = model.hydrostatics._replace(
        x_cm_m=-0.3, y_cm_m=0.0, z_cm_m=0.0, x_cb_m=0.0, z_cb_m=0.0
    )
    return model._replace(inertia=inertia, hydrostatics=centred)


def _rise(
    name: str, model: VehicleModel, nose_up: bool, net_n: float, k_kgpm: float, mass_kg: float
) -> Iterator[Check]:
    start = dynamics.state_at_rest(START_M)
    if nose_up:
        start[3:7] = np.array([1.0, 0.0, -1.0, 0.0]) / sqrt(2)
    end = flight.fly(model, start, SECONDS)[-1]
    terminal = sqrt(net_n / k_kgpm)
    x = k_kgpm * terminal * SECONDS / mass_kg
    climb = (flight.rotation(end) @ end[7:10])[2]
    yield relative(f"{name}, speed after 20 s", "m/s", climb, terminal * tanh(x), 1e-9, SOURCE)
    yield relative(
        f"{name}, height gained",
        "m",
        end[2] - start[2],
        mass_kg / k_kgpm * log(cosh(x)),
        1e-9,
        SOURCE,
    )
    later = flight.fly(model, end, 300.0)[-1]
    climb = (flight.rotation(later) @ later[7:10])[2]
    yield relative(f"{name}, terminal speed", "m/s", climb, terminal, 1e-6, "sqrt(F / k)")
