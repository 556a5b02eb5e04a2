"""Summary of a campaign or of a design, as a record and as text."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from ground.campaign import design_summary, identification, refit
from ground.campaign.campaign_folder import STAGES, CampaignFolder
from ground.campaign.summary_file import (
    FORMAT,
    PAPER_VEHICLE,
    CampaignSummary,
    DesignSummary,
    LoopAnalysis,
    MarginsSummary,
    Pole,
    PredictedError,
    RateErrors,
    SteadyErrorEntry,
)
from ground.client.assessment import format_value
from ground.live import monitor_view
from ground.missions import script
from sysid.control_analysis.margins import Analysis, damping
from sysid.design.pid import Design, Response
from sysid.design.specification import MinimumVariance
from sysid.monitor import MonitorReport
from sysid.monitor.sequential import (
    AS_PREDICTED,
    MIN_WINDOWS,
    describe_agreement,
    rms_ratios,
)
from sysid.monitor.tracking_metrics import SETTLING_S, TrackingMetrics
from sysid.monitor.windows import SETTLED_M, SETTLED_RAD
from sysid.planes import Plane

PAPER_ERRORS = {"heading_deg": "2.5 -> 2.0", "pitch_deg": "10 -> 2.5", "depth_m": "0.50 -> 0.10"}
"""Errors of the paper's Table 5."""

SETTLED = {"heading_deg": math.degrees(SETTLED_RAD), "depth_m": SETTLED_M}
"""Largest 95 % error of a leg that has settled."""


class Totals(NamedTuple):
    """Totals of the dives of a campaign, as in `CampaignSummary`."""

    vehicle_s: float
    messages: int
    lost_frames: int
    seed: int


def build(
    folder: CampaignFolder,
    totals: Totals,
    design: DesignSummary,
    gains: Mapping[str, Mapping[str, float]],
    trims: Mapping[str, float],
    missions: Sequence[str],
) -> CampaignSummary:
    """Return the summary of a campaign without its wall time.

    Parameters
    ----------
    folder : CampaignFolder
        Logs and model.
    totals : Totals
        Totals of the dives.
    design : DesignSummary
        Result of `summarise_design`.
    gains : Mapping
        Flown gains by set, as in `STAGES`.
    trims : Mapping
        Trim parameters.
    missions : Sequence of str
        Missions that were flown with each set.
    """
    settling = settling_s(folder.mission_file("straight_run"))
    tracking = {mission: _tracking(folder, mission, list(gains), settling) for mission in missions}
    return CampaignSummary(
        format=FORMAT,
        wall_s=0.0,
        **totals._asdict(),
        trims=dict(trims),
        gains={name: dict(values) for name, values in gains.items()},
        model=identification.summarise_model(folder.model),
        design=design,
        tracking=tracking,
        monitoring={mission: _monitoring(folder, mission) for mission in missions},
        steady_error={
            name: SteadyErrorEntry(
                heading_deg=errors.heading_deg.p95,
                pitch_deg=errors.pitch_deg.p95,
                depth_m=errors.depth_m.p95,
            )
            for name, errors in tracking["straight_run"].items()
        },
        vehicle=folder.prior,
        scaled=folder.scaled,
    )


def summarise_design(design: Design) -> DesignSummary:
    """Return margins, poles and predicted errors of the initial and the redesigned gains."""
    return DesignSummary(
        redesigned=_analysis(design.analysis, design.predicted),
        initial=_analysis(design.initial_analysis, design.initial),
        gains=design.gains,
        reasons=design.reasons,
        specification=design.spec,
        robustness=design.robustness,
        predicted={
            name: PredictedError(mean=e.mean, rms=e.rms, p95=e.p95)
            for name, e in design.baseline.predicted.items()
        },
        minimum_variance=design.minimum,
        model_sha256=design.baseline.model_sha256,
    )


def format_text(summary: CampaignSummary, out: Path) -> str:
    """Return the result of a campaign as text."""
    steady = summary.steady_error
    with_paper = summary.vehicle == PAPER_VEHICLE
    names = [summary.design.final_set if name == "redesigned" else name for name in steady]
    head = f"{'steady error, 95 %':20s}{''.join(f'{name:>12s}' for name in names)}"
    lines = [f"{head}   the paper" if with_paper else head]
    for e, paper in PAPER_ERRORS.items():
        figures = "".join(f"{getattr(errors, e):12.3f}" for errors in steady.values())
        line = f"  {e.replace('_', ', '):18s}{figures}"
        lines.append(f"{line}   {paper}" if with_paper else line)
    lines += [f"scaled {note}" for note in summary.scaled]
    lines += [
        "held-out rate error, (deg/s)^2",
        *_held_out_lines(summary.model.held_out_rate_error),
    ]
    gains = ", ".join(f"{n} {v:.4g}" for n, v in summary.design.gains.items())
    lines += [
        f"flown because of {r.reason}: {r.test}, {r.vehicle_s:.0f} s" for r in summary.retests
    ]
    selection = summary.design.selection
    if selection is not None and selection.reason:
        lines.append(selection.reason)
    lines += [
        f"gains {gains}",
        *describe_unsettled(summary),
        *describe_performance(summary.monitoring, summary.design.final_set),
        (
            f"{summary.vehicle_s:.0f} s of vehicle time in {summary.wall_s:.1f} s,"
            f" {summary.messages} messages, {summary.lost_frames} lost"
        ),
        f"{out / 'report.html'}",
    ]
    return "\n".join(lines)


def format_design(design: Design, out: Path) -> str:
    """Return gains, reasons, limits and predicted performance as text."""
    lines = [
        f"{out}:",
        *(f"  {n:14s}{v:9.4g}  {design.reasons[n]}" for n, v in design.gains.items()),
    ]
    lines += [
        "on the identified model:",
        *design_summary.format_lines(summarise_design(design)),
        "predicted in the sea of the tests, 95 %:",
    ]
    lines += [
        f"  {label:32s}{design.baseline.predicted[name].p95:9.3f}"
        for name, label in monitor_view.ROWS.items()
    ]
    return "\n".join([*lines, *minimum_lines(design.predicted, design.minimum)])


def minimum_lines(ours: Response, least: MinimumVariance | None) -> list[str]:
    """Return predicted standard deviations beside their lower bounds, as lines of text.

    Parameters
    ----------
    ours : Response
        Predicted response of a design.
    least : MinimumVariance or None
        Lower bounds; there are no lines without them.

    Returns
    -------
    list of str
        One line per error, below a title and a head.
    """
    if least is None:
        return []
    rows = (
        ("heading, deg", ours.heading_deg, least.heading_deg, least.same_rudder_heading_deg),
        ("pitch, deg", ours.pitch_deg, least.pitch_deg, None),
        ("depth, cm", 100 * ours.depth_m, 100 * least.depth_m, 100 * least.same_elevator_depth_m),
    )
    head = f"  {'':14s}{'predicted':>10s}{'minimum variance':>24s}{'with the same command':>28s}"
    lines = ["standard deviation beside the bound of any linear controller (no limit of margins):"]
    lines.append(head)
    for name, value, bound, same in rows:
        text = f"  {name:14s}{value:10.3f}{bound:16.3f} ({value / bound:4.1f} x)"
        lines.append(text if same is None else f"{text}{same:20.3f} ({value / same:4.2f} x)")
    return lines


def describe_performance(monitoring: Mapping[str, MonitorReport], final_set: str) -> list[str]:
    """Return how the performance of the last dives compares with the predicted one.

    Parameters
    ----------
    monitoring : Mapping
        Result of monitoring by mission.
    final_set : str
        Word for the gains of these dives, as in `DesignSummary`.

    Returns
    -------
    list of str
        One line per mission and likely cause of a deviation; without any, one line per mission
        with other errors than predicted; else one line with the range of the errors.
    """
    causes = [
        f"{mission}: {'REFIT RECOMMENDED: ' if cause.refit_recommended else ''}{cause.message}"
        for mission, report in monitoring.items()
        for cause in report.causes
    ]
    others = [
        f"{mission}: {agreement}"
        for mission, report in monitoring.items()
        if (agreement := describe_agreement(report.rms, report.windows)) not in ("", AS_PREDICTED)
    ]
    return causes or others or [_describe_range(monitoring, final_set)]


def describe_unsettled(summary: CampaignSummary) -> list[str]:
    """Return the legs of the missions that do not settle with the gains of the last dives.

    Parameters
    ----------
    summary : CampaignSummary
        Summary of a campaign.

    Returns
    -------
    list of str
        One line per mission and quantity, with the errors of the initial gains for comparison.

    Notes
    -----
    A leg has not settled if its 95 % error, without the settling time, is above `SETTLED`.
    """
    return [
        line
        for mission, sets in summary.tracking.items()
        if "redesigned" in sets
        for name in SETTLED
        if (line := _unsettled_line(mission, name, sets, summary.design))
    ]


def _unsettled_line(
    mission: str, name: str, sets: Mapping[str, TrackingMetrics], design: DesignSummary
) -> str:
    """Return the errors of a quantity on the legs where it does not settle; empty without any."""
    limit = SETTLED[name]
    errors = [getattr(window, name).p95 for window in sets["redesigned"].windows]
    unsettled = [index for index, error in enumerate(errors) if error > limit]
    if not unsettled:
        return ""
    quantity, _, unit = name.partition("_")

    def listed(values: Sequence[float]) -> str:
        return ", ".join(map(format_value, values))

    first = [getattr(window, name).p95 for window in sets["initial"].windows]
    before = (
        f", with the initial gains {listed([first[k] for k in unsettled if k < len(first)])} {unit}"
        if not design.kept_first
        else ""
    )
    return (
        f"{mission}: {quantity} does not settle on {len(unsettled)} of {len(errors)} legs: 95 %"
        f" error {listed([errors[k] for k in unsettled])} {unit}, at most {limit:g} {unit}{before}"
    )


def _describe_range(monitoring: Mapping[str, MonitorReport], final_set: str) -> str:
    """Return the range of the errors over the predicted ones."""
    ratios = [
        ratio
        for report in monitoring.values()
        if report.windows >= MIN_WINDOWS
        for ratio in rms_ratios(report.rms).values()
    ]
    if not ratios:
        return "no dive had enough steady flight to compare with the prediction"
    return (
        f"the {final_set} gains perform as predicted: errors and surfaces {min(ratios):.1f} to"
        f" {max(ratios):.1f} times the predicted rms"
    )


def _held_out_lines(errors: Mapping[Plane, RateErrors]) -> list[str]:
    """Return the rate errors on held-out tests, initial and refitted, one line per plane."""
    return [
        f"  {plane:18s}{pair.initial_model_deg2ps2:12.3f}{pair.refitted_model_deg2ps2:12.3f}"
        for plane, pair in errors.items()
    ]


def _analysis(analysis: Analysis, predicted: Response) -> LoopAnalysis:
    """Return damping, poles, margins and predicted response of a set of gains."""
    return LoopAnalysis(
        damping={loop: damping(poles) for loop, poles in analysis.visible.items()},
        poles_radps=_pairs(analysis.poles),
        visible_modes_radps=_pairs(analysis.visible),
        margins={
            cut: MarginsSummary(
                gm_db=_finite_or_none(margins.gm_db),
                pm_deg=_finite_or_none(margins.pm_deg),
                max_sensitivity=margins.max_sensitivity,
                crossover_radps=_finite_or_none(margins.crossover_radps),
            )
            for cut, margins in analysis.margins.items()
        },
        predicted=predicted,
    )


def _pairs(poles: Mapping[str, tuple[complex, ...]]) -> dict[str, tuple[Pole, ...]]:
    """Return the poles of each loop as real and imaginary part."""
    return {loop: tuple((p.real, p.imag) for p in values) for loop, values in poles.items()}


def _finite_or_none(value: float) -> float | None:
    """Return the value, or None if it is infinite, which JSON cannot represent."""
    return value if math.isfinite(value) else None


def _monitoring(folder: CampaignFolder, mission: str) -> MonitorReport:
    """Compare a dive of the redesigned gains with their predicted performance."""
    return refit.monitor_log(folder.log(STAGES["redesigned"], mission), folder.baseline)


def _tracking(
    folder: CampaignFolder, mission: str, sets: Sequence[str], settling: float
) -> dict[str, TrackingMetrics]:
    """Return the tracking errors of a mission by set of gains, after the settling time (s)."""
    return {name: refit.tracking(folder.log(STAGES[name], mission), settling) for name in sets}


def settling_s(straight_run: str) -> float:
    """Return the time (s) that is excluded after each change of set-point.

    Parameters
    ----------
    straight_run : str
        Name or file of the mission whose legs are longer for a slower vehicle.

    Returns
    -------
    float
        `SETTLING_S`, longer in the ratio of these legs to those of the shipped mission.
    """
    flown_s, shipped_s = (
        script.duration_s(script.load(name)) for name in (straight_run, "straight_run")
    )
    return SETTLING_S * max(1.0, flown_s / shipped_s)
