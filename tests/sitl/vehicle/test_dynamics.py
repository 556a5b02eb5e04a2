"""Equations of motion: signs, trim, symmetry, current, stability of the integration."""

from collections.abc import Iterable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import fsolve

from sitl.vehicle import dynamics
from sitl.vehicle.model import VehicleModel
from sitl.vehicle.vectors import Vector, Vector3
from sitl.vehicle.water import drifting
from tests.sitl.vehicle import flight

FIVE_DEG = np.radians(5)
MIRROR = np.array([1, -1, 1, 1, -1, 1, -1, 1, -1, 1, -1, 1, -1])
"""Signs of the state's reflection in the vertical plane through north: port becomes starboard."""


@pytest.fixture(params=flight.SHIPPED)
def model(request: pytest.FixtureRequest) -> VehicleModel:
    return flight.model(request.param)


def heading_rad(track: Vector) -> Vector:
    """Return the heading clockwise from north; yaw in NWU is positive to port."""
    w, x, y, z = track[:, 3:7].T
    return np.asarray(-np.unwrap(np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))))


def nose_up_rad(state: Vector) -> float:
    return float(np.arcsin(flight.rotation(state)[2, 0]))


def test_positive_rudder_turns_to_starboard(model: VehicleModel) -> None:
    track = flight.fly(model, flight.cruising(), 10.0, rudder_rad=FIVE_DEG, thrust_fraction=0.58)
    assert np.degrees(heading_rad(track)[-1]) > 10
    assert track[-1, 1] < -1.0


def test_positive_elevator_raises_nose_and_climbs(model: VehicleModel) -> None:
    track = flight.fly(model, flight.cruising(), 10.0, elevator_rad=FIVE_DEG, thrust_fraction=0.58)
    assert np.degrees(nose_up_rad(track[-1])) > 5
    assert track[-1, 2] > track[0, 2] + 0.3


def level_trim(model: VehicleModel, thrust_fraction: float) -> tuple[Vector, float]:
    """Return state and elevator of steady level motion, by root search on the full equations."""

    def state_of(u: float, theta: float) -> Vector:
        state = flight.cruising()
        state[3], state[5] = np.cos(theta / 2), np.sin(theta / 2)
        state[7], state[9] = u, u * np.tan(theta)
        return state

    def residual(unknown: Iterable[float]) -> Vector:
        u, theta, elevator = unknown
        shaft_rps = thrust_fraction * model.propeller.full_rps
        out = flight.rate(model, state_of(u, theta), elevator_rad=elevator, shaft_rps=shaft_rps)
        return out[[7, 9, 11]]

    u, theta, elevator = fsolve(residual, [1.3, 0.03, 0.01], xtol=1e-12)
    assert residual([u, theta, elevator]) == pytest.approx([0, 0, 0], abs=1e-9)
    return state_of(u, theta), elevator


def test_58_percent_thrust_gives_level_1_3_mps(model: VehicleModel) -> None:
    state, elevator = level_trim(model, 0.58)
    velocity = flight.rotation(state) @ state[7:10]
    assert np.linalg.norm(velocity) == pytest.approx(1.30, rel=0.01)
    assert velocity[2] == pytest.approx(0.0, abs=1e-9)
    assert nose_up_rad(state) < 0, "the net buoyancy is held down by flying nose down"
    assert abs(np.degrees(elevator)) < 3


def test_level_trim_is_steady_in_time(model: VehicleModel) -> None:
    state, elevator = level_trim(model, 0.58)
    track = flight.fly(model, state, 30.0, elevator_rad=elevator, thrust_fraction=0.58)
    assert track[-1, 2] == pytest.approx(state[2], abs=1e-3)
    assert track[-1, 7:13] == pytest.approx(state[7:13], abs=1e-4)


def test_mirrored_manoeuvre_gives_mirrored_track_to_the_bit(model: VehicleModel) -> None:
    start = flight.tumbling(-50.0)
    push = np.array([3.0, -5.0, 2.0, 4.0, -6.0, 7.0])
    inputs = {"elevator_rad": 0.1, "thrust_fraction": 0.8}
    track = flight.fly(
        model,
        start,
        60.0,
        rudder_rad=0.2,
        disturbance=push,
        water=drifting((0.3, -0.2, 0.05)),
        **inputs,
    )
    mirrored = flight.fly(
        model,
        start * MIRROR,
        60.0,
        rudder_rad=-0.2,
        disturbance=push * [1, -1, 1, -1, 1, -1],
        water=drifting((0.3, 0.2, 0.05)),
        **inputs,
    )
    assert np.array_equal(mirrored, track * MIRROR)


def test_straight_run_stays_in_vertical_plane(model: VehicleModel) -> None:
    track = flight.fly(model, flight.cruising(), 600.0, thrust_fraction=0.58)
    assert not track[:, [1, 4, 6, 8, 10, 12]].any()


def test_yaw_and_pitch_forces_equal_after_rotation_about_x() -> None:
    """A rotation of velocity and duct by 90 degrees about x rotates the force, without weight."""
    model = flight.balanced(flight.model("caribou_nominal"))
    yawing, pitching = flight.cruising(), flight.cruising()
    yawing[[8, 12]] = 0.3, 0.2
    pitching[[9, 11]] = 0.3, -0.2
    in_yaw = flight.rate(model, yawing, rudder_rad=0.1, shaft_rps=3.7)[7:]
    in_pitch = flight.rate(model, pitching, elevator_rad=-0.1, shaft_rps=3.7)[7:]
    assert in_pitch == pytest.approx(
        [in_yaw[0], 0, in_yaw[1], 0, -in_yaw[5], 0], rel=1e-12, abs=1e-15
    )


@given(st.tuples(*[st.floats(-1, 1)] * 3))
@settings(max_examples=20)
def test_uniform_current_only_adds_drift(current: Vector3) -> None:
    model, start = flight.model("caribou_truth"), flight.tumbling(-500.0)
    inputs = flight.Inputs(rudder_rad=0.1, elevator_rad=-0.05, thrust_fraction=0.6)
    still = flight.fly(model, start, 20.0, **inputs)
    carried = start.copy()
    carried[7:10] += flight.rotation(start).T @ np.array(current)
    moving = flight.fly(model, carried, 20.0, water=drifting(current), **inputs)
    assert moving[-1, 3:7] == pytest.approx(still[-1, 3:7], abs=1e-8)
    drift = 20.0 * np.array(current)
    assert moving[-1, 0:3] - still[-1, 0:3] == pytest.approx(drift, abs=1e-7)


Motion = tuple[float, tuple[float, float, float, float], Vector3, Vector3]
"""Height, quaternion, velocity and rates."""
STATE = st.tuples(
    st.floats(-5, 1),
    st.tuples(*[st.floats(-1, 1)] * 4),
    st.tuples(*[st.floats(-4, 4)] * 3),
    st.tuples(*[st.floats(-2, 2)] * 3),
)


@given(
    STATE,
    st.floats(-0.3, 0.3),
    st.floats(-0.3, 0.3),
    st.floats(-1, 1),
    st.sampled_from(flight.SHIPPED),
)
@settings(max_examples=60)
def test_random_states_stay_bounded(
    start: Motion, rudder: float, elevator: float, thrust: float, name: str
) -> None:
    z, quaternion, velocity, rates = start
    state = dynamics.state_at_rest(z)
    if np.linalg.norm(quaternion) > 0.1:
        state[3:7] = np.array(quaternion) / np.linalg.norm(quaternion)
    state[7:10], state[10:13] = velocity, rates
    track = flight.fly(flight.model(name), state, 60.0, rudder, elevator, thrust)
    assert np.isfinite(track).all()
    assert np.linalg.norm(track[:, 7:10], axis=1).max() < 12
    assert np.linalg.norm(track[-1, 7:10]) < 4
    assert np.linalg.norm(track[:, 3:7], axis=1) == pytest.approx(1.0, abs=1e-12)


def test_specific_force_at_rest_is_upward_gravity(model: VehicleModel) -> None:
    state = flight.tumbling()
    state[7:13] = 0.0
    held = np.zeros(dynamics.STATE_SIZE)
    assert dynamics.specific_force(state, held, model) == pytest.approx(
        9.80665 * flight.rotation(state)[2], rel=1e-12
    )


def test_specific_force_is_acceleration_minus_gravity(model: VehicleModel) -> None:
    """Reference: second difference of position in a manoeuvre."""
    dt = 1e-3
    track = flight.fly(
        model, flight.tumbling(-50.0), 1.0, rudder_rad=0.1, thrust_fraction=0.5, dt_s=dt
    )
    i = 500
    acceleration = (track[i + 1, 0:3] - 2 * track[i, 0:3] + track[i - 1, 0:3]) / dt**2
    expected = flight.rotation(track[i]).T @ (acceleration + np.array([0, 0, 9.80665]))
    rate = flight.rate(model, track[i], rudder_rad=0.1, shaft_rps=0.5 * model.propeller.full_rps)
    assert dynamics.specific_force(track[i], rate, model) == pytest.approx(expected, abs=1e-5)
