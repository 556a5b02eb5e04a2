"""Progress on stderr: what a dive, a campaign or a computation is doing."""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from threading import Lock

from rich.console import Group, RenderableType
from rich.live import Live
from rich.progress import (
    BarColumn,
    Progress,
    ProgressColumn,
    SpinnerColumn,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
)

from ground.client.flight import FlightProgress as DiveProgress
from ground.client.vehicle import StatusText
from ground.terminal import Escaped, console, heading, literal

URGENT_SEVERITY = 4
"""MAV_SEVERITY_WARNING: texts as urgent as this are shown between the bars."""


class ProgressDisplay:
    """A live display: one line a dive, words about what begins, and a picture below."""

    def __init__(self, bars: Progress, *, quiet: bool) -> None:
        self._bars, self._quiet = bars, quiet
        self._tasks: dict[str, TaskID] = {}
        self._lock = Lock()
        self._below: RenderableType | None = None
        self.dive = "dive"

    def watch(self, at: DiveProgress) -> None:
        """Show where the one dive stands."""
        self.watch_named(self.dive, at)

    def watch_named(self, name: str, at: DiveProgress) -> None:
        """Show where a dive stands."""
        ratio = at.vehicle_s / at.wall_s if at.wall_s > 0 else 0.0
        words = f"{at.depth_m:5.1f} m {at.heading_deg:4.0f} deg {at.vehicle_s:6.0f} s {ratio:4.0f}x"
        self._bars.update(self._task(name), completed=at.item + 1, total=at.items, words=words)

    def hear(self, text: StatusText) -> None:
        """Show what the vehicle says, when it is urgent or about a test."""
        if not self._quiet and (
            text.severity <= URGENT_SEVERITY or text.text.startswith("SystemID")
        ):
            self._bars.console.print(literal(text.text))

    def show(self, picture: RenderableType) -> None:
        """Show a picture below the bars, in place of the one before."""
        self._below = picture

    def picture(self) -> RenderableType:
        """The whole display."""
        return Escaped(Group(self._bars, *([self._below] if self._below else [])))

    def say(self, words: str) -> None:
        """Leave a line."""
        if not self._quiet:
            self._bars.console.print(literal(words))

    def announce(self, words: str) -> None:
        """Say what begins."""
        if not self._quiet:
            self._bars.console.print(heading(words))

    def share(self, words: str, share: float) -> None:
        """Show how much of a computation is done."""
        self._bars.update(self._task(self.dive), completed=share, total=1.0, words=words)

    def _task(self, name: str) -> TaskID:
        with self._lock:
            if name not in self._tasks:
                self._tasks[name] = self._bars.add_task(name, total=None, words="")
            return self._tasks[name]


def columns() -> tuple[ProgressColumn, ...]:
    """Return the columns of a line: the work, its share done, where the vehicle is, the time."""
    return (
        SpinnerColumn(),
        TextColumn("{task.description:28s}", markup=False),
        BarColumn(20),
        TextColumn("{task.fields[words]}", markup=False),
        TimeElapsedColumn(),
    )


@contextmanager
def display(name: str, *, quiet: bool) -> Iterator[ProgressDisplay]:
    """A display that is gone when the work is done; ``name`` is that of the only dive or work, if
    there is one."""
    page = console(stderr=True)
    bars = Progress(*columns(), console=page)
    shown = ProgressDisplay(bars, quiet=quiet)
    shown.dive = name
    with ExitStack() as stack:
        if page.is_terminal and not quiet:
            stack.enter_context(
                Live(get_renderable=shown.picture, console=page, refresh_per_second=10.0)
            )
        yield shown
