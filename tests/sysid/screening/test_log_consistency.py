"""A log of another vehicle is named from the gain errors of its tests against the common fit.

The sizes are those of simulated campaigns of four 3-2-1-1 tests per plane and log, fitted together.
"""

import math
from dataclasses import replace

import numpy as np
import pytest

from sitl.vehicle import config
from sysid.data.dataset import VelocitySource
from sysid.data.events import StopReason
from sysid.data.runs import Run
from sysid.models import parameters
from sysid.planes import Plane
from sysid.screening import RunScreening
from sysid.screening.log_consistency import two_vehicles, wrong_thrust
from sysid.screening.score_test import Anomaly, Scores

SD_PERCENT = 3.0


def run(name: str) -> Run:
    nothing = np.zeros(2)
    return Run(
        name,
        Plane.YAW,
        "3211",
        5.0,
        np.array([0.0, 0.02]),
        *(nothing,) * 10,
        stop_reason=StopReason.COMPLETE,
        longest_gap_s=0.02,
        rudder_trim_rad=0.0,
        elevator_trim_rad=0.0,
    )


def found(sizes_by_log: dict[str, list[float]], sd_percent: float = SD_PERCENT) -> str:
    sizes = {
        f"{log}/{k}": size for log, sizes in sizes_by_log.items() for k, size in enumerate(sizes)
    }
    screenings = {
        name: RunScreening(
            name,
            Scores((Anomaly("gain error", size / sd_percent, size, sd_percent, "%", None),), 0.5),
            None,
            "",
            (),
        )
        for name, size in sizes.items()
    }
    return two_vehicles(screenings, [run(name) for name in sizes])


def test_log_of_another_vehicle_is_named() -> None:
    """Caribou and ``xfin_auv``, whose rudder is 15 % more effective."""
    said = found({"a": [-6.0, -3.0, 5.0, 2.0], "b": [49.0, 44.0, -7.0, -4.0]})
    assert said == (
        "two different vehicles among the logs, or one that was changed: the response to the rudder"
        " in b is off by 26 % in the median of its 4 tests; fit the logs of one vehicle"
    )


def test_logs_of_one_vehicle_are_accepted() -> None:
    """Steps and 3-2-1-1 of ``remus100``, in which the model fits worst, and one bad test."""
    assert found({"steps": [16.0, -1.0, 13.0, -2.0], "waves": [-3.0, 0.0, 1.0, 0.0]}) == ""
    assert found({"steps": [50.0, -1.0, 3.0, -2.0], "waves": [-3.0, 0.0, 1.0, 0.0]}) == ""


def test_uncertain_or_single_logs_are_not_judged() -> None:
    apart = {"a": [-6.0, -3.0, 5.0, 2.0], "b": [49.0, 44.0, -7.0, -4.0]}
    assert found(apart, sd_percent=20.0) == ""
    assert found({"b": apart["b"]}) == ""
    assert found({"a": apart["a"], "b": [49.0]}) == ""


@pytest.mark.parametrize(
    ("thrust", "source", "is_wrong"),
    [
        (0.58, VelocitySource.COLUMN, False),
        (0.35, VelocitySource.COLUMN, True),
        (1.0, VelocitySource.WATER_TRACK, True),
        (0.35, VelocitySource.BOTTOM_TRACK, False),
        (0.35, VelocitySource.NONE, False),
    ],
)
def test_thrust_that_contradicts_the_speed_through_water_is_named(
    thrust: float, source: VelocitySource, is_wrong: bool
) -> None:
    """Caribou flies at 1.3 m/s with 58 % thrust; a current changes the speed over ground."""
    vehicle = parameters.candidate_vehicle(
        config.load("caribou_nominal"), dict.fromkeys(Plane, 0.0), np.zeros(len(parameters.NAMES))
    )
    measured = replace(
        run("a/0"),
        thrust=np.full(2, thrust),
        velocity_source=source,
        straight_speed_mps=math.nan if source == VelocitySource.NONE else 1.3,
    )
    said = wrong_thrust(vehicle, [measured])
    assert bool(said) == is_wrong
    if is_wrong:
        assert said.startswith(f"a/0: with a thrust of {thrust:.0%} the model reaches")
        assert "1.30 m/s" in said
