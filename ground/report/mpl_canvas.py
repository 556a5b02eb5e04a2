"""Matplotlib figures written to files, without a display and without pyplot's global state."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from matplotlib import rc_context
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

GRID = "#ebe8e0"


@contextmanager
def new_figure(target: Path, size_in: tuple[float, float]) -> Iterator[Any]:
    """Yield a Matplotlib figure, and write it to `target` (PNG or SVG) at the end.

    Parameters
    ----------
    target : Path
        File to write.
    size_in : tuple of float
        Width and height in inches.
    """
    style: Any = {"font.family": "serif", "axes.spines.top": False, "axes.spines.right": False}
    with rc_context(style):
        figure = Figure(figsize=size_in, layout="constrained")
        FigureCanvasAgg(figure)
        yield figure
        figure.savefig(
            target, dpi=110, metadata={"Date": None} if target.suffix == ".svg" else None
        )
