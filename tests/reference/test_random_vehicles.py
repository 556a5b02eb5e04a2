"""Properties of all vehicles: with ring duct or fins, of any feasible size, ballast and shape.

The vehicles are those of ``tests/reference/vehicles.py``; hypothesis draws one, and how it moves.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sitl.vehicle import dynamics, forces
from sitl.vehicle.linearise import linearise
from sitl.vehicle.model import VehicleModel
from sitl.vehicle.vectors import Vector, Vector3
from sitl.vehicle.water import drifting
from tests.reference import energy, fossen
from tests.reference.cases.symmetry import MIRROR, MIRROR_WRENCH
from tests.reference.vehicles import random_vehicles
from tests.sitl.vehicle import flight

VEHICLE = random_vehicles()
SPEED = st.floats(-3, 3)
RATE = st.floats(-2, 2)
ANGLE = st.floats(-0.3, 0.3)
THRUST = st.floats(-1, 1)
MOTION = st.tuples(SPEED, SPEED, SPEED, RATE, RATE, RATE).map(np.array)
ATTITUDE = (
    st.tuples(*[st.floats(-1, 1)] * 4).map(np.array).filter(lambda q: np.linalg.norm(q) > 0.1)
)
any_vehicle = settings(max_examples=100)
flown = settings(max_examples=20)


def state_of(attitude: Vector, motion: Vector, z_up_m: float = -500.0) -> Vector:
    state = dynamics.state_at_rest(z_up_m)
    state[3:7], state[7:13] = attitude / np.linalg.norm(attitude), motion
    return state


@given(VEHICLE)
@any_vehicle
def test_mass_matrices_symmetric_and_positive_definite(model: VehicleModel) -> None:
    for matrix in (model.inertia.M_RB, model.inertia.M):
        assert np.array_equal(matrix, matrix.T)
        assert np.linalg.eigvalsh(matrix).min() > 0
    assert model.inertia.M @ model.inertia.M_inverse == pytest.approx(np.eye(6), abs=1e-9)


@given(VEHICLE, MOTION)
@any_vehicle
def test_coriolis_terms_have_zero_power(model: VehicleModel, nu: Vector) -> None:
    terms = np.multiply(forces.coriolis(tuple(nu.tolist()), model.inertia), nu)
    assert abs(terms.sum()) <= 1e-14 * max(np.abs(terms).sum(), 1.0)


@given(VEHICLE, MOTION)
@settings(max_examples=200)
def test_still_water_power_is_never_positive(model: VehicleModel, nu: Vector) -> None:
    assert energy.power_w(model, nu) <= 1e-12 * energy.power_scale_w(model, nu)


@given(VEHICLE, ATTITUDE, MOTION)
@settings(max_examples=30)
def test_free_motion_energy_never_increases(
    model: VehicleModel, attitude: Vector, motion: Vector
) -> None:
    """In still water without thrust, mechanical energy decreases in every step."""
    kept = energy.mechanical_j(model, flight.fly(model, state_of(attitude, motion), 30.0)[::10])
    moved = np.abs(kept).max() + energy.kinetic_j(model, state_of(attitude, motion)) + 1e-9
    assert np.diff(kept).max() <= 1e-10 * moved


@given(VEHICLE, ATTITUDE, MOTION, ANGLE, ANGLE, THRUST)
@flown
def test_mirrored_inputs_give_mirrored_track(
    model: VehicleModel,
    attitude: Vector,
    motion: Vector,
    rudder: float,
    elevator: float,
    thrust: float,
) -> None:
    start, push = state_of(attitude, motion), np.array([3.0, -5.0, 2.0, 0.1, -0.6, 0.7])
    inputs = {"elevator_rad": elevator, "thrust_fraction": thrust}
    track = flight.fly(
        model, start, 5.0, rudder, disturbance=push, water=drifting((0.3, -0.2, 0.05)), **inputs
    )
    mirrored = flight.fly(
        model,
        start * MIRROR,
        5.0,
        -rudder,
        disturbance=push * MIRROR_WRENCH,
        water=drifting((0.3, 0.2, 0.05)),
        **inputs,
    )
    assert mirrored == pytest.approx(track * MIRROR, rel=1e-9, abs=1e-9), (
        "fins are summed in another order"
    )


@given(VEHICLE, ATTITUDE, MOTION, ANGLE, THRUST, st.tuples(*[st.floats(-1, 1)] * 3))
@flown
def test_uniform_current_only_adds_drift(
    model: VehicleModel,
    attitude: Vector,
    motion: Vector,
    rudder: float,
    thrust: float,
    current: Vector3,
) -> None:
    start = state_of(attitude, motion)
    still = flight.fly(model, start, 10.0, rudder, thrust_fraction=thrust)
    carried = start.copy()
    carried[7:10] += flight.rotation(start).T @ current
    moving = flight.fly(
        model, carried, 10.0, rudder, thrust_fraction=thrust, water=drifting(current)
    )
    assert moving[-1, 3:7] == pytest.approx(still[-1, 3:7], abs=1e-7)
    assert moving[-1, :3] - 10.0 * np.array(current) == pytest.approx(still[-1, :3], abs=1e-6)


@given(VEHICLE, ATTITUDE, MOTION, ANGLE, ANGLE, THRUST, st.tuples(*[st.floats(-1, 1)] * 3))
@any_vehicle
def test_accelerations_equal_fossen_matrix_form(
    model: VehicleModel,
    attitude: Vector,
    motion: Vector,
    rudder: float,
    elevator: float,
    thrust: float,
    current: Vector3,
) -> None:
    state, shaft_rps = state_of(attitude, motion), thrust * model.propeller.full_rps
    found = (
        fossen.FLIP
        @ flight.rate(model, state, rudder, elevator, shaft_rps, water=drifting(current))[7:]
    )
    eta_nu, inputs = fossen.from_state(state), fossen.Inputs(rudder, elevator, shaft_rps)
    if abs(np.cos(eta_nu[4])) > 1e-3:  # Euler angles end where the nose points straight up
        expected = fossen.rates(eta_nu, inputs, fossen.craft(model), fossen.TURN @ current)[6:]
        assert found == pytest.approx(expected, rel=1e-9, abs=1e-9)


@given(VEHICLE, st.floats(-3, 2), ATTITUDE, MOTION, ANGLE, ANGLE, THRUST)
@flown
def test_random_states_stay_bounded(
    model: VehicleModel,
    z_up_m: float,
    attitude: Vector,
    motion: Vector,
    rudder: float,
    elevator: float,
    thrust: float,
) -> None:
    """States at the surface are included."""
    track = flight.fly(model, state_of(attitude, motion, z_up_m), 30.0, rudder, elevator, thrust)
    assert np.isfinite(track).all()
    assert np.linalg.norm(track[:, 3:7], axis=1) == pytest.approx(1.0, abs=1e-12)
    assert np.linalg.norm(track[-1, 7:10]) < 15


@given(VEHICLE, st.floats(0.5, 2.0))
@flown
def test_symmetric_vehicle_runs_straight(model: VehicleModel, u_mps: float) -> None:
    track = flight.fly(model, flight.cruising(u_mps), 60.0, thrust_fraction=0.6)
    assert track[:, [1, 4, 6, 8, 10, 12]] == pytest.approx(0.0, abs=1e-9)


@given(VEHICLE, st.floats(0.5, 2.0))
@flown
def test_small_motion_forces_equal_linear_plane(model: VehicleModel, u_mps: float) -> None:
    plane = linearise(model, u_mps, thrust_fraction=0.0).yaw
    rudder, v, r = 1e-7, 3e-7, -2e-7
    ahead, state = flight.cruising(u_mps), flight.cruising(u_mps)
    state[8], state[12] = v, r
    found = (
        model.inertia.M
        @ (flight.rate(model, state, rudder_rad=rudder) - flight.rate(model, ahead))[7:13]
    )
    expected = plane.F[:2] @ [v, r, 0.0] + plane.G[:2, 0] * rudder
    assert found[[1, 5]] == pytest.approx(expected, rel=1e-4, abs=1e-9)
