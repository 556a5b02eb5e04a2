"""Picture of a campaign's result: straight run and depth changes with both sets of gains."""

from pathlib import Path
from typing import Any

from ground.campaign.campaign_folder import CampaignFolder
from ground.report import figures, mpl_canvas
from ground.report.figures import Curve, Figure
from mavlink_io.errors import InputError

COLORS = {
    "measured": "#9aa3ab",
    "initial": "#c2542d",
    "improved": "#a3852b",
    "redesigned": "#0f6e84",
    "set_point": "#4b4f55",
}
WIDTHS = {"set_point": 1.0, "initial": 1.4, "improved": 1.4, "redesigned": 1.6}
PICTURE_FORMATS = (".png", ".svg")


def draw(folder: Path, target: Path) -> Path:
    """Draw depth and heading of two missions.

    Parameters
    ----------
    folder : Path
        Folder of a finished campaign.
    target : Path
        File to write, ``.png`` or ``.svg``.

    Returns
    -------
    Path
        `target`.

    Raises
    ------
    InputError
        If the suffix is another, or the folder is not that of a finished campaign.
    """
    check_picture_format(target)
    campaign = CampaignFolder(folder)
    mission_figures = figures.mission_figures(campaign, ["straight_run", "combined"])
    with mpl_canvas.new_figure(target, (11.0, 5.6)) as canvas:
        axes = canvas.subplots(2, 2, sharex="col")
        for column, figure in enumerate(mission_figures):
            _column(axes[:, column], figure)
        handles, names = axes[0, 0].get_legend_handles_labels()
        canvas.legend(handles, names, loc="outside upper left", ncols=len(names), frameon=False)
    return target


def check_picture_format(target: Path) -> None:
    """Raise InputError if the suffix is neither ``.png`` nor ``.svg``."""
    if target.suffix not in PICTURE_FORMATS:
        raise InputError(f"--picture {target}: must end in .png or .svg")


def _column(axes: Any, figure: Figure) -> None:
    """Draw depth (m) above heading (deg) of one mission."""
    panels = {panel.title: panel for panel in figure.panels}
    for axis, title in zip(axes, ("depth", "heading"), strict=True):
        for curve in panels[title].curves:
            _line(axis, curve)
        axis.set_ylabel(panels[title].label)
        axis.grid(color=mpl_canvas.GRID, linewidth=0.8)
    axes[0].invert_yaxis()
    axes[0].set_title(figure.title, loc="left")
    axes[-1].set_xlabel("seconds")


def _line(axis: Any, curve: Curve) -> None:
    """Draw a curve in the style of its role."""
    style = "--" if curve.role == "set_point" else "-"
    axis.plot(
        curve.x,
        curve.y,
        style,
        color=COLORS[curve.role],
        linewidth=WIDTHS[curve.role],
        label=curve.name,
    )
