"""A plan as a table for people and as plain numbers."""

from typing import Any

from rich.table import Table

from ground.terminal import Rendered, render
from mavlink_io.printable import printable
from sysid.test_design.information import DesignUncertainty
from sysid.test_design.plan import Planned, TestPlan

WIDTH = 130
COLUMNS = {
    "static_gain_pct": "gain %",
    "b1_pct": "b1 %",
    "p_fast_pct": "fast pole %",
    "p_slow_pct": "slow pole %",
    "delay_s": "delay s",
    "crossover_db": "crossover dB",
    "crossover_deg": "crossover deg",
}


def as_json(plan: TestPlan, files: dict[str, str], parameters: dict[str, float]) -> dict[str, Any]:
    """Everything of a plan, each number with its unit in its name."""
    return {
        "files": files,
        "parameters": parameters,
        "water_s": plan.water_s,
        "crossover_radps": dict(plan.crossover_radps),
        "tests": [_test_json(planned) for planned in plan.tests],
        "held_out": [_test_json(planned) for planned in plan.held_out],
        "standard_deviations": {
            plane: {when: numbers[plane]._asdict() for when, numbers in _stages(plan).items()}
            for plane in plan.before
        },
    }


def _stages(plan: TestPlan) -> dict[str, dict[Any, DesignUncertainty]]:
    return {"before": plan.before, "after": plan.after, "paper_steps": plan.paper}


def _test_json(planned: Planned) -> dict[str, Any]:
    what = planned.manoeuvre._asdict() | {"surface": planned.manoeuvre.surface}
    return {
        **what,
        "excursion": planned.excursion._asdict(),
        **({"elevator_excursion": planned.elevator._asdict()} if planned.elevator else {}),
        "phase_sd_without_it": {plane: 1.0 + share for plane, share in planned.share.items()},
    }


def format_text(plan: TestPlan, parts: list[str]) -> Rendered:
    """Two tables: the tests, and what would be known after them."""
    lines = [
        line.rstrip()
        for line in render([_tests(plan), _numbers(plan)], WIDTH).rstrip("\n").split("\n")
    ]
    return Rendered("\n".join([*lines, *map(printable, parts)]))


def _tests(plan: TestPlan) -> Table:

    table = Table(
        "",
        "surface",
        "signal",
        "loop",
        "deg",
        "s",
        "angle deg",
        "rate deg/s",
        "depth m",
        "P(leave)",
        box=None,
    )
    rows = [*enumerate(plan.tests, start=1), *(("held out", one) for one in plan.held_out)]
    for number, planned in rows:
        for half, (what, found) in enumerate(
            zip(planned.manoeuvre.halves, planned.excursions, strict=True)
        ):
            table.add_row(
                "and" if half else str(number),
                what.surface,
                what.wave,
                "on" if what.loop_on else "off",
                f"{what.size_deg:.3g}",
                str(what.duration_s),
                f"{found.angle_deg:.0f}",
                f"{found.rate_degps:.1f}",
                f"{found.depth_m:.1f}" if what.plane == "pitch" else "",
                f"{found.probability:.3f}",
            )
    return table


def _numbers(plan: TestPlan) -> Table:

    table = Table("sd, foretold", "", *COLUMNS.values(), box=None)
    for plane in plan.before:
        for when, numbers in _stages(plan).items():
            values = [f"{value:.3g}" for value in numbers[plane]]
            table.add_row(plane if when == "before" else "", when.replace("_", " "), *values)
    return table
