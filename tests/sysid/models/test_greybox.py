"""The plane model equals the simulator's physics, and its actuator equals the tailcone."""

import math
from dataclasses import replace

import numpy as np
import pytest

from sitl.core import tailcone
from sitl.vehicle import build_model, config
from sysid.data.runs import RATE_HZ
from sysid.estimation.map import steady_state
from sysid.estimation.map.datasets import STRIDE
from sysid.models import greybox, linear_planes, parameters
from sysid.planes import PLANES, Plane
from tests.sysid import sea

QUIET = sea.Sensors(0.0, 0.0, 0.0, 0.0)


def nominal(vehicle: config.VehicleConfig, plane: Plane) -> greybox.Actuator:
    tail = vehicle.tailcone
    bias = (tail.rudder_bias_deg, tail.elevator_bias_deg)[PLANES[plane].index]
    return greybox.Actuator(
        tail.delay_s,
        tail.natural_frequency_radps,
        tail.damping_ratio,
        math.radians(bias),
        math.radians(tail.travel_deg),
        math.radians(tail.rate_degps),
    )


@pytest.mark.parametrize(
    ("delay_s", "play_deg"), [(0.3, 0.0), (0.317, 0.0), (0.05, 0.0), (0.3, 2.0)]
)
def test_actuator_model_equals_simulated_tailcone(
    bench: config.VehicleConfig, delay_s: float, play_deg: float
) -> None:
    rng = np.random.default_rng(2)
    command = np.repeat(rng.uniform(-0.3, 0.3, 30), 40)
    actuator = nominal(bench, Plane.YAW)._replace(
        delay_s=delay_s, backlash_rad=math.radians(play_deg)
    )
    axis = tailcone.discretise(
        natural_frequency_radps=3.0,
        damping=0.6,
        delay_s=delay_s,
        travel_rad=actuator.travel_rad,
        rate_limit_radps=actuator.rate_radps,
        bias_rad=0.0,
        substep_s=0.005,
        backlash_rad=math.radians(play_deg),
    )
    state, substeps, expected = tailcone.at_rest(axis), np.empty(4), []
    command[:60] = 0.0
    for angle in command:
        expected.append(tailcone.duct_angle_rad(axis, state))
        tailcone.advance(axis, state, angle, substeps)
    found = greybox.duct_angles(command, actuator, 1.0 / RATE_HZ)
    # Steps of up to 30 deg: the two models integrate the rate limit over 20 and 5 ms.
    assert np.max(np.abs(found - np.array(expected))) < math.radians(0.15)


@pytest.mark.parametrize(
    ("plane", "degrees", "bound_degps"), [("yaw", 5.0, 0.08), ("pitch", 4.0, 0.12)]
)
def test_plane_model_equals_six_dof_simulation(
    bench: config.VehicleConfig, plane: Plane, degrees: float, bound_degps: float
) -> None:
    """Compare six degrees of freedom with closed loops against one plane.

    The difference is roll and the other plane.
    """
    run = sea.fly(bench, plane, sea.step(degrees, 8.0), level=sea.CALM, sensors=QUIET).since(-5.0)
    model = build_model.build(bench)
    motion = greybox.simulate(
        model, nominal(bench, plane), run, greybox.initial_motion(run), 1, 1.3
    )
    assert np.max(np.abs(np.degrees(motion.rate_radps - run.rate_radps))) < bound_degps
    assert np.ptp(np.degrees(run.rate_radps)) > 2.0


def test_measured_speed_replaces_the_simulated_speed(bench: config.VehicleConfig) -> None:
    """The speed of the simulation, measured with another scale, gives the same motion.

    Tolerance: the measured speed is smoothed over 2 s (0.1 deg/s of 6 deg/s).
    """
    run = sea.fly(bench, Plane.YAW, sea.step(9.0), level=sea.CALM, sensors=QUIET)
    model = build_model.build(bench)
    actuator = nominal(bench, Plane.YAW)
    start = greybox.initial_motion(run)
    motion = greybox.simulate(model, actuator, run, start, 1, 1.3)
    assert motion.speed_mps[-1] < 1.25
    scaled = 1.1 * motion.speed_mps
    measured = replace(run, forward_mps=scaled, straight_speed_mps=float(scaled[0]))
    same = greybox.simulate(model, actuator, measured, start, 1, 1.3)
    constant = replace(run, forward_mps=0.0 * scaled + 1.0, straight_speed_mps=1.0)
    other = greybox.simulate(model, actuator, constant, start, 1, 1.3)
    assert np.max(np.abs(np.degrees(same.rate_radps - motion.rate_radps))) < 0.1
    assert np.max(np.abs(np.degrees(other.rate_radps - motion.rate_radps))) > 0.2


def test_fit_step_equals_fine_step(bench: config.VehicleConfig) -> None:
    run = sea.fly(bench, Plane.YAW, sea.step(9.0), level=sea.CALM, sensors=QUIET)
    model = build_model.build(bench)
    actuator = nominal(bench, Plane.YAW)
    start = greybox.initial_motion(run)
    fine = greybox.simulate(model, actuator, run, start, 1, 1.3)
    coarse = greybox.simulate(model, actuator, run, start, STRIDE, 1.3)
    assert np.max(np.abs(np.degrees(fine.rate_radps[::STRIDE] - coarse.rate_radps))) < 1e-3


def test_linear_planes_are_derivatives_of_plane_model(bench: config.VehicleConfig) -> None:
    """The tolerance is 0.5 %: with z_CM off the axis, the surge force of the net buoyancy adds to
    the righting moment.
    """
    vehicle = parameters.candidate_vehicle(
        bench, dict.fromkeys(PLANES, 0.0), np.zeros(len(parameters.NAMES))
    )
    rps = 0.58 * vehicle.model.propeller.full_rps
    for plane in PLANES:
        linear = steady_state.straight_plane(vehicle, plane)

        def rates(
            across: float, rate: float, angle: float, duct: float, plane: Plane = plane
        ) -> np.ndarray:
            state = np.array([1.3, -across, -rate, -angle, -50.0])
            return -greybox.accelerations(vehicle.model, plane, state, duct, rps)[1:]

        h = 1e-5
        for column in range(3):
            point = np.zeros(4)
            point[column] = h
            slope = (rates(*point) - rates(*-point)) / (2 * h)
            np.testing.assert_allclose(slope, linear.A[:2, column], rtol=5e-3, atol=2e-5)
        slope = (rates(0, 0, 0, h) - rates(0, 0, 0, -h)) / (2 * h)
        np.testing.assert_allclose(slope, linear.B[:2], rtol=5e-3)


def test_small_signal_equals_paper_accelerations() -> None:
    """The adjusted column gives the accelerations that the paper measured: 0.51 in yaw, 0.46 in
    pitch.
    """
    from sysid.reproduction.paper_tables import TABLE_1_ADJUSTED

    yaw = linear_planes.small_signal(linear_planes.yaw_plane(TABLE_1_ADJUSTED))
    pitch = linear_planes.small_signal(linear_planes.pitch_plane(TABLE_1_ADJUSTED))
    assert yaw.b1_per_s2 == pytest.approx(0.51, abs=0.002)
    assert pitch.b1_per_s2 == pytest.approx(0.46, abs=0.002)
    assert yaw.static_gain_per_s == pytest.approx(1.77, abs=0.02)
    assert yaw.p_fast_per_s < yaw.p_slow_per_s < 0


def test_backlash_full_width_is_crossed_before_motion() -> None:
    """The lag is so fast that the motor reaches its command within one sample."""
    motor = np.array([0.0, 1.0, 3.0, 2.0, 1.0, -4.0, -4.0])
    found = greybox.duct_angles(motor, greybox.Actuator(0.0, 1e3, 0.7, 0.0, 9.0, 1e3, 2.0), 1.0)
    np.testing.assert_allclose(found[1:], [0.0, 0.0, 2.0, 2.0, 2.0, -3.0])
