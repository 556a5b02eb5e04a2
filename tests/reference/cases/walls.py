"""Floor and ice.

Verifies: the suction of a wall on a hull that moves along it, near and far away; that the suction
does no work; that floor and ice support a resting hull. Leaves out: the surface as a wall; the
effect of a wall on added mass, which is significant within one radius of it. Reference: the line of
sources of a slender hull and its mirror image (Lagally 1922; Newman 1965, DTMB report
2127), integrated here on a grid of its own; far away two dipoles side by side, 3 rho V^2 U^2 / (64
pi h^4). Tolerance: 3 % near the wall, where the simulator reads a table that ends a hull's length
off; 2 % far away; rounding for work; a centimetre of a resting hull.
"""

from collections.abc import Iterator
from math import pi

import numpy as np

from sitl.vehicle import config, dynamics, hull, wall_effects
from sitl.vehicle.water import Water
from tests.reference.check import Check, relative
from tests.sitl.vehicle import flight

SPEED_MPS = 1.3
DISTANCES_M = (0.35, 0.5, 1.0)
GRID = 4000


def checks() -> Iterator[Check]:
    """Pull near and far, its work, and rest."""
    for name in ("caribou_nominal", "caribou_truth"):
        vehicle, model = config.load(name), flight.model(name)
        for distance in DISTANCES_M:
            state = flight.cruising(SPEED_MPS)
            near = flight.rate(model, state, water=Water(floor_m=state[2] - distance))
            pull = (model.inertia.M @ (near - flight.rate(model, state))[7:13])[2]
            reference = -_pull_kgpm(vehicle, distance) * SPEED_MPS**2
            yield relative(
                f"{name}, pull of a floor {distance} m off",
                "N",
                pull,
                reference,
                0.03,
                "Newman 1965",
            )
        far = 10 * hull.length_m(vehicle.hull)
        volume = hull.integrals(vehicle.hull).volume_m3
        dipoles = 3 * vehicle.water.density_kgpm3 * volume**2 / (64 * pi * far**4)
        yield relative(
            f"{name}, pull ten lengths off",
            "kg/m",
            wall_effects.pull(vehicle.hull, vehicle.water.density_kgpm3, far)[0],
            dipoles,
            0.02,
            "dipoles",
        )
        yield Check(f"{name}, work of the pull", "part", _work(name), 0.0, 1e-9, "conservation")
    yield from _rest()


def _pull_kgpm(vehicle: config.VehicleConfig, distance_m: float) -> float:
    """Per U^2: sources at the middles of equal steps, each as strong as the section's change over
    its step.
    """
    half = hull.length_m(vehicle.hull) / 2
    edges = np.linspace(-half, half, GRID + 1)
    sources = np.diff(pi * hull.radius_m(vehicle.hull, edges) ** 2)
    x, across = (edges[1:] + edges[:-1]) / 2, 2 * distance_m
    mirrored = across / ((x[:, None] - x) ** 2 + across**2) ** 1.5
    return float(vehicle.water.density_kgpm3 / (4 * pi) * sources @ mirrored @ sources)


def _work(name: str) -> float:
    """Power of the pull on a hull that moves in every way, over what force and speed could make of
    it.
    """
    model, state = flight.model(name), flight.cruising(SPEED_MPS)
    state[8:13] = 0.1, -0.2, 0.05, 0.03, -0.04
    near, free = (
        flight.rate(model, state, water=w) for w in (Water(floor_m=state[2] - 0.5), Water())
    )
    terms = (model.inertia.M @ (near - free)[7:13]) * state[7:13]
    return float(abs(terms.sum()) / np.abs(terms).sum())


def _rest() -> Iterator[Check]:
    """A vehicle too heavy comes to rest on the floor, one too light under the ice, a radius off."""
    model = flight.model("caribou_nominal")
    h = model.hydrostatics
    for label, ratio, water in (
        ("floor", 0.99, Water(floor_m=-12.0)),
        ("ice", 1.01, Water(ceiling_m=-2.0)),
    ):
        loaded = model._replace(hydrostatics=h._replace(buoyancy_n=ratio * h.weight_n))
        end = flight.fly(loaded, dynamics.state_at_rest(-5.0), 300.0, water=water)[-1]
        reference = -12.0 + h.radius_m if label == "floor" else -2.0 - h.radius_m
        yield Check(f"resting at the {label}, axis", "m", end[2], reference, 0.01, "a radius off")
