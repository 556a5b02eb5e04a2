"""Display of the progress of dives and computations on stderr."""

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
from sysid.data.events import TestEnded, TestStarted

URGENT_SEVERITY = 4
"""MAV_SEVERITY_WARNING: texts of this or a lower severity number are shown."""


class ProgressDisplay:
    """A live display: messages, one progress bar per dive, and a picture below."""

    def __init__(self, bars: Progress, *, quiet: bool) -> None:
        self._bars, self._quiet = bars, quiet
        self._tasks: dict[str, TaskID] = {}
        self._lock = Lock()
        self._below: RenderableType | None = None
        self.dive = "dive"

    def watch(self, progress: DiveProgress) -> None:
        """Show the progress of the only dive."""
        self.watch_named(self.dive, progress)

    def watch_named(self, name: str, progress: DiveProgress) -> None:
        """Show the progress of a dive by its name."""
        speed = progress.vehicle_s / progress.wall_s if progress.wall_s > 0 else 0.0
        text = (
            f"{progress.depth_m:5.1f} m {progress.heading_deg:4.0f} deg "
            f"{progress.vehicle_s:6.0f} s {speed:4.0f}x"
        )
        self._bars.update(
            self._task(name), completed=progress.item + 1, total=progress.items, words=text
        )

    def show_text(self, text: StatusText) -> None:
        """Print a text of the vehicle if it is urgent or about a test."""
        if not self._quiet and (
            text.severity <= URGENT_SEVERITY or isinstance(text.event, TestStarted | TestEnded)
        ):
            self._bars.console.print(literal(text.text))

    def show(self, picture: RenderableType) -> None:
        """Show a picture below the bars instead of the last one."""
        self._below = picture

    def picture(self) -> RenderableType:
        """Return the complete display."""
        return Escaped(Group(self._bars, *([self._below] if self._below else [])))

    def print_line(self, text: str) -> None:
        """Print a line."""
        if not self._quiet:
            self._bars.console.print(literal(text))

    def announce(self, text: str) -> None:
        """Print what begins, in bold."""
        if not self._quiet:
            self._bars.console.print(heading(text))

    def show_fraction(self, text: str, fraction: float) -> None:
        """Show the completed fraction of a computation."""
        self._bars.update(self._task(self.dive), completed=fraction, total=1.0, words=text)

    def _task(self, name: str) -> TaskID:
        """Return the bar of a name; create it on first use."""
        with self._lock:
            if name not in self._tasks:
                self._tasks[name] = self._bars.add_task(name, total=None, words="")
            return self._tasks[name]


def columns() -> tuple[ProgressColumn, ...]:
    """Return the columns of a bar: name, bar, state of the vehicle, elapsed time."""
    return (
        SpinnerColumn(),
        TextColumn("{task.description:28s}", markup=False),
        BarColumn(20),
        TextColumn("{task.fields[words]}", markup=False),
        TimeElapsedColumn(),
    )


@contextmanager
def display(name: str, *, quiet: bool) -> Iterator[ProgressDisplay]:
    """Show a display while the work lasts.

    Parameters
    ----------
    name : str
        Name of the dive or computation, if there is only one.
    quiet : bool
        Print no messages, and no bars.
    """
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
