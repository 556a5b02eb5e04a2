"""Validation figures of an identified model as one Matplotlib picture."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ground.campaign.campaign_folder import CampaignFolder
from ground.report import mpl_canvas, summary_picture, validation_figures
from ground.report.figures import Curve, Figure
from sysid.models.model_file import MAX_POSTERIOR_TO_PRIOR_SD, Coefficient

COLORS = {
    "measured": "#6f7a84",
    "initial": "#c2542d",
    "redesigned": "#0f6e84",
    "set_point": "#4b4f55",
}
WIDTHS = {"set_point": 1.0, "initial": 1.2, "redesigned": 1.6, "measured": 1.0}
HEIGHT_IN, PANEL_IN = 1.2, 1.5
"""Height of a row of figures without panels, and of each panel."""


def draw(folder: Path, target: Path) -> Path:
    """Draw response, predictions, whiteness and posterior deviations of a campaign's model.

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
    summary_picture.check_picture_format(target)
    campaign = CampaignFolder(folder)
    predictions = validation_figures.prediction_figures(campaign)
    half = (len(predictions) + 1) // 2
    rows = [
        validation_figures.response_figures(campaign),
        *(predictions[k::half] for k in range(half)),
        validation_figures.whiteness_figures(campaign),
    ]
    heights = [HEIGHT_IN + PANEL_IN * max(len(f.panels) for f in row) for row in rows if row]
    with mpl_canvas.new_figure(target, (11.0, sum(heights) + 3.0)) as canvas:
        bands = canvas.subfigures(len(heights) + 1, 1, height_ratios=[*heights, 3.0])
        for band, row in zip(bands, [row for row in rows if row], strict=False):
            for subfigure, figure in zip(
                band.subfigures(1, len(row), squeeze=False)[0], row, strict=True
            ):
                panels(subfigure, figure)
        _posterior_sds(bands[-1].subplots(), campaign.summary.model.coefficients)
    return target


def panels(subfigure: Any, figure: Figure) -> None:
    """Draw a figure of the report into a Matplotlib subfigure."""
    axes = subfigure.subplots(len(figure.panels), 1, sharex=True, squeeze=False)[:, 0]
    for axis, panel in zip(axes, figure.panels, strict=True):
        for curve in panel.curves:
            _curve(axis, curve)
        for start, end in figure.shaded:
            axis.axvspan(start, end, color="#808080", alpha=0.15, linewidth=0)
        if figure.upright is not None:
            axis.axvline(figure.upright, color="#808080", linewidth=1.0, linestyle=":")
        axis.set_ylabel(panel.label)
        axis.grid(which="both" if figure.log_x else "major", color=mpl_canvas.GRID, linewidth=0.8)
        if panel.limits:
            axis.set_ylim(*panel.limits)
    if figure.log_x:
        _log_axis(axes[-1], figure)
    axes[0].set_title(figure.title, loc="left", fontsize=11)
    axes[0].legend(frameon=False, fontsize=8)
    axes[-1].set_xlabel(figure.x_label)


def _log_axis(axis: Any, figure: Figure) -> None:
    """Set a logarithmic x axis with ticks at round values."""
    axis.set_xscale("log")
    ends = figure.panels[0].curves[0].x
    ticks = [
        t
        for t in (0.1, 0.2, 0.3, 0.5, 0.7, 1.0, 2.0, 3.0, 5.0, 7.0, 10.0)
        if ends[0] <= t <= ends[-1]
    ]
    axis.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    axis.minorticks_off()


def _curve(axis: Any, curve: Curve) -> None:
    """Draw a curve as line, marks with bars, or band."""
    color = COLORS[curve.role]
    if curve.look == "marks":
        bars = None if curve.high is None else curve.high - curve.y
        axis.errorbar(
            curve.x,
            curve.y,
            bars,
            fmt="o",
            color=color,
            markersize=3.5,
            elinewidth=1.0,
            label=curve.name,
        )
        return
    if curve.low is not None and curve.high is not None:
        name = curve.name if curve.look == "band" else None
        axis.fill_between(
            curve.x, curve.low, curve.high, color=color, alpha=0.18, linewidth=0, label=name
        )
    if curve.look == "band":
        return
    style = "--" if curve.role == "set_point" else "-"
    axis.plot(curve.x, curve.y, style, color=color, linewidth=WIDTHS[curve.role], label=curve.name)


def _posterior_sds(axis: Any, coefficients: Mapping[str, Coefficient]) -> None:
    """Draw posterior over prior standard deviation of each coefficient."""
    free = {
        name: c
        for name, c in coefficients.items()
        if c.prior_sd > 0 and c.posterior_to_prior_sd is not None
    }
    colors = [COLORS["redesigned" if c.status == "measured" else "initial"] for c in free.values()]
    axis.bar(
        range(len(free)),
        [c.posterior_to_prior_sd for c in free.values()],
        color=colors,
        width=0.7,
    )
    axis.axhline(MAX_POSTERIOR_TO_PRIOR_SD, color="#808080", linewidth=1.0, linestyle=":")
    axis.set_xticks(range(len(free)), [_mathematical(name) for name in free])
    axis.set_ylim(0.0, 1.05)
    axis.set_ylabel("sd after over before")
    axis.set_title(
        "Information in the tests: above the dotted line the prior value is kept",
        loc="left",
        fontsize=11,
    )


def _mathematical(name: str) -> str:
    """Return a coefficient's name as TeX."""
    letter, _, index = name.partition("_")
    index = {"dr": r"\delta r", "de": r"\delta e"}.get(index, index.replace("dot", "'"))
    return f"${letter}_{{{index}}}$"
