"""Random vehicles that could be built: for what must hold for any vehicle, not for one.

Each is a point in the unit cube that becomes a vehicle file such as a user writes, geometry and
ballast only, and takes a user's way from there: every coefficient is derived. Four kinds of hull,
three of tail; port is the mirror of starboard. A vehicle takes long to make beside one look at it,
so they are numbered, made once and drawn by number."""

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
    """Any of the fleet."""
    return st.integers(0, FLEET - 1).map(numbered)


@cache
def numbered(number: int) -> VehicleModel:
    """Always the same vehicle."""
    return vehicle(np.random.default_rng([RANDOM_SEED, number]).random(DIMENSIONS).tolist())


def fleet() -> list[VehicleModel]:
    """All of them."""
    return [numbered(number) for number in range(FLEET)]


def vehicle(point: Sequence[float]) -> VehicleModel:
    """The vehicle at a point of the unit cube."""
    return build_model.build(config.parse(vehicle_file(point), "random vehicle"))


def vehicle_file(point: Sequence[float]) -> str:
    """Its file."""
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
    """Series 58 with a payload section, Myring's, a cylinder with caps, or a profile by points."""
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
    """Ring duct, upright fins or diagonal ones."""
    if kind < 1 / 3:
        ring = (0.5 + 0.4 * size) * d
        return f"[duct]\ndiameter_m = {ring}\nchord_m = {ring / (1.5 + 3.0 * aspect)}"
    layout = "cruciform" if kind < 2 / 3 else "x"
    span = (0.25 + 0.25 * size) * d
    return (
        f'[fins]\nlayout = "{layout}"\nspan_m = {span}\nroot_chord_m ='
        f" {span / (0.6 + 1.2 * aspect)}"
    )
