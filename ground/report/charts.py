"""Figures as Plotly's JSON. Colours are names of roles: the page's script gives them the theme's."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ground.report import tables
from ground.report.figures import Curve, Figure

PANEL_HEIGHT_PX = 168
_GAP = 0.07
Chart = dict[str, Any]


def of_figure(figure: Figure) -> Chart:
    """Stacked panels with one legend and one x axis."""
    count = len(figure.panels)
    height = (1.0 - _GAP * (count - 1)) / count
    layout: dict[str, Any] = {"height": PANEL_HEIGHT_PX * count + 70}
    data: list[dict[str, Any]] = []
    for row, panel in enumerate(figure.panels):
        suffix = "" if row == 0 else str(row + 1)
        top = 1.0 - row * (height + _GAP)
        label = f"{panel.title}, {panel.y_label}"
        layout[f"yaxis{suffix}"] = {"domain": [round(top - height, 4), round(top, 4)], "title": {"text": label}}
        if panel.title == "depth":
            layout[f"yaxis{suffix}"]["autorange"] = "reversed"
        data += [_line(curve, suffix, show_legend=row == 0) for curve in panel.curves]
    last = "" if count == 1 else str(count)
    layout["xaxis"] = {"anchor": f"y{last}", "title": {"text": figure.x_label}}
    return {"data": data, "layout": layout}


def of_estimates(coefficients: Mapping[str, Mapping[str, Any]]) -> Chart:
    """Each coefficient over its prior value, with one standard deviation before and after the tests."""
    free = {name: c for name, c in coefficients.items() if c["prior_sd"] > 0 and c["prior"] != 0}
    names = [tables.symbol(name) for name in free]

    def points(label: str, role: str, values: Sequence[float], sds: Sequence[float], symbol: str) -> dict[str, Any]:
        return {
            "type": "scatter", "mode": "markers", "name": label, "role": role, "x": names, "y": values,
            "error_y": {"type": "data", "array": sds, "thickness": 1.6, "width": 4},
            "marker": {"size": 8, "symbol": symbol},
        }  # fmt: skip

    before = points(
        "before the tests", "initial",
        [1.0] * len(free), [round(c["prior_sd"] / abs(c["prior"]), 4) for c in free.values()], "circle-open",
    )  # fmt: skip
    after = points(
        "after", "redesigned",
        [round(c["value"] / c["prior"], 4) for c in free.values()],
        [round((c["sd"] or 0.0) / abs(c["prior"]), 4) for c in free.values()], "circle",
    )  # fmt: skip
    layout = {
        "height": 360,
        "yaxis": {"title": {"text": "value over the initial value"}},
        "xaxis": {"type": "category"},
    }
    return {"data": [before, after], "layout": layout}


def of_poles(poles: Mapping[str, Mapping[str, Sequence[Sequence[float]]]], loop: str) -> Chart:
    """Closed-loop poles of one loop under both sets of gains, with the line of damping 0.6."""
    data: list[dict[str, Any]] = [_damping_line(0.6)]
    for role, symbol in (("initial", "x-thin-open"), ("redesigned", "circle-open")):
        found = poles[role][loop]
        data.append({
            "type": "scatter", "mode": "markers", "name": f"{role} gains", "role": role,
            "x": [round(p[0], 4) for p in found], "y": [round(p[1], 4) for p in found],
            "marker": {"size": 10, "symbol": symbol, "line": {"width": 2}},
        })  # fmt: skip
    layout = {
        "height": 320,
        "margin": {"l": 58, "r": 14, "t": 62, "b": 44},
        "xaxis": {"title": {"text": "real, rad/s"}, "range": [-4.2, 0.4]},
        "yaxis": {"title": {"text": "imaginary, rad/s"}, "range": [-4.0, 4.0]},
    }
    return {"data": data, "layout": layout}


def _damping_line(ratio: float) -> dict[str, Any]:
    rise = float(np.sqrt(1.0 - ratio**2)) / ratio
    x = [-4.0, 0.0, -4.0]
    return {
        "type": "scatter", "mode": "lines", "name": f"damping {ratio}", "role": "set_point",
        "x": x, "y": [-x[0] * rise, 0.0, x[2] * rise], "line": {"dash": "dot", "width": 1.2}, "hoverinfo": "skip",
    }  # fmt: skip


def _line(curve: Curve, suffix: str, *, show_legend: bool) -> dict[str, Any]:
    line = {"width": 1.1 if curve.role == "measured" else 1.7}
    if curve.role == "set_point":
        line |= {"dash": "dash", "width": 1.2}  # type: ignore[dict-item]
    return {
        "type": "scatter", "mode": "lines", "name": curve.name, "role": curve.role, "legendgroup": curve.name,
        "showlegend": show_legend, "yaxis": f"y{suffix}", "line": line,
        "x": _rounded(curve.x, 2), "y": _rounded(curve.y, 3),
    }  # fmt: skip


def _rounded(values: Any, digits: int) -> list[float | None]:
    return [round(float(v), digits) if np.isfinite(v) else None for v in values]
