"""Compare the measured performance of a vehicle with that predicted for its gains, live."""

from collections.abc import Callable, Mapping

from rich.console import RenderableType

from ground.client.vehicle import StatusText
from ground.live import monitor_view
from ground.live.telemetry import Telemetry
from mavlink_io.clock import Interval
from mavlink_io.codec import Frame
from sysid.data.dataset import DEFAULT_TRAVEL_DEG
from sysid.monitor import Monitor, MonitorReport
from sysid.monitor.performance_spec import PerformanceBaseline

LOOK_PERIOD_S = 0.5
"""Time between two evaluations, by the wall clock (s)."""
OVERLAP_S = 2.0
"""Telemetry from before an evaluation that the next one needs, for the latest values (s)."""


class PerformanceMonitor:
    """Live monitor of the performance predicted in the header of a ``gains.param`` file.

    Parameters
    ----------
    baseline : PerformanceBaseline
        Predicted performance of the current gains.
    announce : callable, optional
        Function that receives one line for each likely cause of a deviation, once.
    """

    def __init__(
        self, baseline: PerformanceBaseline, announce: Callable[[str], None] | None = None
    ) -> None:
        self._baseline, self._announce = baseline, announce
        self._monitor, self._telemetry = Monitor(baseline), Telemetry({})
        self._announced: set[str] = set()
        self._due = Interval(LOOK_PERIOD_S)

    def begin(self, parameters: Mapping[str, float]) -> None:
        """Start monitoring a vehicle; ``parameters`` are its known parameters."""
        # ACT_TRAVEL_DEG is unknown without a parameter download; the design assumed a value.
        travel = {
            "ACT_TRAVEL_DEG": self._baseline.specification.get("travel_deg", DEFAULT_TRAVEL_DEG)
        }
        self._telemetry = Telemetry({**travel, **parameters})

    def on_frame(self, frame: Frame) -> None:
        """Add a frame to the telemetry; restart the monitor if the vehicle's clock was reset."""
        self._telemetry.on_frame(frame, on_restart=self._monitor.interrupt)

    def on_text(self, text: StatusText) -> None:
        """Add an event of the vehicle to the telemetry."""
        self._telemetry.on_event(text.event)

    def poll(self, *, last: bool = False) -> None:
        """Evaluate the new telemetry, when due or at the ``last`` call, and announce new causes."""
        if not (last or self._due.due()):
            return
        until_s = self._telemetry.complete_s
        try:
            self._monitor.take(self._telemetry.log(until_s), until_s)
        except (ArithmeticError, ValueError):
            # Data are still incomplete; an error of the monitor must not end a dive.
            return
        self._telemetry.forget(until_s - OVERLAP_S)
        for cause in self._monitor.report().causes:
            if self._announce is not None and cause.name not in self._announced:
                self._announce(monitor_view.line(cause))
            self._announced.add(cause.name)

    def picture(self) -> RenderableType:
        """Return a table of the measured and predicted errors up to now."""
        return monitor_view.table(self._monitor.report())

    def report(self) -> MonitorReport:
        """Return the result up to now."""
        return self._monitor.report()

    def format_text(self) -> str:
        """Return the result of the dive as text in a few lines."""
        return monitor_view.format_text(self._monitor.report())
