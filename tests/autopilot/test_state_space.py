"""Laws aboard: the arithmetic against numpy, limits, and when the PIDs fly instead."""

import math

import numpy as np
import pytest

from autopilot import loops, state_space
from autopilot.params import Config, ParamTable
from autopilot.state_space import Law, Laws
from autopilot.targets import Setpoint
from autopilot.types import Estimate, LoopMemory

TURNS = Law(rows=((0.9, 0.1, 0.3, 0.02, 0.3), (0.0, 0.8, 0.1, 0.1, -0.2)), feedback=(-1.5, -0.4))
DIVES = Law(rows=((0.9, 0.1, 0.2, -0.3, 0.05, 0.1),), feedback=(2.0,))
LAWS = Laws(speed_mps=1.3, heading=TURNS, depth=DIVES, pitch_per_metre=0.2)
LEFT = Setpoint(heading_rad=-0.1)


def rudder(estimate: Estimate, config: Config, asked: Setpoint = LEFT) -> float:
    wanted, _ = loops.close(estimate, asked, LoopMemory(), config, 0.02, heading=True, depth=False)
    return wanted.rudder_rad


def test_a_law_is_its_matrices() -> None:
    matrix, feedback, rng = np.array(TURNS.rows), np.array(TURNS.feedback), np.random.default_rng(1)
    belief, states, before, command = None, np.zeros(2), None, 0.0
    for measured in rng.standard_normal((20, 2)):
        u, belief = state_space.act(TURNS, belief, tuple(measured.tolist()), -0.2, 0.2)
        mean = measured if before is None else 0.5 * (before + measured)
        states = matrix @ np.concatenate([states, [command], mean])
        command, before = float(np.clip(feedback @ states, -0.2, 0.2)), measured
        assert u == pytest.approx(command, abs=1e-15)
    assert belief is not None
    assert belief.states == pytest.approx(states, abs=1e-14)


def test_a_law_flies_about_its_speed_and_the_pid_elsewhere() -> None:
    law, pid = Config(laws=LAWS), Config()
    for speed, flies in ((1.3, True), (1.1, True), (1.6, True), (0.9, False), (1.7, False), (0.0, False)):
        seen = Estimate(speed_mps=speed, r_radps=0.01)
        assert (rudder(seen, law) == rudder(seen, pid)) != flies, speed


def test_the_pid_is_one_parameter_away() -> None:
    table, seen = ParamTable(laws=LAWS), Estimate(speed_mps=1.3, r_radps=0.01)
    by_law = rudder(seen, table.config)
    table.set("LAW_ENABLE", 0.0)
    assert rudder(seen, table.config) == rudder(seen, Config()) != by_law
    table.reset()
    assert rudder(seen, table.config) == by_law


def test_the_command_keeps_to_the_travel_that_the_trim_leaves() -> None:
    config = Config(laws=LAWS, rudder_trim_deg=6.0)
    for heading in (-3.0, 3.0):
        seen = Estimate(speed_mps=1.3, r_radps=math.copysign(30.0, heading), heading_rad=heading)
        wanted = rudder(seen, config, Setpoint())
        assert abs(wanted) <= math.radians(15.0) + 1e-12
    assert abs(wanted) == pytest.approx(math.radians(15.0))


def test_a_depth_error_counts_as_far_as_the_pitch_limit_goes() -> None:
    config, seen = Config(laws=LAWS, pitch_limit_deg=20.0), Estimate(speed_mps=1.3)
    metres = math.radians(20.0) / LAWS.pitch_per_metre

    def elevator(depth_m: float) -> float:
        wanted, _ = loops.close(seen, Setpoint(depth_m=depth_m), LoopMemory(), config, 0.02, heading=False, depth=True)
        assert abs(wanted.pitch_setpoint_rad) <= math.radians(20.0) + 1e-12
        return wanted.elevator_rad

    assert elevator(0.5 * metres) == pytest.approx(0.5 * elevator(metres))
    assert elevator(5.0 * metres) == elevator(metres)


def test_a_pitch_that_is_asked_for_is_held_by_the_pid() -> None:
    """Stabilize and the rise without a depth ask for one; the law knows none."""
    seen, asked = Estimate(speed_mps=1.3, depth_m=1.0), Setpoint(pitch_rad=0.1)
    by_law, by_pid = (
        loops.close(seen, asked, LoopMemory(), config, 0.02, heading=False, depth=True)[0]
        for config in (Config(laws=LAWS), Config())
    )
    assert by_law == by_pid


def test_a_loop_that_was_open_begins_anew() -> None:
    config, seen = Config(laws=LAWS), Estimate(speed_mps=1.3, r_radps=0.02)
    _, memory = loops.close(seen, LEFT, LoopMemory(), config, 0.02, heading=True, depth=True)
    assert memory.rudder_belief is not None
    assert memory.elevator_belief is not None
    _, memory = loops.close(seen, LEFT, memory, config, 0.02, heading=False, depth=False)
    assert memory.rudder_belief is memory.elevator_belief is None
