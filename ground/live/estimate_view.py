"""The estimate in a terminal: a table that grows surer, a line after each test, and plain numbers
for programs."""

from typing import Any

from rich.console import RenderableType
from rich.table import Table
from rich.text import Text

from ground.live.estimate import PLANES, Standing
from sysid.estimation.recursive.report import SURE_DB, SURE_DEG, Number, Reading

ROWS = {
    "static_gain_per_s": "static gain, 1/s",
    "b1_per_s2": "b1, 1/s2",
    "p_fast_per_s": "fast pole, 1/s",
    "p_slow_per_s": "slow pole, 1/s",
    "delay_s": "delay, s",
    "actuator_bias_deg": "actuator bias, deg",
}
SURE, UNSURE, TROUBLE, LABEL = "green", "", "bold red", "cyan"


def table(standing: Standing) -> RenderableType:
    """Each number with its standard deviation, and how much of the one before the first test that
    is."""
    if not standing.readings:
        return Text(
            standing.trouble or "no test yet", style=TROUBLE if standing.trouble else "bright_black"
        )
    shown = [plane for plane in PLANES if plane in standing.readings]
    drawn = Table(box=None, padding=(0, 2), title_justify="left")
    drawn.add_column("and % of the prior's sd left", style=LABEL, header_style="bright_black")
    for plane in shown:
        drawn.add_column(f"{plane}, under test" if plane in standing.testing else plane)
    readings = [standing.readings[plane] for plane in shown]
    for name, label in ROWS.items():
        drawn.add_row(label, *(_cell(found.numbers[name]) for found in readings))
    drawn.add_row("crossover, rad/s", *(f"{found.crossover_radps:.2f}" for found in readings))
    drawn.add_row("gain there, dB", *(_cell(found.gain_db) for found in readings))
    drawn.add_row("phase there, deg", *(_cell(found.phase_deg) for found in readings))
    drawn.add_row(
        "", *(Text(verdict(found), style=SURE if found.enough else UNSURE) for found in readings)
    )
    if standing.trouble:
        drawn.add_row("no estimate", Text(standing.trouble, style=TROUBLE))
    return drawn


def verdict(found: Reading) -> str:
    """Whether the tests have told enough."""
    if found.enough:
        return "enough, you may stop"
    lacking = [f"phase to +-{SURE_DEG:g} deg"] if found.phase_deg.sd > SURE_DEG else []
    lacking += [f"gain to +-{SURE_DB:g} dB"] if found.gain_db.sd > SURE_DB else []
    return f"go on: {' and '.join(lacking)}"


def line(found: Reading) -> str:
    """A plane in one line."""
    b1, delay = found.numbers["b1_per_s2"], found.numbers["delay_s"]
    return (
        f"{found.plane}: b1 {_spell(b1)} per s2 (prior +-{_few(b1.before)}), delay {_spell(delay)}"
        f" s; at {found.crossover_radps:.2f} rad/s +-{_few(found.gain_db.sd)} dB,"
        f" +-{_few(found.phase_deg.sd)} deg: {verdict(found)}"
    )


def as_json(standing: Standing) -> dict[str, Any]:
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
    return f"{_spell(number)}  {100.0 * number.sd / number.before:3.0f} %"


def _spell(number: Number) -> str:
    """A value to the digits that its standard deviation lets count."""
    return f"{number.value:.{_digits(number.sd)}f} +- {_few(number.sd)}"


def _few(value: float) -> str:
    return f"{value:.{_digits(value)}f}"


def _digits(sd: float) -> int:
    """Decimals that show two significant figures of it, four at most."""
    return next((digits for digits in range(4) if round(sd, digits) >= 9.5 * 10.0**-digits), 4)
