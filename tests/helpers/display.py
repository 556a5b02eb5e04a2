"""Display of progress on a page in memory."""

import io

from rich.progress import BarColumn, Progress

from ground import terminal
from ground.cli import progress


def shown_on(page: io.StringIO) -> progress.ProgressDisplay:
    """The display of a dive, on a page as wide as any text."""
    bars = Progress(
        *progress.columns(), BarColumn(20), console=terminal.console(file=page, width=10_000)
    )
    return progress.ProgressDisplay(bars)
