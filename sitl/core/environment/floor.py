"""The sea floor: a plane or a grid, its height and tilt under a place, and where a sound beam meets
it. NWU axes."""

from __future__ import annotations

from math import cos, inf, radians, sin, sqrt, tan
from pathlib import Path
from typing import NamedTuple

import numpy as np

from sitl import bathymetry, environment_schema
from sitl.vehicle.jit import Vector, Vector3, entry_point, kernel

MAX_RANGE_M = 500.0
"""Beyond this no beam is followed over a grid."""
_HALVINGS = 40


class SeaFloor(NamedTuple):
    """Heights over the still surface, negative."""

    height_m: float
    """Of the plane, under the place that north and west are counted from; of a grid, its lowest
    node."""
    north_slope: float
    west_slope: float
    """Rise of the plane per metre."""
    grid: Vector
    """Heights at nodes, (rows, columns), south to north and west to east; no rows where the floor
    is a plane."""
    south_m: float
    west_edge_m: float
    """East of the place, of the westernmost column."""
    cell_m: float


def build(floor: environment_schema.FloorTable) -> SeaFloor:
    """Raises ScenarioError when its file is wrong."""
    if floor.file:
        grid = bathymetry.read(Path(floor.file))
        return SeaFloor(
            float(grid.height_m.min()),
            0.0,
            0.0,
            grid.height_m,
            grid.south_m,
            grid.west_m,
            grid.cell_m,
        )
    fall, towards = tan(radians(floor.slope_deg)), radians(floor.deepens_towards_deg)
    return SeaFloor(
        -floor.depth_m, -fall * cos(towards), fall * sin(towards), np.empty((0, 0)), 0.0, 0.0, 1.0
    )


@kernel
def _cell(at_m: float, cell_m: float, nodes: int) -> tuple[int, float]:
    """Cell of a grid and place in it, 0 to 1; beyond the edge the place is that of the edge."""
    place = min(max(at_m / cell_m, 0.0), nodes - 1.0)
    cell = min(int(place), nodes - 2)
    return cell, place - cell


@kernel
def height_and_slope(floor: SeaFloor, north_m: float, west_m: float) -> tuple[float, float, float]:
    """(height, rise per metre north, rise per metre west) of the floor: bilinear in a grid, whose
    edges go on level."""
    rows, columns = floor.grid.shape
    if rows == 0:
        height = floor.height_m + floor.north_slope * north_m + floor.west_slope * west_m
        return height, floor.north_slope, floor.west_slope
    north, east = north_m - floor.south_m, -west_m - floor.west_edge_m
    i, y = _cell(north, floor.cell_m, rows)
    j, x = _cell(east, floor.cell_m, columns)
    a, b, c, d = (
        floor.grid[i, j],
        floor.grid[i, j + 1],
        floor.grid[i + 1, j],
        floor.grid[i + 1, j + 1],
    )
    south, north_edge = a + (b - a) * x, c + (d - c) * x
    north_slope = (north_edge - south) / floor.cell_m
    east_slope = ((b - a) * (1.0 - y) + (d - c) * y) / floor.cell_m
    if north < 0.0 or north > (rows - 1) * floor.cell_m:
        north_slope = 0.0
    if east < 0.0 or east > (columns - 1) * floor.cell_m:
        east_slope = 0.0
    return south + (north_edge - south) * y, north_slope, -east_slope


@kernel
def normal(north_slope: float, west_slope: float) -> Vector3:
    """Unit vector out of a floor of that slope, NWU."""
    length = sqrt(1.0 + north_slope * north_slope + west_slope * west_slope)
    return -north_slope / length, -west_slope / length, 1.0 / length


@kernel
def _clearance(floor: SeaFloor, origin: Vector3, along: Vector3, range_m: float) -> float:
    """Height over the floor of the point at ``range_m`` along a ray."""
    north, west = origin[0] + along[0] * range_m, origin[1] + along[1] * range_m
    return origin[2] + along[2] * range_m - height_and_slope(floor, north, west)[0]


@entry_point
def range_m(floor: SeaFloor, origin: Vector3, along: Vector3) -> float:
    """Distance from ``origin`` (NWU, m) to the floor along a unit vector; infinite where the ray
    meets none.

    Over a grid the ray is followed in steps of a quarter of a cell, and the crossing found by
    halving."""
    above = _clearance(floor, origin, along, 0.0)
    if above <= 0.0:
        return 0.0
    if floor.grid.shape[0] == 0:
        closing = floor.north_slope * along[0] + floor.west_slope * along[1] - along[2]
        return above / closing if closing > 0.0 else inf
    if along[2] < 0.0 and along[0] == 0.0 and along[1] == 0.0:
        return above
    step, near = 0.25 * floor.cell_m, 0.0
    farthest = (
        min(MAX_RANGE_M, (origin[2] - floor.height_m) / -along[2])
        if along[2] < 0.0
        else MAX_RANGE_M
    )
    while near < farthest:
        far = min(near + step, farthest)
        if _clearance(floor, origin, along, far) <= 0.0 or (far == farthest and far < MAX_RANGE_M):
            for _ in range(_HALVINGS):
                middle = 0.5 * (near + far)
                if _clearance(floor, origin, along, middle) > 0.0:
                    near = middle
                else:
                    far = middle
            return far
        near = far
    return inf
