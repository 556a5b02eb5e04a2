"""Tables 1 and 4 against the print, and the poles against python-control."""

import control
import numpy as np
import pytest

from sysid.reproduction import paper_poles, table_comparisons
from sysid.reproduction.comparison import Verdict, at_most, judge, statement, within
from sysid.reproduction.paper_poles import PoleRow
from sysid.reproduction.paper_tables import TABLE_1_INITIAL, TABLE_3_INITIAL, TABLE_4

S = control.tf("s")


def test_judge_evidence_counts_only_where_criterion_fails() -> None:
    assert judge(holds=True, impossible="no mass") is Verdict.REPRODUCED
    assert judge(holds=False, impossible="no mass") is Verdict.NOT_REPRODUCIBLE
    assert judge(holds=False) is Verdict.NOT_REPRODUCED


def test_within_and_at_most_give_signed_difference() -> None:
    row = within("Table 1", "Y_v", "kg/s", -449.0, -440.0, share=0.02)
    assert row.difference == pytest.approx(9.0)
    assert row.verdict is Verdict.NOT_REPRODUCED
    assert at_most("Table 5", "depth", "m", 0.1, 0.2).verdict is Verdict.NOT_REPRODUCED
    assert at_most("Table 5", "depth", "m", 0.1, 0.1).verdict is Verdict.REPRODUCED
    assert statement("Figure 5", "tests", "few hours", "1 h", holds=True).difference == ""


def test_table_1_initial_follows_except_centre_of_mass() -> None:
    rows = table_comparisons.table_1_initial(table_comparisons.derivation())
    assert [row.quantity for row in rows] == [f"{n}, initial" for n in TABLE_1_INITIAL._fields]
    others = {row.quantity: row.verdict for row in rows if row.verdict is not Verdict.REPRODUCED}
    assert others == {"z_CM, initial": Verdict.NOT_REPRODUCIBLE}
    assert table_comparisons.table_1_changes().verdict is Verdict.REPRODUCED


def test_table_4_first_pole_equals_that_of_python_control() -> None:
    """Heading, initial model and gains: every block by python-control from Tables 1 and 3."""
    c, m, U, g = TABLE_1_INITIAL, 637.0, 1.3, TABLE_3_INITIAL
    A = [
        [c.Y_v / (m - c.Y_vdot), (c.Y_r - m * U) / (m - c.Y_vdot), 0],
        [c.N_v / (c.I_zz - c.N_rdot), c.N_r / (c.I_zz - c.N_rdot), 0],
        [0, 1, 0],
    ]
    B = [[-c.Y_dr / (m - c.Y_vdot)], [-c.N_dr / (c.I_zz - c.N_rdot)], [0]]
    body = control.ss2tf(control.ss(A, B, [[0, 0, 1]], 0))
    duct = 1 / (S**2 / 9 + 4 * S / 10 + 1) * control.tf(*control.pade(0.3, 2))
    loop = (g["HDG_P"] + g["HDG_I"] / S + g["HDG_D"] * S) * duct * body
    poles = control.poles(control.minreal(1 / (1 + loop), verbose=False))
    row = paper_poles.rows()[0]
    assert (row.loop, row.case) == ("heading", "I/I")
    assert np.min(np.abs(poles - row.ours)) < 1e-4


def test_table_4_row_is_excused_only_by_contradiction() -> None:
    """A far pole is a miss where some tailcone explains all rows, else not reproducible."""
    rows = [
        PoleRow(loop=loop, case=case, paper=pole, ours=2.0 * pole)
        for (loop, case), pole in TABLE_4.items()
    ]
    readings, alone = paper_poles.readings(), paper_poles.single_pole_conditions()
    contradicting = table_comparisons.table_4(rows, readings, alone)[:9]
    assert {row.verdict for row in contradicting} == {Verdict.NOT_REPRODUCIBLE}
    explained = [readings[0]._replace(remain=())]
    missed = table_comparisons.table_4(rows, explained, alone)[:9]
    assert {row.verdict for row in missed} == {Verdict.NOT_REPRODUCED}
