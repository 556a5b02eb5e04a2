"""How a promise is kept: a table for the terminal, lines for people, plain numbers for programs."""

from typing import TYPE_CHECKING, Any

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

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


def table(kept: "MonitorReport") -> RenderableType:
    """Each error's rms, measured and foretold, and what is likely the matter."""
    if not kept.blocks:
        return Text(
            "no steady flight yet to compare with what the gains promise", style=FAINT_STYLE
        )
    drawn = Table(box=None, padding=(0, 2), title_justify="left")
    drawn.add_column("rms about what was foretold", header_style=FAINT_STYLE)
    for head in ("measured", "foretold"):
        drawn.add_column(head, header_style=FAINT_STYLE, justify="right")
    for name, label in ROWS.items():
        measured, foretold = kept.errors[name]
        drawn.add_row(Text(label, style=LABEL_STYLE), f"{measured:.3f}", f"{foretold:.3f}")
    good = Text(f"  as foretold, {kept.steady_s:.0f} s of steady flight", style=GOOD_STYLE)
    causes = [
        Text(f"  {line(cause)}", style=BAD_STYLE if cause.refit_due else "")
        for cause in kept.causes
    ]
    return Group(drawn, *(causes or [good]))


def line(cause: "Cause") -> str:
    return f"{'REFIT DUE' if cause.refit_due else 'noticed'}: {cause.words}"


def format_text(kept: "MonitorReport") -> str:
    """A dive's result in a few lines."""
    if not kept.blocks:
        return "no steady flight to compare with what the gains promise"
    lines = [f"rms about what was foretold, over {kept.steady_s:.0f} s of steady flight"]
    for name, label in ROWS.items():
        measured, foretold = kept.errors[name]
        lines.append(f"  {label:16s}{measured:8.3f}   foretold {foretold:.3f}")
    lines += [line(cause) for cause in kept.causes] or ["as foretold"]
    lines += (
        [f"first noticed at {kept.found_s:.0f} s of vehicle time"]
        if kept.found_s is not None
        else []
    )
    return "\n".join(lines)


def as_json(kept: "MonitorReport") -> dict[str, Any]:
    return {
        "blocks": kept.blocks,
        "steady_s": kept.steady_s,
        "rms": {
            name: {"measured": measured, "foretold": told}
            for name, (measured, told) in kept.errors.items()
        },
        "causes": [cause._asdict() for cause in kept.causes],
        "found_s": kept.found_s,
        "refit_due": kept.refit_due,
    }
