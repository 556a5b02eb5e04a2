"""Charts of the control loops on the identified model: Bode, Nyquist, steps and root loci."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from ground.report.charts import Chart, figure_chart
from ground.report.figures import Curve, Figure, Panel
from sysid.control_analysis import loop_state_space, loop_transfer, root_locus
from sysid.control_analysis.loop_state_space import LOOPS
from sysid.control_analysis.loop_transfer import ComplexArray
from sysid.design.design_model import DesignModel
from sysid.planes import PLANES, Plane

Gains = Mapping[str, float]
ROLES = ("initial", "redesigned")
MIN_RADPS, MAX_RADPS = 0.02, 10.0
"""Frequencies shown: below, the integrators dominate; above, the delay does."""
EVERY = 2
"""Every second frequency of the grid is drawn in a Nyquist plot."""
NYQUIST_LIMIT = 3.0
STEP_S = {"heading": 30.0, "pitch": 30.0, "depth": 60.0}
"""Length of each step response."""
STEP_STATE = {"heading": 2, "pitch": 2, "depth": 3}
"""State of the plane that each loop controls."""
LOCUS_GAINS = np.concatenate([[0.0], np.geomspace(1e-2, 3.0, 150)])
"""Loop gains of the root loci; 1 is the designed one."""
LOCUS_X, LOCUS_Y = (-4.2, 0.8), (-0.1, 4.0)


class LoopCharts(NamedTuple):
    """Charts of the loops by the id of their places, and the titles of the places."""

    charts: dict[str, Chart]
    bode: dict[str, str]
    nyquist: dict[str, str]
    steps: dict[str, str]
    loci: dict[str, str]


def loop_charts(vehicle: DesignModel, gains: Mapping[str, Gains]) -> LoopCharts:
    """Return the charts of all loops with the initial and with the redesigned gains.

    Parameters
    ----------
    vehicle : DesignModel
        Identified model as the design uses it.
    gains : Mapping
        Gains by set: ``initial`` and ``redesigned``.

    Returns
    -------
    LoopCharts
        Charts and titles.
    """
    opened = {role: _open_loops(vehicle, gains[role]) for role in ROLES}
    cuts = list(opened["redesigned"])
    charts = {f"bode-{cut}": figure_chart(_bode(cut, opened)) for cut in cuts}
    charts |= {f"nyquist-{cut}": _nyquist(cut, opened) for cut in cuts}
    charts |= {f"closed-{loop}": figure_chart(_steps(loop, vehicle, gains)) for loop in LOOPS}
    charts |= {f"locus-{loop}": _locus(loop, vehicle, gains["redesigned"]) for loop in LOOPS}
    return LoopCharts(
        charts=charts,
        bode={f"bode-{cut}": f"Loop opened at the {cut}" for cut in cuts},
        nyquist={f"nyquist-{cut}": f"Loop opened at the {cut}" for cut in cuts},
        steps={f"closed-{loop}": f"{loop.capitalize()} loop" for loop in LOOPS},
        loci={f"locus-{loop}": f"{loop.capitalize()} loop" for loop in LOOPS},
    )


def _open_loops(vehicle: DesignModel, gains: Gains) -> dict[str, ComplexArray]:
    """Return the open-loop transfer functions of both planes by cut, on `GRID_RADPS`."""
    lags = vehicle.yaw_lag, vehicle.pitch_lag
    loops: dict[str, ComplexArray] = {}
    for plane in Plane:
        index = PLANES[plane].index
        responses = loop_transfer.responses(vehicle.planes[index], lags[index])
        loops |= loop_transfer.open_loops(plane, responses, gains)
    return loops


def _shown() -> np.ndarray[Any, Any]:
    """Return the indices of the grid that are drawn."""
    grid = loop_transfer.GRID_RADPS
    inside = np.flatnonzero((grid >= MIN_RADPS) & (grid <= MAX_RADPS))
    return np.asarray(inside[:: max(1, inside.size // 200)])


def _bode(cut: str, opened: Mapping[str, Mapping[str, ComplexArray]]) -> Figure:
    """Return gain, phase and sensitivity of a loop over frequency."""
    rows = _shown()
    radps = loop_transfer.GRID_RADPS[rows]

    def curves(values: Mapping[str, np.ndarray[Any, Any]]) -> tuple[Curve, ...]:
        """Return one curve per set of gains."""
        return tuple(Curve(f"{role} gains", role, radps, values[role][rows]) for role in ROLES)

    loops = {role: opened[role][cut] for role in ROLES}
    gain = {role: 20.0 * np.log10(np.abs(loop)) for role, loop in loops.items()}
    phase = {role: _phase_deg(loop) for role, loop in loops.items()}
    sensitivity = {role: -20.0 * np.log10(np.abs(1.0 + loop)) for role, loop in loops.items()}
    return Figure(
        key=f"bode-{cut}",
        title=cut,
        note="",
        x_label="frequency, rad/s",
        panels=(
            Panel("gain", "dB", curves(gain), (-40.0, 40.0)),
            Panel("phase", "°", curves(phase), (-450.0, 0.0)),
            Panel("sensitivity", "dB", curves(sensitivity), (-40.0, 12.0)),
        ),
        log_x=True,
    )


def _phase_deg(loop: ComplexArray) -> np.ndarray[Any, Any]:
    """Return the unwrapped phase (deg) that starts between -360 and 0."""
    angle = np.degrees(np.unwrap(np.angle(loop)))
    return np.asarray(angle - 360.0 * np.ceil((angle[0] - 1.0) / 360.0))


def _nyquist(cut: str, opened: Mapping[str, Mapping[str, ComplexArray]]) -> Chart:
    """Return the Nyquist plot of a loop with the circle of the largest sensitivity."""
    angle = np.linspace(0.0, 2.0 * np.pi, 73)
    loop = opened["redesigned"][cut]
    radius = float(np.min(np.abs(1.0 + loop)))
    data = [
        _trace(f"Ms = {1.0 / radius:.2f}", "set_point", -1.0 + radius * np.exp(1j * angle), "dot"),
        {
            **_trace("−1", "set_point", np.array([-1.0 + 0.0j]), "solid"),
            "mode": "markers",
            "marker": {"symbol": "cross", "size": 9},
        },
    ]
    for role in ROLES:
        curve = opened[role][cut][loop_transfer.GRID_RADPS >= MIN_RADPS][::EVERY]
        near = np.where(np.abs(curve) < 2.0 * NYQUIST_LIMIT, curve, np.nan)
        dash = "dash" if role == "initial" else "solid"
        data.append(_trace(f"{role} gains", role, near, dash))
    axis = {"range": [-NYQUIST_LIMIT, NYQUIST_LIMIT]}
    layout = {
        "height": 400,
        "margin": {"l": 58, "r": 14, "t": 62, "b": 44},
        "hovermode": "closest",
        "xaxis": {**axis, "title": {"text": "real"}, "constrain": "domain"},
        "yaxis": {**axis, "title": {"text": "imaginary"}, "scaleanchor": "x"},
    }
    return {"data": data, "layout": layout}


def _steps(loop: str, vehicle: DesignModel, gains: Mapping[str, Gains]) -> Figure:
    """Return the response of a closed loop to a unit step of its set-point."""
    time_s = np.arange(0.0, STEP_S[loop], 0.1)
    curves = [
        Curve(
            f"{role} gains",
            role,
            time_s,
            loop_state_space.step_response(
                _closed(loop, vehicle, gains[role]), STEP_STATE[loop], STEP_S[loop]
            ),
        )
        for role in ROLES
    ]
    setpoint = Curve("set-point", "set_point", time_s[[0, -1]], np.ones(2))
    return Figure(
        key=f"closed-{loop}",
        title=loop,
        note="",
        x_label="seconds",
        panels=(Panel(loop, "per unit", (setpoint, *curves)),),
    )


def _closed(loop: str, vehicle: DesignModel, gains: Gains) -> loop_state_space.ClosedLoop:
    """Return one of the closed loops."""
    lags = vehicle.yaw_lag, vehicle.pitch_lag
    return loop_state_space.close_loop(loop, vehicle.planes, lags, gains)


def _locus(loop: str, vehicle: DesignModel, gains: Gains) -> Chart:
    """Return the root locus of a loop, upper half-plane, for 0 to 3 times its gain."""
    closed = _closed(loop, vehicle, gains)
    opened = root_locus.open_at_duct(closed, 4 if loop == "depth" else 3)
    branches = root_locus.poles(opened, LOCUS_GAINS)
    data = [
        {
            **_marks("loop gain 0 to 3", "redesigned", branches.ravel(), "circle", 2),
            "hoverinfo": "skip",
        },
        _marks("gain 0", "measured", branches[0], "x-thin-open", 9),
        _marks("zeros", "measured", root_locus.zeros(opened), "circle-open", 9),
        _marks("designed gain", "initial", loop_state_space.poles(closed), "square-open", 10),
    ]
    layout = {
        "height": 380,
        "margin": {"l": 58, "r": 14, "t": 62, "b": 44},
        "hovermode": "closest",
        "xaxis": {"range": list(LOCUS_X), "title": {"text": "real, rad/s"}},
        "yaxis": {"range": list(LOCUS_Y), "title": {"text": "imaginary, rad/s"}},
    }
    return {"data": data, "layout": layout}


def _marks(name: str, role: str, points: ComplexArray, symbol: str, size: int) -> dict[str, Any]:
    """Return the points of the upper half-plane that lie within the axes."""
    inside = (points.real > LOCUS_X[0]) & (points.real < LOCUS_X[1])
    inside &= (points.imag >= -1e-9) & (points.imag < LOCUS_Y[1])
    return {
        **_trace(name, role, points[inside], "solid"),
        "mode": "markers",
        "marker": {"symbol": symbol, "size": size},
    }


def _trace(name: str, role: str, points: ComplexArray, dash: str) -> dict[str, Any]:
    """Return complex numbers as a line."""
    return {
        "type": "scatter",
        "mode": "lines",
        "name": name,
        "role": role,
        "x": _numbers(points.real),
        "y": _numbers(points.imag),
        "line": {"width": 1.7, "dash": dash},
    }


def _numbers(values: Sequence[float] | np.ndarray[Any, Any]) -> list[float | None]:
    """Return rounded numbers; None for those that are not finite."""
    return [round(float(v), 3) if np.isfinite(v) else None for v in values]
