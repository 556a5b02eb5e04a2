"""Assessment of a dive from synthetic logs with a known cause."""

import json
import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ground.client import assessment
from ground.client.assessment import ErrorCause
from sysid.data import dataset as logs
from sysid.data.dataset import Log

Array = NDArray[np.float64]
FIRST_GAINS = {
    "ACT_TRAVEL_DEG": 15.0,
    "PTCH_P": 0.8,
    "TRIM_RUD_DEG": 0.0,
    "TRIM_ELE_DEG": 0.0,
    "TRIM_AUTO_S": 0.0,
}
EMPTY = np.empty(0)


def constant(value: float) -> Callable[[Array], Array]:
    return lambda t: np.full(t.size, value)


def dive(
    *,
    length_s: float = 200.0,
    heading_error_deg: Callable[[Array], Array] = np.zeros_like,
    depth_error_m: Callable[[Array], Array] = np.zeros_like,
    turn_degps: float = 0.0,
    rudder_deg: float = 0.0,
    elevator_deg: float = 0.0,
    pitch_deg: float = 0.0,
    parameters: dict[str, float] | None = None,
) -> Log:
    """Return the log of a leg at 20 deg, which may turn, and 3 m that begins at 0 s."""
    t = np.arange(0.0, length_s, 0.1)
    zero = np.zeros(t.size)
    setpoint_rad = np.radians(20.0 + turn_degps * t)
    return Log(
        name="made up",
        sha256="",
        attitude=logs.Attitude(
            time_s=t,
            roll_rad=zero,
            pitch_rad=np.full(t.size, math.radians(pitch_deg)),
            yaw_rad=setpoint_rad + np.radians(heading_error_deg(t)),
            p_radps=zero,
            q_radps=zero,
            r_radps=zero,
        ),
        actuators=logs.Actuators(
            time_s=t,
            rudder_rad=np.full(t.size, math.radians(rudder_deg)),
            elevator_rad=np.full(t.size, math.radians(elevator_deg)),
            thrust=np.full(t.size, 0.58),
        ),
        depth=logs.Depth(t, 3.0 + depth_error_m(t), zero),
        setpoints=logs.Setpoints(t, setpoint_rad, zero, t, np.full(t.size, 3.0)),
        events=(),
        parameters=FIRST_GAINS | (parameters or {}),
        duct=logs.DuctAngles(EMPTY, EMPTY, EMPTY),
    )


def swing(size: float, period_s: float = 8.0) -> Callable[[Array], Array]:
    return lambda t: size * np.sin(2.0 * math.pi * t / period_s)


def decay(size: float, time_s: float) -> Callable[[Array], Array]:
    return lambda t: size * np.exp(-t / time_s)


def test_dive_held_well_has_no_findings() -> None:
    found = assessment.assess_log(dive(heading_error_deg=swing(1.0), depth_error_m=constant(-0.2)))
    assert (found.findings, found.reason, found.short_legs) == ((), "", 0)
    (leg,) = found.legs
    assert (leg.heading_setpoint_deg, leg.depth_setpoint_m) == pytest.approx((20.0, 3.0))
    # 95 % of a sine lie within sin(0.95 * 90 deg) = 0.997 of its amplitude
    assert leg.heading_deg.p95 == pytest.approx(0.997, abs=0.005)
    assert (leg.depth_m.mean, leg.depth_m.p95) == pytest.approx((-0.2, 0.2))
    words = "good: 95 % of the errors within 2.5 deg of heading and 0.5 m of depth on every leg"
    assert words in assessment.format_text(found)


def test_heading_offset_names_the_trim_that_is_not_set() -> None:
    found = assessment.assess_log(dive(heading_error_deg=constant(-8.4), rudder_deg=6.05))
    (finding,) = found.findings
    assert (finding.axis, finding.cause, finding.legs) == ("heading", ErrorCause.TRIM, 1)
    assert "heading 8.4 deg off in the mean: the rudder trim is not set" in finding.message
    assert (
        "set TRIM_RUD_DEG to 6.0" in finding.message or "set TRIM_RUD_DEG to 6.1" in finding.message
    )
    assert finding.message in assessment.format_text(found)


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


def test_short_dive_is_not_assessed() -> None:
    found = assessment.assess_log(dive(length_s=20.0, heading_error_deg=constant(-8.4)))
    assert (found.legs, found.findings, found.short_legs) == ((), (), 1)
    assert (
        "cannot be assessed: too short: no leg under water lasted 30 s"
        in assessment.format_text(found)
    )


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


def test_heading_on_a_line_uses_moving_setpoint() -> None:
    """Line-of-sight guidance turns the set-point by 0.2 deg/s, in steps below those of a change."""
    moving = dive(turn_degps=0.2, heading_error_deg=constant(-1.0))
    (leg,) = assessment.assess_log(moving).legs
    # the set-point of the sample before is up to 0.1 s old, which is 0.02 deg
    assert leg.heading_deg.mean == pytest.approx(-1.0, abs=0.03)


def test_trims_that_the_vehicle_learned_are_reported() -> None:
    found = assessment.assess_log(dive(), "TRIM_RUD_DEG 6.05, TRIM_ELE_DEG 0.4")
    assert found.trims_learned == "TRIM_RUD_DEG 6.05, TRIM_ELE_DEG 0.4"
    assert "learned its trims: TRIM_RUD_DEG 6.05" in assessment.format_text(found)


def test_assessment_as_json_holds_plain_finite_values() -> None:
    found = assessment.assess_log(dive(heading_error_deg=constant(-8.4), rudder_deg=6.05))
    plain = json.loads(json.dumps(assessment.as_json(found), allow_nan=False))
    assert plain["findings"][0]["cause"] == "trim not set"
    assert plain["legs"][0]["heading_deg"]["mean"] == pytest.approx(-8.4)
    assert plain["settling_s"] == 25.0
