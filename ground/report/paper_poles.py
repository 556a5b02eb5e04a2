"""The paper's Table 4 beside what its own numbers give and beside our vehicle's, and which delay
its poles ask for."""

from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from sysid.reproduction.paper_poles import Alone, Case, Reading, Row

OURS = "bench"
"""The first-principles vehicle."""
CONTROLLERS = {
    "I": "Table 3's initial gains",
    "A": "Table 3's improved gains",
    "P": "our prototype's gains",
}


class Found(NamedTuple):
    rows: "list[Row]"
    ours: "list[Case]"
    """Our vehicle with three controllers, as in CONTROLLERS."""
    readings: "list[Reading]"
    alone: "list[Alone]"


def reckon() -> Found:
    """A few seconds."""
    from sysid.reproduction import paper_poles

    return Found(paper_poles.rows(), _ours(), paper_poles.readings(), paper_poles.alone())


def _ours() -> "list[Case]":
    from sysid.design.initial import on_loci
    from sysid.reproduction.paper_poles import Case
    from sysid.reproduction.paper_tables import TABLE_3_IMPROVED, TABLE_3_INITIAL

    vehicle, _, found = on_loci(OURS)
    first = {**found["heading"].gains, **found["depth"].gains}
    gains = {"I": TABLE_3_INITIAL, "A": TABLE_3_IMPROVED, "P": first}
    return [
        Case(f"ours/{name}", vehicle.planes, g, vehicle.yaw_lag, vehicle.pitch_lag)
        for name, g in gains.items()
    ]


def as_json(found: Found) -> dict[str, Any]:
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


def in_words(found: Found) -> list[str]:
    """Lines."""
    return [
        (
            "Table 4, dominant closed-loop poles, rad/s: paper, ours (model/controller: I initial,"
            " A adjusted)"
        ),
        *(f"  {r.loop:8s}{r.case}  {_spell(r.paper)}  {_spell(r.ours)}" for r in found.rows),
        "  The pair of least damping; Tables 1 and 3 behind s^2/9 + 4s/10 + 1 and 0.3 s by Pade 2",
        "",
        (
            "The same of our first-principles vehicle"
            f" ({', '.join(f'{k} {words}' for k, words in CONTROLLERS.items())})"
        ),
        *(f"  {loop:8s}{case}  {_spell(pole)}" for loop, case, pole in _our_poles(found)),
        "",
        (
            "The tailcone that explains the nine printed poles best, by how the garbled transfer"
            " function is read"
        ),
        (
            f"  {'lag':22s}{'delay':12s}{'rad/s':>6s}{'damping':>9s}{'delay, s':>10s}{'95 %':>13s}{'rms, rad/s':>12s}"
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


def _reading(found: "Reading", rows: "list[Row]") -> str:
    low, high = found.delays_s
    explained = [
        f"{row.loop} {row.case}" for row in rows if (row.loop, row.case) not in found.remain
    ]
    lag, known = found.lag, ", ".join(explained) or "none"
    return (
        f"  {found.lag_name:22s}{found.form:12s}{lag.natural_frequency_radps:6.2f}{lag.damping_ratio:9.2f}{lag.delay_s:10.2f}{f'{low:.2f}..{high:.2f}':>13s}{found.misfit_radps:12.2f}"
        f"  {known}"
    )


def _verdict(found: Found) -> str:
    first, adjusted = (
        [a.delay_s for a in found.alone if a.case.startswith(model)] for model in "IA"
    )
    least = min(found.readings, key=lambda reading: reading.misfit_radps)
    return (
        f"No tailcone explains all nine: {least.misfit_radps:.2f} rad/s rms is the least. The"
        f" initial model's rows ask for {min(first):.2f} to {max(first):.2f} s, the adjusted"
        f" model's for {min(adjusted):.2f} to {max(adjusted):.2f} s."
    )


def _our_poles(found: Found) -> list[tuple[str, str, complex]]:
    from sysid.reproduction import paper_poles

    return [
        (loop, case.name, paper_poles.pole(loop, case))
        for loop in paper_poles.LOOPS
        for case in found.ours
    ]


def _pair(pole: complex) -> list[float]:
    return [round(pole.real, 4), round(pole.imag, 4)]


def _spell(pole: complex) -> str:
    return f"{pole.real:8.4f} +- {pole.imag:6.4f}i"
