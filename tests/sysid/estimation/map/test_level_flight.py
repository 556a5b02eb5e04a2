"""Level flight and its linearisation; references: equations of motion, linear coefficients."""

import math

import msgspec
import numpy as np
import pytest

from sitl.vehicle import config
from sysid.estimation.map.steady_state import level_flight, linear_plane, straight_plane
from sysid.models import greybox, parameters
from sysid.models.parameters import NAMES, PARAMETERS, CandidateVehicle
from sysid.planes import PLANES, Plane

UNBIASED = dict.fromkeys(PLANES, 0.0)


def candidate(vehicle: config.VehicleConfig, **z: float) -> CandidateVehicle:
    """Return a vehicle with some parameters changed, in prior standard deviations."""
    return parameters.candidate_vehicle(
        vehicle, UNBIASED, np.array([z.get(name, 0.0) for name in NAMES])
    )


def test_level_flight_has_no_acceleration_and_no_climb(bench: config.VehicleConfig) -> None:
    vehicle = candidate(bench)
    flight = level_flight(vehicle)
    state = np.array([flight.speed_mps, flight.heave_mps, 0.0, flight.pitch_rad, -50.0])
    rps = 0.58 * vehicle.model.propeller.full_rps
    slopes = greybox.accelerations(vehicle.model, Plane.PITCH, state, flight.elevator_rad, rps)
    np.testing.assert_allclose(slopes, 0.0, atol=1e-9)
    assert flight.heave_mps == pytest.approx(flight.speed_mps * math.tan(flight.pitch_rad))


def test_buoyancy_adds_crossflow_damping(bench: config.VehicleConfig) -> None:
    """To first order 2 c |w| in heave and c |w| in sway, c the sum of the strips, N s2/m2."""
    vehicle = candidate(bench)
    w = abs(level_flight(vehicle).heave_mps)
    c = float(np.sum(vehicle.model.stations.drag_kgpm))
    for plane, times, mass_kg in ((Plane.YAW, 1.0, 1272.0), (Plane.PITCH, 2.0, 1272.0)):
        added = linear_plane(vehicle, plane).A[0, 0] - straight_plane(vehicle, plane).A[0, 0]
        assert added == pytest.approx(-times * c * w / mass_kg, rel=0.1)


@pytest.mark.parametrize("plane", list(Plane))
def test_neutral_vehicle_has_the_straight_plane(bench: config.VehicleConfig, plane: Plane) -> None:
    """The tolerance is that of the gyroscopic terms of the righting moment (0.5 %)."""
    neutral = msgspec.structs.replace(
        bench, ballast=msgspec.structs.replace(bench.ballast, net_buoyancy_n=0.0)
    )
    vehicle = candidate(neutral)
    level, straight = linear_plane(vehicle, plane), straight_plane(vehicle, plane)
    np.testing.assert_allclose(level.A, straight.A, rtol=5e-3, atol=5e-4)
    np.testing.assert_allclose(level.B, straight.B, rtol=5e-3, atol=5e-4)


def test_crossflow_slope_moves_the_drag_aft(bench: config.VehicleConfig) -> None:
    slope = -0.4
    sd = PARAMETERS[NAMES.index("crossflow_slope")].prior_sd
    before = candidate(bench).model.stations
    after = candidate(bench, crossflow_slope=slope / sd).model.stations
    xi = before.x_m / np.max(np.abs(before.x_m))
    np.testing.assert_allclose(after.drag_kgpm, before.drag_kgpm * (1.0 + slope * xi))
