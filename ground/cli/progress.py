"""Display of the progress of dives and computations on stderr."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from threading import Lock
from typing import TYPE_CHECKING

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
from rich.text import Text

from ground.terminal import Escaped, console, heading, is_redrawable, literal
from mavlink_io.clock import Interval
from sysid.data.events import TestEnded, TestStarted

if TYPE_CHECKING:  # a computation without a vehicle does not load MAVLink
    from ground.client.flight import FlightProgress as DiveProgress
    from ground.client.vehicle import StatusText

URGENT_SEVERITY = 4
"""MAV_SEVERITY_WARNING: texts of this or a lower severity number are shown."""
LINE_PERIOD_S = 5.0
"""Wall time between two lines about the same dive or computation where there is no terminal."""


class ProgressDisplay:
    """Messages, one progress bar per dive, and a picture below; without a terminal, lines."""

    def __init__(self, bars: Progress) -> None:
        self._bars = bars
        self._tasks: dict[str, TaskID] = {}
        self._lines: dict[str, Interval] | None = None if is_redrawable(bars.console) else {}
        """Time of the last line by task; None if a terminal shows the bars."""
        self._warnings: dict[str, str] = {}
        """Last warning by task."""
        self._lock = Lock()
        self._below: RenderableType | None = None
        self.dive = "dive"

    def watch(self, progress: DiveProgress) -> None:
        """Show the progress of the only dive."""
        self.watch_named(self.dive, progress)

    def watch_named(self, name: str, progress: DiveProgress) -> None:
        """Show the progress of a dive by its name."""
        speed = progress.vehicle_s / progress.wall_s if progress.wall_s > 0 else 0.0
        heading_deg = _known((progress.heading_deg + 0.5) // 1.0 % 360.0, 0)
        depth_m = _known(progress.depth_m, 1)
        text = f"{depth_m:>5s} m {heading_deg:>4s} deg {progress.vehicle_s:6.0f} s {speed:4.0f}x"
        self._bars.update(
            self._task(name), completed=progress.item + 1, total=progress.items, words=text
        )
        place = progress.place or f"item {progress.item + 1} of {progress.items}"
        self._print_progress(
            name,
            f"{place}, {depth_m} m deep, heading"
            f" {heading_deg} deg, {progress.vehicle_s:.0f} s at {speed:.0f}x",
        )
        if progress.warning and progress.warning != self._warnings.get(name):
            self.print_line(f"{name}: {progress.warning}")
        self._warnings[name] = progress.warning

    def show_text(self, text: StatusText) -> None:
        """Print a text of the vehicle if it is urgent or about a test."""
        if text.severity <= URGENT_SEVERITY or isinstance(text.event, TestStarted | TestEnded):
            self._print(literal(text.text))

    def show(self, picture: RenderableType) -> None:
        """Show a picture below the bars instead of the last one."""
        self._below = picture

    def picture(self) -> RenderableType:
        """Return the complete display."""
        return Escaped(Group(self._bars, *([self._below] if self._below else [])))

    def print_line(self, text: str) -> None:
        """Print a line."""
        self._print(literal(text))

    def announce(self, text: str) -> None:
        """Print what begins, in bold."""
        self._print(heading(text))

    def show_fraction(self, text: str, fraction: float) -> None:
        """Show the completed fraction of a computation."""
        self._bars.update(self._task(self.dive), completed=fraction, total=1.0, words=text)
        done = f"{100.0 * fraction:.0f} %, " if fraction else ""
        self._print_progress(self.dive, f"{done}{text}")

    def _print_progress(self, name: str, text: str) -> None:
        """Print a line about a dive or computation if no terminal shows its bar, and it is due."""
        if self._lines is None:
            return
        with self._lock:
            is_due = self._lines.setdefault(name, Interval(LINE_PERIOD_S)).due()
        if is_due:
            self._print(literal(f"{name}: {text}"))

    def _print(self, text: Text) -> None:
        """Print a text; lines are not broken at the width that rich assumes of a file."""
        self._bars.console.print(text, soft_wrap=True)

    def _task(self, name: str) -> TaskID:
        """Return the bar of a name; create it on first use."""
        with self._lock:
            if name not in self._tasks:
                self._tasks[name] = self._bars.add_task(name, total=None, words="")
            return self._tasks[name]


def _known(value: float, digits: int) -> str:
    """Return a number with these decimal places, and a dash for an unknown one."""
    return f"{value:.{digits}f}" if math.isfinite(value) else "–"


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
def display(name: str) -> Iterator[ProgressDisplay]:
    """Show a display while the work lasts.

    Parameters
    ----------
    name : str
        Name of the dive or computation, if there is only one.
    """
    page = console(stderr=True)
    bars = Progress(*columns(), console=page)
    shown = ProgressDisplay(bars)
    shown.dive = name
    with ExitStack() as stack:
        if is_redrawable(page):
            stack.enter_context(
                Live(get_renderable=shown.picture, console=page, refresh_per_second=10.0)
            )
        yield shown
