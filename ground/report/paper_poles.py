"""The paper's Table 4 beside what its own numbers give and beside our vehicle's, and which delay
its poles ask for."""

from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from sysid.reproduction.paper_poles import Case, PoleRow, SinglePoleCondition, TransferReading

NOMINAL_VEHICLE = "caribou_nominal"
"""The first-principles vehicle."""
CONTROLLERS = {
    "I": "Table 3's initial gains",
    "A": "Table 3's improved gains",
    "P": "our prototype's gains",
}


class PolesComparison(NamedTuple):
    rows: "list[PoleRow]"
    ours: "list[Case]"
    """Our vehicle with three controllers, as in CONTROLLERS."""
    readings: "list[TransferReading]"
    alone: "list[SinglePoleCondition]"


def compute() -> PolesComparison:
    """A few seconds."""
    from sysid.reproduction import paper_poles

    return PolesComparison(
        paper_poles.rows(),
        _our_cases(),
        paper_poles.readings(),
        paper_poles.single_pole_conditions(),
    )


def _our_cases() -> "list[Case]":
    from sysid.design.initial import design_on_root_loci
    from sysid.reproduction.paper_poles import Case
    from sysid.reproduction.paper_tables import TABLE_3_IMPROVED, TABLE_3_INITIAL

    vehicle, _, found = design_on_root_loci(NOMINAL_VEHICLE)
    first = {**found["heading"].gains, **found["depth"].gains}
    gains = {"I": TABLE_3_INITIAL, "A": TABLE_3_IMPROVED, "P": first}
    return [
        Case(f"ours/{name}", vehicle.planes, g, vehicle.yaw_lag, vehicle.pitch_lag)
        for name, g in gains.items()
    ]


def as_json(found: PolesComparison) -> dict[str, Any]:
    return {
        "table_4_radps": [
            {"loop": r.loop, "case": r.case, "paper": _pair(r.paper), "ours": _pair(r.ours)}
            for r in found.rows
        ],
        "table_4_our_vehicle_radps": [
            {"loop": loop, "case": case, "ours": _pair(pole)}
            for loop, case, pole in _our_poles(found)
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
            for r in found.readings
        ],
        "table_4_alone": [row._asdict() for row in found.alone],
    }


def format_lines(found: PolesComparison) -> list[str]:
    """Lines."""
    return [
        (
            "Table 4, dominant closed-loop poles, rad/s: paper, ours (model/controller: I initial,"
            " A adjusted)"
        ),
        *(
            f"  {r.loop:8s}{r.case}  {_format_pole(r.paper)}  {_format_pole(r.ours)}"
            for r in found.rows
        ),
        "  The pair of least damping; Tables 1 and 3 behind s^2/9 + 4s/10 + 1 and 0.3 s by Pade 2",
        "",
        (
            "The same of our first-principles vehicle"
            f" ({', '.join(f'{k} {words}' for k, words in CONTROLLERS.items())})"
        ),
        *(f"  {loop:8s}{case}  {_format_pole(pole)}" for loop, case, pole in _our_poles(found)),
        "",
        (
            "The tailcone that explains the nine printed poles best, by how the garbled transfer"
            " function is read"
        ),
        (
            f"  {'lag':22s}{'delay':12s}{'rad/s':>6s}{'damping':>9s}"
            f"{'delay, s':>10s}{'95 %':>13s}{'rms, rad/s':>12s}"
            "  rows within a tenth"
        ),
        *(_reading(reading, found.rows) for reading in found.readings),
        "",
        (
            "What each printed pole asks for alone, behind s^2/9 + 4s/10 + 1: delay, and loop gain"
            " over Tables 1 and 3's"
        ),
        *(
            f"  {a.loop:8s}{a.case}  {a.delay_s:.2f} +- {a.delay_sd_s:.2f} s  {a.loop_gain:5.2f}"
            for a in found.alone
        ),
        f"  {_verdict(found)}",
    ]


def _reading(found: "TransferReading", rows: "list[PoleRow]") -> str:
    low, high = found.delays_s
    explained = [
        f"{row.loop} {row.case}" for row in rows if (row.loop, row.case) not in found.remain
    ]
    lag, known = found.lag, ", ".join(explained) or "none"
    return (
        f"  {found.lag_name:22s}{found.form:12s}"
        f"{lag.natural_frequency_radps:6.2f}{lag.damping_ratio:9.2f}"
        f"{lag.delay_s:10.2f}{f'{low:.2f}..{high:.2f}':>13s}{found.misfit_radps:12.2f}"
        f"  {known}"
    )


def _verdict(found: PolesComparison) -> str:
    first, adjusted = (
        [a.delay_s for a in found.alone if a.case.startswith(model)] for model in "IA"
    )
    least = min(found.readings, key=lambda reading: reading.misfit_radps)
    return (
        f"No tailcone explains all nine: {least.misfit_radps:.2f} rad/s rms is the least. The"
        f" initial model's rows ask for {min(first):.2f} to {max(first):.2f} s, the adjusted"
        f" model's for {min(adjusted):.2f} to {max(adjusted):.2f} s."
    )


def _our_poles(found: PolesComparison) -> list[tuple[str, str, complex]]:
    from sysid.reproduction import paper_poles

    return [
        (loop, case.name, paper_poles.pole(loop, case))
        for loop in paper_poles.LOOPS
        for case in found.ours
    ]


def _pair(pole: complex) -> list[float]:
    return [round(pole.real, 4), round(pole.imag, 4)]


def _format_pole(pole: complex) -> str:
    return f"{pole.real:8.4f} +- {pole.imag:6.4f}i"
