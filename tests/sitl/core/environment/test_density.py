"""Density and pressure of the water compared with quadrature."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad

from sitl.core.environment import density
from sitl.environment_schema import Density, DensityLayer, WaterTable

G = 9.81
LAYERS = ((1.0, 1005.0), (3.0, 1007.0), (4.0, 1022.0), (30.0, 1026.0))
COLUMN = density.column(
    Density(layer=tuple(DensityLayer(depth_m=z, density_kgpm3=r) for z, r in LAYERS)),
    WaterTable(),
    G,
)


@given(st.floats(0.0, 100.0))
def test_pressure_is_weight_of_water_above(depth_m: float) -> None:
    depths, rhos = zip(*LAYERS, strict=True)
    weight, _ = quad(
        lambda z: G * np.interp(z, depths, rhos), 0.0, depth_m, points=depths, limit=200
    )
    rho, pressure = density.density_and_pressure(COLUMN, depth_m, G)
    assert rho == pytest.approx(np.interp(depth_m, depths, rhos), rel=1e-12)
    assert pressure == pytest.approx(weight, rel=1e-9, abs=1e-6)


def test_uniform_density_needs_no_layers() -> None:
    column = density.column(Density(), WaterTable(density_kgpm3=1000.0), G)
    assert density.density_and_pressure(column, 12.0, G) == pytest.approx(
        (1000.0, 12.0 * G * 1000.0)
    )


def test_pressure_above_surface_is_extrapolated() -> None:
    assert density.density_and_pressure(COLUMN, -0.5, G) == pytest.approx(
        (1005.0, -0.5 * G * 1005.0)
    )
