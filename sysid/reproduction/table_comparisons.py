"""Tables 1, 3 and 4 as far as they follow from the paper's own numbers, without a flight."""

from collections.abc import Sequence

from sitl.vehicle import config as vehicle_files
from sitl.vehicle import first_principles
from sitl.vehicle.slender_body import Derivation
from sysid.control_analysis import margins
from sysid.design.initial import InitialDesign
from sysid.reproduction.comparison import PublishedComparison, Verdict, judge, statement, within
from sysid.reproduction.paper_poles import PoleRow, SinglePoleCondition, TransferReading
from sysid.reproduction.paper_tables import (
    TABLE_1_ADJUSTED,
    TABLE_1_CHANGE_PCT,
    TABLE_1_INITIAL,
    TABLE_3_INITIAL,
    UNITS,
)

NOMINAL_VEHICLE = "caribou_nominal"
"""Vehicle file of the first-principles vehicle."""
DERIVATION_SHARE = 0.05
"""Tolerance of the derived coefficients: the paper prints neither the total length nor k_1."""
GAIN_SHARE = 0.25
"""Tolerance of the root-locus gains: the paper prints no damping target."""
POLE_SHARE = 0.15
"""Tolerance of a pole, as a share of its magnitude: the paper prints no mass and no delay form."""
CHANGE_ROUNDING_PCT = 0.5
"""Largest difference between a printed percentage and the one computed from rounded entries."""
ROOT_LOCUS_GAINS = ("HDG_P", "HDG_D", "PTCH_P", "PTCH_D", "DPT_P")
"""Gains of Table 3 that a root locus determines."""
NO_RULE = "the paper prints no rule for integral gains and their limits"
CASE_NAMES = {
    "I/I": "initial model, initial gains",
    "A/I": "adjusted model, initial gains",
    "A/A": "adjusted model, improved gains",
}


def derivation() -> list[Derivation]:
    """Return the first-principles derivation of Table 1's initial column.

    Returns
    -------
    list of Derivation
        Steps from geometry to coefficients, SI units, in the paper's axes.
    """
    return first_principles.trace(vehicle_files.load(NOMINAL_VEHICLE))


def derivation_text() -> str:
    """Return the derivation as a plain-text table with remarks."""
    return first_principles.report(vehicle_files.load(NOMINAL_VEHICLE))


def table_1_initial(steps: Sequence[Derivation]) -> list[PublishedComparison]:
    """Compare the initial column of Table 1 with its derivation.

    Parameters
    ----------
    steps : Sequence of Derivation
        Result of `derivation`.

    Returns
    -------
    list of PublishedComparison
        One comparison per coefficient, in the order of the table. Y_v and Z_w are those with the
        paper's slip; the entry of Y_v in `discrepancies` has the evidence.
    """
    by_symbol = {step.symbol: step for step in steps}
    slip, moment, added = by_symbol["Y_v slip"], by_symbol["I_zz"], by_symbol["Y_vdot"]
    sources = {
        **by_symbol,
        "Y_v": slip,
        "Z_w": slip,
        "I_yy": moment,
        "Z_wdot": added,
        "M_qdot": by_symbol["N_rdot"],
    }
    return [
        _derived(name, sources.get(name), getattr(TABLE_1_INITIAL, name), getattr(UNITS, name))
        for name in TABLE_1_INITIAL._fields
    ]


def _derived(
    name: str, step: Derivation | None, published: float, unit: str
) -> PublishedComparison:
    """Compare one coefficient; without a derivation it is an input."""
    if step is None:
        return PublishedComparison(
            item="Table 1",
            quantity=f"{name}, initial",
            unit=unit,
            published=published,
            ours="not derived",
            difference="",
            criterion=f"within {100 * DERIVATION_SHARE:g} %",
            verdict=Verdict.NOT_REPRODUCIBLE,
            reason="the paper gives no ballast from which it follows",
        )
    return within(
        "Table 1",
        f"{name}, initial",
        unit,
        published,
        step.value,
        share=DERIVATION_SHARE,
        reason=f"{step.formula}: {step.source}",
    )


def table_1_changes() -> PublishedComparison:
    """Compare the printed percentages of Table 1 with those of its two columns."""
    computed = {
        name: 100.0 * (getattr(TABLE_1_ADJUSTED, name) / initial - 1.0)
        for name, initial in TABLE_1_INITIAL._asdict().items()
    }
    errors = {
        name: abs(value - getattr(TABLE_1_CHANGE_PCT, name)) for name, value in computed.items()
    }
    name = max(errors, key=lambda key: errors[key])
    return statement(
        "Table 1",
        "percent change",
        "19 percentages",
        f"all within {errors[name]:.2f} % ({name}: {computed[name]:.2f} %)",
        errors[name] <= CHANGE_ROUNDING_PCT,
        reason="computed from the two printed columns",
    )


def table_3_initial(design: InitialDesign) -> list[PublishedComparison]:
    """Compare Table 3's initial gains with a root-locus design on the first-principles vehicle.

    Parameters
    ----------
    design : InitialDesign
        Design for the first-principles vehicle.

    Returns
    -------
    list of PublishedComparison
        One comparison per gain of the table.
    """
    return [_initial_gain(name, design) for name in TABLE_3_INITIAL]


def _initial_gain(name: str, design: InitialDesign) -> PublishedComparison:
    """Compare one initial gain."""
    why = design.comparison[name].why if name in design.comparison else design.reasons[name]
    return within(
        "Table 3",
        f"{name}, initial",
        "",
        TABLE_3_INITIAL[name],
        design.parameters[name],
        share=GAIN_SHARE,
        reason=f"root locus on the first-principles vehicle; {why}",
        impossible="" if name in ROOT_LOCUS_GAINS else NO_RULE,
    )


def table_4(
    rows: Sequence[PoleRow],
    readings: Sequence[TransferReading],
    alone: Sequence[SinglePoleCondition],
) -> list[PublishedComparison]:
    """Compare the nine printed pole pairs with those of Tables 1 and 3, and their order.

    Parameters
    ----------
    rows : Sequence of PoleRow
        Printed and computed poles (rad/s).
    readings : Sequence of TransferReading
        Best tailcone for each reading of the printed transfer function.
    alone : Sequence of SinglePoleCondition
        Delay and loop gain that each printed pole implies.

    Returns
    -------
    list of PublishedComparison
        Nine poles, and one statement per loop on the damping.
    """
    explained = any(not reading.remain for reading in readings)
    conditions = {(row.loop, row.case): row for row in alone}
    poles = [_pole(row, conditions[row.loop, row.case], explained) for row in rows]
    return [*poles, *_damping_order(rows)]


def _pole(row: PoleRow, alone: SinglePoleCondition, explained: bool) -> PublishedComparison:
    """Compare one pole pair; `explained`: some tailcone explains all nine."""
    share = abs(row.ours - row.paper) / abs(row.paper)
    evidence = (
        f"alone it implies a delay of {alone.delay_s:.2f} s and {alone.loop_gain:.2f} times the"
        " loop gain, and no tailcone explains all nine pairs"
    )
    verdict = judge(share <= POLE_SHARE, "" if explained else evidence)
    return PublishedComparison(
        item="Table 4",
        quantity=f"{row.loop}, {CASE_NAMES[row.case]}",
        unit="",
        published=_pair(row.paper),
        ours=_pair(row.ours),
        difference=f"{100 * share:.1f} %",
        criterion=f"within {100 * POLE_SHARE:g} % of the magnitude",
        verdict=verdict,
        reason=evidence
        if verdict is Verdict.NOT_REPRODUCIBLE
        else "Tables 1 and 3, lag s^2/9 + 4s/10 + 1, delay 0.3 s as Pade 2",
    )


def _damping_order(rows: Sequence[PoleRow]) -> list[PublishedComparison]:
    """Compare, for each loop, the statement that the improved model and gains add damping."""
    by_case = {(row.loop, row.case): row for row in rows}
    order = []
    for loop in dict.fromkeys(row.loop for row in rows):
        printed, computed = (
            [margins.damping((getattr(by_case[loop, case], who),)) for case in CASE_NAMES]
            for who in ("paper", "ours")
        )
        order.append(
            statement(
                "Table 4",
                f"{loop}, damping ratio with the improved gains",
                f"greatest of the three: {', '.join(f'{ratio:.2f}' for ratio in printed)}",
                ", ".join(f"{ratio:.2f}" for ratio in computed),
                max(computed) == computed[-1],
                reason="the paper: greater damping in all three loops",
            )
        )
    return order


def _pair(pole: complex) -> str:
    """Return a pole pair as text (rad/s)."""
    return f"{pole.real:.4f} +- {pole.imag:.4f}i rad/s"
