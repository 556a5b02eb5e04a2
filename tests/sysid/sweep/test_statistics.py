"""Evaluation of a sweep: intervals, combinations, worst dives and influences."""

import csv
import io
from collections.abc import Mapping

import numpy as np
import pytest
from scipy.stats import binom

from sysid.models.parameters import NAMES
from sysid.sweep import points, statistics
from sysid.sweep.dives import COLUMNS, Conditions
from sysid.sweep.points import Sampler
from sysid.sweep.statistics import Table

DEFAULTS: dict[str, object] = {
    **dict.fromkeys(COLUMNS, 0.0),
    **Conditions()._asdict(),
    "vehicle": "caribou",
    "gains": "pid",
    "mission": "square",
    "diverged": "",
    "failsafe": "",
    "not_redesigned": "",
    "passed": 1,
    "heading_deg": 1.0,
    "pitch_deg": 1.0,
    "depth_m": 0.1,
    "settling_s": 20.0,
}


def table_of(*rows: Mapping[str, object]) -> Table:
    """Return a table of dives; columns that a row lacks have defaults."""
    text = io.StringIO()
    lines = csv.DictWriter(text, COLUMNS, lineterminator="\n")
    lines.writerows({**DEFAULTS, "dive": number, **row} for number, row in enumerate(rows))
    return statistics.read([text.getvalue()])


# Verifies: Clopper-Pearson limits. Reference: their definition by binomial tails of 2.5 %
# (Clopper and Pearson 1934). Tolerance: of the quantile function.
@pytest.mark.parametrize(("passed", "count"), [(0, 20), (1, 20), (19, 20), (20, 20), (870, 1000)])
def test_pass_probability_limits_have_tails_of_binomial(passed: int, count: int) -> None:
    interval = statistics.pass_probability(passed, count)
    assert interval.estimate == passed / count
    if passed:
        assert binom.sf(passed - 1, count, interval.low) == pytest.approx(0.025, abs=1e-9)
    else:
        assert interval.low == 0.0
    if passed < count:
        assert binom.cdf(passed, count, interval.high) == pytest.approx(0.025, abs=1e-9)
    else:
        assert interval.high == 1.0


def test_cells_one_for_each_combination_with_reasons() -> None:
    table = table_of(
        {"gains": "pid", "disturbance_scale": 1.0, "heading_deg": 1.0},
        {"gains": "pid", "disturbance_scale": 1.0, "heading_deg": 3.0},
        {"gains": "pid", "disturbance_scale": 2.0, "passed": 0, "diverged": "depth"},
        {"gains": "lqg", "disturbance_scale": 2.0, "passed": 0, "heading_deg": ""},
    )
    first, second, third = statistics.cells(table, ["disturbance_scale"])
    assert first.inputs == {
        "vehicle": "caribou",
        "gains": "pid",
        "mission": "square",
        "disturbance_scale": "1",
    }
    assert (first.dives, first.passed, first.failures) == (2, 2, {})
    assert (first.errors["heading_deg"].median, first.errors["heading_deg"].worst) == (2.0, 3.0)
    assert (second.passed, second.failures) == (0, {"did not hold depth": 1})
    assert third.failures == {"outside the limits": 1}
    assert "heading_deg" not in third.errors


def test_worst_lost_dives_first_then_largest_error() -> None:
    table = table_of(
        {"heading_deg": 1.0},
        {"heading_deg": 9.0},
        {"depth_m": 5.0},
        {"passed": 0, "failsafe": "leak"},
        {"heading_deg": ""},
        {"passed": 0, "broached": 1},
        {"passed": 0, "not_redesigned": "no gains meet the limits", "heading_deg": 2.0},
    )
    assert statistics.worst(table, 5) == [3, 5, 2, 1, 6]


def sampled_table(samples: int, effect: float) -> Table:
    """Return dives with two gains; heading error = effect x current + gains + noise of z."""
    drawn = points.draw(Sampler.SOBOL, samples, 1 + len(NAMES), 1)
    noise = np.random.default_rng(2).standard_normal(samples)
    return table_of(
        *(
            {
                "sample": n,
                "gains": gains,
                "current_mps": point[0],
                **{f"z_{name}": z for name, z in zip(NAMES, point[1:], strict=True)},
                "heading_deg": effect * point[0] + (gains == "lqg") + noise[n],
            }
            for n, point in enumerate(drawn)
            for gains in ("pid", "lqg")
        )
    )


def test_influences_names_inputs_that_act_and_no_other() -> None:
    found = {
        entry.input: entry
        for entry in statistics.influences(sampled_table(128, 6.0), "heading_deg")
    }
    assert set(found) == {"current_mps", "gains"}
    # Variances: 36/12 of the current, 1/4 of the gains, 1 of the noise; ranks differ by little.
    assert found["current_mps"].share == pytest.approx(3.0 / 4.25, abs=0.1)
    assert found["gains"].share == pytest.approx(0.25 / 4.25, abs=0.03)
    assert found["current_mps"].direction > 0.7
    assert np.isnan(found["gains"].direction)


def test_influences_of_noise_alone_are_empty() -> None:
    table = sampled_table(128, 0.0)
    pid = table.texts["gains"] == "pid"
    only_noise = Table(
        {name: column[pid] for name, column in table.numbers.items()},
        {name: column[pid] for name, column in table.texts.items()},
    )
    assert statistics.influences(only_noise, "heading_deg") == []
    assert statistics.influences(table, "depth_m") == [], "a constant result"
