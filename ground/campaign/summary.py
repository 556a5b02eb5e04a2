"""What a campaign or a design came to: as numbers for ``summary.json`` and as words for people."""

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
"""The three errors of the paper's Table 5."""


def build(
    folder: CampaignFolder,
    design: Mapping[str, Any],
    gains: Mapping[str, Mapping[str, float]],
    trims: Mapping[str, float],
    missions: Sequence[str],
) -> dict[str, Any]:
    """Model, design and flights of a campaign, every quantity with its unit in its name.

    Args:
        design: as ``summarise_design`` tells it.
        gains: what was flown by set, as in ``STAGES``.
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
    """Margins, poles and predicted errors of the initial and the redesigned gains on the identified
    model."""
    return {
        "redesigned": {**_analysis(design.analysis), "predicted": design.predicted._asdict()},
        "initial": {**_analysis(design.initial_analysis), "predicted": design.initial._asdict()},
        "gains": dict(design.gains),
        "reasons": dict(design.reasons),
        "specification": {
            name: _finite_or_none(limit) for name, limit in design.spec._asdict().items()
        },
        "trust": design.robustness and design.robustness._asdict(),
        "foretold": {
            name: {"mean": e.mean, "rms": e.rms, "p95": e.p95}
            for name, e in design.baseline.predicted.items()
        },
        "model_sha256": design.baseline.model_sha256,
    }


def format_text(summary: Mapping[str, Any], out: Path) -> str:
    """The result of a campaign in a few lines."""
    steady = summary["steady_error"]
    paper = {"heading_deg": "2.5 -> 2.0", "pitch_deg": "10 -> 2.5", "depth_m": "0.50 -> 0.10"}
    lines = [f"{'steady error, 95 %':20s}{''.join(f'{name:>12s}' for name in steady)}   the paper"]
    for e in ERRORS:
        figures = "".join(f"{found[e]:12.3f}" for found in steady.values())
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
    """The gains with their reasons."""
    lines = [
        f"{out}:",
        *(f"  {n:14s}{v:9.4g}  {design.reasons[n]}" for n, v in design.gains.items()),
    ]
    lines += [
        "on the identified model:",
        *design_summary.format_lines(summarise_design(design)),
        "foretold in the sea of the tests, 95 %:",
    ]
    lines += [
        f"  {label:32s}{design.baseline.predicted[name].p95:9.3f}"
        for name, label in monitor_view.ROWS.items()
    ]
    return "\n".join(lines)


def _performance_warnings(kept: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """A line for each mission and likely cause; one that says so where there is none."""
    lines = [
        f"{mission}: {'REFIT DUE: ' if cause['refit_due'] else ''}{cause['words']}"
        for mission, found in kept.items()
        for cause in found["causes"]
    ]
    return lines or ["the redesigned gains keep what they promise"]


def _held_out_lines(errors: Mapping[str, Mapping[str, float]]) -> list[str]:
    return [
        f"  {plane:18s}{pair['initial_model_deg2ps2']:12.3f}{pair['refitted_model_deg2ps2']:12.3f}"
        for plane, pair in errors.items()
    ]


def _analysis(found: Analysis) -> dict[str, Any]:

    return {
        "damping": {loop: damping(poles) for loop, poles in found.visible.items()},
        "poles_radps": {
            loop: [[p.real, p.imag] for p in poles] for loop, poles in found.poles.items()
        },
        "shown_poles_radps": {
            loop: [[p.real, p.imag] for p in poles] for loop, poles in found.visible.items()
        },
        "margins": {
            cut: {k: _finite_or_none(v) for k, v in m._asdict().items()}
            for cut, m in found.margins.items()
        },
    }


def _finite_or_none(value: float) -> float | None:
    """A number that JSON can hold; None for infinity: no margin to lose, or no limit."""
    return value if math.isfinite(value) else None


def _monitoring(folder: CampaignFolder, mission: str) -> dict[str, Any]:
    """Whether the redesigned gains kept their promise."""
    return monitor_view.as_json(
        refit.monitor_log(folder.log(STAGES["redesigned"], mission), folder.promise)
    )


def _tracking(folder: CampaignFolder, mission: str, sets: Sequence[str]) -> dict[str, Any]:
    return {name: refit.tracking(folder.log(STAGES[name], mission)) for name in sets}


def _steady(straight_run: Mapping[str, Mapping[str, Any]]) -> dict[str, dict[str, float]]:
    """Table 5's errors, which the paper takes from straight runs."""
    return {
        name: {error: found[error]["p95"] for error in ERRORS}
        for name, found in straight_run.items()
    }
