"""Curves of Figures 4 and 6 to 15 for the page."""

import math

import numpy as np

from ground.paper.flights import BiasSteps, PaperFlights
from ground.paper.table_rows import figure_step
from ground.report import figures
from ground.report.figures import Curve, Figure, Panel
from sysid.data import segments
from sysid.estimation import bench_test
from sysid.estimation.bench_test import AxisBench
from sysid.models import actuator
from sysid.planes import Plane
from sysid.reproduction.paper_method import PlaneFit

MISSION_NUMBERS = {
    "straight_run": "10 and 11",
    "depth_change": "12 and 13",
    "combined": "14",
    "shallow_1m": "15",
}
"""Figure numbers by mission."""
AMPLITUDE_ROLES = ("redesigned", "initial")
"""Roles of the curves by amplitude, smallest first."""
CURVE_HZ = 10.0
"""Sample rate of the drawn curves."""


def drawn(flights: PaperFlights, fits: dict[Plane, PlaneFit]) -> list[Figure]:
    """Return the figures in the order of their numbers.

    Parameters
    ----------
    flights : PaperFlights
        All flights.
    fits : dict
        Adjustment of each plane with its history.

    Returns
    -------
    list of Figure
        Figures 4 and 6 to 15; Figure 5 is the process and has no curves.
    """
    campaign = flights.campaign
    steps = [
        figures.step_figure(campaign, figure_step(campaign, plane), "")._replace(
            key=f"figure-{number}", title=f"Figure {number}. {plane.capitalize()} step of +15°"
        )
        for number, plane in (("8", Plane.YAW), ("9", Plane.PITCH))
    ]
    missions = [
        figure._replace(key=f"figure-{number.split()[0]}", title=f"Figure {number}. {figure.title}")
        for number, figure in zip(
            MISSION_NUMBERS.values(),
            figures.mission_figures(campaign, list(MISSION_NUMBERS)),
            strict=True,
        )
    ]
    return [
        _figure_4(flights.bench),
        _figure_6(fits),
        _figure_7(flights.bias_steps),
        *steps,
        *missions,
    ]


def _figure_4(bench: AxisBench) -> Figure:
    """Return magnitude and phase of the elevator, measured and by the paper's linear model."""
    hz = np.geomspace(0.05, 1.5, 100)
    response = np.array([bench_test.linear_response(actuator.PAPER, float(f)) for f in hz])
    model = "the paper's linear model"
    magnitude = [Curve(model, "set_point", hz, 20.0 * np.log10(np.abs(response)))]
    phase = [Curve(model, "set_point", hz, np.degrees(np.unwrap(np.angle(response))))]
    sizes = sorted({point.amplitude_deg for point in bench.points})
    for size, role in zip(sizes, AMPLITUDE_ROLES, strict=False):
        points = [point for point in bench.points if point.amplitude_deg == size]
        x, name = np.array([p.frequency_hz for p in points]), f"{size:g}° peak to peak"
        gain_db = 20.0 * np.log10([p.gain for p in points])
        magnitude.append(Curve(name, role, x, gain_db, look="marks"))
        phase.append(Curve(name, role, x, np.array([p.phase_deg for p in points]), look="marks"))
    return Figure(
        key="figure-4",
        title="Figure 4. Elevator on the bench",
        note="",
        x_label="Hz",
        panels=(Panel("gain", "dB", tuple(magnitude)), Panel("phase", "°", tuple(phase))),
        log_x=True,
    )


def _figure_6(fits: dict[Plane, PlaneFit]) -> Figure:
    """Return the mean squared rate error after each step of the adjustment."""
    panels = tuple(
        Panel(
            f"{plane} rate error",
            "(°/s)²",
            (
                Curve(
                    "all runs",
                    "redesigned",
                    np.arange(float(len(fit.history_deg2ps2))),
                    np.array(fit.history_deg2ps2),
                ),
            ),
        )
        for plane, fit in fits.items()
    )
    return Figure("figure-6", "Figure 6. Adjustment of the model", "", "improving step", panels)


def _figure_7(steps: BiasSteps) -> Figure:
    """Return command, duct angle and motion of the rudder steps of 5 and 7 deg."""
    log = steps.log
    tests = segments.times_of_tests(log)
    time_s = np.arange(tests[0][0] - 10.0, tests[-1][1] + 10.0, 1.0 / CURVE_HZ)

    def curve(name: str, role: str, at_s: np.ndarray, values: np.ndarray) -> Curve:
        return Curve(name, role, time_s, np.interp(time_s, at_s, values))

    attitude, deg = log.attitude, 180.0 / math.pi
    return Figure(
        key="figure-7",
        title="Figure 7. Rudder steps to 5° and 7° with a bias of −6°",
        note="",
        x_label="seconds since the vehicle was armed",
        panels=(
            Panel(
                "rudder",
                "°",
                (
                    curve(
                        "command", "set_point", log.actuators.time_s, log.actuators.rudder_rad * deg
                    ),
                    curve("actual", "measured", steps.time_s, steps.rudder_rad * deg),
                ),
            ),
            Panel(
                "yaw rate",
                "°/s",
                (curve("yaw rate", "redesigned", attitude.time_s, attitude.r_radps * deg),),
            ),
            Panel(
                "pitch",
                "°",
                (curve("pitch", "initial", attitude.time_s, attitude.pitch_rad * deg),),
            ),
            Panel("depth", "m", (curve("depth", "measured", log.depth.time_s, log.depth.depth_m),)),
        ),
        shaded=tuple(tests),
    )
