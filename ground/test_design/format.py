"""A test plan as tables and as JSON."""

from typing import Any

from rich.table import Table

from ground.rendered import Rendered
from ground.terminal import render
from mavlink_io.printable import printable
from sysid.planes import PLANES
from sysid.test_design.information import DesignUncertainty
from sysid.test_design.plan import Planned, TestPlan

WIDTH = 130
"""Width of the tables in characters."""
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
    """Return a plan as plain values, each number with its unit in its name."""
    return {
        "files": files,
        "parameters": parameters,
        "test_time_s": plan.test_time_s,
        "crossover_radps": dict(plan.crossover_radps),
        "tests": [_test_json(planned) for planned in plan.tests],
        "held_out": [_test_json(planned) for planned in plan.held_out],
        "standard_deviations": {
            plane: {
                stage: numbers[plane]._asdict() for stage, numbers in _uncertainties(plan).items()
            }
            for plane in plan.before
        },
    }


def _uncertainties(plan: TestPlan) -> dict[str, dict[Any, DesignUncertainty]]:
    """Return standard deviations before and after the plan, and after the paper's steps."""
    return {"before": plan.before, "after": plan.after, "paper_steps": plan.paper}


def _test_json(planned: Planned) -> dict[str, Any]:
    """Return one test as plain values."""
    manoeuvre = planned.manoeuvre._asdict() | {"surface": planned.manoeuvre.surface}
    return {
        **manoeuvre,
        "excursion": planned.excursion._asdict(),
        **({"elevator_excursion": planned.elevator._asdict()} if planned.elevator else {}),
        "phase_sd_ratio_without_test": {
            plane: 1.0 + share for plane, share in planned.share.items()
        },
    }


def format_text(plan: TestPlan, notes: list[str]) -> Rendered:
    """Return two tables, the tests and the predicted standard deviations, then the notes."""
    lines = [
        line.rstrip()
        for line in render([_tests(plan), _numbers(plan)], WIDTH).rstrip("\n").split("\n")
    ]
    return Rendered("\n".join([*lines, *map(printable, notes)]))


def _tests(plan: TestPlan) -> Table:
    """Return the table of the tests."""
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
    rows = [*enumerate(plan.tests, start=1), *(("held out", test) for test in plan.held_out)]
    for number, planned in rows:
        for half, (manoeuvre, excursion) in enumerate(
            zip(planned.manoeuvre.halves, planned.excursions, strict=True)
        ):
            table.add_row(
                "and" if half else str(number),
                manoeuvre.surface,
                manoeuvre.wave,
                "on" if manoeuvre.loop_on else "off",
                f"{manoeuvre.size_deg:.3g}",
                str(manoeuvre.duration_s),
                f"{excursion.angle_deg:.0f}",
                f"{excursion.rate_degps:.1f}",
                f"{excursion.depth_m:.1f}" if PLANES[manoeuvre.plane].has_depth else "",
                f"{excursion.probability:.3f}",
            )
    return table


def _numbers(plan: TestPlan) -> Table:
    """Return the table of predicted standard deviations."""
    table = Table("sd, predicted", "", *COLUMNS.values(), box=None)
    for plane in plan.before:
        for stage, numbers in _uncertainties(plan).items():
            values = [f"{value:.3g}" for value in numbers[plane]]
            table.add_row(plane if stage == "before" else "", stage.replace("_", " "), *values)
    return table
