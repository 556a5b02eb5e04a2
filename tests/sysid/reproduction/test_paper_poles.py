"""Table 4 by the paper's own numbers, and a tailcone found again from poles that were made with
it."""

import cmath

import numpy as np
import pytest

from sysid.control_analysis import loop_transfer, margins
from sysid.control_analysis.loop_transfer import Lag
from sysid.reproduction import paper_poles
from sysid.reproduction.paper_poles import search
from sysid.reproduction.paper_poles.conditions import required_delay_and_gain
from sysid.reproduction.paper_poles.poles import CONTROLLERS
from sysid.reproduction.paper_tables import TABLE_4


def test_rows_beside_the_paper() -> None:
    """All nine; the ordering is what the paper's argument needs, the values agree as far as it lets
    them."""
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


def test_the_dominant_pair_rings_most() -> None:
    slow, ringing, beyond = complex(-0.2, 0.15), complex(-1.0, 1.8), complex(-1.0, 9.0)
    assert paper_poles.dominant([slow, ringing, beyond, complex(-0.01, 0.0)]) == ringing
    assert cmath.isnan(paper_poles.dominant([complex(-1.0, 0.0)]))


def made_with(lag: Lag, form: loop_transfer.Approximation) -> dict[tuple[str, str], complex]:
    return {(row.loop, row.case): row.ours for row in paper_poles.rows(lag, form)}


@pytest.mark.parametrize("form", paper_poles.FORMS, ids=lambda form: form.name)
def test_a_delay_is_found_again_from_poles_made_with_it(form: paper_poles.Form) -> None:
    """Each in its own form; that of the printed form is 5 % of its T."""
    true = Lag(0.24)
    misfits = search.TailconeSearch(made_with(true, form.approximation))
    found = misfits.best_delay(Lag(0.0), form)
    assert found.delay_s == pytest.approx(0.24, abs=0.002)
    assert misfits.misfit(found, form) < 0.005


def test_a_lag_is_found_again_with_its_delay() -> None:
    true, exact = Lag(0.2, 4.0, 0.5), paper_poles.FORMS[-1]
    misfits = search.TailconeSearch(made_with(true, exact.approximation))
    found = misfits.best_lag(exact, any_damping=True)
    assert found.delay_s == pytest.approx(true.delay_s, abs=0.01)
    assert found.natural_frequency_radps == pytest.approx(true.natural_frequency_radps, rel=0.02)
    assert found.damping_ratio == pytest.approx(true.damping_ratio, abs=0.02)


def test_one_pole_alone_tells_delay_and_loop_gain() -> None:
    """Poles of a loop whose gains are all a tenth weaker than those it is asked by, behind a delay
    of 0.25 s."""
    known, lag = paper_poles.models(), Lag(0.25)
    for loop in ("heading", "pitch"):
        gains = dict(CONTROLLERS["I"])
        weaker = {name: 0.9 * gain for name, gain in gains.items()}
        pole = paper_poles.dominant(
            loop_transfer.poles(paper_poles.close_loop(loop, known["I"], lag, weaker, 6))
        )
        delay_s, gain = required_delay_and_gain(loop, known["I"], gains, pole, Lag(0.0))
        assert delay_s == pytest.approx(0.25, abs=1e-3)
        assert gain == pytest.approx(0.9, rel=1e-3)


def test_the_exact_form_solves_the_equation_with_a_true_delay() -> None:
    """1 + L = 0 at the pole, the delay an exponential: no approximation is asked."""
    known, lag = paper_poles.models(), Lag(0.9)
    pole = paper_poles.dominant(
        loop_transfer.poles(paper_poles.close_loop("pitch", known["I"], lag, CONTROLLERS["I"], 6))
    )
    delay_s, gain = required_delay_and_gain("pitch", known["I"], CONTROLLERS["I"], pole, lag)
    turn = 2.0 * np.pi / pole.imag
    assert min(abs(delay_s - 0.9 + k * turn) for k in (-1, 0, 1)) < 1e-3
    assert gain == pytest.approx(1.0, rel=1e-3)


def test_no_delay_explains_the_printed_poles() -> None:
    """The rows ask for delays further apart than the lag leaves open; those of the initial model
    for the shortest."""
    by_row = {(a.loop, a.case): a for a in paper_poles.single_pole_conditions()}
    assert set(by_row) == set(TABLE_4)
    delays = [a.delay_s for a in by_row.values()]
    assert max(delays) - min(delays) > 5.0 * max(a.delay_sd_s for a in by_row.values())
    for loop in paper_poles.LOOPS:
        assert (
            by_row[loop, "I/I"].delay_s < by_row[loop, "A/I"].delay_s < by_row[loop, "A/A"].delay_s
        )


def test_readings_end_in_what_remains() -> None:
    found = paper_poles.readings()
    stated, best = found[0], min(found, key=lambda reading: reading.misfit_radps)
    assert stated.lag == paper_poles.LAG
    assert best.misfit_radps < 0.7 * stated.misfit_radps
    assert all(reading.remain for reading in found)
    for reading in found[2:]:
        assert reading.delays_s[0] <= reading.lag.delay_s <= reading.delays_s[1]
