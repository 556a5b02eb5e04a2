"""The monitor study: figures from synthetic rows, and one dive with a fault."""

import math

import numpy as np
import pytest
from msgspec import structs

from benchmarks import monitor
from sysid.monitor.performance_spec import PredictedStatistic
from tests.sysid.monitor import made

GAINS = {"HDG_I": 0.05, "HDG_IMAX": 0.1}


def figures(case: str, rows: list[list[float]]) -> dict[str, float]:
    return {figure.name: figure.value for figure in monitor.judge(case, np.array(rows))}


def test_one_false_alarm_misses_the_target() -> None:
    found = monitor.judge("matched", np.array([[0.2, math.nan, 0.0], [0.2, 130.0, 0.0]]))
    assert [(figure.name, figure.met) for figure in found] == [
        ("steady flight", True),
        ("false alarms", False),
    ]


def test_missed_fault_gives_infinite_delay() -> None:
    assert figures("buoyancy", [[0.1, 40.0, 1.0], [0.1, 80.0, 1.0]])["after, slowest"] == 80.0
    never = figures("buoyancy", [[0.1, 40.0, 1.0], [0.1, math.nan, 0.0]])
    assert (never["noticed"], never["after, median"], never["cause named"]) == (0.5, math.inf, 0.5)


def test_bent_rudder_is_detected_with_its_cause(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The baseline is set by hand, twice as wide as a design's; three degrees still exceed it."""
    monkeypatch.setattr(monitor, "FROM_S", 120.0)
    monkeypatch.setattr(monitor, "LASTS_S", 240.0)
    promise = made.baseline()
    wide = {name: wider(expected) for name, expected in promise.predicted.items()}
    hours, after_s, right = monitor.trial(
        structs.replace(promise, predicted=wide), GAINS, "bent rudder", 1
    )
    assert hours > 0.04
    assert 0.0 < after_s < 60.0
    assert right == 1.0


def wider(expected: PredictedStatistic) -> PredictedStatistic:
    return structs.replace(expected, rms=2.0 * expected.rms, mean_sd_20s=2.0 * expected.mean_sd_20s)
