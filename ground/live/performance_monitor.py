"""Does she keep what her gains promise? Follows a vehicle's frames, and says so as soon as she does
not."""

from collections.abc import Callable, Mapping
from typing import Any

from rich.console import RenderableType

from ground.client.vehicle import StatusText
from ground.live import monitor_view
from ground.live.estimate import CLOCK_RESTART_S
from ground.live.telemetry import Telemetry
from mavlink_io.clock import Every
from mavlink_io.codec import Frame
from sysid.data.readers.samples import DEFAULT_TRAVEL_DEG
from sysid.monitor import Monitor
from sysid.monitor.performance_spec import PerformanceBaseline

LOOK_PERIOD_S = 0.5
"""Of the wall clock."""
OVERLAP_S = 2.0
"""What a look needs of the time before it: the values told last."""


class PerformanceMonitor:
    """Made with the promise that stands in the head of a ``gains.param``."""

    def __init__(
        self, promise: PerformanceBaseline, announce: Callable[[str], None] | None = None
    ) -> None:
        """``announce`` gets a line for each likely cause, once."""
        self._promise, self._announce = promise, announce
        self._monitor, self._telemetry = Monitor(promise), Telemetry({})
        self._told: set[str] = set()
        self._due = Every(LOOK_PERIOD_S)

    def begin(self, parameters: Mapping[str, float]) -> None:
        """The vehicle is there; ``parameters`` are those aboard, as far as they are known."""
        # A stranger is not told how far the duct turns; the design was.
        travel = {
            "ACT_TRAVEL_DEG": self._promise.specification.get("travel_deg", DEFAULT_TRAVEL_DEG)
        }
        self._telemetry = Telemetry({**travel, **parameters})

    def on_frame(self, frame: Frame) -> None:
        before_s = self._telemetry.now_s
        if self._telemetry.on_frame(frame) < before_s - CLOCK_RESTART_S:
            self._telemetry.restart()
            self._monitor.interrupt()
            self._telemetry.on_frame(frame)

    def on_text(self, text: StatusText) -> None:
        self._telemetry.on_text(text.severity, text.text)

    def poll(self, *, last: bool = False) -> None:
        if not (last or self._due.due()):
            return
        until_s = self._telemetry.complete_s
        try:
            self._monitor.take(self._telemetry.log(until_s), until_s)
        except (
            ArithmeticError,
            ValueError,
        ):  # not everything has been told yet; and who watches must not end a dive
            return
        self._telemetry.forget(until_s - OVERLAP_S)
        for cause in self._monitor.report().causes:
            if self._announce is not None and cause.name not in self._told:
                self._announce(monitor_view.line(cause))
            self._told.add(cause.name)

    def picture(self) -> RenderableType:
        """Measured errors beside those foretold, as things stand."""
        return monitor_view.table(self._monitor.report())

    def as_json(self) -> dict[str, Any]:
        return monitor_view.as_json(self._monitor.report())

    def format_text(self) -> str:
        """The same in a few lines, for when the dive is over."""
        return monitor_view.format_text(self._monitor.report())
