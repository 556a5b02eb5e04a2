"""Outlier tests on a fitted campaign in which one run is replaced by a run with an anomaly."""

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
import pytest

from sitl.vehicle import config
from sysid import prior_knowledge
from sysid.data.runs import RATE_HZ, Run
from sysid.estimation.map import fit
from sysid.estimation.map.datasets import dataset, with_coupling_inputs
from sysid.estimation.map.fit import Fit
from sysid.estimation.map.problem import Prior
from sysid.planes import Plane
from sysid.screening import RunScreening
from sysid.screening.outlier_tests import find_outliers
from sysid.screening.refit_loop import refit_until_clean
from tests.sysid import sea
from tests.sysid.sea import Fault

SIZES_DEG = (3.0, -3.0, 5.0, -5.0, 7.0, -7.0, 9.0)
"""Magnitudes of the campaign's rudder steps, deg."""


class Fitted(NamedTuple):
    """Campaign with its fit."""

    runs: list[Run]
    fitted: Fit
    prior: Prior

    def of(self, runs: Sequence[Run]) -> Fit:
        """Return the fit with other runs; the outlier tests compute the optimum of these runs."""
        planes = {run.plane for run in runs}
        datasets = {
            p: tuple(
                with_coupling_inputs(self.fitted.vehicle, dataset(r)) for r in runs if r.plane == p
            )
            for p in sorted(planes)
        }
        return self.fitted._replace(datasets=datasets)

    def screenings(self, runs: Sequence[Run]) -> dict[str, RunScreening]:
        return {
            screening.run: screening
            for screening in find_outliers(self.of(runs), self.prior).screenings
        }

    def outliers(self, runs: Sequence[Run]) -> set[str]:
        return {name for name, screening in self.screenings(runs).items() if screening.reason}


@pytest.fixture(scope="module")
def fitted(campaign: list[Run], bench: config.VehicleConfig) -> Fitted:
    prior = prior_knowledge.prior_of(campaign, bench)
    return Fitted(campaign, fit.fit(campaign, prior), prior)


@pytest.fixture(scope="module")
def again(field: config.VehicleConfig) -> Callable[..., Run]:
    def fly(k: int, fault: Fault, seed: int = 1000, **sea_of: Any) -> Run:
        """Simulate rudder test ``k`` of a campaign again: the same disturbance, with a fault."""
        trim = -math.radians(field.tailcone.rudder_bias_deg), math.radians(1.0)
        signal = sea.step(SIZES_DEG[k], 20.0)
        return sea.fly(
            field,
            Plane.YAW,
            signal,
            name=f"rudder/{k}",
            seed=seed + k,
            trim_rad=trim,
            fault=fault,
            **sea_of,
        )

    return fly


def test_find_outliers_clean_campaign_has_none(fitted: Fitted) -> None:
    assert fitted.outliers(fitted.runs) == set()


def test_find_outliers_slip_size_and_time(fitted: Fitted, again: Callable[..., Run]) -> None:
    runs = list(fitted.runs)
    runs[3] = again(3, Fault(slip_rad=math.radians(-1.5), slip_s=8.0))
    screening = fitted.screenings(runs)["rudder/3"]
    slip = screening.scores.anomalies[0]
    assert screening.reason.startswith("actuator slip: rudder jumped by -1.")
    assert abs(slip.size + 1.5) < 3.0 * slip.sd
    assert slip.sd < 0.4
    assert slip.at_s == pytest.approx(8.0, abs=2.0)
    assert fitted.outliers(runs) == {"rudder/3"}


def test_find_outliers_gain_error(fitted: Fitted, again: Callable[..., Run]) -> None:
    """Gain and speed have nearly the same effect on a turn; the reason names both."""
    runs = list(fitted.runs)
    runs[4] = again(4, Fault(gain=1.3))
    screening = fitted.screenings(runs)["rudder/4"]
    gain = next(a for a in screening.scores.anomalies if a.kind == "gain error")
    assert "gain error: rudder moved" in screening.reason
    assert abs(gain.size - 30.0) < 3.0 * gain.sd


@pytest.mark.slow
def test_find_outliers_rarely_drops_a_sound_run(
    fitted: Fitted, field: config.VehicleConfig
) -> None:
    """Of 20 campaigns at most one loses a sound run, too.

    FAMILY_ERROR_RATE is 1 % per campaign, so two or more of 20 have a probability of 1.7 %.
    """
    trim = -math.radians(field.tailcone.rudder_bias_deg), math.radians(1.0)
    unexpected = []
    for seed in range(1000, 3000, 100):
        runs = sea.campaign(field, seed=seed)
        runs[4] = sea.fly(
            field,
            Plane.YAW,
            sea.step(SIZES_DEG[4], 20.0),
            name="rudder/4",
            seed=seed + 4,
            trim_rad=trim,
            fault=Fault(gain=1.3),
        )
        outliers = fitted.outliers(runs)
        assert "rudder/4" in outliers
        unexpected += [seed] if len(outliers) > 1 else []
    assert len(unexpected) <= 1


def test_find_outliers_distinguishes_gust_from_slip(
    fitted: Fitted, again: Callable[..., Run]
) -> None:
    pushed = sea.accelerations(sea.SETTLE_S + 20.0, sea.ROUGH, np.random.default_rng(3))
    time_s = np.arange(len(pushed)) / RATE_HZ - sea.SETTLE_S
    pushed[:, 1] += math.radians(-1.0) * (
        (time_s > 6.0) & (time_s < 11.0)
    )  # the paper's z points up
    runs = list(fitted.runs)
    runs[1] = again(1, Fault(), sea_radps2=pushed)
    screening = fitted.screenings(runs)["rudder/1"]
    gust = next(a for a in screening.scores.anomalies if a.kind == "gust")
    assert screening.reason.startswith("gust: a push of +")
    assert abs(gust.size - 1.0) < 4.0 * gust.sd
    assert gust.at_s == pytest.approx(6.0, abs=1.5)


@pytest.mark.parametrize("seed", [1000, 2000, 2800, 3200, 3800])
def test_find_outliers_growth_with_size_is_structure(
    seed: int, fitted: Fitted, field: config.VehicleConfig, again: Callable[..., Run]
) -> None:
    """The control effectiveness grows with the deflection: all large tests have large residuals.

    A third of such campaigns lost their smallest or their largest test.
    """
    runs = sea.campaign(field, seed=seed)
    for k, degrees in enumerate(SIZES_DEG):
        runs[k] = again(k, Fault(gain=0.8 + 0.06 * abs(degrees)), seed)
    result = find_outliers(fitted.of(runs), fitted.prior)
    assert [v.run for v in result.screenings if v.reason] == []
    assert any(
        text.startswith(
            "structure: the response to the largest yaw test differs from the model's by +"
        )
        for text in result.structure
    )


def test_find_outliers_single_largest_test_is_accepted(
    fitted: Fitted, again: Callable[..., Run]
) -> None:
    """Without another test of its size, an anomaly and an error of the structure look the same."""
    runs = [run for k, run in enumerate(fitted.runs) if k not in (4, 5)]
    runs[4] = again(6, Fault(slip_rad=math.radians(2.5), slip_s=5.0))
    screening = fitted.screenings(runs)["rudder/6"]
    assert screening.reason == ""
    assert screening.scores.p_value < 1e-4
    assert "no other test is as large" in screening.warnings[0]


def test_find_outliers_repeated_runs_are_compared(
    fitted: Fitted, again: Callable[..., Run]
) -> None:
    """Runs of the same test, of either sign, differ only if one of them has an anomaly."""
    runs = list(fitted.runs)
    before = fitted.screenings(runs)
    assert before["rudder/2"].repeat is not None
    assert before["rudder/6"].repeat is None
    runs[2] = again(2, Fault(slip_rad=math.radians(2.0), slip_s=4.0))
    after = fitted.screenings(runs)
    outlier_scores = after["rudder/2"].repeat
    assert outlier_scores is not None
    sound = [before[name].repeat for name in ("rudder/0", "rudder/4")]
    assert outlier_scores.p_value < 0.001
    assert all(scores is not None and scores.p_value > 0.01 for scores in sound)
    assert outlier_scores.anomalies[0].kind == "actuator slip"


def test_refit_until_clean_fits_without_outlier(fitted: Fitted, again: Callable[..., Run]) -> None:
    """One further fit for one outlier, and none for a clean campaign."""
    runs, fitted_names = list(fitted.runs), list[list[str]]()

    def fit_runs(chosen: Sequence[Run]) -> Fit:
        fitted_names.append([run.name for run in chosen])
        return fitted.of(chosen)

    refitted = refit_until_clean(runs, fitted.prior, fit_runs)
    assert (len(fitted_names), refitted.fit_of_all_runs, len(refitted.accepted_runs)) == (
        1,
        None,
        len(runs),
    )
    runs[3] = again(3, Fault(slip_rad=math.radians(1.5), slip_s=8.0))
    refitted = refit_until_clean(runs, fitted.prior, fit_runs)
    assert len(fitted_names) == 3
    assert refitted.fit_of_all_runs is not None
    assert "rudder/3" not in fitted_names[-1]
    assert [run.name for run in refitted.accepted_runs] == fitted_names[-1]
    assert refitted.screenings["rudder/3"].reason
    assert set(refitted.screenings) == {run.name for run in runs}


def test_find_outliers_keeps_minimum_of_runs(fitted: Fitted, again: Callable[..., Run]) -> None:
    """Of two runs none is dropped: it is unknown which of them is the outlier."""
    pair = [fitted.runs[2], again(3, Fault(slip_rad=math.radians(3.0), slip_s=5.0))]
    screenings = fitted.screenings([*pair, *fitted.runs[7:]])
    assert all(not screening.reason for screening in screenings.values())
    assert screenings["rudder/3"].warnings


def test_find_outliers_ambiguous_pair_names_both(fitted: Fitted, again: Callable[..., Run]) -> None:
    """Two large tests differ, and small ones do not show which is the outlier: both are named."""
    runs = [run for k, run in enumerate(fitted.runs) if k not in (2, 3, 6)]
    runs[3] = again(5, Fault(gain=1.3))
    screenings = fitted.screenings(runs)
    large_tests = {name: screenings[name] for name in ("rudder/4", "rudder/5")}
    (outlier,) = [name for name, screening in large_tests.items() if screening.reason]
    (accepted,) = set(large_tests) - {outlier}
    assert f"or it is {accepted}: fly both again" in large_tests[outlier].reason
    assert (
        f"or it is {outlier}, which was left out: the tests do not determine which"
        in large_tests[accepted].warnings[0]
    )
