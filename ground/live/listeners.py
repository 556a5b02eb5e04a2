"""Several who follow one vehicle: what she tells goes to each, what each makes of it is shown
together."""

from collections.abc import Callable, Mapping, Sequence
from typing import Protocol

from rich.console import Group, RenderableType

from ground.client.flight import TelemetryListener
from ground.client.vehicle import StatusText
from mavlink_io.clock import Every
from mavlink_io.codec import Frame

REFRESH_PERIOD_S = 0.5


class VisibleListener(TelemetryListener, Protocol):
    """A follower whose findings can be looked at."""

    def picture(self) -> RenderableType: ...


class Listeners:
    def __init__(
        self, each: Sequence[VisibleListener], show: Callable[[RenderableType], None] | None = None
    ) -> None:
        self._each, self._show, self._due = each, show, Every(REFRESH_PERIOD_S)

    def begin(self, parameters: Mapping[str, float]) -> None:
        for follower in self._each:
            follower.begin(parameters)

    def on_frame(self, frame: Frame) -> None:
        for follower in self._each:
            follower.on_frame(frame)

    def on_text(self, text: StatusText) -> None:
        for follower in self._each:
            follower.on_text(text)

    def poll(self, *, last: bool = False) -> None:
        for follower in self._each:
            follower.poll(last=last)
        if self._each and self._show is not None and (last or self._due.due()):
            self._show(self.picture())

    def picture(self) -> RenderableType:
        return Group(*(follower.picture() for follower in self._each))
