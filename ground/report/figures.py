"""Curves, units and titles of the figures in the report and in the summary picture."""

from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ground.campaign.campaign_folder import STAGES, CampaignFolder
from ground.campaign.summary_file import PAPER_VEHICLE
from mavlink_io.vehicle_modes import VehicleMode
from sysid.data.dataset import Log
from sysid.data.events import ModeChanged
from sysid.data.runs import Run
from sysid.models.prediction import predict
from sysid.planes import PLANES, Plane

Array = NDArray[np.float64]
CURVE_HZ = 5.0
"""Sample rate of the drawn curves: a plot of several minutes shows no finer detail."""
ANGLE_TITLES = {Plane.YAW: "heading change", Plane.PITCH: "pitch"}
"""Title of the panel with the angle of a test."""


class Curve(NamedTuple):
    """One line of a chart."""

    name: str
    role: str
    """Role that sets colour and dash: measured, initial, redesigned, set_point."""
    x: Array
    y: Array
    low: Array | None = None
    """Lower limit of the band or of the error bars; `high` is the upper one."""
    high: Array | None = None
    look: Literal["line", "marks", "band"] = "line"
    """``line``: line with band; ``marks``: points with error bars; ``band``: band only."""


class Panel(NamedTuple):
    """One pair of axes."""

    title: str
    y_label: str
    curves: tuple[Curve, ...]
    limits: tuple[float, float] | None = None

    @property
    def label(self) -> str:
        """Label of the y axis."""
        return f"{self.title}, {self.y_label}" if self.y_label else self.title


class Figure(NamedTuple):
    """Stacked panels that share their x axis."""

    key: str
    title: str
    note: str
    x_label: str
    panels: tuple[Panel, ...]
    log_x: bool = False
    shaded: tuple[tuple[float, float], ...] = ()
    """Intervals of x drawn with a grey background."""
    upright: float | None = None
    """Position on the x axis of a vertical line in all panels."""


def step_figures(folder: CampaignFolder) -> list[Figure]:
    """Return the largest steps (the paper's figures 8 and 9) and one held-out run per plane."""
    first, second = (
        ("The paper's figure 8.", "The paper's figure 9.")
        if folder.prior == PAPER_VEHICLE
        else ("Fitted.", "Fitted.")
    )
    selected = [
        (_largest_step(folder.runs("rudder_steps")), first),
        (_largest_step(folder.runs("elevator_steps")), second),
        (_largest_step(folder.runs("rudder_heldout")), "Held out: not used in the fit."),
        (_largest_step(folder.runs("elevator_heldout")), "Held out: not used in the fit."),
    ]
    return [step_figure(folder, run, note) for run, note in selected]


def mission_figures(folder: CampaignFolder, missions: list[str]) -> list[Figure]:
    """Return each mission with every set of gains (the paper's figures 10 to 15)."""
    return [_mission_figure(folder, mission) for mission in missions]


def _largest_step(runs: list[Run]) -> Run:
    return max(runs, key=lambda run: (run.wave == "step", abs(run.magnitude_deg)))


def step_figure(folder: CampaignFolder, run: Run, note: str) -> Figure:
    """Return rate and angle of a test, measured and predicted by both models.

    Parameters
    ----------
    folder : CampaignFolder
        Campaign with its model.
    run : Run
        Test of the campaign.
    note : str
        Text below the title.

    Returns
    -------
    Figure
        Panels of rate and angle.
    """
    predicted = predict(folder.model, run, folder.prior_config)
    surface, angle_title = PLANES[run.plane].surface, ANGLE_TITLES[run.plane]
    start_index = int(np.argmax(~run.preroll))
    thin = slice(0, None, 5)
    t = run.time_s[thin]

    def rate(name: str, role: str, values: Array) -> Curve:
        return Curve(name=name, role=role, x=t, y=np.degrees(values)[thin])

    def angle_change(name: str, role: str, values: Array) -> Curve:
        offset = values[start_index] if PLANES[run.plane].is_yaw else 0.0
        return Curve(name=name, role=role, x=t, y=np.degrees(values - offset)[thin])

    return Figure(
        key=f"step-{run.name.replace('/', '-')}",
        title=f"{run.wave.capitalize()} of {run.magnitude_deg:+g}° {surface} about its trim",
        note=note,
        x_label="seconds since the test began",
        panels=(
            Panel(
                f"{run.plane} rate",
                "°/s",
                (
                    rate("measured", "measured", run.rate_radps),
                    rate("initial model", "initial", predicted.prior_rate_radps),
                    rate("refitted model", "redesigned", predicted.rate_radps),
                ),
            ),
            Panel(
                angle_title,
                "°",
                (
                    angle_change("measured", "measured", run.angle_rad),
                    angle_change("initial model", "initial", predicted.prior_angle_rad),
                    angle_change("refitted model", "redesigned", predicted.angle_rad),
                ),
            ),
        ),
    )


def _mission_figure(folder: CampaignFolder, mission: str) -> Figure:
    """Draw the motion and the surfaces in a mission with every set of gains."""
    flown, final_set = folder.summary.tracking[mission], folder.summary.design.final_set
    logs = {name: folder.log(stage, mission) for name, stage in STAGES.items() if name in flown}
    ends = {name: end_s(log) for name, log in logs.items()}
    reference = logs["redesigned"]
    span = ends["redesigned"]

    def curve(role: str, time_s: Array, values: Array) -> Curve:
        """Return the curve of a set of gains."""
        name = final_set if role == "redesigned" else role
        return _curve(name, role, time_s, values, ends[role])

    depth = [curve(role, log.depth.time_s, log.depth.depth_m) for role, log in logs.items()]
    heading = [
        curve(role, log.attitude.time_s, np.degrees(log.attitude.yaw_rad))
        for role, log in logs.items()
    ]
    pitch = [
        curve(role, log.attitude.time_s, np.degrees(log.attitude.pitch_rad))
        for role, log in logs.items()
    ]
    surfaces = {
        name: [
            curve(role, log.actuators.time_s, np.degrees(getattr(log.actuators, field)))
            for role, log in logs.items()
        ]
        for name, field in (("rudder", "rudder_rad"), ("elevator", "elevator_rad"))
    }
    setpoints = reference.setpoints
    depth_setpoint = _curve(
        "set-point", "set_point", setpoints.depth_time_s, setpoints.depth_m, span
    )
    heading_setpoint = _curve(
        "set-point", "set_point", setpoints.attitude_time_s, np.degrees(setpoints.heading_rad), span
    )
    return Figure(
        key=f"mission-{mission}",
        title=_TITLES.get(mission, mission),
        note=_NOTES.get(mission, "") if folder.prior == PAPER_VEHICLE else "",
        x_label="seconds since the vehicle was armed",
        panels=(
            Panel("depth", "m", (depth_setpoint, *depth)),
            Panel("heading", "°", (heading_setpoint, *heading)),
            Panel("pitch", "°", tuple(pitch)),
            *(Panel(name, "°", tuple(curves)) for name, curves in surfaces.items()),
        ),
    )


_TITLES = {
    "straight_run": "Straight run",
    "depth_change": "Depth changes",
    "combined": "Depth and heading together",
    "shallow_1m": "Depth of one metre",
}
_NOTES = {
    "straight_run": "The paper's figures 10 and 11.",
    "depth_change": "The paper's figures 12 and 13.",
    "combined": "The paper's figure 14: 4 m at -80°, 7 m at -40°, 1 m at -100°.",
    "shallow_1m": "The paper's figure 15.",
}


def end_s(log: Log) -> float:
    """Return the time (s) at which the mission ended and the vehicle began to surface."""
    surfacing = ModeChanged(VehicleMode.SURFACE)
    return next(
        (event.time_s for event in log.events if event.value == surfacing),
        float(log.attitude.time_s[-1]),
    )


def _curve(name: str, role: str, time_s: Array, values: Array, stop_s: float) -> Curve:
    """Return a curve with CURVE_HZ points per second."""
    thin = np.arange(0.0, stop_s, 1.0 / CURVE_HZ)
    return Curve(
        name=name,
        role=role,
        x=thin,
        y=np.interp(thin, time_s, values) if time_s.size else np.full(thin.size, np.nan),
    )
