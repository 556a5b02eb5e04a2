"""A rehearsal as tables for people and as plain numbers."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from ground.terminal import Rendered, heading, render

if TYPE_CHECKING:
    from rich.console import RenderableType
    from rich.table import Table

    from sysid.monte_carlo.study import LegSummary, Range, SimulationSummary

WIDTH = 118


def as_json(told: "Sequence[SimulationSummary]", mission: str, seed: int) -> dict[str, Any]:
    """Everything that is told, each number with its unit in its name; null for what no vehicle
    showed."""
    return {"mission": mission, "seed": seed, "rehearsed": [_summary_json(one) for one in told]}


def _summary_json(told: "SimulationSummary") -> dict[str, Any]:
    return {
        "gains": told.gains,
        "sea_times": told.sea.times,
        "current_mps": told.sea.current_mps,
        "bias_shift_deg": round(math.degrees(told.sea.bias_shift_rad), 9),
        "vehicles": told.vehicles,
        **{
            name: _range(getattr(told, name))
            for name in (
                "heading_deg",
                "pitch_deg",
                "depth_m",
                "rudder_deg",
                "elevator_deg",
                "stopped_pct",
                "shallowest_m",
            )
        },
        "legs": [{**leg._asdict(), "settled_s": _range(leg.settled_s)} for leg in told.legs],
        "broached": told.broached,
        "diverged": told.diverged,
        "failsafes": told.failsafes,
        "vehicle_s": round(told.vehicle_s, 3),
    }


def _range(found: "Range | None") -> dict[str, float] | None:
    return found and found._asdict()


def format_text(told: "Sequence[SimulationSummary]", mission: str) -> Rendered:
    """Two tables: how steady, and how soon."""
    legs: list[RenderableType] = []
    if any(one.legs for one in told):
        legs = [heading("seconds until each leg had settled"), _legs(told)]
    page = render(
        [heading(_title(told[0], mission)), _steady(told), *legs, *map(verdict, told)], WIDTH
    )
    return Rendered("\n".join(line.rstrip() for line in page.split("\n") if line.strip()))


def _title(told: "SimulationSummary", mission: str) -> str:
    drift = f", in a current of {told.sea.current_mps:g} m/s" if told.sea.current_mps else ""
    bent = (
        f", rudder bent by {math.degrees(told.sea.bias_shift_rad):g} deg"
        if told.sea.bias_shift_rad
        else ""
    )
    return f"{mission}, by {told.vehicles} vehicles that the model allows for{drift}{bent}"


def _steady(told: "Sequence[SimulationSummary]") -> "Table":
    """95 % of the errors once settled, and what else is worth knowing: median and worst vehicle."""
    table = _table(
        "gains",
        "sea",
        "vehicle",
        "heading deg",
        "pitch deg",
        "depth cm",
        "rudder deg",
        "elevator deg",
        "at stops %",
        "shallowest m",
    )
    for one in told:
        table.add_row(one.gains, f"x{one.sea.times:g}", "median", *_figures(one, "median"))
        table.add_row("", "", "worst", *_figures(one, "worst"))
    return table


def _figures(told: "SimulationSummary", which: str) -> list[str]:
    return [
        f"{times * getattr(found, which):.{digits}f}" if found else "-"
        for found, digits, times in (
            (told.heading_deg, 2, 1.0),
            (told.pitch_deg, 2, 1.0),
            (told.depth_m, 1, 100.0),
            (told.rudder_deg, 1, 1.0),
            (told.elevator_deg, 1, 1.0),
            (told.stopped_pct, 1, 1.0),
            (told.shallowest_m, 2, 1.0),
        )
    ]


def _legs(told: "Sequence[SimulationSummary]") -> "Table":
    longest = max((one.legs for one in told), key=len)
    table = _table("leg", *(f"{one.gains} x{one.sea.times:g}" for one in told))
    for number, leg in enumerate(longest):
        cells = [
            _settled(one.legs[number], one.vehicles) if number < len(one.legs) else "-"
            for one in told
        ]
        table.add_row(f"{leg.depth_m:g} m, {leg.heading_deg:.0f} deg", *cells)
    return table


def _settled(leg: "LegSummary", vehicles: int) -> str:
    """Median and worst of those that did, and how many did not."""
    if leg.settled_s is None:
        return f"{vehicles} did not"
    words = f"{leg.settled_s.median:.0f}, worst {leg.settled_s.worst:.0f}"
    return f"{words}; {leg.unsettled} did not" if leg.unsettled else words


def verdict(told: "SimulationSummary") -> str:
    """What became of the vehicles, in one line."""
    parts = [f"{count} did not hold {what}" for what, count in told.diverged.items()]
    parts += [f"{told.broached} broached"] if told.broached else []
    parts += [f"{count} surfaced for {what}" for what, count in told.failsafes.items()]
    which = f"{told.gains}, sea x{told.sea.times:g}"
    if not parts:
        return f"{which}: all {told.vehicles} vehicles were held to the end, and none broached"
    return f"{which}: of {told.vehicles} vehicles {', '.join(parts)}"


def _table(*heads: str) -> "Table":
    from rich import box
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    for number, head in enumerate(heads):
        table.add_column(head, justify="left" if number == 0 else "right", no_wrap=number == 0)
    return table
