"""The data behind the page's charts and the README's picture: which curves, in which units, under
which name."""

from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ground.campaign.campaign_folder import STAGES, CampaignFolder

if TYPE_CHECKING:
    from sysid.data.dataset import Log
    from sysid.data.segments import Run

Array = NDArray[np.float64]
CURVE_HZ = 5.0
"""Curves are drawn at this rate: finer than a line on paper can show over minutes."""
SURFACED_TEXT = "Mode SURFACE"


class Curve(NamedTuple):
    """One line of a chart."""

    name: str
    role: str
    """Colour and dash by meaning: measured, initial, redesigned, set_point."""
    x: Array
    y: Array
    low: Array | None = None
    """With ``high``: a band about the line, or the ends of the bars of marks."""
    high: Array | None = None
    look: Literal["line", "marks", "band"] = "line"
    """A line with its band, points with bars, or the band alone."""


class Panel(NamedTuple):
    """One pair of axes."""

    title: str
    y_label: str
    curves: tuple[Curve, ...]
    limits: tuple[float, float] | None = None

    @property
    def label(self) -> str:
        """Of the y axis."""
        return f"{self.title}, {self.y_label}" if self.y_label else self.title


class Figure(NamedTuple):
    """Panels above one another that share their x axis."""

    key: str
    title: str
    note: str
    x_label: str
    panels: tuple[Panel, ...]
    log_x: bool = False
    shaded: tuple[tuple[float, float], ...] = ()
    """Stretches of x that count for less."""
    upright: float | None = None
    """An x that all panels mark."""


def step_figures(folder: CampaignFolder) -> list[Figure]:
    """The paper's figures 8 and 9: the largest steps, measured and modelled; then a held-out run of
    each plane."""
    chosen = [
        (_largest_step(folder.runs("rudder_steps")), "The paper's figure 8."),
        (_largest_step(folder.runs("elevator_steps")), "The paper's figure 9."),
        (_largest_step(folder.runs("rudder_heldout")), "Held out: no model was fitted to it."),
        (_largest_step(folder.runs("elevator_heldout")), "Held out: no model was fitted to it."),
    ]
    return [_step_figure(folder, run, note) for run, note in chosen]


def mission_figures(folder: CampaignFolder, missions: list[str]) -> list[Figure]:
    """The paper's figures 10 to 15: each mission under every set of gains, in the same sea."""
    return [_mission_figure(folder, mission) for mission in missions]


def _largest_step(runs: "list[Run]") -> "Run":
    return max(runs, key=lambda run: (run.wave == "step", abs(run.magnitude_deg)))


def _step_figure(folder: CampaignFolder, run: "Run", note: str) -> Figure:
    from sysid.models.prediction import predict

    predicted = predict(folder.model, run)
    axis, motion = ("rudder", "yaw") if run.plane == "yaw" else ("elevator", "pitch")
    angle = (
        run.heading_rad - run.heading_rad[~run.preroll][0] if run.plane == "yaw" else run.pitch_rad
    )
    began = int(np.argmax(~run.preroll))
    thin = slice(0, None, 5)
    t = run.time_s[thin]

    def rate(name: str, role: str, values: Array) -> Curve:
        return Curve(name, role, t, np.degrees(values)[thin])

    def turned(name: str, role: str, values: Array) -> Curve:
        shift = values[began] if run.plane == "yaw" else 0.0
        return Curve(name, role, t, np.degrees(values - shift)[thin])

    return Figure(
        key=f"step-{run.name.replace('/', '-')}",
        title=f"{run.wave.capitalize()} of {run.magnitude_deg:+g}° {axis} about its trim",
        note=note,
        x_label="seconds since the test began",
        panels=(
            Panel(
                f"{motion} rate",
                "°/s",
                (
                    rate("measured", "measured", run.rate_radps),
                    rate("initial model", "initial", predicted.prior_rate_radps),
                    rate("refitted model", "redesigned", predicted.rate_radps),
                ),
            ),
            Panel(
                "heading change" if run.plane == "yaw" else "pitch",
                "°",
                (
                    Curve("measured", "measured", t, np.degrees(angle)[thin]),
                    turned("initial model", "initial", predicted.prior_angle_rad),
                    turned("refitted model", "redesigned", predicted.angle_rad),
                ),
            ),
        ),
    )


def _mission_figure(folder: CampaignFolder, mission: str) -> Figure:
    flown = folder.summary["tracking"][mission]
    logs = {name: folder.log(stage, mission) for name, stage in STAGES.items() if name in flown}
    ends = {name: _end_s(log) for name, log in logs.items()}
    reference = logs["redesigned"]
    span = ends["redesigned"]
    depth = [_curve(n, n, log.depth.time_s, log.depth.depth_m, ends[n]) for n, log in logs.items()]
    heading = [
        _curve(n, n, log.attitude.time_s, np.degrees(log.attitude.yaw_rad), ends[n])
        for n, log in logs.items()
    ]
    pitch = [
        _curve(n, n, log.attitude.time_s, np.degrees(log.attitude.pitch_rad), ends[n])
        for n, log in logs.items()
    ]
    wanted = reference.setpoints
    asked_depth = _curve("set-point", "set_point", wanted.depth_time_s, wanted.depth_m, span)
    asked_heading = _curve(
        "set-point", "set_point", wanted.attitude_time_s, np.degrees(wanted.heading_rad), span
    )
    return Figure(
        key=f"mission-{mission}",
        title=_TITLES.get(mission, mission),
        note=_NOTES.get(mission, ""),
        x_label="seconds since the vehicle was armed",
        panels=(
            Panel("depth", "m", (asked_depth, *depth)),
            Panel("heading", "°", (asked_heading, *heading)),
            Panel("pitch", "°", tuple(pitch)),
        ),
    )


_TITLES = {
    "straight_run": "Straight run",
    "depth_change": "Depth changes",
    "combined": "Depth and heading together",
    "shallow_1m": "One metre under the surface",
}
_NOTES = {
    "straight_run": "The paper's figures 10 and 11.",
    "depth_change": "The paper's figures 12 and 13.",
    "combined": "The paper's figure 14: 4 m at -80°, 7 m at -40°, 1 m at -100°.",
    "shallow_1m": "The paper's figure 15.",
}


def _end_s(log: "Log") -> float:
    """When the mission ended and the surfacing began."""
    return next(
        (event.time_s for event in log.events if event.text == SURFACED_TEXT),
        float(log.attitude.time_s[-1]),
    )


def _curve(name: str, role: str, time_s: Array, values: Array, end_s: float) -> Curve:
    thin = np.arange(0.0, end_s, 1.0 / CURVE_HZ)
    return Curve(
        name,
        role,
        thin,
        np.interp(thin, time_s, values) if time_s.size else np.full(thin.size, np.nan),
    )
