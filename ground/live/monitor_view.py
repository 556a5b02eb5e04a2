"""Format the result of performance monitoring as a table and as text."""

from typing import TYPE_CHECKING

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from sysid.monitor.sequential import describe_agreement

if TYPE_CHECKING:
    from sysid.monitor import Cause, MonitorReport

ROWS = {
    "heading_deg": "heading, deg",
    "pitch_deg": "pitch, deg",
    "depth_m": "depth, m",
    "rudder_deg": "rudder, deg",
    "elevator_deg": "elevator, deg",
}
GOOD_STYLE, BAD_STYLE, LABEL_STYLE, FAINT_STYLE = "green", "bold red", "cyan", "bright_black"


def table(report: "MonitorReport") -> RenderableType:
    """Return a table of measured and predicted rms errors, with likely causes of a deviation."""
    if not report.windows:
        return Text(
            "no steady flight yet to compare with the predicted performance", style=FAINT_STYLE
        )
    output = Table(box=None, padding=(0, 2), title_justify="left")
    output.add_column("rms about the predicted mean", header_style=FAINT_STYLE)
    for head in ("measured", "predicted"):
        output.add_column(head, header_style=FAINT_STYLE, justify="right")
    for name, label in ROWS.items():
        rms = report.rms[name]
        output.add_row(
            Text(label, style=LABEL_STYLE), f"{rms.measured:.3f}", f"{rms.predicted:.3f}"
        )
    agreement = describe_agreement(report.rms, report.windows)
    good = Text(f"  {agreement}, {report.steady_s:.0f} s of steady flight", style=GOOD_STYLE)
    causes = [
        Text(f"  {line(cause)}", style=BAD_STYLE if cause.refit_recommended else "")
        for cause in report.causes
    ]
    return Group(output, *(causes or [good]))


def line(cause: "Cause") -> str:
    """Return a likely cause in one line."""
    return f"{'REFIT RECOMMENDED' if cause.refit_recommended else 'detected'}: {cause.message}"


def format_text(report: "MonitorReport") -> str:
    """Return the result of a dive as text in a few lines."""
    if not report.windows:
        return "no steady flight to compare with the predicted performance"
    lines = [f"rms about the predicted mean, over {report.steady_s:.0f} s of steady flight"]
    for name, label in ROWS.items():
        rms = report.rms[name]
        lines.append(f"  {label:16s}{rms.measured:8.3f}   predicted {rms.predicted:.3f}")
    agreement = describe_agreement(report.rms, report.windows)
    lines += [line(cause) for cause in report.causes] or [agreement]
    lines += (
        [f"first detected at {report.detected_at_s:.0f} s of vehicle time"]
        if report.detected_at_s is not None
        else []
    )
    return "\n".join(lines)
