"""The column of water: its density over depth, and the pressure that its weight makes."""

from __future__ import annotations

import numpy as np

from sitl.environment_schema import Density, WaterTable
from sitl.vehicle.jit import Vector, entry_point


def column(density: Density, water: WaterTable, gravity_mps2: float) -> Vector:
    """Shape (layers, 3): depth in m, density in kg/m3, and pressure over that at the surface in Pa.

    Density is linear between the rows, so pressure, the integral of rho g dz, is exact by the
    trapezoidal rule at them."""
    rows = np.array(
        [(layer.depth_m, layer.density_kgpm3) for layer in density.layer]
        or [(0.0, water.density_kgpm3)]
    )
    if rows[0, 0] > 0.0:
        rows = np.vstack([(0.0, rows[0, 1]), rows])
    depth, rho = rows.T
    gained = gravity_mps2 * 0.5 * (rho[1:] + rho[:-1]) * np.diff(depth)
    return np.column_stack([depth, rho, np.concatenate([[0.0], np.cumsum(gained)])])


@entry_point
def density_and_pressure(
    column: Vector, depth_m: float, gravity_mps2: float
) -> tuple[float, float]:
    """Density (kg/m3) and pressure over that at the still surface (Pa) at a depth; above the
    surface it is negative."""
    last = len(column) - 1
    if depth_m <= 0.0:
        return column[0, 1], gravity_mps2 * column[0, 1] * depth_m
    for i in range(last):
        if depth_m < column[i + 1, 0]:
            down = depth_m - column[i, 0]
            growth = (column[i + 1, 1] - column[i, 1]) / (column[i + 1, 0] - column[i, 0])
            rho = column[i, 1] + growth * down
            return rho, column[i, 2] + gravity_mps2 * 0.5 * (column[i, 1] + rho) * down
    return column[last, 1], column[last, 2] + gravity_mps2 * column[last, 1] * (
        depth_m - column[last, 0]
    )
