"""Charts of one dive or of several dives side by side, and the data of the 3-D track."""

import math
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ground.client.assessment import MAX_ERROR, UNIT, AssessedLeg, format_heading
from ground.report.charts import Chart
from ground.report.dive_data import ReportedDive
from sysid.data.dataset import Log
from sysid.data.events import Armed

Array = NDArray[np.float64]

MAX_POINTS = 4000
"""Points per curve of all dives together: about two per pixel of a wide screen."""
MAX_TRACK_POINTS = 4000
"""Points of all tracks together."""
MAX_EVENTS = 300
"""Events on the time axis per dive: more overlap."""
MAX_LINES = 40
"""Vertical lines at modes and failsafes in all panels."""
PANEL_PX, STRIP_PX = 150, 60
"""Height of a panel, and of the row of events of one dive."""
GAP_PX = 26
DASHES = ("solid", "dash", "dot", "dashdot", "longdash", "longdashdot")
"""Line style of each dive, so that colour is not needed to distinguish them."""
PATTERNS = ("", "/", ".", "x", "-", "|")
"""Fill of each dive's bars."""
SYMBOLS = {"mode": "diamond", "test": "square", "failsafe": "x", "text": "circle"}
Series = Callable[[Log], tuple[Array, Array]]


def role(number: int) -> str:
    """Return the role, and so the colour, of a dive by its number."""
    return f"dive-{number % len(DASHES)}"


def motion_chart(dives: Sequence[ReportedDive]) -> Chart:
    """Return events, depth, heading and pitch with their set-points over time.

    Parameters
    ----------
    dives : sequence of ReportedDive
        Dives to show side by side.

    Returns
    -------
    dict
        Plotly's data and layout.
    """
    panels: list[tuple[str, Series, Series | None]] = [
        ("depth, m", _depth, _depth_setpoint),
        ("heading, °", _heading, _heading_setpoint),
        ("pitch, °", _pitch, _pitch_setpoint),
    ]
    return _stacked(dives, panels, events=True)


def actuator_chart(dives: Sequence[ReportedDive]) -> Chart:
    """Return rudder, elevator and thrust over time; numbered outputs where they are not known.

    Parameters
    ----------
    dives : sequence of ReportedDive
        Dives to show side by side.

    Returns
    -------
    dict
        Plotly's data and layout.
    """
    panels: list[tuple[str, Series, Series | None]] = [
        ("rudder, °", _rudder, None),
        ("elevator, °", _elevator, None),
        ("thrust, %", _thrust, None),
    ]
    if not all(dive.names_surfaces for dive in dives):
        panels = [
            ("output 1, %", _rudder_pct, None),
            ("output 2, %", _elevator_pct, None),
            ("output 3, %", _thrust, None),
        ]
    return _stacked(dives, panels, events=False)


def error_chart(dives: Sequence[ReportedDive]) -> Chart:
    """Return the 95 % errors of heading and depth by leg.

    Parameters
    ----------
    dives : sequence of ReportedDive
        Dives to show side by side.

    Returns
    -------
    dict
        Plotly's data and layout.
    """
    data, shapes = [], []
    layout: dict[str, Any] = {"height": 2 * PANEL_PX + 130, "barmode": "group", "hovermode": "x"}
    for row, axis in enumerate(MAX_ERROR):
        suffix = "" if row == 0 else "2"
        for number, dive in enumerate(dives):
            legs = dive.assessment.legs
            data.append(
                {
                    "type": "bar",
                    "name": dive.label,
                    "role": role(number),
                    "legendgroup": dive.label,
                    "showlegend": row == 0,
                    "x": [f"leg {index}" for index in range(1, len(legs) + 1)],
                    "y": [round(_p95(leg, axis), 3) for leg in legs],
                    "hovertext": [_leg_name(leg) for leg in legs],
                    "xaxis": "x",
                    "yaxis": f"y{suffix}",
                    "marker": {"pattern": {"shape": PATTERNS[number % len(PATTERNS)]}},
                }
            )
        layout[f"yaxis{suffix}"] = {
            "domain": [0.54, 1.0] if row == 0 else [0.0, 0.46],
            "title": {"text": f"{axis}, {'°' if UNIT[axis] == 'deg' else 'm'}"},
            "rangemode": "tozero",
        }
        shapes.append(_limit_line(MAX_ERROR[axis], f"y{suffix}"))
    most = max(len(dive.assessment.legs) for dive in dives)
    layout["bargap"] = max(0.2, 1.0 - 0.12 * most * len(dives))
    layout |= {"shapes": shapes, "xaxis": {"anchor": "y2", "type": "category"}}
    return {"data": data, "layout": layout}


def track_data(dives: Sequence[ReportedDive]) -> dict[str, Any]:
    """Return the tracks with pose and commands for the 3-D view.

    Parameters
    ----------
    dives : sequence of ReportedDive
        Dives to show side by side.

    Returns
    -------
    dict
        Columns by dive: time (s), position (m), angles and commands (deg).
    """
    points = MAX_TRACK_POINTS // len(dives)
    return {
        "dives": [_track(dive, number, points) for number, dive in enumerate(dives)],
        "end": max(float(dive.track.time_s[-1]) for dive in dives),
    }


def _track(dive: ReportedDive, number: int, points: int) -> dict[str, Any]:
    """Return the columns of one track."""
    track, log = dive.track, dive.log
    keep = np.unique(np.linspace(0, track.time_s.size - 1, points).astype(int))
    at_s = track.time_s[keep] + dive.start_s

    def degrees(time_s: Array, values: Array) -> list[float]:
        return _list(np.degrees(np.interp(at_s, time_s, values)), 1)

    attitude, commands = log.attitude, log.actuators
    known = 1.0 if dive.names_surfaces else 0.0  # else the duct is drawn straight
    return {
        "name": dive.label,
        "role": role(number),
        "t": _list(track.time_s[keep], 1),
        "n": _list(track.north_m[keep], 2),
        "e": _list(track.east_m[keep], 2),
        "d": _list(track.depth_m[keep], 2),
        "roll": degrees(attitude.time_s, attitude.roll_rad),
        "pitch": degrees(attitude.time_s, attitude.pitch_rad),
        "yaw": degrees(attitude.time_s, attitude.yaw_rad),
        "rudder": degrees(commands.time_s, commands.rudder_rad * known),
        "elevator": degrees(commands.time_s, commands.elevator_rad * known),
        "surfaces": dive.names_surfaces,
    }


def _list(values: Array, digits: int) -> list[float]:
    """Return rounded values; NaN becomes 0."""
    return [float(value) for value in np.round(np.nan_to_num(values), digits)]


def _stacked(
    dives: Sequence[ReportedDive],
    panels: Sequence[tuple[str, Series, Series | None]],
    *,
    events: bool,
) -> Chart:
    """Return panels over time, with a row of events above the first one."""
    strip_px = STRIP_PX + 14 * (len(dives) - 1) if events else 0
    inner_px = len(panels) * PANEL_PX + (len(panels) - 1) * GAP_PX
    inner_px += strip_px + GAP_PX if events else 0
    layout: dict[str, Any] = {"height": inner_px + 100, "shapes": [], "annotations": []}
    data: list[dict[str, Any]] = []
    top_px = inner_px
    for row, (label, measured, setpoint) in enumerate(panels):
        if row == 0 and events:
            top_px -= strip_px + GAP_PX
        suffix = "" if row == 0 else str(row + 1)
        domain = [round((top_px - PANEL_PX) / inner_px, 4), round(top_px / inner_px, 4)]
        layout[f"yaxis{suffix}"] = {"domain": domain, "title": {"text": label}}
        if label.startswith("depth"):
            layout[f"yaxis{suffix}"]["autorange"] = "reversed"
        top_px -= PANEL_PX + GAP_PX
        for number, dive in enumerate(dives):
            data += _curves(dive, number, len(dives), f"y{suffix}", measured, setpoint, row == 0)
    if events:
        strip = f"axis{len(panels) + 1}"
        layout[f"y{strip}"] = {
            "domain": [round(1.0 - strip_px / inner_px, 4), 1.0],
            "title": {"text": "events"},
            "range": [-0.7, len(dives) - 0.3],
            "showticklabels": False,
            "showgrid": False,
            "zeroline": False,
            "fixedrange": True,
        }
        data += [
            trace
            for place, dive in enumerate(dives)
            for trace in _event_traces(dive, place, len(dives) - 1 - place, f"y{len(panels) + 1}")
        ]
    last = "" if len(panels) == 1 else str(len(panels))
    layout["xaxis"] = {
        "anchor": f"y{last}",
        "title": {"text": _time_label(dives)},
        "range": _time_range(dives),
    }
    layout["hovermode"] = "closest" if len(dives) > 1 else "x unified"
    if len(dives) == 1:
        layout["shapes"] = [*_leg_bands(dives[0]), *_event_lines(dives[0])]
        layout["annotations"] = _leg_labels(dives[0])
    return {"data": data, "layout": layout, "time": True}


def _time_label(dives: Sequence[ReportedDive]) -> str:
    """Return the title of the time axis."""
    is_armed = all(
        any(isinstance(event.value, Armed) for event in dive.log.events) for dive in dives
    )
    return "seconds since arming" if is_armed else "seconds since arming or the start of the log"


def _time_range(dives: Sequence[ReportedDive]) -> list[float]:
    """Return the time axis: from the arming of all dives to the end of the longest."""
    end_s = max(float(dive.track.time_s[-1]) for dive in dives)
    return [round(-0.01 * end_s, 2), round(1.01 * end_s, 2)]


def _curves(
    dive: ReportedDive,
    number: int,
    count: int,
    axis: str,
    measured: Series,
    setpoint: Series | None,
    first: bool,
) -> Iterator[dict[str, Any]]:
    """Yield the set-point and the measurement of one dive in one panel."""
    limit = max(600, MAX_POINTS // count)
    alone = count == 1
    setpoint_s, setpoints = setpoint(dive.log) if setpoint else (np.empty(0), np.empty(0))
    if setpoint_s.size:
        x, y = thin(setpoint_s - dive.start_s, setpoints, limit // 4)
        yield {
            **_line(f"set-point{'' if alone else ' of ' + dive.label}", x, y, axis),
            "role": "set_point" if alone else role(number),
            "legendgroup": f"set-point {number}",
            "showlegend": first and alone,
            "line": {"width": 1.2, "dash": "dash" if alone else "dot", "shape": "hv"},
        }
    time_s, values = measured(dive.log)
    x, y = thin(time_s - dive.start_s, values, limit)
    yield {
        **_line("measured" if alone and setpoint else dive.label, x, y, axis),
        "role": role(number),
        "legendgroup": dive.label,
        "showlegend": first,
        "line": {"width": 1.5, "dash": DASHES[number % len(DASHES)]},
    }


def _line(name: str, x: Array, y: Array, axis: str) -> dict[str, Any]:
    """Return a trace without its style."""
    return {
        "type": "scatter",
        "mode": "lines",
        "name": name,
        "yaxis": axis,
        "x": [round(float(value), 2) for value in x],
        "y": [round(float(value), 3) if math.isfinite(value) else None for value in y],
    }


def thin(time_s: Array, values: Array, limit: int) -> tuple[Array, Array]:
    """Return at most about `limit` samples that keep the extremes of every stretch.

    Parameters
    ----------
    time_s, values : ndarray, shape (n,)
        Samples.
    limit : int
        Number of samples to keep.

    Returns
    -------
    tuple of ndarray
        The smallest and the largest sample of each of `limit` / 2 stretches, in order of time.
    """
    if time_s.size <= limit:
        return time_s, values
    size = math.ceil(time_s.size / (limit // 2))
    whole = time_s.size // size * size
    finite = np.nan_to_num(values[:whole].reshape(-1, size))
    starts = np.arange(0, whole, size)
    rows = [starts + np.argmin(finite, axis=1), starts + np.argmax(finite, axis=1)]
    breaks = np.flatnonzero(~np.isfinite(values))
    indexes = np.unique(np.concatenate([[0], *rows, breaks, [time_s.size - 1]]))
    return time_s[indexes], values[indexes]


def _event_traces(
    dive: ReportedDive, number: int, height: int, axis: str
) -> Iterator[dict[str, Any]]:
    """Yield one trace of marks per kind of event."""
    all_events = _shown_events(dive)
    for kind, symbol in SYMBOLS.items():
        events = [event for event in all_events if event.kind == kind]
        if events:
            yield {
                "type": "scatter",
                "mode": "markers",
                "name": f"{dive.label}: {kind}",
                "role": "initial" if kind == "failsafe" else role(number),
                "showlegend": False,
                "x": [round(event.time_s, 1) for event in events],
                "y": [height] * len(events),
                "text": [event.text for event in events],
                "hovertemplate": "%{x:.1f} s: %{text}<extra></extra>",
                "yaxis": axis,
                "marker": {"symbol": symbol, "size": 9},
            }


def _shown_events(dive: ReportedDive) -> list[Any]:
    """Return the events of the time axis; texts are left out first where there are too many."""
    if len(dive.events) <= MAX_EVENTS:
        return list(dive.events)
    return [event for event in dive.events if event.kind != "text"][:MAX_EVENTS]


def _event_lines(dive: ReportedDive) -> list[dict[str, Any]]:
    """Return vertical lines at modes and failsafes."""
    marked = [event for event in dive.events if event.kind in ("mode", "failsafe")]
    return [_vertical(event.time_s, event.kind == "failsafe") for event in marked[:MAX_LINES]]


def _vertical(x: float, failsafe: bool) -> dict[str, Any]:
    """Return a vertical line over all panels."""
    return {
        "type": "line",
        "xref": "x",
        "yref": "paper",
        "x0": round(x, 2),
        "x1": round(x, 2),
        "y0": 0,
        "y1": 1,
        "line": {
            "width": 1.6 if failsafe else 1,
            "dash": "solid" if failsafe else "dot",
            "color": "rgba(200,80,40,0.9)" if failsafe else "rgba(128,128,128,0.8)",
        },
    }


def _leg_bands(dive: ReportedDive) -> list[dict[str, Any]]:
    """Return a grey band over each assessed leg."""
    return [
        {
            "type": "rect",
            "xref": "x",
            "yref": "paper",
            "x0": round(leg.start_s - dive.start_s, 2),
            "x1": round(leg.stop_s - dive.start_s, 2),
            "y0": 0,
            "y1": 1,
            "fillcolor": "rgba(128,128,128,0.11)",
            "line": {"width": 0},
            "layer": "below",
        }
        for leg in dive.assessment.legs[:MAX_LINES]
    ]


def _leg_labels(dive: ReportedDive) -> list[dict[str, Any]]:
    """Return the number of each leg at the lower end of its band."""
    return [
        {
            "x": round(0.5 * (leg.start_s + leg.stop_s) - dive.start_s, 2),
            "y": 0,
            "yref": "paper",
            "yanchor": "bottom",
            "text": f"leg {number}",
            "showarrow": False,
            "opacity": 0.7,
            "font": {"size": 11},
        }
        for number, leg in enumerate(dive.assessment.legs[:MAX_LINES], 1)
    ]


def _limit_line(value: float, axis: str) -> dict[str, Any]:
    """Return a dotted line at the limit of an error."""
    line = {"width": 1.2, "dash": "dot", "color": "rgba(128,128,128,0.9)"}
    ends = {"x0": 0, "x1": 1, "y0": value, "y1": value}
    return {"type": "line", "xref": "paper", "yref": axis, "line": line, **ends}


def _p95(leg: AssessedLeg, axis: str) -> float:
    """Return the 95 % error of one axis."""
    return (leg.heading_deg if axis == "heading" else leg.depth_m).p95


def _leg_name(leg: AssessedLeg) -> str:
    """Return the set-points of a leg."""
    return f"{format_heading(leg.heading_setpoint_deg)}°, {leg.depth_setpoint_m:.1f} m"


def _depth(log: Log) -> tuple[Array, Array]:
    return log.depth.time_s, log.depth.depth_m


def _depth_setpoint(log: Log) -> tuple[Array, Array]:
    return log.setpoints.depth_time_s, log.setpoints.depth_m


def _heading(log: Log) -> tuple[Array, Array]:
    return log.attitude.time_s, _shown_heading(log, log.attitude.yaw_rad)


def _heading_setpoint(log: Log) -> tuple[Array, Array]:
    points = log.setpoints
    return points.attitude_time_s, _shown_heading(log, points.heading_rad)


def _shown_heading(log: Log, angle_rad: Array) -> Array:
    """Return headings in degrees: continuous within one turn, else 0 to 360 with breaks."""
    yaw_deg, angle_deg = np.degrees(log.attitude.yaw_rad), np.degrees(angle_rad)
    if np.ptp(yaw_deg) < 300.0:
        middle = 0.5 * (np.min(yaw_deg) + np.max(yaw_deg))
        shift = 360.0 * np.floor(middle / 360.0)
        own = 360.0 * np.round((angle_deg - middle) / 360.0)
        return np.asarray(angle_deg - own - shift)
    wrapped = angle_deg % 360.0
    wrapped[1:][np.abs(np.diff(wrapped)) > 180.0] = np.nan
    return np.asarray(wrapped)


def _pitch(log: Log) -> tuple[Array, Array]:
    return log.attitude.time_s, np.degrees(log.attitude.pitch_rad)


def _pitch_setpoint(log: Log) -> tuple[Array, Array]:
    return log.setpoints.attitude_time_s, np.degrees(log.setpoints.pitch_rad)


def _rudder(log: Log) -> tuple[Array, Array]:
    return log.actuators.time_s, np.degrees(log.actuators.rudder_rad)


def _elevator(log: Log) -> tuple[Array, Array]:
    return log.actuators.time_s, np.degrees(log.actuators.elevator_rad)


def _rudder_pct(log: Log) -> tuple[Array, Array]:
    commands = log.actuators
    return commands.time_s, 100.0 * commands.rudder_rad / commands.travel_rad


def _elevator_pct(log: Log) -> tuple[Array, Array]:
    commands = log.actuators
    return commands.time_s, 100.0 * commands.elevator_rad / commands.travel_rad


def _thrust(log: Log) -> tuple[Array, Array]:
    return log.actuators.time_s, 100.0 * log.actuators.thrust
