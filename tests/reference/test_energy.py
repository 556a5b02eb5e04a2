"""What the equations of motion must conserve.

Verifies: mechanical energy of body and entrained water; that Coriolis terms do no work; the Munk moment; that fluid
forces only take energy away. Tolerance: 1e-6 of the initial energy over 100 s.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sitl.vehicle import dynamics
from tests.sitl.vehicle import flight

SPEEDS = st.tuples(*[st.floats(-3, 3)] * 6)


def kinetic_j(model, state):
    return state[7:13] @ model.inertia.M @ state[7:13] / 2


def potential_j(model, state):
    h = model.hydrostatics
    up = flight.rotation(state)[2]
    cm = state[2] + up @ [h.x_cm_m, h.y_cm_m, h.z_cm_m]
    cb = state[2] + up @ [h.x_cb_m, 0.0, h.z_cb_m]
    return h.weight_n * cm - h.buoyancy_n * cb


@pytest.mark.parametrize("name", flight.SHIPPED)
def test_energy_is_conserved_without_damping_and_thrust(name):
    model = flight.without_fluid_forces(flight.model(name))
    start = flight.tumbling()
    track = flight.fly(model, start, 100.0)
    energy = np.array([kinetic_j(model, s) + potential_j(model, s) - potential_j(model, start) for s in track[::100]])
    assert energy == pytest.approx(np.full_like(energy, kinetic_j(model, start)), rel=1e-6)
    assert np.ptp([kinetic_j(model, s) for s in track[::100]]) > 10, "energy has moved between its forms"


@given(SPEEDS)
@settings(deadline=None)
def test_coriolis_terms_do_no_work(nu):
    wrench = dynamics.coriolis(nu, flight.model("field").inertia)
    scale = np.abs(np.multiply(wrench, nu)).sum()
    assert abs(np.dot(wrench, nu)) <= 1e-14 * max(scale, 1.0)


@given(st.floats(0.5, 3), st.floats(-1, 1))
@settings(deadline=None)
def test_the_munk_moment_is_the_analytic_one(u, v):
    """(Y_vdot - X_udot) u v on a drifting body in inviscid flow (Newman 1977, ch. 4)."""
    inertia = flight.model("bench").inertia
    *_, N = dynamics.coriolis((u, v, 0.0, 0.0, 0.0, 0.0), inertia)
    assert pytest.approx(-(inertia.M_A[1, 1] - inertia.M_A[0, 0]) * u * v, rel=1e-9, abs=1e-9) == N


@given(SPEEDS, st.sampled_from(flight.SHIPPED))
@settings(deadline=None, max_examples=300)
def test_fluid_forces_take_energy_away(nu, name):
    """Rate of change of kinetic energy with weight, buoyancy and thrust off, duct amidships."""
    model = flight.without_weight(flight.model(name))
    state = flight.cruising()
    state[7:13] = nu
    rates = flight.rate(model, state)[7:13]
    power = nu @ model.inertia.M @ rates
    assert power <= 1e-9
