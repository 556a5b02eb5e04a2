"""Format the live estimate as a table, as one line per test and as JSON."""

import math
from typing import Any

from rich.console import RenderableType
from rich.table import Table
from rich.text import Text

from ground.live.estimate import EstimateStatus
from sysid.estimation.recursive.report import (
    ENOUGH_GAIN_SD_DB,
    ENOUGH_PHASE_SD_DEG,
    Number,
    PlaneReport,
)
from sysid.planes import Plane

ROWS = {
    "static_gain_per_s": "static gain, 1/s",
    "b1_per_s2": "b1, 1/s2",
    "p_fast_per_s": "fast pole, 1/s",
    "p_slow_per_s": "slow pole, 1/s",
    "delay_s": "delay, s",
    "actuator_bias_deg": "actuator bias, deg",
}
ENOUGH_STYLE, NOT_ENOUGH_STYLE, ERROR_STYLE, LABEL_STYLE = "green", "", "bold red", "cyan"


def table(status: EstimateStatus) -> RenderableType:
    """Return a table of the estimates with sd, and the ratio of sd to prior sd (percent)."""
    if not status.readings:
        return Text(
            status.trouble or "no test yet",
            style=ERROR_STYLE if status.trouble else "bright_black",
        )
    shown = [plane for plane in Plane if plane in status.readings]
    output = Table(box=None, padding=(0, 2), title_justify="left")
    output.add_column("sd as % of prior sd", style=LABEL_STYLE, header_style="bright_black")
    for plane in shown:
        output.add_column(f"{plane}, under test" if plane in status.testing else plane)
    readings = [status.readings[plane] for plane in shown]
    for name, label in ROWS.items():
        output.add_row(label, *(_cell(report.numbers[name]) for report in readings))
    output.add_row("crossover, rad/s", *(f"{report.crossover_radps:.2f}" for report in readings))
    output.add_row("gain there, dB", *(_cell(report.gain_db) for report in readings))
    output.add_row("phase there, deg", *(_cell(report.phase_deg) for report in readings))
    output.add_row(
        "",
        *(
            Text(
                describe_precision(report),
                style=ENOUGH_STYLE if report.enough else NOT_ENOUGH_STYLE,
            )
            for report in readings
        ),
    )
    if status.trouble:
        output.add_row("no estimate", Text(status.trouble, style=ERROR_STYLE))
    return output


def describe_precision(report: PlaneReport) -> str:
    """Return whether the estimate is accurate enough, or what to improve."""
    if report.enough:
        return "enough, you may stop"
    insufficient = (
        [f"phase to +-{ENOUGH_PHASE_SD_DEG:g} deg"]
        if report.phase_deg.sd > ENOUGH_PHASE_SD_DEG
        else []
    )
    insufficient += (
        [f"gain to +-{ENOUGH_GAIN_SD_DB:g} dB"] if report.gain_db.sd > ENOUGH_GAIN_SD_DB else []
    )
    return f"go on: {' and '.join(insufficient)}"


def line(report: PlaneReport) -> str:
    """Return the estimate of one plane in one line."""
    b1, delay = report.numbers["b1_per_s2"], report.numbers["delay_s"]
    return (
        f"{report.plane}: b1 {_format_value(b1)} per s2 (prior +-{_format_short(b1.prior_sd)}), "
        f"delay {_format_value(delay)} s; at {report.crossover_radps:.2f} rad/s"
        f" +-{_format_short(report.gain_db.sd)} dB,"
        f" +-{_format_short(report.phase_deg.sd)} deg: {describe_precision(report)}"
    )


def as_panel(status: EstimateStatus) -> dict[str, Any]:
    """Return the rows of `table` as JSON values for the live page."""
    return {
        "trouble": status.trouble,
        "planes": [
            {
                "plane": plane,
                "testing": plane in status.testing,
                "enough": report.enough,
                "verdict": "you may stop"
                if report.enough
                else describe_precision(report).removeprefix("go on: "),
                "rows": [
                    *((label, _cell(report.numbers[name])) for name, label in ROWS.items()),
                    ("crossover, rad/s", f"{report.crossover_radps:.2f}"),
                    ("gain there, dB", _cell(report.gain_db)),
                    ("phase there, deg", _cell(report.phase_deg)),
                ],
            }
            for plane, report in status.readings.items()
        ],
    }


def as_json(status: EstimateStatus) -> dict[str, Any]:
    """Return value, standard deviation and prior standard deviation by plane and name."""
    return {
        plane: {
            **{name: _values(number) for name, number in report.numbers.items()},
            "crossover_radps": report.crossover_radps,
            "gain_db": _values(report.gain_db),
            "phase_deg": _values(report.phase_deg),
            "enough": report.enough,
        }
        for plane, report in status.readings.items()
    }


def _values(number: Number) -> dict[str, float | None]:
    """Return the values of a number by name; null in place of an infinite standard deviation."""
    return {
        name: value if math.isfinite(value) else None for name, value in number._asdict().items()
    }


def _cell(number: Number) -> str:
    if math.isinf(number.sd):
        return f"{number.value:.2g}  not bounded"
    if math.isinf(number.prior_sd):
        return _format_value(number)
    return f"{_format_value(number)}  {100.0 * number.sd / number.prior_sd:3.0f} %"


def _format_value(number: Number) -> str:
    """Format a value with the significant digits that its standard deviation allows."""
    return f"{number.value:.{_digits(number.sd)}f} +- {_format_short(number.sd)}"


def _format_short(value: float) -> str:
    return f"{value:.{_digits(value)}f}"


def _digits(sd: float) -> int:
    """Return the number of decimals for two significant digits of `sd`, at most four."""
    return next((digits for digits in range(4) if round(sd, digits) >= 9.5 * 10.0**-digits), 4)
