"""Distribute the telemetry of one vehicle to several listeners and show their results together."""

from collections.abc import Callable, Mapping, Sequence
from typing import Protocol

from rich.console import Group, RenderableType

from ground.client.flight import TelemetryListener
from ground.client.vehicle import StatusText
from mavlink_io.clock import Interval
from mavlink_io.codec import Frame

REFRESH_PERIOD_S = 0.5


class VisibleListener(TelemetryListener, Protocol):
    """A telemetry listener with results that can be displayed."""

    def picture(self) -> RenderableType:
        """Return the present results for the terminal."""


class Listeners:
    """Several listeners that appear as one.

    Parameters
    ----------
    listeners : sequence of VisibleListener
        Listeners that receive every frame and text.
    show : callable, optional
        Function that receives the joint display every `REFRESH_PERIOD_S`.
    """

    def __init__(
        self,
        listeners: Sequence[VisibleListener],
        show: Callable[[RenderableType], None] | None = None,
    ) -> None:
        self._listeners, self._show, self._due = listeners, show, Interval(REFRESH_PERIOD_S)

    def begin(self, parameters: Mapping[str, float]) -> None:
        """Begin all listeners; ``parameters`` are the known parameters of the vehicle."""
        for listener in self._listeners:
            listener.begin(parameters)

    def on_frame(self, frame: Frame) -> None:
        """Pass a frame of the vehicle to all listeners."""
        for listener in self._listeners:
            listener.on_frame(frame)

    def on_text(self, text: StatusText) -> None:
        """Pass a text of the vehicle to all listeners."""
        for listener in self._listeners:
            listener.on_text(text)

    def poll(self, *, last: bool = False) -> None:
        """Update all listeners and, when due or at the ``last`` call, the joint display."""
        for listener in self._listeners:
            listener.poll(last=last)
        if self._listeners and self._show is not None and (last or self._due.due()):
            self._show(self.picture())

    def picture(self) -> RenderableType:
        """Return the results of all listeners, one below the other."""
        return Group(*(listener.picture() for listener in self._listeners))
