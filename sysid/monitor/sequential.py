"""Sums of log-likelihood ratios, one for each way in which a promise can be broken (CUSUM; Page
1954).

Each test weighs "off by what the promise allows" against "off by clearly more". Its sum is kept
from falling below zero; while the promise holds it passes h once in e^h blocks at the most often
(Lorden 1971, Ann. Math. Stat. 42), so the threshold follows from how seldom a false alarm may be.
An average over a block is taken as normal, a variance as chi-square with a degree of freedom for
each ``memory_s``."""

import math
from collections.abc import Mapping, Sequence
from typing import Literal, NamedTuple

from sysid.monitor.blocks import Block
from sysid.monitor.performance_spec import AVERAGED_S, PerformanceBaseline, PredictedStatistic

FALSE_ALARM_H = 100.0
"""Hours of steady flight between two false alarms, at least."""
ChangeKind = Literal["more", "less", "louder"]
MIN_SHIFT = {
    "heading_deg": 0.5,
    "pitch_deg": 0.05,
    "depth_m": 0.1,
    "rudder_deg": 0.5,
    "elevator_deg": 0.5,
}
"""Averages off by less than this, beside what the model does not know, are nothing to speak of.
Pitch tells of the buoyancy: a third more of it moves Caribou's by half a degree."""
CLEAR_SHIFT_SD = 1.5
"""An average's standard deviations beyond what is allowed for which its test is sharpest."""
ALLOWED_RATIO, CLEAR_RATIO = 2.0, 4.0
"""Of variances: a sea is never twice the same, and rms is told to 40 % or so."""
HINT = 3.0
"""A sum that says twenty to one: not enough to raise an alarm, enough to tell what another one is
about."""


class Sum(NamedTuple):
    """One test, and what it has seen since its sum last was zero."""

    value: float = 0.0
    blocks: int = 0
    total: float = 0.0
    """Of the departures from the promise, or of the ratios of variances."""

    @property
    def mean(self) -> float:
        return self.total / self.blocks if self.blocks else 0.0


Sums = Mapping[tuple[str, ChangeKind], Sum]


def initial_sums(promise: PerformanceBaseline) -> Sums:
    sums: dict[tuple[str, ChangeKind], Sum] = {}
    for name in promise.predicted:
        if name in MIN_SHIFT:
            sums |= {(name, "more"): Sum(), (name, "less"): Sum()}
        sums[name, "louder"] = Sum()
    return sums


def update(promise: PerformanceBaseline, sums: Sums, block: Block) -> Sums:
    """The sums with one more block."""
    return {
        (name, way): _update_sum(name, way, promise.predicted[name], found, block)
        for (name, way), found in sums.items()
    }


def threshold(sums: Sums) -> float:
    """That all tests together pass once in ``FALSE_ALARM_H`` at the most often."""
    return math.log(len(sums) * FALSE_ALARM_H * 3600.0 / AVERAGED_S)


def has_alarm(sums: Sums) -> bool:
    return any(found.value > threshold(sums) for found in sums.values())


def shifted_means(sums: Sums) -> dict[str, float]:
    """By how much averages have moved, where that is likely, and likelier than that they only vary
    more."""
    return {
        name: found.mean
        for (name, way), found in sums.items()
        if way != "louder" and found.value > max(HINT, sums[name, "louder"].value)
    }


def increased_rms(sums: Sums, hint: float = HINT) -> dict[str, float]:
    """Ratios of rms, measured over promised, for those that are likely larger than allowed."""
    return {
        n: math.sqrt(found.mean)
        for (n, way), found in sums.items()
        if way == "louder" and found.value > hint
    }


def errors(promise: PerformanceBaseline, blocks: Sequence[Block]) -> dict[str, tuple[float, float]]:
    """By quantity the rms about the promised mean over all blocks, and the promised one."""
    if not blocks:
        return {}

    def measured(name: str, mean: float) -> float:
        squares = [block.variances[name] + (block.means[name] - mean) ** 2 for block in blocks]
        return math.sqrt(sum(squares) / len(squares))

    return {
        name: (measured(name, e.mean if name in MIN_SHIFT else 0.0), e.rms)
        for name, e in promise.predicted.items()
    }


def _update_sum(
    name: str, way: ChangeKind, expected: PredictedStatistic, before: Sum, block: Block
) -> Sum:
    if way == "louder":
        seen = block.variances[name] / (expected.rms**2 - expected.average_sd**2)
        gain = _variance_log_likelihood_ratio(seen, AVERAGED_S / expected.memory_s)
    else:
        seen = block.means[name] - expected.mean
        gain = _mean_log_likelihood_ratio(seen if way == "more" else -seen, name, expected)
    value = max(0.0, before.value + gain)
    return Sum(value, before.blocks + 1, before.total + seen) if value > 0.0 else Sum()


def _mean_log_likelihood_ratio(departure: float, name: str, expected: PredictedStatistic) -> float:
    """Logarithm of the likelihood ratio of an average, ``departure`` above what was promised."""
    # A design's integrators promise averages steadier than these; slow currents, which no model
    # knows, are against it.
    sd = max(expected.average_sd, expected.rms * math.sqrt(expected.memory_s / AVERAGED_S))
    allowed, further = MIN_SHIFT[name] + 2.0 * expected.mean_sd, CLEAR_SHIFT_SD * sd
    return further * (departure - allowed - 0.5 * further) / sd**2


def _variance_log_likelihood_ratio(ratio: float, freedom: float) -> float:
    """The same of a variance over the promised one."""
    fall = 1.0 / ALLOWED_RATIO - 1.0 / CLEAR_RATIO
    return 0.5 * freedom * (ratio * fall - math.log(CLEAR_RATIO / ALLOWED_RATIO))
