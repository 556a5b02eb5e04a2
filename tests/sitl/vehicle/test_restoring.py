"""Weight, buoyancy and the free surface."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sitl.vehicle import dynamics, restoring
from sitl.vehicle.vectors import Vector3, Wrench
from tests.sitl.vehicle import flight

MODEL = flight.model("caribou_nominal")
H, STATIONS = MODEL.hydrostatics, MODEL.stations
NET_BUOYANCY_N = 22.24


def submerged(up: Vector3) -> Wrench:
    """Return the wrench of weight and buoyancy at 10 m depth."""
    return restoring.wrench(-10.0, up[0], up, 1.0, H, STATIONS)


def test_deep_and_level_gives_net_buoyancy() -> None:
    force = submerged((0.0, 0.0, 1.0))
    assert force == pytest.approx((0, 0, NET_BUOYANCY_N, 0, 0, 0), abs=1e-9)


def test_above_water_gives_weight() -> None:
    force = restoring.wrench(10.0, 0.0, (0.0, 0.0, 1.0), 1.0, H, STATIONS)
    assert force == pytest.approx((0, 0, -H.weight_n, 0, 0, 0), rel=1e-12, abs=1e-9)


def test_low_centre_of_mass_rights_pitch_and_roll() -> None:
    angle = 0.1
    *_, roll, _, _ = submerged((0.0, np.sin(angle), np.cos(angle)))
    *_, pitch, _ = submerged((-np.sin(angle), 0.0, np.cos(angle)))
    righting = H.weight_n * H.z_cm_m * np.sin(angle)
    assert (roll, pitch) == pytest.approx((righting, righting), rel=1e-12)


@given(st.floats(-1.5, 1.5), st.floats(-1.2, 1.2))
def test_surface_forces_have_a_potential(z: float, pitch: float) -> None:
    """Pitch moment and heave force derive from one potential: cross derivatives are equal."""

    def heave_and_pitch(z: float, pitch: float) -> tuple[float, float]:
        up = (-np.sin(pitch), 0.0, np.cos(pitch))
        X, _, Z, _, M, _ = restoring.wrench(z, up[0], up, 1.0, H, STATIONS)
        return X * up[0] + Z * up[2], M

    h = 1e-5
    dM_dz = (heave_and_pitch(z + h, pitch)[1] - heave_and_pitch(z - h, pitch)[1]) / (2 * h)
    dZ_dpitch = (heave_and_pitch(z, pitch + h)[0] - heave_and_pitch(z, pitch - h)[0]) / (2 * h)
    assert dM_dz == pytest.approx(dZ_dpitch, abs=2.0)


@pytest.mark.parametrize("thrust", [0.0, 0.58, 1.0])
@pytest.mark.parametrize("elevator", [0.0, 0.2])
def test_surfaced_vehicle_floats(thrust: float, elevator: float) -> None:
    track = flight.fly(
        MODEL,
        dynamics.state_at_rest(-3.0),
        300.0,
        elevator_rad=elevator,
        thrust_fraction=thrust,
    )
    assert np.isfinite(track).all()
    assert track[:, 2].max() < 1.0
    if thrust == 0.0:
        early, late = track[12000:24000, 2], track[-12000:, 2]
        assert np.ptp(late) < 0.5 * np.ptp(early)
        assert (-H.radius_m < late).all()
        assert (late < 0.0).all()


@pytest.mark.parametrize(
    ("z", "fraction"), [(-1.0, 1.0), (-0.3, 1.0), (0.0, 0.5), (0.3, 0.0), (5.0, 0.0)]
)
def test_immersion_of_circular_section(z: float, fraction: float) -> None:
    assert restoring.immersion(z, 0.3) == fraction
