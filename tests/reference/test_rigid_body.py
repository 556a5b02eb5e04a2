"""The equations of motion against independent ones.

Verifies: rigid-body terms with an offset centre of mass and a full inertia tensor, against the paper's six scalar
equations; a torque-free tumble, against Euler's equations integrated by scipy; momenta; the integrator's order. Leaves
out: fluid forces, switched off but in the last.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from tests.sitl.vehicle import flight

MASS = 640.0
CM = np.array([0.12, -0.07, -0.05])
INERTIA = np.array([[42.0, 3.0, -5.0], [3.0, 480.0, 7.0], [-5.0, 7.0, 510.0]])
"""About the origin, off-diagonal elements as tensor elements: I_xy = -int x y dm."""


def rigid_body(cm=CM, inertia=INERTIA):
    """A model of nothing but a rigid body in empty space."""
    x, y, z = cm
    M = np.zeros((6, 6))
    M[:3, :3] = MASS * np.eye(3)
    M[:3, 3:] = MASS * np.array([[0, z, -y], [-z, 0, x], [y, -x, 0]])
    M[3:, :3] = M[:3, 3:].T
    M[3:, 3:] = inertia
    model = flight.without_weight(flight.without_fluid_forces(flight.model("bench")))
    return model._replace(
        inertia=model.inertia._replace(mass_kg=MASS, M_RB=M, M_A=0 * M, M=M, M_inverse=np.linalg.inv(M))
    )


def paper_equations(nu, rates):
    """X, Y, Z, K, M, N as the paper prints them under "Overall Vehicle Modeling"."""
    (u, v, w, p, q, r), (du, dv, dw, dp, dq, dr), m = nu, rates, MASS
    x, y, z = CM
    (Ixx, Ixy, Ixz), (Iyx, Iyy, Iyz), (Izx, Izy, Izz) = INERTIA
    return [
        m * (du + q * w - r * v + dq * z - dr * y + (q * y + r * z) * p - (q**2 + r**2) * x),
        m * (dv + r * u - p * w + dr * x - dp * z + (r * z + p * x) * q - (r**2 + p**2) * y),
        m * (dw + p * v - q * u + dp * y - dq * x + (p * x + q * y) * r - (p**2 + q**2) * z),
        Ixx * dp + Ixy * dq + Ixz * dr + (Izz - Iyy) * r * q + Iyz * (q**2 - r**2) + Ixz * p * q - Ixy * p * r
        + m * (y * (dw + p * v - q * u) - z * (dv + r * u - p * w)),
        Iyx * dp + Iyy * dq + Iyz * dr + (Ixx - Izz) * p * r + Ixz * (r**2 - p**2) + Ixy * q * r - Iyz * q * p
        + m * (z * (du + q * w - r * v) - x * (dw + p * v - q * u)),
        Izx * dp + Izy * dq + Izz * dr + (Iyy - Ixx) * p * q + Ixy * (p**2 - q**2) + Iyz * p * r - Ixz * q * r
        + m * (x * (dv + r * u - p * w) - y * (du + q * w - r * v)),
    ]  # fmt: skip


@given(st.tuples(*[st.floats(-2, 2)] * 6), st.tuples(*[st.floats(-300, 300)] * 6))
@settings(deadline=None)
def test_accelerations_satisfy_the_papers_equations(nu, wrench):
    state = flight.cruising()
    state[7:13] = nu
    rates = flight.rate(rigid_body(), state, disturbance=np.array(wrench))[7:13]
    assert paper_equations(nu, rates) == pytest.approx(wrench, rel=1e-9, abs=1e-7)


def test_a_torque_free_tumble_is_eulers():
    inertia = np.diag([40.0, 480.0, 510.0])
    model = rigid_body(cm=np.zeros(3), inertia=inertia)
    state = flight.cruising(0.0)
    state[10:13] = 0.8, 0.5, -0.3
    track = flight.fly(model, state, 60.0)
    euler = solve_ivp(
        lambda _, omega: np.linalg.solve(inertia, -np.cross(omega, inertia @ omega)),
        (0, 60), state[10:13], method="DOP853", rtol=1e-12, atol=1e-13,
    )  # fmt: skip
    assert track[-1, 10:13] == pytest.approx(euler.y[:, -1], abs=1e-8)
    momentum = np.array([flight.rotation(s) @ inertia @ s[10:13] for s in track[::1000]])
    assert momentum == pytest.approx(np.broadcast_to(momentum[0], momentum.shape), abs=1e-6)


def test_a_body_without_forces_keeps_its_momenta():
    """Offset centre of mass: linear and angular momentum about a fixed point, both constant in the inertial frame."""
    model, start = rigid_body(), flight.tumbling()

    def momenta(state):
        R, momentum = flight.rotation(state), model.inertia.M @ state[7:13]
        linear = R @ momentum[:3]
        return np.concatenate([linear, R @ momentum[3:] + np.cross(state[0:3] - start[0:3], linear)])

    track = flight.fly(model, start, 60.0, dt_s=0.002)
    assert momenta(track[-1]) == pytest.approx(momenta(track[0]), abs=1e-5)


def test_the_integrator_is_of_fourth_order():
    """Halving the step divides the error by sixteen, every force on, where none of them has a kink.

    Drag in |v| v and stall have one; so the motion keeps the sign of each speed and stays below stall.
    """
    model, start, seconds = flight.model("bench"), flight.cruising(), 0.5
    start[7:13] = 1.3, 0.2, 0.15, 0.4, 0.02, -0.02
    steps = [seconds / n for n in (4, 8, 16, 1024)]
    ends = [flight.fly(model, start, seconds, 0.1, 0.05, 0.6, dt_s=dt)[-1] for dt in steps]
    errors = [np.linalg.norm(end - ends[-1]) for end in ends[:-1]]
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    assert orders == pytest.approx([4.0, 4.0], abs=0.3)
