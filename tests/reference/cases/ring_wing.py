"""Ring-wing lift.

Verifies: the slope of the ring duct's lift against the two published points; the whole force over
incidence and duct angle below stall against the paper's formulas with its own matrices. Leaves out:
stall, which the paper does not treat; interaction with the hull. Reference: 3.4855 per rad at an
aspect ratio of 1.25 and 5.1566 at 4.3716 (Milewski and the DSRV report, as the source paper quotes
them under "Tailcone"); the paper's C_L, C_D and transformation T_R/B. Tolerance: the five digits
printed; rounding for the force.
"""

from collections.abc import Iterator
from itertools import product
from math import cos, pi, radians, sin

import numpy as np
from numpy.typing import NDArray

from sitl.vehicle import duct
from tests.reference.check import Check, relative, worst
from tests.sitl.vehicle import flight

POINTS = ((1.25, 3.4855), (4.3716, 5.1566))
"""Aspect ratio, lift slope per rad."""
DIAMETER_M, CHORD_M = 0.415, 0.120


def checks() -> Iterator[Check]:
    """Yield the checks of the two points, then of the force at many attitudes."""
    for aspect, published in POINTS:
        slope = duct.ring_wing_lift_slope_per_rad(aspect)
        yield relative(
            f"slope at aspect ratio {aspect}", "1/rad", slope, published, 1e-4, "published point"
        )
    ring = flight.model("caribou_nominal").duct
    attitudes = product((0.9, 1.3, 2.5), (-0.1, 0.05), (0.02, 0.1), (-7, 3), (-4, 8))
    cases = [
        (np.array([u, v, w]), radians(rudder), radians(elevator))
        for u, v, w, rudder, elevator in attitudes
    ]
    found = [
        duct.force(tuple(v.tolist()), duct.ring_axis(rudder, elevator), ring)
        for v, rudder, elevator in cases
    ]
    yield worst(
        "force over 48 attitudes",
        "N",
        found,
        [paper_force(*case) for case in cases],
        1e-11,
        "paper, Tailcone",
    )


def paper_force(
    velocity: NDArray[np.float64], rudder: float, elevator: float
) -> NDArray[np.float64]:
    """The paper's "Tailcone" section as printed, with its matrices; below stall, moving forward,
    not along the axis.
    """
    cR, sR, cE, sE = cos(rudder), sin(rudder), cos(elevator), sin(elevator)
    to_ring = np.array([[cR * cE, sR, -cR * sE], [-sR * cE, cR, sR * sE], [sE, 0, cE]])
    v = to_ring @ velocity
    speed = np.linalg.norm(v)
    alpha = np.arcsin(np.linalg.norm(np.cross(v, [1, 0, 0])) / speed)
    C_L = 5.133 * alpha + 0.81 * alpha**2
    C_D = 0.010 + C_L**2 / (pi * DIAMETER_M / CHORD_M * 0.90)
    pressure = 1025 / 2 * DIAMETER_M * CHORD_M * speed**2
    t2 = np.cross(v, [1, 0, 0])
    t3 = np.cross(v, t2)
    axes = np.column_stack([t / np.linalg.norm(t) for t in (v, t2, t3)])
    return np.asarray(to_ring.T @ axes @ [-pressure * C_D, 0, -pressure * C_L])
