"""Output to a terminal without markup or control characters from outside this program."""

import sys
from collections.abc import Sequence
from io import StringIO
from typing import IO

from rich.console import Console, ConsoleOptions, RenderableType, RenderResult
from rich.segment import Segment
from rich.text import Text

from ground.rendered import Rendered
from mavlink_io.printable import printable, printable_lines

WIDTH = 118
"""Width of the tables of most commands, in characters."""


class Escaped:
    """A renderable whose text is escaped when it is drawn."""

    def __init__(self, renderable: RenderableType) -> None:
        self._renderable = renderable

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """Yield the segments of the renderable with escaped text; rich calls this method."""
        for segment in console.render(self._renderable, options):
            if segment.control or segment.text.isprintable():
                yield segment
            else:
                yield Segment(printable_lines(segment.text), segment.style)


def console(
    *, file: IO[str] | None = None, stderr: bool = False, width: int | None = None
) -> Console:
    """Return a console that does not interpret markup in square brackets, or emoji names."""
    return Console(
        file=file, stderr=stderr, width=width, markup=False, emoji=False, highlight=False
    )


def is_redrawable(console: Console) -> bool:
    """Return whether a console is a terminal that can move its cursor, unlike one of TERM=dumb."""
    return console.is_terminal and not console.is_dumb_terminal


def literal(text: object, style: str = "") -> Text:
    """Return a text for rich without markup, with control characters escaped."""
    return Text(printable(text), style=style)


def heading(text: object) -> Text:
    """Return a text for rich in bold letters."""
    return literal(text, "bold")


def render(parts: Sequence[RenderableType], width: int = WIDTH) -> Rendered:
    """Draw parts one below the other, in colour if stdout is a terminal."""
    output = StringIO()
    drawing = Console(
        file=output,
        width=width,
        force_terminal=sys.stdout.isatty(),
        markup=False,
        emoji=False,
        highlight=False,
    )
    for part in parts:
        drawing.print(Escaped(part))
    return Rendered(output.getvalue())
