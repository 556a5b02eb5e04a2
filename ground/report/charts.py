"""Plotly JSON of the report's charts.

Each trace has a role; the page's script sets the colour of each role from the theme.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ground.report import tables
from ground.report.figures import Curve, Figure
from sysid.models.model_file import MAX_POSTERIOR_TO_PRIOR_SD, Coefficient

PANEL_HEIGHT_PX = 168
_GAP = 0.07
Chart = dict[str, Any]


def figure_chart(figure: Figure) -> Chart:
    """Return stacked panels with one legend and one x axis."""
    count = len(figure.panels)
    height = (1.0 - _GAP * (count - 1)) / count
    layout: dict[str, Any] = {"height": PANEL_HEIGHT_PX * count + 70}
    data: list[dict[str, Any]] = []
    for row, panel in enumerate(figure.panels):
        suffix = "" if row == 0 else str(row + 1)
        top = 1.0 - row * (height + _GAP)
        layout[f"yaxis{suffix}"] = {
            "domain": [round(top - height, 4), round(top, 4)],
            "title": {"text": panel.label},
        }
        if panel.title == "depth":
            layout[f"yaxis{suffix}"]["autorange"] = "reversed"
        if panel.limits:
            layout[f"yaxis{suffix}"]["range"] = list(panel.limits)
        for curve in panel.curves:
            data += _traces(curve, suffix, show_legend=row == 0)
    last = "" if count == 1 else str(count)
    layout["xaxis"] = {"anchor": f"y{last}", "title": {"text": figure.x_label}}
    if figure.log_x:
        layout["xaxis"] |= {"type": "log"}
    layout["shapes"] = [_shaded_interval(*ends) for ends in figure.shaded]
    if figure.upright is not None:
        layout["shapes"] += [_vertical_line(figure.upright)]
    return {"data": data, "layout": layout}


def estimates_chart(coefficients: Mapping[str, Coefficient]) -> Chart:
    """Return each coefficient over its prior value, with its standard deviations."""
    free = {name: c for name, c in coefficients.items() if c.prior_sd > 0 and c.prior != 0}
    names = [tables.symbol(name) for name in free]

    def points(
        label: str, role: str, values: Sequence[float], sds: Sequence[float], symbol: str
    ) -> dict[str, Any]:
        """Return a trace of values with error bars of one standard deviation."""
        return {
            "type": "scatter",
            "mode": "markers",
            "name": label,
            "role": role,
            "x": names,
            "y": values,
            "error_y": {"type": "data", "array": sds, "thickness": 1.6, "width": 4},
            "marker": {"size": 8, "symbol": symbol},
        }

    before = points(
        "before the tests",
        "initial",
        [1.0] * len(free),
        [round(c.prior_sd / abs(c.prior), 4) for c in free.values()],
        "circle-open",
    )
    after = points(
        "after",
        "redesigned",
        [round(c.value / c.prior, 4) for c in free.values()],
        [round((c.sd or 0.0) / abs(c.prior), 4) for c in free.values()],
        "circle",
    )
    layout = {
        "height": 360,
        "yaxis": {"title": {"text": "value over prior value"}},
        "xaxis": {"type": "category"},
    }
    return {"data": [before, after], "layout": layout}


def posterior_chart(coefficients: Mapping[str, Coefficient]) -> Chart:
    """Return posterior over prior standard deviation; above the line the data say little."""
    free = [
        (tables.symbol(name), c.posterior_to_prior_sd, c.status)
        for name, c in coefficients.items()
        if c.prior_sd > 0 and c.posterior_to_prior_sd is not None
    ]
    data = [
        {
            "type": "bar",
            "name": label,
            "role": role,
            "x": [name for name, _, _ in free],
            "showlegend": True,
            "y": [
                round(sd_ratio, 3) if (status == "measured") == measured else None
                for _, sd_ratio, status in free
            ],
        }
        for label, role, measured in (
            ("measured", "redesigned", True),
            ("prior", "initial", False),
        )
    ]
    limit = {
        "type": "line",
        "xref": "paper",
        "x0": 0,
        "x1": 1,
        "y0": MAX_POSTERIOR_TO_PRIOR_SD,
        "y1": MAX_POSTERIOR_TO_PRIOR_SD,
        "line": {"width": 1, "dash": "dot", "color": "rgba(128,128,128,0.9)"},
    }
    layout = {
        "height": 300,
        "barmode": "overlay",
        "shapes": [limit],
        "yaxis": {"title": {"text": "sd after over sd before"}, "range": [0, 1.05]},
        "xaxis": {"type": "category"},
    }
    return {"data": data, "layout": layout}


def poles_chart(poles: Mapping[str, Mapping[str, Sequence[Sequence[float]]]], loop: str) -> Chart:
    """Return the closed-loop poles (rad/s) of one loop with both sets of gains, and damping 0.6."""
    data: list[dict[str, Any]] = [_damping_line(0.6)]
    for role, symbol in (("initial", "x-thin-open"), ("redesigned", "circle-open")):
        points = poles[role][loop]
        data.append(
            {
                "type": "scatter",
                "mode": "markers",
                "name": f"{role} gains",
                "role": role,
                "x": [round(p[0], 4) for p in points],
                "y": [round(p[1], 4) for p in points],
                "marker": {"size": 10, "symbol": symbol, "line": {"width": 2}},
            }
        )
    layout = {
        "height": 320,
        "margin": {"l": 58, "r": 14, "t": 62, "b": 44},
        "xaxis": {"title": {"text": "real, rad/s"}, "range": [-4.2, 0.4]},
        "yaxis": {"title": {"text": "imaginary, rad/s"}, "range": [-4.0, 4.0]},
    }
    return {"data": data, "layout": layout}


def _damping_line(ratio: float) -> dict[str, Any]:
    """Return the rays of a damping ratio in the s-plane."""
    rise = float(np.sqrt(1.0 - ratio**2)) / ratio
    x = [-4.0, 0.0, -4.0]
    return {
        "type": "scatter",
        "mode": "lines",
        "name": f"damping {ratio}",
        "role": "set_point",
        "x": x,
        "y": [-x[0] * rise, 0.0, x[2] * rise],
        "line": {"dash": "dot", "width": 1.2},
        "hoverinfo": "skip",
    }


def _shaded_interval(start: float, end: float) -> dict[str, Any]:
    """Return a grey rectangle over an interval of x."""
    return {
        "type": "rect",
        "xref": "x",
        "yref": "paper",
        "x0": start,
        "x1": end,
        "y0": 0,
        "y1": 1,
        "fillcolor": "rgba(128,128,128,0.15)",
        "line": {"width": 0},
        "layer": "below",
    }


def _vertical_line(x: float) -> dict[str, Any]:
    """Return a dotted line at x over all panels."""
    return {
        "type": "line",
        "xref": "x",
        "yref": "paper",
        "x0": x,
        "x1": x,
        "y0": 0,
        "y1": 1,
        "line": {"width": 1, "dash": "dot", "color": "rgba(128,128,128,0.9)"},
    }


def _traces(curve: Curve, suffix: str, *, show_legend: bool) -> list[dict[str, Any]]:
    """Return the traces of a curve: a line with its band, marks with bars, or a band."""
    if curve.look == "marks":
        return [_marks(curve, suffix, show_legend=show_legend)]
    line = _line(curve, suffix, show_legend=show_legend)
    if curve.low is None or curve.high is None:
        return [line]
    edge = line | {"showlegend": False, "hoverinfo": "skip", "line": {"width": 0}}
    low, high = ({**edge, "y": _round(values, 3)} for values in (curve.low, curve.high))
    filled = high | {"fill": "tonexty", "showlegend": show_legend and curve.look == "band"}
    return [low, filled] if curve.look == "band" else [low, filled, line]


def _marks(curve: Curve, suffix: str, *, show_legend: bool) -> dict[str, Any]:
    """Return a curve as marks with error bars."""
    marks = _line(curve, suffix, show_legend=show_legend) | {
        "mode": "markers",
        "marker": {"size": 6},
    }
    if curve.high is not None:
        marks["error_y"] = {
            "type": "data",
            "array": _round(curve.high - curve.y, 3),
            "thickness": 1.2,
            "width": 2,
        }
    return marks


def _line(curve: Curve, suffix: str, *, show_legend: bool) -> dict[str, Any]:
    """Return a curve as a line on the y axis with this suffix."""
    line = {"width": 1.1 if curve.role == "measured" else 1.7}
    if curve.role == "set_point":
        line |= {"dash": "dash", "width": 1.2}  # type: ignore[dict-item]
    return {
        "type": "scatter",
        "mode": "lines",
        "name": curve.name,
        "role": curve.role,
        "legendgroup": curve.name,
        "showlegend": show_legend,
        "yaxis": f"y{suffix}",
        "line": line,
        "x": _round(curve.x, 4),
        "y": _round(curve.y, 3),
    }


def _round(values: Any, digits: int) -> list[float | None]:
    """Return rounded values, None for those that are not finite (JSON has no NaN)."""
    return [round(float(v), digits) if np.isfinite(v) else None for v in values]
