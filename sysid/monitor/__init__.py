"""Performance monitoring: compare steady flight with the predictions of the gains file.

Steady flight is cut into windows, sequential tests accumulate evidence over windows, and alarms are
assigned to likely causes. The module is pure: a log or recent telemetry in, a report out. The
performance baseline is the header of ``gains.param`` (`sysid.monitor.performance_spec`). Dives,
simulations and old logs are treated alike.
"""

from sysid.data.dataset import Log
from sysid.models.json_record import JsonRecord
from sysid.monitor import causes, sequential
from sysid.monitor.causes import Cause
from sysid.monitor.performance_spec import PerformanceBaseline
from sysid.monitor.sequential import RmsComparison, Sums
from sysid.monitor.windows import MonitorWindow, WindowCutter, sample

__all__ = ["Cause", "Monitor", "MonitorReport", "MonitorWindow", "monitor_log"]

SPEED_TOLERANCE = 0.1
"""Largest relative deviation of a window's thrust: the baseline holds at one speed."""


class MonitorReport(JsonRecord, frozen=True):
    """Result of monitoring up to now."""

    windows: int
    """Number of evaluated windows of steady flight."""
    steady_s: float
    """Duration of these windows."""
    rms: dict[str, RmsComparison]
    """Measured and predicted rms by quantity; empty without a window."""
    causes: tuple[Cause, ...]
    """Likely causes of a deviation; empty while performance is as predicted."""
    detected_at_s: float | None
    """Vehicle time of the first alarm (s); None without alarm."""
    refit_recommended: bool
    """Whether a cause requires new tests and a refit."""


class Monitor:
    """Monitor that takes stretches of telemetry in order of time.

    Parameters
    ----------
    baseline : PerformanceBaseline
        Predicted performance of the current gains.
    """

    def __init__(self, baseline: PerformanceBaseline) -> None:
        self._baseline = baseline
        self._cutter = WindowCutter(baseline)
        self._sums: Sums = sequential.initial_sums(baseline)
        self._windows: list[MonitorWindow] = []
        self._causes: tuple[Cause, ...] = ()
        self._detected_at_s: float | None = None
        self._until_s: float | None = None

    def take(self, log: Log, until_s: float) -> None:
        """Evaluate telemetry from the end of the last call.

        Parameters
        ----------
        log : Log
            Log or recent telemetry.
        until_s : float
            End of the evaluated stretch (s of vehicle time).
        """
        rows = sample(log, self._until_s, until_s)
        if len(rows):
            self._until_s = float(rows[-1].time_s)
        for window in self._cutter.take(rows):
            if abs(window.thrust - self._baseline.thrust) <= SPEED_TOLERANCE * abs(
                self._baseline.thrust
            ):
                self._evaluate(window)

    def interrupt(self) -> None:
        """Discard the window in progress after the vehicle clock restarted; results are kept."""
        self._cutter, self._until_s = WindowCutter(self._baseline), None

    def report(self) -> MonitorReport:
        """Return the result up to now."""
        return MonitorReport(
            windows=len(self._windows),
            steady_s=sum((window.stop_s - window.start_s for window in self._windows), 0.0),
            rms=sequential.rms(self._baseline, self._windows),
            causes=self._causes,
            detected_at_s=self._detected_at_s,
            refit_recommended=any(cause.refit_recommended for cause in self._causes),
        )

    def _evaluate(self, window: MonitorWindow) -> None:
        """Update the tests with one window."""
        self._windows.append(window)
        self._sums = sequential.update(self._baseline, self._sums, window)
        if sequential.has_alarm(self._sums):
            self._detected_at_s = (
                window.stop_s if self._detected_at_s is None else self._detected_at_s
            )
        if self._detected_at_s is not None:
            self._causes = (
                causes.likely_causes(self._baseline, self._sums, self._windows) or self._causes
            )


def monitor_log(log: Log, baseline: PerformanceBaseline) -> MonitorReport:
    """Monitor a whole log.

    Parameters
    ----------
    log : Log
        Log of a dive.
    baseline : PerformanceBaseline
        Baseline from the header of the gains file.

    Returns
    -------
    MonitorReport
        Errors and likely causes.
    """
    monitor = Monitor(baseline)
    monitor.take(log, float(log.attitude.time_s[-1]))
    return monitor.report()
