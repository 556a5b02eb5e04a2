"""Limits of an unsteady start, from the pre-rolls of the other runs."""

import math
from dataclasses import replace

import numpy as np
import pytest

from sitl.vehicle import config
from sysid.data.runs import Run
from sysid.planes import Plane
from sysid.screening import screen
from sysid.screening.preroll import UsualPreroll
from sysid.screening.rules import unsteady_start
from tests.sysid import sea


@pytest.fixture(scope="module")
def calm(field: config.VehicleConfig) -> list[Run]:
    return _set(field, sea.CALM)


@pytest.fixture(scope="module")
def rough(field: config.VehicleConfig) -> list[Run]:
    return _set(field, 2.5 * sea.ROUGH)


def _set(field: config.VehicleConfig, level: float) -> list[Run]:
    trim = (math.radians(6.0), 0.0)
    return [
        sea.fly(
            field, Plane.YAW, sea.step(4.0, 8.0), name=f"{k}", seed=k, level=level, trim_rad=trim
        )
        for k in range(4)
    ]


def unsteady(runs: list[Run], turning_degps: float) -> bool:
    """Return whether the first run is rejected for a turn rate before its test."""
    turn = math.radians(turning_degps) * runs[0].approach
    (first, *_) = screen([replace(runs[0], r_radps=runs[0].r_radps + turn), *runs[1:]])
    return any(reason.startswith("unsteady start: mean rate") for reason in first.reasons)


def test_unsteady_start_limit_follows_disturbance(calm: list[Run], rough: list[Run]) -> None:
    for runs in (calm, rough):
        assert not unsteady(runs, 0.0)
    assert unsteady(calm, 0.7)
    assert not unsteady(rough, 0.7)
    assert unsteady(rough, 4.0)


def test_unsteady_start_ignores_common_gyro_bias(calm: list[Run]) -> None:
    biased = [replace(run, r_radps=run.r_radps + math.radians(0.7)) for run in calm]
    assert not unsteady(biased, 0.0)
    assert unsteady(biased, 0.7)


def test_unsteady_start_single_run_has_fixed_limit(calm: list[Run]) -> None:
    assert not unsteady(calm[:1], 0.7)
    assert unsteady(calm[:1], 1.3)


def test_unsteady_start_limit_is_robust_to_one_run(calm: list[Run]) -> None:
    wild = replace(
        calm[1],
        r_radps=calm[1].r_radps + math.radians(5.0) * np.sin(calm[1].time_s) * calm[1].preroll,
    )
    assert unsteady([calm[0], wild, *calm[2:]], 0.7)


def test_unsteady_start_reason_shows_excess_over_limit(calm: list[Run]) -> None:
    """Two decimals read as the limit."""
    sinking = replace(calm[0], depth_m=0.0512 * calm[0].time_s)
    usual = UsualPreroll(rate_radps=0.0, rate_allowed_radps=1.0, depth_rate_allowed_mps=0.05)
    assert unsteady_start(sinking, usual) == (
        "unsteady start: depth changing at 0.0512 m/s, at most 0.05 in this sea"
    )


def test_unsteady_start_names_loop_in_limit_cycle(calm: list[Run]) -> None:
    """The heading loop of a hull with a slow servo drove its rudder from stop to stop."""
    first = calm[0]
    swing = first.travel_rad * np.sign(np.sin(first.time_s))
    cycling = replace(first, rudder_rad=np.where(first.time_s < 0.0, swing, first.rudder_rad))
    reasons = screen([cycling, *calm[1:]])[0].reasons
    (reason,) = (reason for reason in reasons if reason.startswith("unsteady start"))
    assert reason.startswith("unsteady start: the rudder was at its stops (15 deg) before the test")
    assert "lower the gains" in reason


def test_unsteady_start_accepts_moment_at_stops(calm: list[Run]) -> None:
    """A wave takes the rudder to its stop for half a second."""
    first = calm[0]
    wave = np.where(np.abs(first.time_s + 2.0) < 0.25, first.travel_rad, first.rudder_rad)
    (accepted, *_) = screen([replace(first, rudder_rad=wave), *calm[1:]])
    assert accepted.reasons == ()
