"""Result of a Monte-Carlo simulation of a mission as text and as plain numbers."""

import math
from collections.abc import Sequence
from typing import Any

from rich import box
from rich.console import RenderableType
from rich.table import Table

from ground.rendered import Rendered
from ground.terminal import heading, render
from sysid.monte_carlo.study import LegSummary, ResultRange, SimulationSummary


def as_json(summaries: Sequence[SimulationSummary], mission: str, seed: int) -> dict[str, Any]:
    """Return the summaries as plain numbers.

    Parameters
    ----------
    summaries : Sequence of SimulationSummary
        One summary per set of gains and sea.
    mission : str
        Name of the mission.
    seed : int
        Seed of the samples.

    Returns
    -------
    dict
        Quantities with the unit in their names; None where no vehicle gave a value.
    """
    return {
        "mission": mission,
        "seed": seed,
        "results": [_summary_json(summary) for summary in summaries],
    }


def _summary_json(summary: SimulationSummary) -> dict[str, Any]:
    """Return the result of one set of gains as a JSON object."""
    return {
        "gains": summary.gains,
        "disturbance_scale": summary.sea.times,
        "current_mps": summary.sea.current_mps,
        "bias_shift_deg": round(math.degrees(summary.sea.bias_shift_rad), 9),
        "vehicles": summary.vehicles,
        **{
            name: _range(getattr(summary, name))
            for name in (
                "heading_deg",
                "pitch_deg",
                "depth_m",
                "rudder_deg",
                "elevator_deg",
                "at_stops_pct",
                "shallowest_m",
            )
        },
        "legs": [{**leg._asdict(), "settling_s": _range(leg.settling_s)} for leg in summary.legs],
        "broached": summary.broached,
        "diverged": summary.diverged,
        "failsafes": summary.failsafes,
        "vehicle_s": round(summary.vehicle_s, 3),
    }


def _range(values: ResultRange | None) -> dict[str, float] | None:
    return values and values._asdict()


def format_text(summaries: Sequence[SimulationSummary], mission: str) -> Rendered:
    """Return tables of the steady errors and of the settling times, and one line per summary."""
    legs: list[RenderableType] = []
    if any(summary.legs for summary in summaries):
        legs = [heading("settling time of each leg, s"), _legs(summaries)]
    page = render(
        [
            heading(_title(summaries[0], mission)),
            _steady(summaries),
            *legs,
            *map(describe_outcome, summaries),
        ]
    )
    return Rendered("\n".join(line.rstrip() for line in page.split("\n") if line.strip()))


def _title(summary: SimulationSummary, mission: str) -> str:
    """Return mission, number of vehicles and changes of the sea as a title."""
    drift = f", in a current of {summary.sea.current_mps:g} m/s" if summary.sea.current_mps else ""
    bias_shift = (
        f", rudder bias changed by {math.degrees(summary.sea.bias_shift_rad):g} deg"
        if summary.sea.bias_shift_rad
        else ""
    )
    return f"{mission}: {summary.vehicles} vehicles sampled from the model{drift}{bias_shift}"


def _steady(summaries: Sequence[SimulationSummary]) -> Table:
    """Return the 95 % errors after settling and other figures of the median and worst vehicle."""
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
    for summary in summaries:
        sea = f"x{summary.sea.times:g}"
        table.add_row(summary.gains, sea, "median", *_figures(summary, "median"))
        table.add_row("", "", "worst", *_figures(summary, "worst"))
    return table


def _figures(summary: SimulationSummary, which: str) -> list[str]:
    """Return the cells of the median or the worst vehicle."""
    return [
        f"{times * getattr(values, which):.{digits}f}" if values else "-"
        for values, digits, times in (
            (summary.heading_deg, 2, 1.0),
            (summary.pitch_deg, 2, 1.0),
            (summary.depth_m, 1, 100.0),
            (summary.rudder_deg, 1, 1.0),
            (summary.elevator_deg, 1, 1.0),
            (summary.at_stops_pct, 1, 1.0),
            (summary.shallowest_m, 2, 1.0),
        )
    ]


def _legs(summaries: Sequence[SimulationSummary]) -> Table:
    """Return a table with the settled vehicles in each leg."""
    longest = max((summary.legs for summary in summaries), key=len)
    table = _table("leg", *(f"{s.gains} x{s.sea.times:g}" for s in summaries))
    for number, leg in enumerate(longest):
        cells = [
            _settled(s.legs[number], s.vehicles) if number < len(s.legs) else "-" for s in summaries
        ]
        table.add_row(f"{leg.depth_m:g} m, {leg.heading_deg:.0f} deg", *cells)
    return table


def _settled(leg: LegSummary, vehicles: int) -> str:
    """Return median and worst settling time (s), and how many vehicles did not settle."""
    if leg.settling_s is None:
        return f"{vehicles} did not"
    settled = f"{leg.settling_s.median:.0f}, worst {leg.settling_s.worst:.0f}"
    return f"{settled}; {leg.unsettled} did not" if leg.unsettled else settled


def describe_outcome(summary: SimulationSummary) -> str:
    """Return one line: how many vehicles diverged, broached or surfaced early."""
    parts = [f"{count} did not hold {what}" for what, count in summary.diverged.items()]
    parts += [f"{summary.broached} broached"] if summary.broached else []
    parts += [f"{count} surfaced for {what}" for what, count in summary.failsafes.items()]
    which = f"{summary.gains}, sea x{summary.sea.times:g}"
    if not parts:
        return f"{which}: all {summary.vehicles} vehicles were held to the end, and none broached"
    return f"{which}: of {summary.vehicles} vehicles {', '.join(parts)}"


def _table(*heads: str) -> Table:
    """Return an empty table with these column titles."""
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    for number, head in enumerate(heads):
        table.add_column(head, justify="left" if number == 0 else "right", no_wrap=number == 0)
    return table
