"""Performance monitoring: compare steady flight with the predictions of the gains file.

Steady flight is cut into blocks, sequential tests accumulate evidence over blocks, and alarms are
assigned to likely causes. The module is pure: a log or recent telemetry in, a report out. The
performance baseline is the header of ``gains.param`` (`sysid.monitor.performance_spec`). Dives,
simulations and old logs are treated alike.
"""

from typing import NamedTuple

from sysid.data.dataset import Log
from sysid.monitor import causes, sequential
from sysid.monitor.blocks import Block, BlockCutter, sample
from sysid.monitor.causes import Cause
from sysid.monitor.performance_spec import PerformanceBaseline
from sysid.monitor.sequential import Sums

__all__ = ["Block", "Cause", "Monitor", "MonitorReport", "monitor_log"]

SPEED_TOLERANCE = 0.1
"""Largest relative deviation of a block's thrust: the baseline holds at one speed."""


class MonitorReport(NamedTuple):
    """Result of monitoring up to now."""

    blocks: int
    """Number of evaluated blocks of steady flight."""
    steady_s: float
    errors: dict[str, tuple[float, float]]
    """Measured rms about the predicted mean, and predicted rms, by quantity."""
    causes: tuple[Cause, ...]
    """Likely causes of a deviation; empty while performance is as predicted."""
    found_s: float | None
    """Vehicle time of the first alarm (s); None without alarm."""

    @property
    def refit_due(self) -> bool:
        """Whether a cause requires new tests and a refit."""
        return any(cause.refit_due for cause in self.causes)


class Monitor:
    """Monitor that takes stretches of telemetry in order of time.

    Parameters
    ----------
    baseline : PerformanceBaseline
        Predicted performance of the current gains.
    """

    def __init__(self, baseline: PerformanceBaseline) -> None:
        self._baseline = baseline
        self._cutter = BlockCutter(baseline)
        self._sums: Sums = sequential.initial_sums(baseline)
        self._blocks: list[Block] = []
        self._causes: tuple[Cause, ...] = ()
        self._found_s: float | None = None
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
        for block in self._cutter.take(rows):
            if abs(block.thrust - self._baseline.thrust) <= SPEED_TOLERANCE * abs(
                self._baseline.thrust
            ):
                self._evaluate(block)

    def interrupt(self) -> None:
        """Discard the block in progress after the vehicle clock restarted; results are kept."""
        self._cutter, self._until_s = BlockCutter(self._baseline), None

    def report(self) -> MonitorReport:
        """Return the result up to now."""
        return MonitorReport(
            blocks=len(self._blocks),
            steady_s=sum(block.stop_s - block.start_s for block in self._blocks),
            errors=sequential.errors(self._baseline, self._blocks),
            causes=self._causes,
            found_s=self._found_s,
        )

    def _evaluate(self, block: Block) -> None:
        """Update the tests with one block."""
        self._blocks.append(block)
        self._sums = sequential.update(self._baseline, self._sums, block)
        if sequential.has_alarm(self._sums):
            self._found_s = block.stop_s if self._found_s is None else self._found_s
        if self._found_s is not None:
            self._causes = causes.likely_causes(self._baseline, self._sums) or self._causes


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
