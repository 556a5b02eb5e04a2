"""Density of the water over depth, and the hydrostatic pressure."""

from __future__ import annotations

import numpy as np

from mavlink_io.jit import entry_point
from sitl.environment_schema import Density, WaterTable
from sitl.vehicle.vectors import Vector


def column(density: Density, water: WaterTable, gravity_mps2: float) -> Vector:
    """Return the water column, shape (layers, 3): depth (m), density (kg/m3), gauge pressure (Pa).

    p(z) = g * integral of rho dz from the surface. Density is linear between rows, so the
    trapezoidal rule is exact at them.
    """
    rows = np.array(
        [(layer.depth_m, layer.density_kgpm3) for layer in density.layer]
        or [(0.0, water.density_kgpm3)]
    )
    if rows[0, 0] > 0.0:
        rows = np.vstack([(0.0, rows[0, 1]), rows])
    depth, rho = rows.T
    increment = gravity_mps2 * 0.5 * (rho[1:] + rho[:-1]) * np.diff(depth)
    return np.column_stack([depth, rho, np.concatenate([[0.0], np.cumsum(increment)])])


@entry_point
def density_and_pressure(
    column: Vector, depth_m: float, gravity_mps2: float
) -> tuple[float, float]:
    """Return density (kg/m3) and pressure (Pa) at a depth.

    The pressure is relative to that at the still surface; above the surface it is negative.
    """
    # Row i of the column: depth d_i (m), density rho_i (kg/m3), pressure p_i (Pa). In layer i, with
    # density linear in depth, the hydrostatic equation dp/dd = g rho integrates exactly to
    #     rho(d) = rho_i + rho_i' (d - d_i),   p(d) = p_i + g (rho_i + rho(d)) / 2 (d - d_i).
    # Above the surface and below the last row the density is constant.
    last = len(column) - 1
    if depth_m <= 0.0:
        return column[0, 1], gravity_mps2 * column[0, 1] * depth_m
    for i in range(last):
        if depth_m < column[i + 1, 0]:
            down = depth_m - column[i, 0]
            gradient = (column[i + 1, 1] - column[i, 1]) / (column[i + 1, 0] - column[i, 0])
            rho = column[i, 1] + gradient * down
            return rho, column[i, 2] + gravity_mps2 * 0.5 * (column[i, 1] + rho) * down
    return column[last, 1], column[last, 2] + gravity_mps2 * column[last, 1] * (
        depth_m - column[last, 0]
    )
