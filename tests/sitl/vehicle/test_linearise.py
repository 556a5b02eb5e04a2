"""Linear planes: structure, dependence on speed, and agreement with small nonlinear motion."""

import control
import numpy as np
import pytest

from sitl.vehicle.linearise import linearise
from sitl.vehicle.model import VehicleModel
from tests.sitl.vehicle import flight


@pytest.fixture(params=flight.SHIPPED)
def model(request: pytest.FixtureRequest) -> VehicleModel:
    return flight.model(request.param)


def test_small_rudder_steps_follow_linear_plane(model: VehicleModel) -> None:
    plane = linearise(model).yaw
    rudder, seconds = 1e-6, 20.0
    track = flight.fly(
        flight.balanced(model), flight.cruising(), seconds, rudder_rad=rudder, thrust_fraction=0.58
    )
    system = control.ss(plane.A, plane.B, np.eye(3), 0)
    time = np.linspace(0, seconds, len(track))
    linear = np.asarray(control.step_response(system, time).states)[:, 0] * rudder
    assert track[:, 12] == pytest.approx(linear[1], abs=1e-4 * np.abs(linear[1]).max())
    assert track[:, 8] == pytest.approx(linear[0], abs=1e-4 * np.abs(linear[0]).max())


def test_duct_scales_with_pressure_and_hull_with_speed(model: VehicleModel) -> None:
    slow, fast = (linearise(model, u).coefficients for u in (1.0, 2.0))
    assert fast["Y_dr_nprad"] == pytest.approx(4 * slow["Y_dr_nprad"], rel=0.1)
    assert fast["Y_v_kgps"] == pytest.approx(2 * slow["Y_v_kgps"], rel=1e-6)
    assert fast["z_CM_m"] == pytest.approx(slow["z_CM_m"], rel=1e-6)


def test_balanced_thrust_at_operating_point_is_58_percent(model: VehicleModel) -> None:
    balanced, commanded = linearise(model, 1.3), linearise(model, 1.3, thrust_fraction=0.58)
    assert balanced.coefficients == pytest.approx(commanded.coefficients, rel=1e-9)


def test_linear_plane_integrates_depth_and_attitude(model: VehicleModel) -> None:
    pitch = linearise(model, 1.3).pitch
    assert pitch.A[2].tolist() == [0, 1, 0, 0]
    assert pitch.A[3].tolist() == [-1, 0, 1.3, 0]
    assert linearise(model).yaw.A[2].tolist() == [0, 1, 0]


@pytest.mark.parametrize(
    ("name", "yaw", "pitch"),
    [("caribou_nominal", -447 / 927, -447 / 927), ("caribou_truth", -0.51, -0.46)],
)
def test_step_gives_measured_initial_acceleration(name: str, yaw: float, pitch: float) -> None:
    """The paper measured -0.51 and -0.46 rad/s2 per rad, printed to two digits."""
    planes = linearise(flight.model(name))
    assert planes.yaw.B[1, 0] == pytest.approx(yaw, abs=0.005)
    assert planes.pitch.B[1, 0] == pytest.approx(pitch, abs=0.005)
