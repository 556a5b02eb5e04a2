"""LQG against independent methods.

Closed forms, python-control, the separation principle, a Lyapunov equation and simulation in time.
"""

import math

import control
import msgspec
import numpy as np
import pytest
from scipy.linalg import block_diag, expm, solve_continuous_lyapunov

from mavlink_io.tick import TICK_S
from sysid.control_analysis import loop_state_space, loop_transfer
from sysid.control_analysis.loop_transfer import Lag
from sysid.control_analysis.margins import Planes
from sysid.design import lqg as optimal
from sysid.design.design_model import DEFAULT_DISTURBANCE, DesignModel, build, outputs
from sysid.design.lqg import controller as lqg_controller
from sysid.design.lqg import loop_analysis, synthesis, weights
from sysid.design.lqg.controller import ContinuousController
from sysid.design.lqg.synthesis import AugmentedModel
from sysid.design.specification import DesignInfeasibleError
from sysid.models import noise
from sysid.models.linear_planes import linear_plane, pitch_plane, yaw_plane
from sysid.models.model_file import IdentifiedModel
from sysid.planes import PLANES, Plane
from sysid.reproduction.paper_tables import TABLE_1_ADJUSTED, TABLE_1_INITIAL

LAG = Lag(0.33)
WEIGHTS = {"yaw": weights.HEADING_STARTS[0], "pitch": weights.DEPTH_STARTS[0]}
SEA = noise.from_model(DEFAULT_DISTURBANCE)


@pytest.fixture(scope="module")
def vehicle() -> DesignModel:
    planes = Planes(yaw_plane(TABLE_1_ADJUSTED), pitch_plane(TABLE_1_ADJUSTED))
    return build(planes, LAG, LAG, dict.fromkeys(PLANES, DEFAULT_DISTURBANCE))


def designed(vehicle: DesignModel, plane: Plane) -> tuple[AugmentedModel, ContinuousController]:
    linear = vehicle.planes[PLANES[plane].index]
    return synthesis.build_model(linear, LAG, SEA, WEIGHTS[plane]), synthesis.controller(
        linear, LAG, SEA, WEIGHTS[plane]
    )


def test_feedback_double_integrator_equals_closed_form() -> None:
    """r' = u + load, psi' = r: F = -(sqrt(2/rho), 1/rho), and the load is subtracted."""
    A = np.array([[-1.0, 0, 0, 0], [0, 0, 0, 1], [0, 1, 0, 0], [0, 0, 0, 0]])
    model = AugmentedModel(
        A, np.array([0.0, 1, 0, 0]), np.zeros((2, 4)), np.zeros((4, 4)), np.eye(2), load=3
    )
    rho = 0.3
    F = synthesis.feedback(model, WEIGHTS["yaw"]._replace(effort=rho, rate_s=0.0))
    assert pytest.approx([0.0, -math.sqrt(2.0 / rho), -1.0 / rho, -1.0]) == F


def test_filter_gains_random_walk_equal_closed_form() -> None:
    """x' = w, y = x + v: L = sqrt(q/r)."""
    one = np.eye(1)
    assert synthesis.filter_gains(
        AugmentedModel(0.0 * one, one[0], one, 0.02 * one, 0.5 * one, load=1)
    ) == pytest.approx(0.2)


@pytest.mark.parametrize("plane", Plane)
def test_gains_equal_those_of_python_control(vehicle: DesignModel, plane: Plane) -> None:
    model, controller = designed(vehicle, plane)
    K, _, _ = control.lqr(
        model.A[: model.load, : model.load], model.B[: model.load, None], *weighted(model, plane)
    )
    assert np.allclose(-K[0], controller.F[: model.load], rtol=1e-6, atol=1e-9)
    L, _, _ = control.lqe(model.A, np.eye(len(model.A)), model.C, model.process, model.measurement)
    assert np.allclose(L, controller.L, rtol=1e-5, atol=1e-7)


def weighted(model: AugmentedModel, plane: Plane) -> tuple[np.ndarray, np.ndarray]:
    w = WEIGHTS[plane]
    held = {
        Plane.YAW: [0.0, w.rate_s, 1.0],
        Plane.PITCH: [0.0, w.rate_s, w.pitch, 1.0],
    }[plane]
    return np.diag(np.square(held + [0.0] * (model.load - len(held)))), np.array([[w.effort**2]])


@pytest.mark.parametrize("plane", Plane)
def test_closed_loop_poles_are_those_of_filter_and_feedback(
    vehicle: DesignModel, plane: Plane
) -> None:
    """Separation principle; the constant loads are not affected by feedback."""
    model, controller = designed(vehicle, plane)
    closed = lqg_controller.close(controller, model.A, model.B, model.C).A
    apart = block_diag(model.A + np.outer(model.B, controller.F), controller.A)
    computed, expected = (np.linalg.eigvals(block) for block in (closed, apart))
    for pole in expected:
        assert np.min(np.abs(computed - pole)) < 1e-4 * max(1.0, abs(pole))


@pytest.mark.parametrize("plane", Plane)
def test_response_equals_that_of_python_control(vehicle: DesignModel, plane: Plane) -> None:
    _, controller = designed(vehicle, plane)
    frequencies = np.geomspace(0.01, 50.0, 30)
    system = control.ss(controller.closed, controller.L, controller.F[None, :], 0)
    assert np.allclose(
        lqg_controller.response(controller, frequencies), system(1j * frequencies)[0].T, rtol=1e-6
    )


@pytest.mark.parametrize("plane", Plane)
def test_tick_controller_response_equals_continuous_one(vehicle: DesignModel, plane: Plane) -> None:
    """Gain within 1 % and phase within one degree up to three times the crossover frequency."""
    _, controller = designed(vehicle, plane)
    linear = vehicle.planes[PLANES[plane].index]
    ticked, frequencies = optimal.tick_controllers(controller, linear), np.array([0.1, 0.9, 2.7])
    n, F = len(ticked.feedback), np.array(ticked.feedback)
    A, B, L = np.split(np.array(ticked.rows), [n, n + 1], axis=1)
    for omega, expected in zip(
        frequencies, lqg_controller.response(controller, frequencies), strict=True
    ):
        z = np.exp(1j * omega * TICK_S)
        computed = F @ np.linalg.solve(z * np.eye(n) - A - B * F, 0.5 * (1.0 + z) * L)
        assert np.abs(computed / expected) == pytest.approx(1.0, abs=0.01)
        assert np.max(np.abs(np.degrees(np.angle(computed / expected)))) < 1.0


@pytest.mark.parametrize("plane", Plane)
def test_constant_load_other_vehicle_leaves_no_error(vehicle: DesignModel, plane: Plane) -> None:
    """Loads of the surface and, in pitch, of buoyancy; the controller has other coefficients."""
    _, controller = designed(vehicle, plane)
    other = linear_plane(plane, TABLE_1_INITIAL)
    A, B = loop_state_space.plane_with_tailcone(other, LAG, loop_analysis.PADE_ORDER)
    C = np.zeros((controller.L.shape[1], len(B)))
    C[:, : len(other.B)] = outputs(other)
    closed = lqg_controller.close(controller, A, B, C).A
    assert np.max(np.linalg.eigvals(closed).real) < 0.0
    for load in (other.B, np.eye(len(other.B))[0]):
        pushed = np.zeros(len(closed))
        pushed[: len(load)] = load
        rest = -np.linalg.solve(closed, pushed)
        held = rest[PLANES[plane].n_outputs]
        if plane == Plane.PITCH or load is other.B:
            assert abs(held) < 1e-6 * np.max(np.abs(rest))


def test_predicted_heading_equals_lyapunov_equation(vehicle: DesignModel) -> None:
    """For the slow disturbance alone: frequency integral against the closed loop's covariance."""
    sea = msgspec.structs.replace(DEFAULT_DISTURBANCE, wave_accel_degps2=0.0)
    _, controller = designed(vehicle, Plane.YAW)
    seen = loop_analysis.measured_plane(
        vehicle._replace(disturbance={Plane.YAW: sea, Plane.PITCH: sea}), Plane.YAW
    )
    closed = loop_analysis._close(seen, controller).A
    n = len(closed)
    A, density = np.zeros((n + 1, n + 1)), np.zeros((n + 1, n + 1))
    A[:n, :n], A[1, n], A[n, n] = closed, 1.0, -1.0 / sea.slow_time_s
    density[n, n] = 2.0 * math.radians(sea.slow_accel_degps2) ** 2 / sea.slow_time_s
    covariance = solve_continuous_lyapunov(A, -density)
    assert loop_analysis.disturbance_response(seen, controller).outputs[1] == pytest.approx(
        math.sqrt(covariance[2, 2]), rel=0.01
    )


def test_gain_margin_true_delay_is_the_stability_limit(vehicle: DesignModel) -> None:
    """In simulation the loop is stable just below the gain margin and unstable above it."""
    _, controller = designed(vehicle, Plane.YAW)
    margin = 10 ** (
        loop_transfer.margins(
            loop_analysis.cuts(loop_analysis.measured_plane(vehicle, Plane.YAW), controller).surface
        ).gm_db
        / 20.0
    )
    for factor, stable in ((0.93 * margin, True), (1.07 * margin, False)):
        assert (growth(vehicle, controller, factor) < 1.0) == stable


def growth(vehicle: DesignModel, controller: ContinuousController, factor: float) -> float:
    """Return late over early amplitude of the heading; the observer receives its own command."""
    dt, plane, ticked = TICK_S, vehicle.planes.yaw, lqg_controller.discretise(controller, TICK_S)
    wn, zeta = LAG.natural_frequency_radps, LAG.damping_ratio
    block = np.zeros((6, 6))
    block[:3, :3], block[:3, 3], block[3, 4] = plane.A, plane.B, 1.0
    block[4, 3:] = -(wn**2), -2.0 * zeta * wn, wn**2
    step = expm(block * dt)
    # Half a tick of hold is what sampling has here: nothing is late by its computing.
    queue = [0.0] * round(LAG.delay_s / dt)
    x = np.array([0.0, 0.0, 0.1, 0.0, 0.0])
    belief = np.zeros(len(controller.B))
    before = np.zeros(2)
    u = 0.0
    sizes = []
    for _ in range(round(120.0 / dt)):
        measured = x[1:3]
        belief = ticked.A @ belief + ticked.B * u + ticked.L @ (0.5 * (before + measured))
        u, before = float(ticked.F @ belief), measured
        queue.append(factor * u)
        x = step[:5, :5] @ x + step[:5, 5] * queue.pop(0)
        sizes.append(abs(x[2]))
    third = len(sizes) // 3
    return float(max(sizes[-third:]) / max(sizes[third : 2 * third]))


def test_infeasible_design_names_limits_and_the_other_method(
    model: IdentifiedModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise DesignInfeasibleError("no gains meet the specification")

    monkeypatch.setattr(optimal, "_tune", fail)
    advice = r"--damping 0\.5 .*; PID loops \(--method pid\)"
    with pytest.raises(DesignInfeasibleError, match=advice):
        optimal.design_lqg(model)
