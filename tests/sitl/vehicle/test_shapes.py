"""Hull shapes against bodies with closed-form integrals; Myring against adaptive quadrature."""

from math import cos, pi, radians, tan

import msgspec
import numpy as np
import pytest
from scipy.integrate import quad

from sitl.vehicle import config, hull
from sitl.vehicle.config import Cylinder, Myring, ProfileHull, Series58
from sitl.vehicle.file_schema import HullGeometry

R, L = 0.1, 1.5
CAPSULE = Cylinder(length_m=L, diameter_m=2 * R)
REMUS = config.load("remus100").hull


def spheroid(points: int = 2001) -> ProfileHull:
    """Return a profile of a spheroid with half axes of 1 and 0.2 m."""
    angles = np.linspace(0.0, pi, points)
    return ProfileHull(
        tuple((1.0 - cos(a), 0.2 * float(np.sin(a)) if 0 < a < pi else 0.0) for a in angles)
    )


def test_capsule_equals_cylinder_and_sphere() -> None:
    shape = hull.integrals(CAPSULE)
    assert shape.volume_m3 == pytest.approx(pi * R**2 * (L - 2 * R) + 4 / 3 * pi * R**3, rel=1e-12)
    assert shape.planform_m2 == pytest.approx(2 * R * (L - 2 * R) + pi * R**2, rel=1e-5)
    assert shape.centroid_m == pytest.approx(0.0, abs=1e-12)
    cylinder = pi * R**4 / 2 * (L - 2 * R)
    assert shape.roll_inertia_m5 == pytest.approx(
        cylinder + 2 / 5 * R**2 * 4 / 3 * pi * R**3, rel=1e-12
    )


def test_flat_caps_give_plain_cylinder() -> None:
    shape = hull.integrals(Cylinder(length_m=L, diameter_m=2 * R, nose_cap_m=0.0, tail_cap_m=0.0))
    assert shape.volume_m3 == pytest.approx(pi * R**2 * L, rel=1e-12)
    assert shape.pitch_inertia_m5 == pytest.approx(
        pi * R**2 * L * (R**2 / 4 + L**2 / 12), rel=1e-12
    )


def test_ellipsoid_caps_have_two_thirds_of_cylinder_volume() -> None:
    shape = hull.integrals(Cylinder(length_m=L, diameter_m=2 * R, nose_cap_m=0.3, tail_cap_m=0.6))
    assert shape.volume_m3 == pytest.approx(pi * R**2 * (L - 0.9 + 2 / 3 * 0.9), rel=1e-12)
    assert shape.centroid_m > 0.0  # the long tail is the slender end


def test_profile_of_spheroid_equals_spheroid() -> None:
    shape = hull.integrals(spheroid())
    volume = 4 / 3 * pi * 0.2**2
    assert shape.volume_m3 == pytest.approx(volume, rel=1e-5)
    assert shape.planform_m2 == pytest.approx(pi * 0.2, rel=1e-5)
    assert shape.pitch_inertia_m5 == pytest.approx(volume * (1.0 + 0.2**2) / 5, rel=1e-5)
    assert shape.section_moment_m5 == pytest.approx(volume / 5, rel=1e-5)


def test_profile_of_two_cones_is_exact() -> None:
    shape = hull.integrals(ProfileHull(((0.0, 0.0), (1.0, 0.3), (3.0, 0.0))))
    assert shape.volume_m3 == pytest.approx(pi * 0.3**2 * 3.0 / 3, rel=1e-12)
    assert shape.centroid_m == pytest.approx(1.5 - (0.75 * 1 + 1.5 * 2) / 3, rel=1e-12)


def myring_radius(s: float) -> float:
    """Return the REMUS radius of Prestero 2001, eqs. 2.1 and 2.3; ``s`` is from the cut nose."""
    a, b, c, d, ahead = 0.191, 0.654, 0.541, 0.191, 0.0165
    if s < a - ahead:
        return float(d / 2 * (1 - ((s + ahead - a) / a) ** 2) ** 0.5)
    t, theta = s - (a + b - ahead), radians(25.0)
    if t < 0:
        return d / 2
    return (
        d / 2 - (3 * d / (2 * c**2) - tan(theta) / c) * t**2 + (d / c**3 - tan(theta) / c**2) * t**3
    )


def test_myring_equals_its_equations_and_published_remus() -> None:
    length = 0.191 + 0.654 + 0.541 - 0.0165 - 0.0368
    shape, breaks = hull.integrals(REMUS), (0.1745, 0.8285)
    volume = quad(lambda s: pi * myring_radius(s) ** 2, 0, length, points=breaks)[0]
    first = quad(lambda s: pi * myring_radius(s) ** 2 * (length / 2 - s), 0, length, points=breaks)[
        0
    ]
    assert hull.length_m(REMUS) == pytest.approx(length, rel=1e-12)
    assert shape.volume_m3 == pytest.approx(volume, rel=1e-9)
    assert shape.centroid_m == pytest.approx(first / volume, rel=1e-9)
    # Prestero's table of hull parameters.
    assert shape.volume_m3 == pytest.approx(3.15e-2, rel=0.01)
    assert shape.planform_m2 == pytest.approx(2.26e-1, rel=0.01)
    assert shape.frontal_m2 == pytest.approx(2.85e-2, rel=0.01)


@pytest.mark.parametrize(
    "shape",
    [
        Series58(2.0, 0.4, 0.0, 0.5, 0.1, 0.65, 0.4),
        Myring(0.3, 0.0, 0.6, 0.2),
        CAPSULE,
        ProfileHull(((0.0, 0.0), (0.4, 0.2), (1.6, 0.0))),
    ],
)
def test_payload_section_adds_cylinder_and_length(shape: HullGeometry) -> None:
    longer = msgspec.structs.replace(shape, midbody_length_m=0.7)
    grown = hull.integrals(longer).volume_m3 - hull.integrals(shape).volume_m3
    assert grown == pytest.approx(pi / 4 * shape.diameter_m**2 * 0.7, rel=1e-9)
    assert hull.length_m(longer) == pytest.approx(hull.length_m(shape) + 0.7, rel=1e-12)
