"""Matplotlib figures written to files, without a display and without pyplot's global state."""

from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import Any

from matplotlib import rc_context
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from mavlink_io.user_data_dir import write_output

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
        picture, file_format = BytesIO(), target.suffix.removeprefix(".")
        figure.savefig(
            picture,
            format=file_format,
            dpi=110,
            metadata={"Date": None} if file_format == "svg" else None,
        )
        write_output(target, picture.getvalue())
