"""Screening rules: every rejection names its rule, and a clean run passes."""

import math
from dataclasses import replace

import numpy as np
import pytest

from sitl.vehicle import config
from sysid.data.events import StopReason
from sysid.data.runs import Run
from sysid.planes import Plane
from sysid.screening import rules, screen
from tests.sysid import sea


@pytest.fixture(scope="module")
def yaw(field: config.VehicleConfig) -> Run:
    return sea.fly(
        field, Plane.YAW, sea.step(4.0, 10.0), level=sea.CALM, trim_rad=(math.radians(6.0), 0.0)
    )


@pytest.fixture(scope="module")
def pitch(field: config.VehicleConfig) -> Run:
    return sea.fly(
        field, Plane.PITCH, sea.step(4.0, 6.0), level=sea.CALM, trim_rad=(math.radians(6.0), 0.0)
    )


def reasons(run: Run) -> tuple[str, ...]:
    (screening,) = screen([run])
    assert screening.accepted == (not screening.reasons)
    return screening.reasons


def test_screen_clean_runs_are_accepted(yaw: Run, pitch: Run) -> None:
    assert all(s.accepted for s in screen([yaw, pitch]))


def during(run: Run, values: np.ndarray, change: float) -> np.ndarray:
    return np.asarray(values + change * (run.time_s > 2.0))


@pytest.mark.parametrize("gap_s", [0.199, 0.201])
def test_rows_at_five_hertz_are_a_gap(yaw: Run, gap_s: float) -> None:
    """Time stamps are rounded to whole milliseconds, up or down."""
    assert "less than 0.2 needed" in screen([replace(yaw, longest_gap_s=gap_s)])[0].reasons[0]
    assert screen([replace(yaw, longest_gap_s=0.19)])[0].reasons == ()


def test_screen_names_each_fault(yaw: Run, pitch: Run) -> None:
    faults = {
        "gap": replace(yaw, longest_gap_s=0.5),
        "aborted too soon": replace(
            yaw,
            time_s=yaw.time_s - yaw.time_s[-1] + 2.0,
            stop_reason=StopReason.PITCH,
            stop_detail="pitch 31 deg",
        ),
        "saturation": replace(
            yaw, elevator_rad=during(yaw, 0.0 * yaw.elevator_rad, math.radians(15.0))
        ),
        "speed off": replace(yaw, thrust=during(yaw, yaw.thrust, 0.1)),
        "unsteady start": replace(yaw, r_radps=yaw.r_radps + math.radians(2.0)),
        "cross-plane coupling": replace(
            yaw, pitch_rad=during(yaw, yaw.pitch_rad, math.radians(12.0))
        ),
    }
    for name, run in faults.items():
        assert any(reason.startswith(f"{name}: ") for reason in reasons(run)), name
    assert any(
        "depth moved" in r for r in reasons(replace(yaw, depth_m=during(yaw, yaw.depth_m, 2.0)))
    )
    assert any(
        "heading moved" in r
        for r in reasons(replace(pitch, heading_rad=during(pitch, pitch.heading_rad, 0.5)))
    )
    assert any("depth changing" in r for r in reasons(replace(yaw, depth_m=0.4 * yaw.time_s)))
    assert any(
        "roll reached" in r for r in reasons(replace(yaw, roll_rad=during(yaw, yaw.roll_rad, 0.5)))
    )


def test_screen_rough_preroll_of_one_run_is_rejected(yaw: Run) -> None:
    gust = np.radians(1.5) * np.sin(2.0 * yaw.time_s) * (yaw.time_s < 0)
    results = screen([yaw, replace(yaw, r_radps=yaw.r_radps + gust), yaw])
    assert [s.accepted for s in results] == [True, False, True]
    assert results[1].reasons[0].startswith("disturbance: ")


def test_screen_large_response_is_accepted(yaw: Run) -> None:
    """Twice the response to the rudder is a property of the vehicle, not a defect of the run."""
    rate = yaw.r_radps * np.where(yaw.time_s > 0, 2.0, 1.0)
    heading = yaw.heading_rad + np.maximum(
        yaw.heading_rad - yaw.heading_rad[np.argmax(yaw.time_s > 0)], 0.0
    )
    assert reasons(replace(yaw, r_radps=rate, heading_rad=heading)) == ()


def test_gap_of_depth_may_be_longer(yaw: Run) -> None:
    assert reasons(replace(yaw, longest_depth_gap_s=0.45)) == ()
    assert reasons(replace(yaw, longest_depth_gap_s=0.55)) == (
        "gap: 0.55 s without depth, at most 0.5",
    )


def test_depth_in_feet_is_named_where_the_speed_is_measured(field: config.VehicleConfig) -> None:
    turned = (math.radians(6.0), 0.0)
    dive = sea.fly(field, Plane.PITCH, sea.step(4.0, 20.0), level=sea.CALM, trim_rad=turned)
    feet = replace(dive, depth_m=dive.depth_m / 0.3048)
    assert "wrong unit" not in str(reasons(feet))
    named = "m/s where 1.3 are measured: the depth is in the wrong unit, give metres"
    assert named in str(reasons(replace(feet, straight_speed_mps=1.3)))
    assert "wrong unit" not in str(reasons(replace(dive, straight_speed_mps=1.3)))


def test_saturation_uses_travel_of_the_vehicle(yaw: Run) -> None:
    """An elevator at 9 deg is at its stops on a vehicle with 9 deg of travel, not with 15 deg."""
    held = replace(yaw, elevator_rad=during(yaw, 0.0 * yaw.elevator_rad, math.radians(9.0)))
    assert not any(reason.startswith("saturation") for reason in reasons(held))
    short = replace(held, travel_rad=math.radians(9.0))
    assert any(
        reason.startswith("saturation: a surface at its stops (9 deg)") for reason in reasons(short)
    )


def test_depth_that_does_not_follow_pitch_is_rejected(field: config.VehicleConfig) -> None:
    """A barometer measures the air in the hull. The vehicle has 1.3 m/s, slower ones less."""
    turned = (math.radians(6.0), 0.0)
    pitch = sea.fly(field, Plane.PITCH, sea.step(4.0, 20.0), level=sea.CALM, trim_rad=turned)
    thrust = float(np.mean(pitch.thrust))
    in_air = replace(pitch, depth_m=0.3 + 0.05 * np.sin(pitch.time_s / 5.0))
    reason = rules.depth_without_pitch(in_air, 1.3 / thrust)
    assert reason.startswith("kinematics: depth does not follow pitch: they give ")
    assert "and the vehicle has 1.30 m/s by its file;" in reason
    (screening,) = screen([in_air], 1.3 / thrust)
    assert reason in screening.reasons
    for speed_mps in (1.3, 3.0):
        assert rules.depth_without_pitch(pitch, speed_mps / thrust) == ""
    for speed_mps in (0.1, math.nan):  # the change of depth is within its noise, or not known
        assert rules.depth_without_pitch(in_air, speed_mps / thrust) == ""
