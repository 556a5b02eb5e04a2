"""Hull geometry against published values and scipy's adaptive quadrature."""

from collections.abc import Callable
from math import pi

import numpy as np
import pytest
from scipy.integrate import quad

from sitl.vehicle import build_model, config, hull

HULL = config.load("caribou_nominal").hull
assert isinstance(HULL, config.Series58)
NOSE, TAIL = hull.length_m(HULL) / 2, -hull.length_m(HULL) / 2
BREAKS = (NOSE - 0.4 * HULL.base_length_m, NOSE - 0.4 * HULL.base_length_m - HULL.midbody_length_m)
Integrand = Callable[[float, float], float]


def integrate(integrand: Integrand) -> float:
    """Return the integral of ``integrand(x, R)`` over the hull."""

    def at(x: float) -> float:
        return integrand(x, float(hull.radius_m(HULL, np.array([x]))[0]))

    value, _ = quad(at, TAIL, NOSE, points=BREAKS, epsabs=1e-11, limit=400)
    return float(value)


def test_model_4154_has_published_coefficients() -> None:
    published = [1.0, 2.14965, -17.7735, 36.71658, -33.51128, 11.41855]
    assert hull.series_58(0.5, 0.1, 0.65, 0.4) == pytest.approx(published, rel=1e-5)


def test_series_58_volume_equals_prismatic_coefficient() -> None:
    base = config.Series58(2.1336, 0.5334, 0.0, 0.5, 0.1, 0.65, 0.4)
    assert hull.integrals(base).volume_m3 == pytest.approx(
        0.65 * pi / 4 * 0.5334**2 * 2.1336, rel=1e-12
    )


@pytest.mark.parametrize(
    ("field", "integrand"),
    [
        ("volume_m3", lambda x, R: pi * R**2),
        ("planform_m2", lambda x, R: 2 * R),
        ("roll_inertia_m5", lambda x, R: pi * R**4 / 2),
        ("pitch_inertia_m5", lambda x, R: pi * R**2 * x**2 + pi * R**4 / 4),
        ("section_moment_m5", lambda x, R: pi * R**2 * x**2),
    ],
)
def test_hull_integrals_equal_adaptive_quadrature(field: str, integrand: Integrand) -> None:
    assert getattr(hull.integrals(HULL), field) == pytest.approx(integrate(integrand), rel=1e-6)


def test_centroid_is_forward_of_mid_length() -> None:
    shape = hull.integrals(HULL)
    assert shape.centroid_m == pytest.approx(
        integrate(lambda x, R: pi * R**2 * x) / shape.volume_m3, rel=1e-6
    )
    assert shape.centroid_m == pytest.approx(0.084, abs=1e-3)


def test_radius_zero_outside_and_constant_in_mid_body() -> None:
    radii = hull.radius_m(
        HULL, np.array([NOSE + 0.01, NOSE, BREAKS[0], 0.0, BREAKS[1], TAIL - 0.01])
    )
    assert radii == pytest.approx(
        [0.0, 0.0, HULL.diameter_m / 2, HULL.diameter_m / 2, HULL.diameter_m / 2, 0.0]
    )


def test_stations_sum_to_planform_and_volume() -> None:
    stations = build_model.build(config.load("caribou_nominal")).stations
    crossflow = 1025.0 / 2 * 1.1
    assert stations.drag_kgpm.sum() / crossflow == pytest.approx(
        hull.integrals(HULL).planform_m2, rel=2e-3
    )
    assert (stations.drag_kgpm @ np.abs(stations.x_m) ** 3) / crossflow == pytest.approx(
        integrate(lambda x, R: 2 * R * abs(x) ** 3), rel=5e-3
    )
    assert stations.buoyancy_share.sum() == pytest.approx(1.0, rel=1e-12)
    assert stations.buoyancy_share @ stations.lever_m == pytest.approx(0.0, abs=1e-12)
