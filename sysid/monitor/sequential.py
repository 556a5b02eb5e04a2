"""Sequential tests for deviations from the performance baseline (CUSUM; Page 1954).

Each test accumulates the log-likelihood ratio of "clear deviation" over "deviation within the
allowance", limited to positive values::

    g_k = max(0, g_(k-1) + ln(p_1(window_k) / p_0(window_k)))

Under p_0 the expected time to a false alarm at threshold h is at least e^h windows (Lorden 1971,
Ann. Math. Stat. 42). The mean of a window is taken as normal, the variance as chi-square with one
degree of freedom per ``correlation_time_s``.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Literal, NamedTuple

from sysid.models.json_record import JsonRecord
from sysid.monitor.performance_spec import AVERAGED_S, PerformanceBaseline, PredictedStatistic
from sysid.monitor.windows import MonitorWindow

FALSE_ALARM_H = 100.0
"""Minimum expected time between false alarms (hours of steady flight)."""
ChangeKind = Literal["higher", "lower", "variance"]
"""Positive or negative shift of the mean, or increase of the variance."""
MIN_SHIFT = {
    "heading_deg": 0.5,
    "pitch_deg": 0.05,
    "depth_m": 0.1,
    "rudder_deg": 0.5,
    "elevator_deg": 0.5,
}
"""Allowed shift of each mean, in addition to model uncertainty.

The limit of pitch is small because pitch shows buoyancy: a third more buoyancy changes Caribou's
pitch by half a degree.
"""
CLEAR_SHIFT_SD = 1.5
"""Shift beyond the allowance for which the test is optimal, in standard deviations of the mean."""
ALLOWED_RATIO, CLEAR_RATIO = 2.0, 4.0
"""Allowed and clear ratio of variances; the rms of a disturbance is known to about 40 %."""
HINT = 3.0
"""Log-likelihood ratio (about 20 to 1) that suggests a cause after another test's alarm."""


class RmsComparison(JsonRecord, frozen=True):
    """Measured and predicted rms of one quantity, in its unit."""

    measured: float
    """Rms about the predicted mean."""
    predicted: float


CALMER_RATIO = 0.7
"""Measured over predicted rms below which the sea was calmer than in the identification tests.

The variance is then half the predicted one, the inverse of `ALLOWED_RATIO`."""
MIN_WINDOWS = 3
"""Minimum number of windows for a statement on larger errors: the rms of one scatters by half."""
AS_PREDICTED = "as predicted"
"""Text for errors that are neither larger nor much smaller than predicted."""
_MOVED_BY_SEA = ("heading_deg", "depth_m")
"""Quantities that the loops hold, by which the sea is judged."""


def describe_agreement(rms: Mapping[str, RmsComparison], windows: int) -> str:
    """Return how the errors of a dive without an alarm compare with the predicted ones.

    Parameters
    ----------
    rms : Mapping
        Measured and predicted rms by quantity; empty without steady flight.
    windows : int
        Number of windows of steady flight.

    Returns
    -------
    str
        ``as predicted``; or that errors were larger, which is less than an alarm; or that they
        were smaller because the sea was calmer; empty without steady flight. A beaten prediction
        is no proof of it.
    """
    larger = [
        _format_ratio(name, ratio)
        for name, ratio in rms_ratios(rms).items()
        if ratio**2 > ALLOWED_RATIO
    ]
    if larger and windows >= MIN_WINDOWS:
        return f"larger than predicted, without an alarm: {_join(larger)} the predicted rms"
    smaller = [
        _format_ratio(name, ratio)
        for name, ratio in rms_ratios(rms).items()
        if ratio < CALMER_RATIO and name in _MOVED_BY_SEA
    ]
    if smaller:
        return f"a calmer sea than in the tests: {_join(smaller)} the predicted rms"
    return AS_PREDICTED if rms else ""


def rms_ratios(rms: Mapping[str, RmsComparison]) -> dict[str, float]:
    """Return measured over predicted rms of heading, pitch, depth and surfaces.

    Parameters
    ----------
    rms : Mapping
        Measured and predicted rms by quantity.

    Returns
    -------
    dict
        Ratio by quantity, without the resonance bands.
    """
    return {
        name: comparison.measured / comparison.predicted
        for name, comparison in rms.items()
        if name in MIN_SHIFT and comparison.predicted > 0.0
    }


def _format_ratio(name: str, ratio: float) -> str:
    """Return a quantity and its ratio as text."""
    return f"{name.split('_')[0]} {ratio:.1f} times"


def _join(parts: Sequence[str]) -> str:
    """Return parts of a list as text: "a, b and c"."""
    return " and ".join((*([", ".join(parts[:-1])] if parts[1:] else []), *parts[-1:]))


class Sum(NamedTuple):
    """State of one test since its sum was last zero."""

    value: float = 0.0
    windows: int = 0
    total: float = 0.0
    """Sum of the deviations of means (in the quantity's unit), or of the variance ratios."""

    @property
    def mean(self) -> float:
        """Mean deviation or variance ratio per window."""
        return self.total / self.windows if self.windows else 0.0


Sums = Mapping[tuple[str, ChangeKind], Sum]


def initial_sums(baseline: PerformanceBaseline) -> Sums:
    """Return the initial state of all tests of a baseline."""
    sums: dict[tuple[str, ChangeKind], Sum] = {}
    for name in baseline.predicted:
        if name in MIN_SHIFT:
            sums |= {(name, "higher"): Sum(), (name, "lower"): Sum()}
        sums[name, "variance"] = Sum()
    return sums


def update(baseline: PerformanceBaseline, sums: Sums, window: MonitorWindow) -> Sums:
    """Return the tests updated with one window."""
    return {
        (name, kind): _update_sum(name, kind, baseline.predicted[name], test, window)
        for (name, kind), test in sums.items()
    }


def threshold(sums: Sums) -> float:
    """Return the threshold h for one false alarm of any test per ``FALSE_ALARM_H``.

    h = ln(number of tests * windows in `FALSE_ALARM_H`).
    """
    return math.log(len(sums) * FALSE_ALARM_H * 3600.0 / AVERAGED_S)


def has_alarm(sums: Sums) -> bool:
    """Return whether any test exceeds the threshold."""
    return any(test.value > threshold(sums) for test in sums.values())


def shifted_means(sums: Sums) -> dict[str, float]:
    """Return the shift of each mean that is likely, and likelier than a larger variance."""
    return {
        name: test.mean
        for (name, kind), test in sums.items()
        if kind != "variance" and test.value > max(HINT, sums[name, "variance"].value)
    }


def increased_rms(sums: Sums, hint: float = HINT) -> dict[str, float]:
    """Return the ratio of measured to predicted rms for quantities with a likely increase."""
    return {
        name: math.sqrt(test.mean)
        for (name, kind), test in sums.items()
        if kind == "variance" and test.value > hint
    }


def rms(
    baseline: PerformanceBaseline, windows: Sequence[MonitorWindow]
) -> dict[str, RmsComparison]:
    """Return the measured and the predicted rms by quantity; nothing without windows."""
    if not windows:
        return {}

    def measured(name: str, mean: float) -> float:
        """Return the rms about `mean` over all windows."""
        squares = [window.variances[name] + (window.means[name] - mean) ** 2 for window in windows]
        return math.sqrt(sum(squares) / len(squares))

    return {
        name: RmsComparison(
            measured=measured(name, statistic.mean if name in MIN_SHIFT else 0.0),
            predicted=statistic.rms,
        )
        for name, statistic in baseline.predicted.items()
    }


def window_variance(expected: PredictedStatistic) -> float:
    """Return the predicted variance about the mean of a window."""
    return expected.rms**2 - expected.mean_sd_20s**2


def _update_sum(
    name: str, kind: ChangeKind, expected: PredictedStatistic, test: Sum, window: MonitorWindow
) -> Sum:
    """Return one test updated with one window.

    The variance of a window is compared with the predicted variance about the window's mean::

        sigma_window^2 = rms^2 - mean_sd_20s^2
    """
    if kind == "variance":
        statistic = window.variances[name] / window_variance(expected)
        gain = _variance_log_likelihood_ratio(statistic, AVERAGED_S / expected.correlation_time_s)
    else:
        statistic = window.means[name] - expected.mean
        gain = _mean_log_likelihood_ratio(
            statistic if kind == "higher" else -statistic, name, expected
        )
    value = max(0.0, test.value + gain)
    return Sum(value, test.windows + 1, test.total + statistic) if value > 0.0 else Sum()


def _mean_log_likelihood_ratio(departure: float, name: str, expected: PredictedStatistic) -> float:
    """Return the log-likelihood ratio of a window's mean, `departure` above the predicted mean.

    For a normal mean with standard deviation s, allowance a and clear shift d beyond it::

        ln(p_1 / p_0) = d (x - a - d / 2) / s^2
    """
    # The predicted means of a design with integrators vary less than this bound; slow currents,
    # which the model does not contain, increase their variation.
    sd = max(
        expected.mean_sd_20s, expected.rms * math.sqrt(expected.correlation_time_s / AVERAGED_S)
    )
    allowed, clear_shift = MIN_SHIFT[name] + 2.0 * expected.mean_sd, CLEAR_SHIFT_SD * sd
    return clear_shift * (departure - allowed - 0.5 * clear_shift) / sd**2


def _variance_log_likelihood_ratio(ratio: float, freedom: float) -> float:
    """Return the log-likelihood ratio of a window's variance over the predicted one.

    For n degrees of freedom and ratio x of variances, with allowed ratio r0 and clear ratio r1::

        ln(p_1 / p_0) = n / 2 (x (1 / r0 - 1 / r1) - ln(r1 / r0))
    """
    slope = 1.0 / ALLOWED_RATIO - 1.0 / CLEAR_RATIO
    return 0.5 * freedom * (ratio * slope - math.log(CLEAR_RATIO / ALLOWED_RATIO))
