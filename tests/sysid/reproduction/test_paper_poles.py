"""Table 4 from the paper's own numbers, and recovery of a known tailcone from synthetic poles."""

import cmath

import numpy as np
import pytest

from sysid.control_analysis import loop_state_space, margins
from sysid.control_analysis.loop_transfer import Lag
from sysid.reproduction import paper_poles
from sysid.reproduction.paper_poles import search
from sysid.reproduction.paper_poles.conditions import required_delay_and_gain
from sysid.reproduction.paper_poles.poles import CONTROLLERS
from sysid.reproduction.paper_tables import TABLE_4


def test_rows_paper_numbers_are_near_table_4() -> None:
    """All nine rows: the order supports the paper's argument, values agree roughly."""
    rows = {(row.loop, row.case): row for row in paper_poles.rows()}
    assert len(rows) == 9
    zeta = {key: margins.damping((row.ours,)) for key, row in rows.items()}
    for loop in paper_poles.LOOPS:
        assert zeta[loop, "A/A"] > zeta[loop, "I/I"], f"{loop}: the redesign adds damping"
        assert zeta[loop, "A/A"] > zeta[loop, "A/I"]
    for case in paper_poles.CASES:
        ours, paper = rows["heading", case].ours, rows["heading", case].paper
        assert abs(ours - paper) / abs(paper) < 0.16
    # The one row that a delay of 0.2 s explains to 1 %.
    delayed = {(r.loop, r.case): r for r in paper_poles.rows(Lag(0.2))}[("pitch", "I/I")]
    assert abs(delayed.ours - delayed.paper) / abs(delayed.paper) < 0.01


def test_dominant_pair_has_smallest_damping() -> None:
    slow, ringing, beyond = complex(-0.2, 0.15), complex(-1.0, 1.8), complex(-1.0, 9.0)
    assert paper_poles.dominant([slow, ringing, beyond, complex(-0.01, 0.0)]) == ringing
    assert cmath.isnan(paper_poles.dominant([complex(-1.0, 0.0)]))


def made_with(lag: Lag, form: loop_state_space.Approximation) -> dict[tuple[str, str], complex]:
    return {(row.loop, row.case): row.ours for row in paper_poles.rows(lag, form)}


@pytest.mark.parametrize("form", paper_poles.FORMS, ids=lambda form: form.name)
def test_best_delay_synthetic_poles_is_recovered(form: paper_poles.Form) -> None:
    """Each form recovers its own delay; the printed form's delay is 5 % of its T."""
    true = Lag(0.24)
    misfits = search.TailconeSearch(made_with(true, form.approximation))
    found = misfits.best_delay(Lag(0.0), form)
    assert found.delay_s == pytest.approx(0.24, abs=0.002)
    assert misfits.misfit(found, form) < 0.005


def test_best_lag_synthetic_poles_is_recovered() -> None:
    true, exact = Lag(0.2, 4.0, 0.5), paper_poles.FORMS[-1]
    misfits = search.TailconeSearch(made_with(true, exact.approximation))
    found = misfits.best_lag(exact, any_damping=True)
    assert found.delay_s == pytest.approx(true.delay_s, abs=0.01)
    assert found.natural_frequency_radps == pytest.approx(true.natural_frequency_radps, rel=0.02)
    assert found.damping_ratio == pytest.approx(true.damping_ratio, abs=0.02)


def test_single_pole_gives_delay_and_loop_gain() -> None:
    """Poles of a loop with 10 % smaller gains than assumed, behind a delay of 0.25 s."""
    known, lag = paper_poles.models(), Lag(0.25)
    for loop in ("heading", "pitch"):
        gains = dict(CONTROLLERS["I"])
        weaker = {name: 0.9 * gain for name, gain in gains.items()}
        pole = paper_poles.dominant(
            loop_state_space.poles(paper_poles.close_loop(loop, known["I"], lag, weaker, 6))
        )
        delay_s, gain = required_delay_and_gain(loop, known["I"], gains, pole, Lag(0.0))
        assert delay_s == pytest.approx(0.25, abs=1e-3)
        assert gain == pytest.approx(0.9, rel=1e-3)


def test_exact_form_pole_solves_characteristic_equation() -> None:
    """1 + L = 0 at the pole with an exponential delay, without approximation."""
    known, lag = paper_poles.models(), Lag(0.9)
    pole = paper_poles.dominant(
        loop_state_space.poles(
            paper_poles.close_loop("pitch", known["I"], lag, CONTROLLERS["I"], 6)
        )
    )
    delay_s, gain = required_delay_and_gain("pitch", known["I"], CONTROLLERS["I"], pole, lag)
    turn = 2.0 * np.pi / pole.imag
    assert min(abs(delay_s - 0.9 + k * turn) for k in (-1, 0, 1)) < 1e-3
    assert gain == pytest.approx(1.0, rel=1e-3)


def test_printed_poles_imply_different_delays() -> None:
    """The rows imply delays that differ by more than the lag's uncertainty.

    The rows of the initial model imply the smallest delays.
    """
    by_row = {(a.loop, a.case): a for a in paper_poles.single_pole_conditions()}
    assert set(by_row) == set(TABLE_4)
    delays = [a.delay_s for a in by_row.values()]
    assert max(delays) - min(delays) > 5.0 * max(a.delay_sd_s for a in by_row.values())
    for loop in paper_poles.LOOPS:
        assert (
            by_row[loop, "I/I"].delay_s < by_row[loop, "A/I"].delay_s < by_row[loop, "A/A"].delay_s
        )


def test_readings_list_unexplained_rows() -> None:
    found = paper_poles.readings()
    stated, best = found[0], min(found, key=lambda reading: reading.misfit_radps)
    assert stated.lag == paper_poles.LAG
    assert best.misfit_radps < 0.7 * stated.misfit_radps
    assert all(reading.remain for reading in found)
    for reading in found[2:]:
        assert reading.delays_s[0] <= reading.lag.delay_s <= reading.delays_s[1]
