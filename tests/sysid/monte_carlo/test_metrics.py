"""What is said of a dive: when a leg had settled, what was not held, and whether her hull came
through the surface."""

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


def told(
    heading_deg: NDArray[np.float64] | float = 0.0,
    depth_m: NDArray[np.float64] | float = 3.0,
    rudder_deg: float = 1.0,
    failsafe: str = "",
    finished: bool = True,
    course_deg: NDArray[np.float64] | float = 0.0,
) -> DiveMetrics:
    """Of a minute at 3 m, the heading to be held 0 where there is no course."""
    none, heading, depth = (
        np.zeros_like(TIME_S),
        np.radians(heading_deg) + 0.0 * TIME_S,
        depth_m + 0.0 * TIME_S,
    )
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
    return metrics.of_dive(SimulatedDive(log, depth, failsafe, finished), TRAVEL_RAD, RADIUS_M)


def test_a_leg_has_settled_when_the_last_excursion_is_over() -> None:
    assert told(heading_deg=np.where(TIME_S < 12.0, 10.0, 1.0)).legs[0].settled_s == pytest.approx(
        11.8, abs=0.11
    )


def test_a_leg_that_is_left_at_its_end_has_not_settled() -> None:
    assert told(depth_m=np.where(TIME_S > 57.0, 3.5, 3.0)).legs[0].settled_s is None


def test_steady_errors_leave_the_settling_out() -> None:
    steady = told(heading_deg=np.where(TIME_S < 20.0, 50.0, 0.5)).steady
    assert steady is not None
    assert steady.heading_deg == pytest.approx(0.5)


def test_on_a_path_the_error_is_from_the_course_of_the_moment() -> None:
    course_deg = 0.5 * TIME_S
    found = told(heading_deg=course_deg + 0.5, course_deg=course_deg)
    assert found.steady is not None
    assert found.steady.heading_deg == pytest.approx(0.5)
    assert found.legs[0].settled_s == 0.0
    assert found.diverged == ""


@pytest.mark.parametrize(
    ("dive", "diverged"),
    [
        (told(), ""),
        (told(heading_deg=25.0 * np.sin(TIME_S)), "heading"),
        (told(rudder_deg=15.0), "heading"),
        (told(depth_m=4.5), "depth"),
        (told(finished=False), "the mission's time"),
        (told(finished=False, failsafe="depth 18.2 m"), ""),
    ],
)
def test_what_was_not_held_is_named(dive: DiveMetrics, diverged: str) -> None:
    assert dive.diverged == diverged


def test_a_failsafe_is_told_without_its_figure() -> None:
    assert told(failsafe="depth 18.2 m").failsafe == "depth"


def test_she_broaches_only_once_she_has_dived() -> None:
    diving = np.minimum(3.0, 0.1 * TIME_S)
    assert not told(depth_m=diving).broached
    shown = told(depth_m=np.where(TIME_S > 50.0, 0.2, diving))
    assert shown.broached
    assert shown.shallowest_m == pytest.approx(0.2)
