"""A picture file by Matplotlib, without a display and without the state of its pyplot module."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

GRID = "#ebe8e0"


@contextmanager
def new_figure(target: Path, size_in: tuple[float, float]) -> Iterator[Any]:
    """A Matplotlib figure to draw on, written into ``target``, a PNG or SVG file, at the end."""
    from matplotlib import rc_context
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    style: Any = {"font.family": "serif", "axes.spines.top": False, "axes.spines.right": False}
    with rc_context(style):
        figure = Figure(figsize=size_in, layout="constrained")
        FigureCanvasAgg(figure)
        yield figure
        figure.savefig(
            target, dpi=110, metadata={"Date": None} if target.suffix == ".svg" else None
        )
