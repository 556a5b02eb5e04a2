"""The estimate in a terminal: a table that grows surer, a line after each test, and plain numbers
for programs."""

from typing import Any

from rich.console import RenderableType
from rich.table import Table
from rich.text import Text

from ground.live.estimate import PLANES, EstimateStatus
from sysid.estimation.recursive.report import (
    ENOUGH_GAIN_SD_DB,
    ENOUGH_PHASE_SD_DEG,
    Number,
    PlaneReport,
)

ROWS = {
    "static_gain_per_s": "static gain, 1/s",
    "b1_per_s2": "b1, 1/s2",
    "p_fast_per_s": "fast pole, 1/s",
    "p_slow_per_s": "slow pole, 1/s",
    "delay_s": "delay, s",
    "actuator_bias_deg": "actuator bias, deg",
}
ENOUGH_STYLE, NOT_ENOUGH_STYLE, ERROR_STYLE, LABEL_STYLE = "green", "", "bold red", "cyan"


def table(standing: EstimateStatus) -> RenderableType:
    """Each number with its standard deviation, and how much of the one before the first test that
    is."""
    if not standing.readings:
        return Text(
            standing.trouble or "no test yet",
            style=ERROR_STYLE if standing.trouble else "bright_black",
        )
    shown = [plane for plane in PLANES if plane in standing.readings]
    drawn = Table(box=None, padding=(0, 2), title_justify="left")
    drawn.add_column("and % of the prior's sd left", style=LABEL_STYLE, header_style="bright_black")
    for plane in shown:
        drawn.add_column(f"{plane}, under test" if plane in standing.testing else plane)
    readings = [standing.readings[plane] for plane in shown]
    for name, label in ROWS.items():
        drawn.add_row(label, *(_cell(found.numbers[name]) for found in readings))
    drawn.add_row("crossover, rad/s", *(f"{found.crossover_radps:.2f}" for found in readings))
    drawn.add_row("gain there, dB", *(_cell(found.gain_db) for found in readings))
    drawn.add_row("phase there, deg", *(_cell(found.phase_deg) for found in readings))
    drawn.add_row(
        "",
        *(
            Text(verdict(found), style=ENOUGH_STYLE if found.enough else NOT_ENOUGH_STYLE)
            for found in readings
        ),
    )
    if standing.trouble:
        drawn.add_row("no estimate", Text(standing.trouble, style=ERROR_STYLE))
    return drawn


def verdict(found: PlaneReport) -> str:
    """Whether the tests have told enough."""
    if found.enough:
        return "enough, you may stop"
    lacking = (
        [f"phase to +-{ENOUGH_PHASE_SD_DEG:g} deg"]
        if found.phase_deg.sd > ENOUGH_PHASE_SD_DEG
        else []
    )
    lacking += (
        [f"gain to +-{ENOUGH_GAIN_SD_DB:g} dB"] if found.gain_db.sd > ENOUGH_GAIN_SD_DB else []
    )
    return f"go on: {' and '.join(lacking)}"


def line(found: PlaneReport) -> str:
    """A plane in one line."""
    b1, delay = found.numbers["b1_per_s2"], found.numbers["delay_s"]
    return (
        f"{found.plane}: b1 {_format_value(b1)} per s2 (prior +-{_format_short(b1.before)}), "
        f"delay {_format_value(delay)} s; at {found.crossover_radps:.2f} rad/s"
        f" +-{_format_short(found.gain_db.sd)} dB,"
        f" +-{_format_short(found.phase_deg.sd)} deg: {verdict(found)}"
    )


def as_json(standing: EstimateStatus) -> dict[str, Any]:
    """By plane and name: value, standard deviation, and that before the first test."""
    return {
        plane: {
            **{name: number._asdict() for name, number in found.numbers.items()},
            "crossover_radps": found.crossover_radps,
            "gain_db": found.gain_db._asdict(),
            "phase_deg": found.phase_deg._asdict(),
            "enough": found.enough,
        }
        for plane, found in standing.readings.items()
    }


def _cell(number: Number) -> str:
    return f"{_format_value(number)}  {100.0 * number.sd / number.before:3.0f} %"


def _format_value(number: Number) -> str:
    """A value to the digits that its standard deviation lets count."""
    return f"{number.value:.{_digits(number.sd)}f} +- {_format_short(number.sd)}"


def _format_short(value: float) -> str:
    return f"{value:.{_digits(value)}f}"


def _digits(sd: float) -> int:
    """Decimals that show two significant figures of it, four at most."""
    return next((digits for digits in range(4) if round(sd, digits) >= 9.5 * 10.0**-digits), 4)
