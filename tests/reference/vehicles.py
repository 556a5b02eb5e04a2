"""Random feasible vehicles, for properties that hold for any vehicle.

A point in the unit cube is converted to a vehicle file with geometry and ballast only, and all
coefficients are derived as for a user's file. There are four kinds of hull and three of tail; port
and starboard are symmetric. Building a vehicle is slow compared with one test of it, so a fixed
number of vehicles is built once and selected by number.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np
from hypothesis import strategies as st

from sitl.vehicle import build_model, config
from sitl.vehicle.model import VehicleModel

DIMENSIONS = 11
RANDOM_SEED = 2026
FLEET = 60


def random_vehicles() -> st.SearchStrategy[VehicleModel]:
    """Return a strategy that selects one of the vehicles."""
    return st.integers(0, FLEET - 1).map(numbered)


@cache
def numbered(number: int) -> VehicleModel:
    """Return the vehicle of a number, always the same one."""
    return vehicle(np.random.default_rng([RANDOM_SEED, number]).random(DIMENSIONS).tolist())


def fleet() -> list[VehicleModel]:
    """Return all vehicles."""
    return [numbered(number) for number in range(FLEET)]


def vehicle(point: Sequence[float]) -> VehicleModel:
    """Return the model of the vehicle at a point of the unit cube."""
    return build_model.build(config.parse(vehicle_file(point), "random vehicle"))


def vehicle_file(point: Sequence[float]) -> str:
    """Return the vehicle file at a point of the unit cube."""
    length, slenderness, shape, tail, size, aspect, net, low, cd, speed, nose = point
    length_m = 1.2 + 4.0 * length
    d = length_m / (5.0 + 5.0 * slenderness)
    return f"""
name = "random"
[hull]
{_hull(shape, length_m, d, nose)}
[ballast]
net_buoyancy_n = {(2 * net - 1) * 50.0 * d * d * length_m}
[linear]
z_CM_m = {-(0.01 + 0.1 * low) * d}
[operating_point]
speed_mps = {0.7 + 1.5 * speed}
[damping]
crossflow_cd = {0.5 + 0.7 * cd}
{_tail(tail, d, size, aspect)}
"""


def _hull(kind: float, length_m: float, d: float, nose: float) -> str:
    """Return a hull: Series 58 with payload section, Myring, cylinder with caps, or profile."""
    if kind < 0.25:
        middle = 0.4 * nose * length_m
        return f"""base_length_m = {length_m - middle}\ndiameter_m = {d}
midbody_length_m = {middle}
nose_radius = 0.5\ntail_radius = 0.1\nprismatic = 0.65\nmax_section = 0.4"""
    if kind < 0.5:
        ends = (0.5 + nose) * d, 2.5 * d
        return f"""shape = "myring"\nnose_length_m = {ends[0]}\ntail_length_m = {ends[1]}
mid_length_m = {length_m - sum(ends)}\ndiameter_m = {d}\nnose_exponent = {1.5 + 2 * nose}"""
    if kind < 0.75:
        return f"""shape = "cylinder"\nlength_m = {length_m}\ndiameter_m = {d}
tail_cap_m = {(0.5 + nose) * d}"""
    points = [
        (0.0, 0.0),
        (0.1, 0.35),
        (0.2 + 0.2 * nose, 0.5),
        (0.7, 0.5),
        (0.9, 0.25),
        (1.0, 0.05),
    ]
    return f"""shape = "profile"\npoints_m = {[[x * length_m, r * d] for x, r in points]}"""


def _tail(kind: float, d: float, size: float, aspect: float) -> str:
    """Return a tail: ring duct, cruciform fins or X fins."""
    if kind < 1 / 3:
        ring = (0.5 + 0.4 * size) * d
        return f"[duct]\ndiameter_m = {ring}\nchord_m = {ring / (1.5 + 3.0 * aspect)}"
    layout = "cruciform" if kind < 2 / 3 else "x"
    span = (0.25 + 0.25 * size) * d
    return (
        f'[fins]\nlayout = "{layout}"\nspan_m = {span}\nroot_chord_m ='
        f" {span / (0.6 + 1.2 * aspect)}"
    )
