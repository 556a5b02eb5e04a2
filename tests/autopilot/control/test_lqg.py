"""LQG controllers: arithmetic against numpy, limits, and use of the PIDs instead."""

import math

import numpy as np
import pytest

from autopilot.control import loops, lqg
from autopilot.control.lqg import LqgControllers, LqgReference
from autopilot.control.params import Config, ParamTable
from autopilot.control.setpoints import Setpoint
from autopilot.control.types import LoopMemory, VehicleEstimate

TURNS = lqg.from_matrices(
    rows=((0.9, 0.1, 0.3, 0.02, 0.3), (0.0, 0.8, 0.1, 0.1, -0.2)),
    feedback=(-1.5, -0.4),
    start=((1.0, 0.3), (0.0, 1.0)),
    loads=1,
)
DIVES = lqg.from_matrices(
    rows=((0.9, 0.1, 0.2, -0.3, 0.05, 0.1),),
    feedback=(0.05,),
    start=((0.0, 0.0, 1.0, 0.0),),
    loads=0,
)
STILL = LqgReference((0.0, 0.0), 0.0, -0.2, 0.2)
CONTROLLERS = LqgControllers(speed_mps=1.3, heading=TURNS, depth=DIVES, pitch_per_metre=0.2)
LEFT = Setpoint(heading_rad=-0.1)


def rudder(estimate: VehicleEstimate, config: Config, asked: Setpoint = LEFT) -> float:
    wanted, _ = loops.step_loops(
        estimate, asked, LoopMemory(), config, 0.02, heading=True, depth=False
    )
    return wanted.rudder_rad


def test_step_equals_matrix_equations() -> None:
    matrix, feedback, start = np.array(TURNS.rows), np.array(TURNS.feedback), np.array(TURNS.start)
    target = STILL._replace(wanted=(0.01, 0.05), feedforward_rad=0.02)
    rng = np.random.default_rng(1)
    observer, states, before, command = None, np.empty(0), np.empty(0), 0.0
    for measured in rng.standard_normal((20, 2)):
        u, observer = lqg.step(TURNS, observer, tuple(measured.tolist()), target)
        inputs = (
            np.concatenate([states, [command], 0.5 * (before + measured)]) if states.size else None
        )
        states = start @ measured if inputs is None else matrix @ inputs
        command = float(np.clip(feedback @ (states - start @ target.wanted) + 0.02, -0.2, 0.2))
        before = measured
        assert u == pytest.approx(command, abs=1e-14)
    assert observer is not None
    assert observer.states == pytest.approx(states, abs=1e-14)


def test_new_reference_changes_command_not_observer() -> None:
    _, observer = lqg.step(TURNS, None, (0.01, 0.02), STILL)
    held, moved = (
        lqg.step(TURNS, observer, (0.01, 0.02), STILL._replace(wanted=wanted))
        for wanted in ((0.0, 0.0), (0.0, 0.05))
    )
    assert moved[0] != held[0]
    assert moved[1].states == held[1].states


def test_moving_reference_freezes_disturbance_states() -> None:
    _, observer = lqg.step(TURNS, None, (0.01, 0.02), STILL)
    _, held = lqg.step(TURNS, observer, (0.03, 0.05), STILL)
    _, turning = lqg.step(TURNS, observer, (0.03, 0.05), STILL._replace(moving=True))
    assert turning.states == (held.states[0], observer.states[1])
    assert held.states[1] != observer.states[1]


def test_heading_past_south_is_unwrapped() -> None:
    """From 179 to 181 degrees the vehicle turns by 2 degrees, not by 358."""
    config = Config(lqg_controllers=CONTROLLERS)
    seen, memory = VehicleEstimate(speed_mps=1.3, heading_rad=math.radians(179.0)), LoopMemory()
    asked = Setpoint(heading_rad=math.radians(-179.0))
    for heading_deg in (179.0, 180.5, -178.5):
        seen = seen._replace(heading_rad=math.radians(heading_deg))
        _, memory = loops.step_loops(seen, asked, memory, config, 0.02, heading=True, depth=False)
        assert memory.rudder_observer is not None
    assert memory.rudder_observer is not None
    assert memory.rudder_observer.measured[1] == pytest.approx(math.radians(181.5))


def test_lqg_outside_its_speed_range_pid_is_used() -> None:
    lqg_config, pid = Config(lqg_controllers=CONTROLLERS), Config()
    for speed, flies in (
        (1.3, True),
        (1.1, True),
        (1.6, True),
        (0.9, False),
        (1.7, False),
        (0.0, False),
    ):
        seen = VehicleEstimate(speed_mps=speed, r_radps=0.01)
        assert (rudder(seen, lqg_config) == rudder(seen, pid)) != flies, speed


def test_lqg_without_the_gyro_pid_is_used() -> None:
    lqg_config, pid = Config(lqg_controllers=CONTROLLERS), Config()
    seen = VehicleEstimate(speed_mps=1.3, r_radps=0.01, rates_measured=False)
    assert rudder(seen, lqg_config) == rudder(seen, pid)


def test_lqg_disabled_by_parameter_pid_is_used() -> None:
    table = ParamTable(lqg_controllers=CONTROLLERS)
    seen = VehicleEstimate(speed_mps=1.3, r_radps=0.01)
    by_law = rudder(seen, table.config)
    table.set("LQG_ENABLE", 0.0)
    assert rudder(seen, table.config) == rudder(seen, Config()) != by_law
    table.reset()
    assert rudder(seen, table.config) == by_law


def test_command_stays_within_travel_with_trim() -> None:
    config = Config(lqg_controllers=CONTROLLERS, rudder_trim_deg=6.0)
    for heading in (-3.0, 3.0):
        seen = VehicleEstimate(
            speed_mps=1.3, r_radps=math.copysign(30.0, heading), heading_rad=heading
        )
        wanted = rudder(seen, config, Setpoint())
        assert abs(wanted) <= math.radians(15.0) + 1e-12
    assert abs(wanted) == pytest.approx(math.radians(15.0))


@pytest.mark.parametrize("pid_gain", [0.0, 2.0])
@pytest.mark.parametrize(("attitude_error_deg", "share"), [(0.0, 1.0), (12.0, 0.8)])
def test_full_command_is_confirmed_with_the_gain_of_the_controller(
    pid_gain: float, attitude_error_deg: float, share: float
) -> None:
    """u_c = 15 deg - 0.85 e_a: 4.8 deg at 12 deg, below 70 % of the travel of 15 deg."""
    config = Config(lqg_controllers=CONTROLLERS, heading_p=pid_gain)
    seen = VehicleEstimate(
        speed_mps=1.3, attitude_error_rad=(0.0, 0.0, math.radians(attitude_error_deg))
    )
    memory, asked = LoopMemory(), Setpoint(heading_rad=3.0)
    for _ in range(50):
        wanted, memory = loops.step_loops(
            seen, asked, memory, config, 0.02, heading=True, depth=False
        )
    assert TURNS.forward[1] == pytest.approx(0.85)
    assert wanted.rudder_rad == pytest.approx(share * config.travel_rad)


def test_depth_error_is_limited_by_pitch_limit() -> None:
    config = Config(lqg_controllers=CONTROLLERS, pitch_limit_deg=20.0)
    seen = VehicleEstimate(speed_mps=1.3)
    metres = math.radians(20.0) / CONTROLLERS.pitch_per_metre

    def elevator(depth_m: float) -> float:
        wanted, _ = loops.step_loops(
            seen, Setpoint(depth_m=depth_m), LoopMemory(), config, 0.02, heading=False, depth=True
        )
        assert abs(wanted.pitch_setpoint_rad) <= math.radians(20.0) + 1e-12
        return wanted.elevator_rad

    assert elevator(0.5 * metres) == pytest.approx(0.5 * elevator(metres))
    assert elevator(5.0 * metres) == elevator(metres)


def test_pitch_setpoint_is_held_by_pid() -> None:
    """STABILIZE and the ascent without depth have a pitch set-point, which LQG does not support."""
    seen, asked = VehicleEstimate(speed_mps=1.3, depth_m=1.0), Setpoint(pitch_rad=0.1)
    by_law, by_pid = (
        loops.step_loops(seen, asked, LoopMemory(), config, 0.02, heading=False, depth=True)[0]
        for config in (Config(lqg_controllers=CONTROLLERS), Config())
    )
    assert by_law == by_pid


def test_observer_open_loop_is_reset() -> None:
    config, seen = Config(lqg_controllers=CONTROLLERS), VehicleEstimate(speed_mps=1.3, r_radps=0.02)
    _, memory = loops.step_loops(seen, LEFT, LoopMemory(), config, 0.02, heading=True, depth=True)
    assert memory.rudder_observer is not None
    assert memory.elevator_observer is not None
    _, memory = loops.step_loops(seen, LEFT, memory, config, 0.02, heading=False, depth=False)
    assert memory.rudder_observer is memory.elevator_observer is None


def test_pitch_of_level_run_is_no_error() -> None:
    """A vehicle at TRIM_PIT_DEG on its depth needs its trim only, from the first tick on."""
    config = Config(lqg_controllers=CONTROLLERS, level_pitch_deg=-2.0, elevator_trim_deg=0.5)
    level = VehicleEstimate(speed_mps=config.cruise_speed_mps, pitch_rad=math.radians(-2.0))
    memory, asked = LoopMemory(), Setpoint()
    for _ in range(3):
        output, memory = loops.step_loops(
            level, asked, memory, config, 0.02, heading=False, depth=True
        )
        assert output.elevator_rad == pytest.approx(math.radians(0.5))
        assert output.pitch_setpoint_rad == pytest.approx(math.radians(-2.0))
