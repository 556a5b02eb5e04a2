"""Assessment of a dive from synthetic logs with a known cause."""

import json
import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ground.client import assessment, verdict
from ground.client.assessment import ErrorCause, Outcome
from ground.client.dive_symptoms import SymptomKind
from sysid.data import dataset as logs
from sysid.data.dataset import Log, LogEvent, VelocitySource
from sysid.data.events import (
    Armed,
    Failsafe,
    FailsafeCause,
    PlainText,
    TrimLearned,
    parse_text,
)
from tests.helpers.synthetic_dive import EMPTY, constant, decay, dive, swing

Array = NDArray[np.float64]


def test_dive_held_well_has_no_findings() -> None:
    found = assessment.assess_log(dive(heading_error_deg=swing(1.0), depth_error_m=constant(-0.2)))
    assert (found.findings, found.reason, found.short_legs) == ((), "", 0)
    (leg,) = found.legs
    assert (leg.heading_setpoint_deg, leg.depth_setpoint_m) == pytest.approx((20.0, 3.0))
    # 95 % of a sine lie within sin(0.95 * 90 deg) = 0.997 of its amplitude
    assert leg.heading_deg.p95 == pytest.approx(0.997, abs=0.005)
    assert (leg.depth_m.mean, leg.depth_m.p95) == pytest.approx((-0.2, 0.2))
    words = "good: heading within 1 deg and depth within 20 cm for 95 % of the leg"
    assert words in verdict.format_text(found)


def test_heading_offset_names_the_trim_that_is_not_set() -> None:
    found = assessment.assess_log(dive(heading_error_deg=constant(-8.4), rudder_deg=6.05))
    (finding,) = found.findings
    assert (finding.axis, finding.cause, finding.legs) == ("heading", ErrorCause.TRIM, 1)
    assert "heading 8.4 deg off in the mean: the rudder trim is not set" in finding.message
    assert (
        "set TRIM_RUD_DEG to 6.0" in finding.message or "set TRIM_RUD_DEG to 6.1" in finding.message
    )
    first, step, *_ = verdict.format_text(found).splitlines()
    assert first.startswith("needs attention: heading 8.4 deg off in the mean: the rudder trim")
    assert step.startswith("next: set TRIM_RUD_DEG to 6.")


CAUSES: list[tuple[ErrorCause, dict[str, Any]]] = [
    (ErrorCause.AT_STOP, {"heading_error_deg": constant(-20.0), "rudder_deg": 15.0}),
    (ErrorCause.UNKNOWN, {"heading_error_deg": constant(-5.0), "rudder_deg": 0.2}),
    (ErrorCause.SWINGING, {"heading_error_deg": swing(6.0)}),
    (ErrorCause.LATE, {"heading_error_deg": decay(40.0, 15.0)}),
    (ErrorCause.UNSETTLED, {"heading_error_deg": decay(40.0, 150.0)}),
    (ErrorCause.TRIM, {"depth_error_m": constant(-0.9), "elevator_deg": 5.0, "pitch_deg": 1.0}),
    (
        ErrorCause.INTEGRATOR,
        {"depth_error_m": constant(-0.9), "elevator_deg": 0.5, "pitch_deg": -4.0},
    ),
    (ErrorCause.UNSETTLED, {"depth_error_m": decay(-6.0, 100.0)}),
    (ErrorCause.SWINGING, {"depth_error_m": swing(1.0)}),
]


@pytest.mark.parametrize(("cause", "flown"), CAUSES)
def test_poor_hold_names_its_cause_and_figures(cause: ErrorCause, flown: dict[str, Any]) -> None:
    axis = "heading" if "heading_error_deg" in flown else "depth"
    (finding,) = assessment.assess_log(dive(**flown)).findings
    assert (finding.axis, finding.cause) == (axis, cause)
    assert finding.message.startswith(f"{axis} ")


def test_trim_being_learned_is_not_called_unset() -> None:
    """A leg of 40 s ends before 10 s of TRIM_AUTO_S have taken the error out."""
    parameters = {"TRIM_AUTO_S": 10.0}
    flown = dive(
        length_s=40.0, heading_error_deg=constant(-8.0), rudder_deg=6.0, parameters=parameters
    )
    (finding,) = assessment.assess_log(flown).findings
    assert finding.cause == ErrorCause.LEARNING
    assert "fly `trim` first" in finding.message


def test_learned_trims_are_for_the_next_dive() -> None:
    """After `trim` itself, "fly `trim` first" would be no remedy."""
    parameters = {"TRIM_AUTO_S": 10.0}
    flown = dive(
        length_s=40.0, heading_error_deg=constant(-8.0), rudder_deg=6.0, parameters=parameters
    )
    learned = logs.LogEvent(30.0, TrimLearned("TRIM_RUD_DEG 6.0"))
    (finding,) = assessment.assess_log(replace(flown, events=(learned,))).findings
    assert finding.remedy.startswith("fly again with the trims that the vehicle has learned")


def test_short_dive_is_not_assessed() -> None:
    found = assessment.assess_log(dive(length_s=20.0, heading_error_deg=constant(-8.4)))
    assert (found.legs, found.findings, found.short_legs) == ((), (), 1)
    assert "not assessed: too short: no leg under water lasted 30 s" in verdict.format_text(found)


def test_log_that_ends_under_way_says_so_first() -> None:
    armed = logs.LogEvent(5.0, Armed())
    found = assessment.assess_log(replace(dive(length_s=20.0), events=(armed,)))
    assert verdict.headline(found) == (
        "the log ends at 3.0 m depth while the vehicle is armed, 15 s after arming"
    )
    assert "ended" in verdict.next_step(found)
    assert "too short" in verdict.format_text(found)


@pytest.mark.parametrize(
    ("depth_error_m", "thrust", "armed_s"),
    [(-2.9, 0.58, [5.0]), (0.0, 0.0, [5.0]), (0.0, 0.58, [])],
)
def test_log_that_ends_at_the_surface_or_unarmed_is_complete(
    depth_error_m: float, thrust: float, armed_s: list[float]
) -> None:
    flown = dive(depth_error_m=constant(depth_error_m))
    log = replace(
        flown,
        actuators=replace(flown.actuators, thrust=np.full(t_of(flown).size, thrust)),
        events=tuple(logs.LogEvent(time_s, Armed()) for time_s in armed_s),
    )
    kinds = [symptom.kind for symptom in assessment.assess_log(log).symptoms]
    assert SymptomKind.CUT_OFF not in kinds


def test_log_without_setpoints_is_not_assessed() -> None:
    silent = replace(dive(), setpoints=logs.Setpoints(EMPTY, EMPTY, EMPTY, EMPTY, EMPTY))
    assert (
        assessment.assess_log(silent).reason
        == "the vehicle sent no set-points of heading and depth"
    )


def test_vehicle_of_unknown_parameters_names_no_trim() -> None:
    foreign = replace(dive(heading_error_deg=constant(-8.4), rudder_deg=6.0), parameters={})
    (finding,) = assessment.assess_log(foreign).findings
    assert finding.cause == ErrorCause.UNKNOWN


@pytest.mark.parametrize("axis", ["attitude", "depth", "actuators"])
def test_gap_of_half_a_leg_is_not_assessed(axis: str) -> None:
    whole = dive(length_s=60.0)
    part = getattr(whole, axis)
    kept = (part.time_s < 25.0) | (part.time_s > 55.0)
    columns = {name: value for name, value in vars(part).items() if isinstance(value, np.ndarray)}
    cut = replace(part, **{name: values[kept] for name, values in columns.items()})
    found = assessment.assess_log(replace(whole, **{axis: cut}))
    assert found.legs == ()
    assert found.reason


def t_of(log: Log) -> Array:
    """Return the times of the set-points of heading."""
    return log.setpoints.attitude_time_s


def test_heading_on_a_line_uses_moving_setpoint() -> None:
    """Line-of-sight guidance turns the set-point by 0.2 deg/s, in steps below those of a change."""
    moving = dive(turn_degps=0.2, heading_error_deg=constant(-1.0))
    (leg,) = assessment.assess_log(moving).legs
    # the set-point of the sample before is up to 0.1 s old, which is 0.02 deg
    assert leg.heading_deg.mean == pytest.approx(-1.0, abs=0.03)


def test_leg_begins_when_the_guidance_has_reached_its_line() -> None:
    """The error of 8 deg lasts as long as the guidance turns the set-point by 1 deg/s."""
    flown = dive(heading_error_deg=lambda t: np.where(t < 60.0, -8.0, 0.5))
    setpoint_rad = flown.setpoints.heading_rad + np.radians(np.minimum(t_of(flown), 60.0) - 60.0)
    yaw_rad = flown.attitude.yaw_rad + setpoint_rad - flown.setpoints.heading_rad
    flown = replace(
        flown,
        attitude=replace(flown.attitude, yaw_rad=yaw_rad),
        setpoints=replace(flown.setpoints, heading_rad=setpoint_rad),
    )
    found = assessment.assess_log(flown)
    (leg,) = found.legs
    assert leg.start_s == pytest.approx(60.0, abs=3.0)
    assert leg.heading_deg.p95 == pytest.approx(0.5, abs=0.1)
    assert found.findings == ()


def test_setpoint_that_always_turns_is_not_assessed() -> None:
    found = assessment.assess_log(dive(turn_degps=0.5))
    assert found.legs == ()
    assert found.reason.startswith("the heading set-point moved all the time; ")


def test_trims_that_the_vehicle_learned_are_reported() -> None:
    found = assessment.assess_log(dive(), "TRIM_RUD_DEG 6.05, TRIM_ELE_DEG 0.4")
    assert found.trims_learned == "TRIM_RUD_DEG 6.05, TRIM_ELE_DEG 0.4"
    assert "learned its trims: TRIM_RUD_DEG 6.05" in verdict.format_text(found)


def test_setpoint_just_below_north_is_printed_as_0_deg() -> None:
    found = assessment.assess_log(dive())
    (leg,) = found.legs
    north = found._replace(legs=(leg._replace(heading_setpoint_deg=359.7),))
    assert " 0 deg, 3.0 m" in verdict.format_text(north)


def test_assessment_as_json_holds_plain_finite_values() -> None:
    found = assessment.assess_log(dive(heading_error_deg=constant(-8.4), rudder_deg=6.05))
    plain = json.loads(json.dumps(assessment.as_json(found), allow_nan=False))
    assert plain["findings"][0]["cause"] == "trim not set"
    assert plain["legs"][0]["heading_deg"]["mean"] == pytest.approx(-8.4)
    assert plain["settling_s"] == 25.0


def hard_over(side_s: float = 20.0) -> Callable[[Array], Array]:
    """Return commands that change from one stop to the other."""
    return lambda t: np.where((t // side_s) % 2 == 0, 15.0, -15.0)


def with_rudder(flown: Log, command_deg: Array, yaw_rate_radps: Array) -> Log:
    commands = replace(flown.actuators, rudder_rad=np.radians(command_deg))
    return replace(
        flown,
        actuators=commands,
        attitude=replace(flown.attitude, r_radps=yaw_rate_radps),
    )


@pytest.mark.parametrize(
    ("turn", "kind"),
    [(1.0, None), (-1.0, SymptomKind.REVERSED), (0.0, SymptomKind.STUCK)],
)
def test_rudder_hard_over_shows_sign_or_lack_of_its_effect(
    turn: float, kind: SymptomKind | None
) -> None:
    """A turn of 5 deg/s with or against the rudder, or always to one side."""
    flown = dive(heading_error_deg=swing(90.0, 40.0))
    command_deg = hard_over()(flown.actuators.time_s)
    rate = math.radians(5.0) * (turn * np.sign(command_deg) if turn else np.ones(command_deg.size))
    found = assessment.assess_log(with_rudder(flown, command_deg, rate))
    assert [s.kind for s in found.symptoms] == ([kind] if kind else [])
    if kind:
        assert found.outcome is Outcome.FAILED
        assert found.findings[0].cause is ErrorCause.SYMPTOM


@pytest.mark.parametrize(
    ("pitch_deg", "kind"), [(4.0, SymptomKind.HEAVY), (-8.0, SymptomKind.LIGHT), (-2.0, None)]
)
def test_level_flight_at_a_large_pitch_names_the_weight(
    pitch_deg: float, kind: SymptomKind | None
) -> None:
    found = assessment.assess_log(dive(pitch_deg=pitch_deg))
    assert [s.kind for s in found.symptoms] == ([kind] if kind else [])
    assert found.outcome is (Outcome.ATTENTION if kind else Outcome.GOOD)


@pytest.mark.parametrize(("depth_m", "elevator_deg"), [(0.2, -15.0), (0.2, 15.0), (3.0, -15.0)])
def test_elevator_hard_down_at_the_surface_means_afloat(
    depth_m: float, elevator_deg: float
) -> None:
    flown = dive()
    commands = replace(
        flown.actuators,
        elevator_rad=np.full(flown.actuators.time_s.size, math.radians(elevator_deg)),
    )
    depth = replace(flown.depth, depth_m=np.full(flown.depth.time_s.size, depth_m))
    found = assessment.assess_log(replace(flown, actuators=commands, depth=depth)).symptoms
    afloat = [s for s in found if s.kind is SymptomKind.AFLOAT]
    assert bool(afloat) is (depth_m < 0.3 and elevator_deg < 0.0)
    assert all(s.message.startswith("the vehicle does not leave the surface") for s in afloat)


@pytest.mark.parametrize("source", [VelocitySource.BOTTOM_TRACK, VelocitySource.WATER_TRACK])
def test_drift_over_ground_is_a_current(source: VelocitySource) -> None:
    """0.5 m/s to starboard at one heading; a log through the water shows no current."""
    flown = dive()
    t = flown.attitude.time_s
    velocity = logs.Velocity(t, np.full(t.size, 1.3), np.full(t.size, 0.5), 0.0 * t, source)
    found = assessment.assess_log(replace(flown, velocity=velocity)).symptoms
    if source is VelocitySource.WATER_TRACK:
        assert found == ()
    else:
        assert found[0].message.startswith("strong current: 0.5 m/s across the heading")
        assert "21 deg off the heading" in found[0].message  # atan(0.5 / 1.3)


@pytest.mark.parametrize("turns", [0, 1])
def test_sideslip_of_a_heading_that_swings_is_no_current(turns: int) -> None:
    """With one mean heading the current along it is unknown, also after a whole turn."""
    flown = dive(heading_error_deg=swing(10.0))
    t, yaw = flown.attitude.time_s, flown.attitude.yaw_rad
    sideslip_mps = -0.5 * np.sin(yaw - np.mean(yaw))
    turned = yaw + 2.0 * math.pi * turns * (t > np.mean(t))
    flown = replace(flown, attitude=replace(flown.attitude, yaw_rad=turned))
    velocity = logs.Velocity(
        t, np.full(t.size, 1.3), sideslip_mps, 0.0 * t, VelocitySource.BOTTOM_TRACK
    )
    found = assessment.assess_log(replace(flown, velocity=velocity)).symptoms
    assert SymptomKind.CURRENT not in [symptom.kind for symptom in found]


def test_failsafe_is_reported_before_errors_without_a_known_cause() -> None:
    event = logs.LogEvent(90.0, Failsafe(FailsafeCause.LEAK, "Failsafe: Leak -> SURFACE"))
    found = assessment.assess_log(replace(dive(depth_error_m=swing(1.0)), events=(event,)))
    assert found.outcome is Outcome.FAILED
    assert (
        verdict.headline(found)
        == "the vehicle reported 90 s after the start of the log: Failsafe: Leak -> SURFACE"
    )


def test_reported_fault_comes_before_the_oscillation_that_it_causes() -> None:
    """A dive with a wrong gyro was advised on gains and on the sea."""
    event = LogEvent(43.0, PlainText(3, "Gyro disagrees"))
    found = assessment.assess_log(replace(dive(heading_error_deg=swing(6.0)), events=(event,)))
    assert verdict.headline(found).endswith("Gyro disagrees")
    assert verdict.next_step(found).startswith("find the cause of this report")
    assert "oscillates" in verdict.format_text(found)


def test_failsafe_after_a_fault_has_a_remedy_of_its_own() -> None:
    events = (
        LogEvent(40.0, PlainText(3, "Pressure sensor silent")),
        LogEvent(45.0, Failsafe(FailsafeCause.DEPTH_UNKNOWN, "Failsafe: depth unknown")),
    )
    flown = dive(depth_error_m=constant(-0.9), elevator_deg=0.5, pitch_deg=-4.0)
    found = assessment.assess_log(replace(flown, events=events))
    assert verdict.next_step(found).startswith("find the cause of this report")


def test_injected_fault_comes_first_and_asks_for_a_dive_without_it() -> None:
    """The simulator announces it as a warning, whose texts are no reports of the vehicle."""
    events = (
        LogEvent(40.0, parse_text(4, "Fault: rudder biased")),
        LogEvent(43.0, PlainText(3, "Duct does not follow")),
        LogEvent(50.0, parse_text(5, "Fault over: rudder biased")),
    )
    flown = dive(heading_error_deg=constant(-8.4), rudder_deg=6.05)
    found = assessment.assess_log(replace(flown, events=events))
    assert verdict.headline(found) == (
        "the simulator injected a fault 40 s after the start of the log: rudder biased"
    )
    assert verdict.next_step(found).startswith("judge gains and trims by a dive without")
    assert "Duct does not follow; find the cause" in verdict.format_text(found)


def test_reported_fault_does_not_hide_a_trim_that_is_not_set() -> None:
    event = LogEvent(43.0, PlainText(3, "Depth not tracking"))
    flown = dive(heading_error_deg=constant(-8.4), rudder_deg=6.05)
    found = assessment.assess_log(replace(flown, events=(event,)))
    assert "trim is not set" in verdict.headline(found)


def test_outputs_that_may_be_motors_are_not_judged() -> None:
    """A log of a multicopter holds constant outputs and no word of a rudder."""
    flown = dive(heading_error_deg=swing(90.0, 40.0))
    command_deg = hard_over()(flown.actuators.time_s)
    rate = np.full(command_deg.size, math.radians(5.0))
    unknown = replace(with_rudder(flown, command_deg, rate), parameters={})
    assert assessment.assess_log(unknown).symptoms == ()


@pytest.mark.parametrize(
    ("command_deg", "pitch_deg", "end"), [(15.0, -12.0, "nose"), (-15.0, 12.0, "tail")]
)
def test_vehicle_that_pitches_against_its_elevator_is_advised_on_ballast(
    command_deg: float, pitch_deg: float, end: str
) -> None:
    """Weight at one end has the effect of an elevator that acts in the wrong direction."""
    flown = dive(pitch_deg=pitch_deg)
    count = flown.actuators.time_s.size
    commands = replace(flown.actuators, elevator_rad=np.full(count, math.radians(command_deg)))
    symptom = assessment.assess_log(replace(flown, actuators=commands)).symptoms[0]
    assert f"{end}-heavy, or the elevator is stuck or acts in the wrong" in symptom.message
    assert symptom.remedy.startswith("check that the vehicle floats level and move ballast")
    assert "wiring" in symptom.remedy


def test_elevator_wrong_on_both_sides_is_reversed() -> None:
    flown = dive()
    command_deg = hard_over()(flown.actuators.time_s)
    commands = replace(flown.actuators, elevator_rad=np.radians(command_deg))
    attitude = replace(flown.attitude, pitch_rad=np.radians(-np.sign(command_deg) * 12.0))
    found = assessment.assess_log(replace(flown, actuators=commands, attitude=attitude))
    assert found.symptoms[0].remedy.startswith("reverse the elevator")
