"""Control loops: effect of each optional part, and no effect if its parameter is off."""

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from autopilot.control import loops, modes, requests
from autopilot.control.params import Config, ParamTable
from autopilot.control.pid import Gains
from autopilot.control.reference_model import ReferenceState, begun
from autopilot.control.setpoints import Setpoint
from autopilot.control.types import Event, LoopMemory, Trim, VehicleEstimate
from autopilot.vehicle import Vehicle
from mavlink_io.frames import wrap_pi
from tests.helpers.missions import under_way

angle = st.floats(-0.5, 0.5)


@given(heading=angle, pitch=angle, q=angle, r=angle, roll=st.floats(-1.0, 1.0), wanted=angle)
def test_roll_compensation_any_roll_gives_level_commands(
    heading: float, pitch: float, q: float, r: float, roll: float, wanted: float
) -> None:
    """Equal rates about vertical and horizontal give equal commands about them at any roll."""
    config = Config(roll_compensated=1, travel_deg=45.0, heading_d=0.5, pitch_d=0.5)
    level = VehicleEstimate(heading_rad=heading, pitch_rad=pitch, q_radps=q, r_radps=r)
    c, s = math.cos(roll), math.sin(roll)
    rolled = level._replace(roll_rad=roll, q_radps=q * c + r * s, r_radps=r * c - q * s)
    asked = Setpoint(heading_rad=wanted, pitch_rad=0.1)
    flat, _ = loops.step_loops(level, asked, LoopMemory(), config, 0.02, heading=True, depth=True)
    turned, _ = loops.step_loops(
        rolled, asked, LoopMemory(), config, 0.02, heading=True, depth=True
    )
    about_vertical = turned.rudder_rad * c + turned.elevator_rad * s
    about_horizontal = turned.elevator_rad * c - turned.rudder_rad * s
    assert about_vertical == pytest.approx(flat.rudder_rad, abs=1e-9)
    assert about_horizontal == pytest.approx(flat.elevator_rad, abs=1e-9)


def test_schedule_gains_half_speed_slows_the_loop() -> None:
    """At half speed all time constants double: D doubles, I halves, P stays."""
    slow = loops.schedule_gains(Gains(0.6, 1.5, 0.02, 0.1), 0.5)
    assert (slow.p, slow.d, slow.i, slow.i_max) == (0.6, 3.0, 0.01, 0.1)


def test_schedule_gains_double_speed_keeps_bandwidth() -> None:
    fast = loops.schedule_gains(Gains(0.6, 1.5, 0.02, 0.1), 2.0)
    assert (fast.p, fast.d, fast.i) == (0.15, 0.375, 0.005)
    assert loops.schedule_gains(Gains(0.6, 1.5, 0.02, 0.1), 50.0) == loops.schedule_gains(
        Gains(0.6, 1.5, 0.02, 0.1), 2.5
    )


def test_heading_reference_large_turn_stays_within_travel() -> None:
    """The kinematic vehicle turns at once with its rudder: the reference rate limits the rudder."""
    direct, shaped = (under_way(modes.DEPTH, heading_ref_radps=w) for w in (0.0, 0.5))
    most = {}
    for name, flight in (("direct", direct), ("shaped", shaped)):
        flight.state = flight.state._replace(
            setpoint=flight.state.setpoint._replace(heading_rad=1.5)
        )
        most[name] = max(abs(flight.trace.rudder_rad) for _ in flight.run(60.0))
        assert abs(flight.heading - 1.5) < 0.02
    assert most["direct"] == pytest.approx(math.radians(15.0))
    assert most["shaped"] < math.radians(14.0)


def test_heading_reference_full_rudder_waits_for_the_vehicle() -> None:
    """A vehicle that does not turn: the reference ends where P e alone is the travel."""
    config = Config(heading_p=0.6, heading_d=1.4, heading_i=0.0, heading_ref_radps=1.0)
    asked, memory = Setpoint(heading_rad=3.0), LoopMemory()
    for _ in range(3000):
        output, memory = loops.step_loops(
            VehicleEstimate(), asked, memory, config, 0.02, heading=True, depth=False
        )
        assert output.rudder_rad <= config.travel_rad
    assert output.rudder_rad == pytest.approx(config.travel_rad)
    assert memory.heading_reference.value == pytest.approx(config.travel_rad / 0.6, rel=1e-3)


def test_heading_reference_fast_turn_is_slowed_at_the_limit() -> None:
    """One tick of a vehicle that turns faster than HDG_REF_RATE: the command is at its limit."""
    config = Config(
        heading_p=0.6, heading_d=1.4, heading_i=0.0, heading_ref_radps=1.0, heading_ref_degps=5.0
    )
    turning = VehicleEstimate(r_radps=0.5)
    output, memory = loops.step_loops(
        turning, Setpoint(), LoopMemory(), config, 0.02, heading=True, depth=False
    )
    reference = memory.heading_reference
    assert output.rudder_rad == pytest.approx(-config.travel_rad)
    wanted = 0.6 * reference.value - 1.4 * (0.5 - reference.rate)
    assert wanted == pytest.approx(-config.travel_rad)


def test_depth_reference_step_keeps_rate_limit() -> None:
    fastest = {}
    for w in (0.0, 0.3):
        flight = under_way(modes.DEPTH, depth_ref_radps=w, depth_ref_mps=0.2, depth_i=0.0)
        list(flight.run(30.0))
        flight.state = flight.state._replace(setpoint=flight.state.setpoint._replace(depth_m=9.0))
        depths = [flight.depth_m for _ in flight.run(90.0)]
        fastest[w] = max((b - a) / 0.5 for a, b in zip(depths[::25], depths[25::25], strict=False))
        assert depths[-1] == pytest.approx(9.0, abs=0.1)
    assert fastest[0.3] < 0.26 < fastest[0.0]


@pytest.mark.parametrize(("speed", "share"), [(1.3, 1.0), (0.65, 4.0), (0.1, 6.25), (2.6, 0.25)])
def test_pitch_feedforward_scales_with_inverse_square_of_speed(speed: float, share: float) -> None:
    """Added to the command of the loops: 0.2 of the pitch at cruise speed, more at lower speed.

    Below cruise speed the reference is slower in proportion, so that its pitch stays the same.
    """
    bare = Config(depth_ref_radps=0.5, depth_ref_mps=0.1, travel_deg=45.0)
    held = replace(bare, pitch_feedforward=0.2)
    memory = LoopMemory(depth_reference=ReferenceState(3.0, 0.1))
    estimate, asked = VehicleEstimate(depth_m=3.0, speed_mps=speed), Setpoint(depth_m=9.0)
    with_it, without = (
        loops.step_loops(estimate, asked, memory, each, 0.02, heading=False, depth=True)[
            0
        ].elevator_rad
        for each in (held, bare)
    )
    pitch = -min(math.radians(20.0), 0.1 * min(1.0, speed / 1.3) / max(speed, 0.3))
    assert with_it - without == pytest.approx(0.2 * pitch * share, rel=1e-6)
    level = loops.step_loops(
        estimate, asked._replace(depth_m=3.0), LoopMemory(), held, 0.02, heading=False, depth=True
    )[0]
    assert level.elevator_rad == 0.0


@pytest.mark.parametrize("weight", [0.0, 0.4, 0.9])
def test_setpoint_weighting_equals_textbook_equation(weight: float) -> None:
    """Reference: P (b r - y) + I integral(r - y), for a heading past south and for depth."""
    config = Config(
        heading_setpoint_weight=weight,
        depth_setpoint_weight=weight,
        heading_i=0.05,
        heading_i_max=0.26,
        heading_i_rate_degps=90.0,
        depth_i=0.02,
        depth_i_max=0.5,
        heading_p=0.2,
        heading_d=0.0,
        depth_p=0.05,
        pitch_limit_deg=60.0,
    )
    memory, rudder_i, nose_down_i = LoopMemory(), 0.0, 0.0
    for tick in range(300):
        heading, depth = 0.4 * math.sin(0.02 * tick), 0.1 * math.sin(0.05 * tick)
        turn, sink = (0.3, 2.0) if tick > 10 else (0.0, 0.0)
        estimate = VehicleEstimate(heading_rad=wrap_pi(3.0 + heading), depth_m=depth)
        asked = Setpoint(heading_rad=wrap_pi(3.0 + turn), depth_m=sink)
        wanted, memory = loops.step_loops(
            estimate, asked, memory, config, 0.02, heading=True, depth=True
        )
        assert wanted.rudder_rad == pytest.approx(
            0.2 * (weight * turn - heading) + rudder_i, abs=1e-9
        )
        assert -wanted.pitch_setpoint_rad == pytest.approx(
            0.05 * (weight * sink - depth) + nose_down_i, abs=1e-9
        )
        rudder_i += 0.05 * (turn - heading) * 0.02
        nose_down_i += 0.02 * (sink - depth) * 0.02


def test_trim_steady_flight_takes_over_integrator() -> None:
    """With a rudder bias of 4 deg the trim takes over from the integrator at constant heading."""
    config = Config(trim_time_s=10.0, heading_i=0.05, heading_i_max=0.2)
    memory, estimate, offset = LoopMemory(), VehicleEstimate(speed_mps=1.3), math.radians(4.0)
    asked = Setpoint()
    for _ in range(50 * 120):
        wanted, memory = loops.step_loops(
            estimate, asked, memory, config, 0.02, heading=True, depth=True
        )
        rate = 0.5 * (wanted.rudder_rad - offset)
        estimate = estimate._replace(heading_rad=estimate.heading_rad + 0.02 * rate, r_radps=rate)
    assert memory.trim.rudder_rad == pytest.approx(offset, rel=0.02)
    assert abs(memory.heading_integral_rad) < math.radians(0.1)
    assert abs(estimate.heading_rad) < math.radians(0.2)
    assert memory.trim.learned_s > 60.0


@pytest.mark.parametrize(("learned_s", "kept_deg"), [(25.0, 4.5), (15.0, 2.0)])
def test_trim_learned_long_enough_is_stored(learned_s: float, kept_deg: float) -> None:
    vehicle = Vehicle(ParamTable({"TRIM_AUTO_S": 10.0, "TRIM_RUD_DEG": 2.0}))
    trim = Trim(math.radians(2.5), math.radians(-1.0), learned_s)
    vehicle.state = vehicle.state._replace(armed=True, loops=LoopMemory(trim=trim))
    vehicle.handle_request(requests.Disarm(force=True))
    assert vehicle.params.get("TRIM_RUD_DEG") == pytest.approx(kept_deg)
    texts = [
        event.text
        for event in vehicle.pop_events()
        if isinstance(event, Event) and "Trim" in event.text
    ]
    assert texts == (["Trim learned: TRIM_RUD_DEG 4.5, TRIM_ELE_DEG -1"] if kept_deg == 4.5 else [])


STANDING = VehicleEstimate(heading_rad=math.radians(-9.0), speed_mps=1.3)


def close_both(
    estimate: VehicleEstimate, memory: LoopMemory, config: Config
) -> tuple[loops.ControlOutput, LoopMemory]:
    return loops.step_loops(estimate, Setpoint(), memory, config, 0.02, heading=True, depth=True)


def test_trim_standing_error_with_limited_integrator() -> None:
    """HDG_IMAX carries 0.57 of 6 deg of rudder: the trim must take out 8.4 deg of heading."""
    config = Config(trim_time_s=10.0)
    memory, estimate, offset = LoopMemory(), VehicleEstimate(speed_mps=1.3), math.radians(6.0)
    for _ in range(50 * 120):
        wanted, memory = close_both(estimate, memory, config)
        rate = 0.5 * (wanted.rudder_rad - offset)
        estimate = estimate._replace(heading_rad=estimate.heading_rad + 0.02 * rate, r_radps=rate)
    assert memory.trim.rudder_rad == pytest.approx(offset, rel=0.02)
    assert abs(estimate.heading_rad) < math.radians(0.1)


@pytest.mark.parametrize(
    ("estimate", "learned"),
    [
        pytest.param(STANDING, True, id="standing"),
        pytest.param(STANDING._replace(speed_mps=0.3), False, id="adrift"),
        pytest.param(STANDING._replace(heading_rad=math.radians(-40.0)), False, id="at its stop"),
        pytest.param(STANDING._replace(r_radps=math.radians(1.0)), False, id="turning"),
    ],
)
def test_trim_large_heading_error_only_if_standing(
    estimate: VehicleEstimate, learned: bool
) -> None:
    _, memory = close_both(estimate, LoopMemory(), Config(trim_time_s=10.0))
    assert (memory.trim.rudder_rad > 0.0) == learned


def test_trim_turning_is_not_learned() -> None:
    config = Config(trim_time_s=10.0)
    turning = VehicleEstimate(r_radps=math.radians(5.0))
    _, memory = loops.step_loops(
        turning, Setpoint(), LoopMemory(), config, 0.02, heading=True, depth=True
    )
    assert memory.trim == LoopMemory().trim


def test_level_pitch_is_added_and_grows_with_inverse_square_of_speed() -> None:
    """Lift balances the net buoyancy: at half the speed four times the angle (Fossen 2021, 4.1)."""
    config = Config(level_pitch_deg=-2.0, cruise_speed_mps=1.3)
    for speed, pitch_deg in ((1.3, -2.0), (0.65, -8.0)):
        still = VehicleEstimate(depth_m=3.0, speed_mps=speed)
        output, _ = loops.step_loops(
            still, Setpoint(depth_m=3.0), LoopMemory(), config, 0.02, heading=False, depth=True
        )
        assert math.degrees(output.pitch_setpoint_rad) == pytest.approx(pitch_deg)


def test_depth_reference_slow_vehicle_waits_for_speed() -> None:
    config = Config(depth_ref_radps=0.5, depth_ref_mps=0.3, cruise_speed_mps=1.3)
    memory, values = LoopMemory(), []
    for speed in (0.0, 0.65):
        for _ in range(1000):
            estimate = VehicleEstimate(depth_m=0.0, speed_mps=speed)
            _, memory = loops.step_loops(
                estimate, Setpoint(depth_m=50.0), memory, config, 0.02, heading=False, depth=True
            )
        values.append(memory.depth_reference)
    assert values[0].value == 0.0
    assert values[1].rate == pytest.approx(0.15)


def test_depth_reference_lead_adds_its_acceleration_to_the_pitch() -> None:
    """Pitch for x' + T x'' over the speed; the gains of depth are zero."""
    estimate, pitch = VehicleEstimate(speed_mps=1.3), []
    for lead_s in (0.0, 3.0):
        config = Config(
            depth_p=0.0,
            depth_i=0.0,
            depth_ref_radps=0.5,
            depth_ref_mps=0.3,
            depth_ref_lead_s=lead_s,
        )
        output, memory = loops.step_loops(
            estimate, Setpoint(depth_m=5.0), LoopMemory(), config, 0.02, heading=False, depth=True
        )
        pitch.append(output.pitch_setpoint_rad)
    rate = memory.depth_reference.rate  # from rest in one tick
    assert rate > 0.0
    assert pitch[0] == pytest.approx(-rate / 1.3)
    assert pitch[1] == pytest.approx(-(rate + 3.0 * rate / 0.02) / 1.3)


def test_references_open_loop_are_reset() -> None:
    config = Config(
        heading_ref_radps=0.5,
        depth_ref_radps=0.5,
        actuator_lead_radps=8.0,
        heading_peak_radps=1.2,
        pitch_peak_radps=1.6,
    )
    _, closed = loops.step_loops(
        VehicleEstimate(), Setpoint(), LoopMemory(), config, 0.02, heading=True, depth=True
    )
    states = (
        closed.heading_reference,
        closed.depth_reference,
        closed.rudder_lead,
        closed.elevator_lead,
        closed.rudder_peak,
        closed.elevator_peak,
    )
    assert all(map(begun, states))
    _, opened = loops.step_loops(
        VehicleEstimate(), Setpoint(), closed, config, 0.02, heading=False, depth=True
    )
    assert not begun(opened.heading_reference)
    assert not begun(opened.rudder_lead)
    assert not begun(opened.rudder_peak)
    assert begun(opened.elevator_lead)
    assert begun(opened.elevator_peak)


def _last_command(estimates: list[VehicleEstimate], asked: Setpoint) -> loops.ControlOutput:
    """Return the commands after 1 s at each estimate, confirmed by accelerometer and compass."""
    memory, config = LoopMemory(), Config(heading_p=2.0, pitch_p=2.0, depth_p=0.2)
    for estimate in estimates:
        for _ in range(50):
            output, memory = loops.step_loops(
                estimate, asked, memory, config, 0.02, heading=True, depth=True
            )
    return output


def test_full_command_on_the_way_to_a_set_point_stays() -> None:
    travel = Config().travel_rad
    output = _last_command([VehicleEstimate(speed_mps=1.3)], Setpoint(heading_rad=1.0, depth_m=5.0))
    assert abs(output.rudder_rad) >= travel
    assert abs(output.elevator_rad) >= travel


@pytest.mark.parametrize("offset_rad", [-0.4, 0.4])
def test_full_command_after_a_reached_set_point_is_reduced(offset_rad: float) -> None:
    """A wrong sensor can lead the vehicle to an attitude from which all sensors ask for it."""
    asked = Setpoint(heading_rad=3.0, depth_m=5.0)
    reached = VehicleEstimate(speed_mps=1.3, heading_rad=3.0, depth_m=5.0)
    led_off = reached._replace(heading_rad=wrap_pi(3.0 + offset_rad), pitch_rad=offset_rad)
    output, travel = _last_command([reached, led_off], asked), Config().travel_rad
    assert output.rudder_rad == pytest.approx(-math.copysign(0.8 * travel, offset_rad))
    assert output.elevator_rad == pytest.approx(-math.copysign(0.8 * travel, offset_rad))
    turned = asked._replace(heading_rad=wrap_pi(3.0 - 5.0 * offset_rad))
    memory, config = LoopMemory(), Config(heading_p=2.0)
    for wanted in (asked, turned):
        for _ in range(50):
            output, memory = loops.step_loops(
                reached, wanted, memory, config, 0.02, heading=True, depth=True
            )
    assert abs(output.rudder_rad) >= travel
