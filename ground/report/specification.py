"""The redesign's specification and what became of its promise, as HTML."""

from collections.abc import Mapping
from html import escape
from typing import Any

from ground.campaign import design_summary
from ground.live.monitor_view import ROWS
from ground.report.tables import table


def specification(design: Mapping[str, Any]) -> str:
    """Asked beside reached."""
    rows = [
        [escape(row.limit), escape(row.asked), f"<b>{escape(row.reached)}</b>", escape(row.where)]
        for row in design_summary.rows(design)
    ]
    note = (
        '<p class="note">Held besides:'
        f" {escape(design_summary.describe_other_limits(design['specification']))}.</p>"
    )
    return table(["", "asked", "reached", "at"], rows, "named told") + note


def reasons(design: Mapping[str, Any]) -> str:
    """Each parameter of the redesign with its reason."""
    rows = [
        [name, f"{value:.4g}", escape(design["reasons"][name])]
        for name, value in design["gains"].items()
    ]
    return table(["parameter", "value", "reason"], rows, "named told")


def monitoring(missions: Mapping[str, Mapping[str, Any]]) -> str:
    """Measured errors of each mission beside those foretold for steady flight, and what the monitor
    says of them."""
    rows = []
    for mission, found in missions.items():
        cells = [_pair(found["rms"].get(name)) for name in ROWS]
        words = "; ".join(cause["words"] for cause in found["causes"]) or (
            "as foretold" if found["blocks"] else ""
        )
        rows.append(
            [mission.replace("_", " "), f"{found['steady_s']:.0f} s", *cells, escape(words)]
        )
    return table(["mission", "steady flight", *ROWS.values(), ""], rows, "named told")


def _pair(rms: Mapping[str, float] | None) -> str:
    return "–" if rms is None else f"<b>{rms['measured']:.2f}</b> ({rms['foretold']:.2f})"
