"""Summary of a campaign or of a design, as plain numbers and as text."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ground.campaign import design_summary, identification, refit
from ground.campaign.campaign_folder import STAGES, CampaignFolder
from ground.live import monitor_view
from sysid.control_analysis.margins import Analysis, damping
from sysid.design.pid import Design

ERRORS = ("heading_deg", "pitch_deg", "depth_m")
"""Errors of the paper's Table 5."""


def build(
    folder: CampaignFolder,
    design: Mapping[str, Any],
    gains: Mapping[str, Mapping[str, float]],
    trims: Mapping[str, float],
    missions: Sequence[str],
) -> dict[str, Any]:
    """Return the summary of a campaign, each quantity with its unit in its name.

    Parameters
    ----------
    folder : CampaignFolder
        Logs and model.
    design : Mapping
        Result of `summarise_design`.
    gains : Mapping
        Flown gains by set, as in `STAGES`.
    trims : Mapping
        Trim parameters.
    missions : Sequence of str
        Missions that were flown with each set.
    """
    tracking = {mission: _tracking(folder, mission, list(gains)) for mission in missions}
    return {
        "trims": dict(trims),
        "gains": {name: dict(values) for name, values in gains.items()},
        "model": identification.summarise_model(folder.model),
        "design": dict(design),
        "tracking": tracking,
        "kept": {mission: _monitoring(folder, mission) for mission in missions},
        "steady_error": _steady(tracking["straight_run"]),
    }


def summarise_design(design: Design) -> dict[str, Any]:
    """Return margins, poles and predicted errors of the initial and the redesigned gains."""
    return {
        "redesigned": {**_analysis(design.analysis), "predicted": design.predicted._asdict()},
        "initial": {**_analysis(design.initial_analysis), "predicted": design.initial._asdict()},
        "gains": dict(design.gains),
        "reasons": dict(design.reasons),
        "specification": {
            name: _finite_or_none(limit) for name, limit in design.spec._asdict().items()
        },
        "trust": design.robustness and design.robustness._asdict(),
        "predicted": {
            name: {"mean": e.mean, "rms": e.rms, "p95": e.p95}
            for name, e in design.baseline.predicted.items()
        },
        "model_sha256": design.baseline.model_sha256,
    }


def format_text(summary: Mapping[str, Any], out: Path) -> str:
    """Return the result of a campaign as text."""
    steady = summary["steady_error"]
    paper = {"heading_deg": "2.5 -> 2.0", "pitch_deg": "10 -> 2.5", "depth_m": "0.50 -> 0.10"}
    lines = [f"{'steady error, 95 %':20s}{''.join(f'{name:>12s}' for name in steady)}   the paper"]
    for e in ERRORS:
        figures = "".join(f"{errors[e]:12.3f}" for errors in steady.values())
        lines.append(f"  {e.replace('_', ', '):18s}{figures}   {paper[e]}")
    lines += [
        "held-out rate error, (deg/s)^2",
        *_held_out_lines(summary["model"]["held_out_rate_error"]),
    ]
    gains = ", ".join(f"{n} {v:.4g}" for n, v in summary["design"]["gains"].items())
    lines += [
        f"gains {gains}",
        *_performance_warnings(summary["kept"]),
        (
            f"{summary['vehicle_s']:.0f} s of vehicle time in {summary['wall_s']:.1f} s,"
            f" {summary['messages']} messages, {summary['lost_frames']} lost"
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
    return "\n".join(lines)


def _performance_warnings(monitoring: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """Return one line per mission and likely cause of a deviation from the prediction."""
    lines = [
        f"{mission}: {'REFIT DUE: ' if cause['refit_due'] else ''}{cause['words']}"
        for mission, monitored in monitoring.items()
        for cause in monitored["causes"]
    ]
    return lines or ["the redesigned gains perform as predicted"]


def _held_out_lines(errors: Mapping[str, Mapping[str, float]]) -> list[str]:
    """Return the rate errors on held-out tests, initial and refitted, one line per plane."""
    return [
        f"  {plane:18s}{pair['initial_model_deg2ps2']:12.3f}{pair['refitted_model_deg2ps2']:12.3f}"
        for plane, pair in errors.items()
    ]


def _analysis(analysis: Analysis) -> dict[str, Any]:
    """Return damping, poles and margins as plain numbers."""
    return {
        "damping": {loop: damping(poles) for loop, poles in analysis.visible.items()},
        "poles_radps": {
            loop: [[p.real, p.imag] for p in poles] for loop, poles in analysis.poles.items()
        },
        "shown_poles_radps": {
            loop: [[p.real, p.imag] for p in poles] for loop, poles in analysis.visible.items()
        },
        "margins": {
            cut: {k: _finite_or_none(v) for k, v in m._asdict().items()}
            for cut, m in analysis.margins.items()
        },
    }


def _finite_or_none(value: float) -> float | None:
    """Return the value, or None if it is infinite, which JSON cannot represent."""
    return value if math.isfinite(value) else None


def _monitoring(folder: CampaignFolder, mission: str) -> dict[str, Any]:
    """Compare a dive of the redesigned gains with their predicted performance."""
    return monitor_view.as_json(
        refit.monitor_log(folder.log(STAGES["redesigned"], mission), folder.promise)
    )


def _tracking(folder: CampaignFolder, mission: str, sets: Sequence[str]) -> dict[str, Any]:
    """Return the tracking errors of a mission by set of gains."""
    return {name: refit.tracking(folder.log(STAGES[name], mission)) for name in sets}


def _steady(straight_run: Mapping[str, Mapping[str, Any]]) -> dict[str, dict[str, float]]:
    """Return the errors of the paper's Table 5, which are those of straight runs."""
    return {
        name: {error: errors[error]["p95"] for error in ERRORS}
        for name, errors in straight_run.items()
    }
