"""Does a vehicle keep what her gains promise? Steady flight block by block, tests that add up, and
a likely cause.

Pure: a log in, or what was told of late, findings out. What is promised stands in the head of
``gains.param`` (`sysid.monitor.performance_spec`); what is compared is the same at sea, in a
simulation and in an old log."""

from typing import NamedTuple

from sysid.data.dataset import Log
from sysid.monitor import causes, sequential
from sysid.monitor.blocks import Block, BlockCutter, sample
from sysid.monitor.causes import Cause
from sysid.monitor.performance_spec import PerformanceBaseline
from sysid.monitor.sequential import Sums

__all__ = ["Block", "Cause", "Monitor", "MonitorReport", "monitor_log"]

SPEED_TOLERANCE = 0.1
"""Share of the thrust by which a block may be off: beyond it the promise is for another speed."""


class MonitorReport(NamedTuple):
    """How a promise is kept up to now."""

    blocks: int
    """Of steady flight that were judged."""
    steady_s: float
    errors: dict[str, tuple[float, float]]
    """By quantity the rms about the promised mean that was measured, and the promised one."""
    causes: tuple[Cause, ...]
    """What is likely the matter; empty while the promise is kept."""
    found_s: float | None
    """Vehicle time at which that was first noticed."""

    @property
    def refit_due(self) -> bool:
        return any(cause.refit_due for cause in self.causes)


class Monitor:
    """Takes stretches of telemetry in order of time."""

    def __init__(self, promise: PerformanceBaseline) -> None:
        self._promise = promise
        self._cutter = BlockCutter(promise)
        self._sums: Sums = sequential.initial_sums(promise)
        self._blocks: list[Block] = []
        self._causes: tuple[Cause, ...] = ()
        self._found_s: float | None = None
        self._until_s: float | None = None

    def take(self, log: Log, until_s: float) -> None:
        """What a log tells from where the last one was left, up to ``until_s``."""
        rows = sample(log, self._until_s, until_s)
        if len(rows):
            self._until_s = float(rows[-1].time_s)
        for block in self._cutter.take(rows):
            if abs(block.thrust - self._promise.thrust) <= SPEED_TOLERANCE * abs(
                self._promise.thrust
            ):
                self._judge(block)

    def interrupt(self) -> None:
        """Her clock has begun anew; what was seen before stays."""
        self._cutter, self._until_s = BlockCutter(self._promise), None

    def kept(self) -> MonitorReport:
        return MonitorReport(
            blocks=len(self._blocks),
            steady_s=sum(block.stop_s - block.start_s for block in self._blocks),
            errors=sequential.errors(self._promise, self._blocks),
            causes=self._causes,
            found_s=self._found_s,
        )

    def _judge(self, block: Block) -> None:
        self._blocks.append(block)
        self._sums = sequential.update(self._promise, self._sums, block)
        if sequential.has_alarm(self._sums):
            self._found_s = block.stop_s if self._found_s is None else self._found_s
        if self._found_s is not None:
            self._causes = causes.likely_causes(self._promise, self._sums) or self._causes


def monitor_log(log: Log, promise: PerformanceBaseline) -> MonitorReport:
    """A whole dive at once."""
    monitor = Monitor(promise)
    monitor.take(log, float(log.attitude.time_s[-1]))
    return monitor.kept()
