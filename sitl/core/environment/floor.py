"""The sea floor: a plane or a grid; its height, slope and the range of a sonar beam (NWU)."""

from __future__ import annotations

from math import cos, inf, radians, sin, sqrt, tan
from pathlib import Path
from typing import NamedTuple

import numpy as np

from mavlink_io.jit import entry_point, kernel
from sitl import bathymetry, environment_schema
from sitl.vehicle.vectors import Vector, Vector3

MAX_RANGE_M = 500.0
"""Longest range that is searched over a grid."""
_BISECTIONS = 40


class SeaFloor(NamedTuple):
    """Sea floor; heights are relative to the still surface, negative below it."""

    height_m: float
    """Height of a plane at the site, or of the lowest node of a grid."""
    north_slope: float
    west_slope: float
    """Rise of the plane per metre."""
    grid: Vector
    """Heights at nodes, rows south to north, columns west to east; shape (0, 0) for a plane."""
    south_m: float
    """Position of the southernmost row, m north of the site."""
    west_edge_m: float
    """Position of the westernmost column, m east of the site."""
    cell_m: float
    """Distance between adjacent nodes."""


def build(floor: environment_schema.FloorTable) -> SeaFloor:
    """Build the floor of a scenario.

    Raises ScenarioError: its file cannot be used.
    """
    if floor.file:
        grid = bathymetry.read(Path(floor.file))
        return SeaFloor(
            height_m=float(grid.height_m.min()),
            north_slope=0.0,
            west_slope=0.0,
            grid=grid.height_m,
            south_m=grid.south_m,
            west_edge_m=grid.west_m,
            cell_m=grid.cell_m,
        )
    fall, towards = tan(radians(floor.slope_deg)), radians(floor.deepens_towards_deg)
    return SeaFloor(
        height_m=-floor.depth_m,
        north_slope=-fall * cos(towards),
        west_slope=fall * sin(towards),
        grid=np.empty((0, 0)),
        south_m=0.0,
        west_edge_m=0.0,
        cell_m=1.0,
    )


@kernel
def _cell(coordinate_m: float, cell_m: float, nodes: int) -> tuple[int, float]:
    """Return the index of a grid cell and the position in it, 0 to 1, limited to the grid."""
    position = min(max(coordinate_m / cell_m, 0.0), nodes - 1.0)
    cell = min(int(position), nodes - 2)
    return cell, position - cell


@kernel
def height_and_slope(floor: SeaFloor, north_m: float, west_m: float) -> tuple[float, float, float]:
    """Return height (m) and slopes (rise per m north, per m west) of the floor at a position.

    Plane: h = h0 + s_n n + s_w w. Grid: bilinear interpolation between the nodes a (SW), b (SE),
    c (NW) and d (NE) of a cell; outside the grid the edge continues at constant height.
    """
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
    """Return the upward unit normal of a floor with these slopes, NWU."""
    length = sqrt(1.0 + north_slope * north_slope + west_slope * west_slope)
    return -north_slope / length, -west_slope / length, 1.0 / length


@kernel
def _clearance(floor: SeaFloor, origin: Vector3, direction: Vector3, range_m: float) -> float:
    """Return the height above the floor of the point at ``range_m`` along a ray."""
    north, west = origin[0] + direction[0] * range_m, origin[1] + direction[1] * range_m
    return origin[2] + direction[2] * range_m - height_and_slope(floor, north, west)[0]


@entry_point
def range_m(floor: SeaFloor, origin: Vector3, direction: Vector3) -> float:
    """Return the distance (m) to the floor along a ray; infinite if the ray does not meet it.

    ``origin`` is in NWU, m; ``direction`` is a unit vector d. For a plane with slopes s,
    range = clearance / (s_n d_n + s_w d_w - d_z). For a grid the ray is searched in steps of a
    quarter of a cell; the crossing is then found by bisection.
    """
    clearance = _clearance(floor, origin, direction, 0.0)
    if clearance <= 0.0:
        return 0.0
    if floor.grid.shape[0] == 0:
        closing = floor.north_slope * direction[0] + floor.west_slope * direction[1] - direction[2]
        return clearance / closing if closing > 0.0 else inf
    if direction[2] < 0.0 and direction[0] == 0.0 and direction[1] == 0.0:
        return clearance
    step, near = 0.25 * floor.cell_m, 0.0
    farthest = (
        min(MAX_RANGE_M, (origin[2] - floor.height_m) / -direction[2])
        if direction[2] < 0.0
        else MAX_RANGE_M
    )
    while near < farthest:
        far = min(near + step, farthest)
        if _clearance(floor, origin, direction, far) <= 0.0 or (
            far == farthest and far < MAX_RANGE_M
        ):
            for _ in range(_BISECTIONS):
                middle = 0.5 * (near + far)
                if _clearance(floor, origin, direction, middle) > 0.0:
                    near = middle
                else:
                    far = middle
            return far
        near = far
    return inf
