"""Metrics of a dive: settling of legs, divergence, failsafe and broaching."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from sysid.data.dataset import Actuators, Attitude, Depth, DuctAngles, Log, Setpoints
from sysid.monte_carlo import metrics
from sysid.monte_carlo.metrics import DiveMetrics
from sysid.monte_carlo.simulate import SimulatedDive

TIME_S = np.arange(0.1, 60.0, 0.1)
TRAVEL_RAD, RADIUS_M = math.radians(15.0), 0.3


def dive_metrics(
    heading_deg: NDArray[np.float64] | float = 0.0,
    depth_m: NDArray[np.float64] | float = 3.0,
    rudder_deg: float = 1.0,
    failsafe: str = "",
    finished: bool = True,
    course_deg: NDArray[np.float64] | float = 0.0,
    settling_s: float = 25.0,
) -> DiveMetrics:
    """Return a dive of one minute at 3 m with heading 0 unless a course is given."""
    none = np.zeros_like(TIME_S)
    heading = np.radians(heading_deg) + 0.0 * TIME_S
    depth = depth_m + 0.0 * TIME_S
    log = Log(
        "dive",
        "",
        Attitude(TIME_S, none, none, heading, none, none, none),
        Actuators(TIME_S, np.radians(rudder_deg) + none, none, none),
        Depth(TIME_S, depth, none),
        Setpoints(TIME_S, np.radians(course_deg) + none, none, TIME_S, 3.0 + none),
        (),
        {},
        DuctAngles(none, none, none),
    )
    dive = SimulatedDive(log, depth, failsafe, finished)
    return metrics.of_dive(dive, TRAVEL_RAD, RADIUS_M, settling_s)


def test_leg_settles_after_last_excursion() -> None:
    assert dive_metrics(heading_deg=np.where(TIME_S < 12.0, 10.0, 1.0)).legs[
        0
    ].settling_s == pytest.approx(11.8, abs=0.11)


def test_leg_excursion_at_end_is_unsettled() -> None:
    assert dive_metrics(depth_m=np.where(TIME_S > 57.0, 3.5, 3.0)).legs[0].settling_s is None


def test_steady_error_excludes_settling() -> None:
    steady = dive_metrics(heading_deg=np.where(TIME_S < 20.0, 50.0, 0.5)).steady
    assert steady is not None
    assert steady.heading_deg == pytest.approx(0.5)


def test_steady_error_on_path_uses_current_setpoint() -> None:
    course_deg = 0.5 * TIME_S
    metrics_on_path = dive_metrics(heading_deg=course_deg + 0.5, course_deg=course_deg)
    assert metrics_on_path.steady is not None
    assert metrics_on_path.steady.heading_deg == pytest.approx(0.5)
    assert metrics_on_path.legs[0].settling_s == 0.0
    assert metrics_on_path.diverged == ""


@pytest.mark.parametrize(
    ("dive", "diverged"),
    [
        (dive_metrics(), ""),
        (dive_metrics(heading_deg=25.0 * np.sin(TIME_S)), "heading"),
        (dive_metrics(rudder_deg=15.0), "heading"),
        (dive_metrics(depth_m=4.5), "depth"),
        (dive_metrics(finished=False), "the mission's time"),
        (dive_metrics(finished=False, failsafe="depth 18.2 m"), ""),
    ],
)
def test_divergence_names_quantity(dive: DiveMetrics, diverged: str) -> None:
    assert dive.diverged == diverged


def test_slow_vehicle_is_given_its_own_settling_time() -> None:
    """A hull of 6 m still dived after 25 s: redesigned gains with less error were refused."""
    diving_m = np.minimum(3.0, 0.075 * TIME_S)
    assert dive_metrics(depth_m=diving_m).diverged == "depth"
    slow = dive_metrics(depth_m=diving_m, settling_s=41.0)
    assert slow.diverged == ""
    assert slow.steady is not None
    assert slow.steady.depth_m == pytest.approx(0.0)


def test_failsafe_text_has_no_number() -> None:
    assert dive_metrics(failsafe="depth 18.2 m").failsafe == "depth"


def test_broached_before_diving_is_false() -> None:
    diving = np.minimum(3.0, 0.1 * TIME_S)
    assert not dive_metrics(depth_m=diving).broached
    shown = dive_metrics(depth_m=np.where(TIME_S > 50.0, 0.2, diving))
    assert shown.broached
    assert shown.shallowest_m == pytest.approx(0.2)
