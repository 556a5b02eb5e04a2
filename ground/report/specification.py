"""HTML tables of the redesign's specification, reasons and monitored performance."""

from collections.abc import Mapping
from html import escape
from typing import Any

from ground.campaign import design_summary
from ground.live.monitor_view import ROWS
from ground.report.tables import table


def specification(design: Mapping[str, Any]) -> str:
    """Return each limit of the specification with the value reached by the design."""
    rows = [
        [escape(row.limit), escape(row.asked), f"<b>{escape(row.reached)}</b>", escape(row.where)]
        for row in design_summary.rows(design)
    ]
    note = (
        '<p class="note">Other limits that are met:'
        f" {escape(design_summary.describe_other_limits(design['specification']))}.</p>"
    )
    return table(["", "asked", "reached", "at"], rows, "named prose") + note


def reasons(design: Mapping[str, Any]) -> str:
    """Return each parameter of the redesign with its reason."""
    rows = [
        [name, f"{value:.4g}", escape(design["reasons"][name])]
        for name, value in design["gains"].items()
    ]
    return table(["parameter", "value", "reason"], rows, "named prose")


def monitoring(missions: Mapping[str, Mapping[str, Any]]) -> str:
    """Return measured and predicted rms errors of each mission in steady flight, and causes."""
    rows = []
    for mission, result in missions.items():
        cells = [_pair(result["rms"].get(name)) for name in ROWS]
        causes = "; ".join(cause["words"] for cause in result["causes"]) or (
            "as predicted" if result["blocks"] else ""
        )
        rows.append(
            [mission.replace("_", " "), f"{result['steady_s']:.0f} s", *cells, escape(causes)]
        )
    return table(["mission", "steady flight", *ROWS.values(), ""], rows, "named prose")


def _pair(rms: Mapping[str, float] | None) -> str:
    """Return the measured and, in brackets, the predicted rms as one cell."""
    return "–" if rms is None else f"<b>{rms['measured']:.2f}</b> ({rms['predicted']:.2f})"
