"""Poles of the paper's Table 4, printed and computed, and the delay that they imply."""

from typing import Any, NamedTuple

from sysid.design.initial import design_on_root_loci
from sysid.reproduction import paper_poles
from sysid.reproduction.paper_poles import Case, PoleRow, SinglePoleCondition, TransferReading
from sysid.reproduction.paper_tables import TABLE_3_IMPROVED, TABLE_3_INITIAL
from sysid.reproduction.table_comparisons import NOMINAL_VEHICLE

CONTROLLERS = {
    "I": "Table 3's initial gains",
    "A": "Table 3's improved gains",
    "P": "our prototype's gains",
}


class PolesComparison(NamedTuple):
    """Printed and computed closed-loop poles (rad/s)."""

    rows: list[PoleRow]
    """Rows of Table 4."""
    ours: list[Case]
    """Our vehicle with each of CONTROLLERS."""
    readings: list[TransferReading]
    """Best actuator model for each interpretation of the paper's transfer function."""
    alone: list[SinglePoleCondition]
    """Delay and loop gain that reproduce each printed pole by itself."""


def compute() -> PolesComparison:
    """Compute all poles; takes a few seconds."""
    return PolesComparison(
        rows=paper_poles.rows(),
        ours=_our_cases(),
        readings=paper_poles.readings(),
        alone=paper_poles.single_pole_conditions(),
    )


def _our_cases() -> list[Case]:
    """Return our first-principles vehicle with each of CONTROLLERS."""
    vehicle, _, loops = design_on_root_loci(NOMINAL_VEHICLE)
    initial_gains = {**loops["heading"].gains, **loops["depth"].gains}
    gains = {"I": TABLE_3_INITIAL, "A": TABLE_3_IMPROVED, "P": initial_gains}
    return [
        Case(
            name=f"ours/{name}",
            planes=vehicle.planes,
            gains=g,
            yaw_lag=vehicle.yaw_lag,
            pitch_lag=vehicle.pitch_lag,
        )
        for name, g in gains.items()
    ]


def as_json(comparison: PolesComparison) -> dict[str, Any]:
    """Return the comparison as plain numbers, poles as [real, imaginary] in rad/s."""
    return {
        "table_4_radps": [
            {"loop": r.loop, "case": r.case, "paper": _pair(r.paper), "ours": _pair(r.ours)}
            for r in comparison.rows
        ],
        "table_4_our_vehicle_radps": [
            {"loop": loop, "case": case, "ours": _pair(pole)}
            for loop, case, pole in _our_poles(comparison)
        ],
        "table_4_tailcones": [
            {
                "lag": r.lag_name,
                "delay_form": r.form,
                **r.lag._asdict(),
                "misfit_radps": r.misfit_radps,
                "delays_s": r.delays_s,
                "remain": [" ".join(row) for row in r.remain],
            }
            for r in comparison.readings
        ],
        "table_4_alone": [row._asdict() for row in comparison.alone],
    }


def format_lines(comparison: PolesComparison) -> list[str]:
    """Return the comparison as lines of text."""
    return [
        (
            "Table 4, dominant closed-loop poles, rad/s: paper, ours (model/controller: I initial,"
            " A adjusted)"
        ),
        *(
            f"  {r.loop:8s}{r.case}  {_format_pole(r.paper)}  {_format_pole(r.ours)}"
            for r in comparison.rows
        ),
        "  Least damped pair; Tables 1 and 3 with the lag s^2/9 + 4s/10 + 1, 0.3 s as Pade 2",
        "",
        (
            "Dominant poles of our first-principles vehicle"
            f" ({', '.join(f'{k} {words}' for k, words in CONTROLLERS.items())})"
        ),
        *(
            f"  {loop:8s}{case}  {_format_pole(pole)}"
            for loop, case, pole in _our_poles(comparison)
        ),
        "",
        (
            "Best fit of the tailcone to the nine printed poles, for each interpretation of the"
            " misprinted transfer function"
        ),
        (
            f"  {'lag':22s}{'delay':12s}{'rad/s':>6s}{'damping':>9s}"
            f"{'delay, s':>10s}{'95 %':>13s}{'rms, rad/s':>12s}"
            "  rows within 10 %"
        ),
        *(_reading(reading, comparison.rows) for reading in comparison.readings),
        "",
        (
            "Fit to each printed pole alone, with the lag s^2/9 + 4s/10 + 1: delay, and loop gain"
            " relative to Tables 1 and 3"
        ),
        *(
            f"  {a.loop:8s}{a.case}  {a.delay_s:.2f} +- {a.delay_sd_s:.2f} s  {a.loop_gain:5.2f}"
            for a in comparison.alone
        ),
        f"  {_conclusion(comparison)}",
    ]


def _reading(reading: TransferReading, rows: list[PoleRow]) -> str:
    """Return one line: best actuator model of an interpretation and the rows that it explains."""
    low, high = reading.delays_s
    explained = [
        f"{row.loop} {row.case}" for row in rows if (row.loop, row.case) not in reading.remain
    ]
    lag, explained_rows = reading.lag, ", ".join(explained) or "none"
    return (
        f"  {reading.lag_name:22s}{reading.form:12s}"
        f"{lag.natural_frequency_radps:6.2f}{lag.damping_ratio:9.2f}"
        f"{lag.delay_s:10.2f}{f'{low:.2f}..{high:.2f}':>13s}{reading.misfit_radps:12.2f}"
        f"  {explained_rows}"
    )


def _conclusion(comparison: PolesComparison) -> str:
    """Return the smallest misfit and the range of delays of each model."""
    initial, adjusted = (
        [a.delay_s for a in comparison.alone if a.case.startswith(model)] for model in "IA"
    )
    best = min(comparison.readings, key=lambda reading: reading.misfit_radps)
    return (
        f"No tailcone fits all nine poles: {best.misfit_radps:.2f} rad/s rms is the smallest. The"
        f" initial model's rows imply {min(initial):.2f} to {max(initial):.2f} s, the adjusted"
        f" model's for {min(adjusted):.2f} to {max(adjusted):.2f} s."
    )


def _our_poles(comparison: PolesComparison) -> list[tuple[str, str, complex]]:
    """Return (loop, case, dominant pole in rad/s) of our vehicle."""
    return [
        (loop, case.name, paper_poles.pole(loop, case))
        for loop in paper_poles.LOOPS
        for case in comparison.ours
    ]


def _pair(pole: complex) -> list[float]:
    return [round(pole.real, 4), round(pole.imag, 4)]


def _format_pole(pole: complex) -> str:
    return f"{pole.real:8.4f} +- {pole.imag:6.4f}i"
