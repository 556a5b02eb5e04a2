"""A campaign flown and fitted once, into which one run with an anomaly is flown again: found,
named, left out."""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
import pytest

from sitl.vehicle import config
from sysid import refit
from sysid.data.segments import Run
from sysid.estimation.map import fit
from sysid.estimation.map.datasets import with_coupling_inputs
from sysid.estimation.map.fit import Fit, Prior
from sysid.screening import RunScreening
from sysid.screening.outlier_tests import find_outliers
from sysid.screening.refit_loop import refit_until_clean
from tests.sysid import sea
from tests.sysid.sea import Fault

SIZES_DEG = (3.0, -3.0, 5.0, -5.0, 7.0, -7.0, 9.0)
"""Of the campaign's rudder steps."""


class Fitted(NamedTuple):
    runs: list[Run]
    found: Fit
    prior: Prior

    def of(self, runs: Sequence[Run]) -> Fit:
        """The same fit with other runs in it: `sift` finds the best parameters for them by
        itself."""
        planes = {run.plane for run in runs}
        datasets = {
            p: tuple(
                with_coupling_inputs(self.found.vehicle, fit.dataset(r))
                for r in runs
                if r.plane == p
            )
            for p in sorted(planes)
        }
        return self.found._replace(datasets=datasets)

    def judged(self, runs: Sequence[Run]) -> dict[str, RunScreening]:
        return {
            screening.run: screening
            for screening in find_outliers(self.of(runs), self.prior).screenings
        }

    def left_out(self, runs: Sequence[Run]) -> set[str]:
        return {name for name, screening in self.judged(runs).items() if screening.reason}


@pytest.fixture(scope="module")
def fitted(campaign: list[Run], bench: config.VehicleConfig) -> Fitted:
    prior = refit.prior_of(campaign, bench)
    return Fitted(campaign, fit.fit(campaign, prior), prior)


@pytest.fixture(scope="module")
def again(field: config.VehicleConfig) -> Callable[..., Run]:
    def fly(k: int, fault: Fault, **sea_of: np.ndarray) -> Run:
        """The campaign's rudder test ``k`` in the same sea, with a fault."""
        trim = -math.radians(field.tailcone.rudder_bias_deg), math.radians(1.0)
        signal = sea.step(SIZES_DEG[k], 20.0)
        return sea.fly(
            field,
            "yaw",
            signal,
            name=f"rudder/{k}",
            seed=1000 + k,
            trim_rad=trim,
            fault=fault,
            **sea_of,
        )

    return fly


def test_a_clean_campaign_loses_no_run(fitted: Fitted) -> None:
    assert fitted.left_out(fitted.runs) == set()


def test_a_slip_is_named_with_its_size_and_time(fitted: Fitted, again: Callable[..., Run]) -> None:
    runs = list(fitted.runs)
    runs[3] = again(3, Fault(slip_rad=math.radians(-1.5), slip_s=8.0))
    screening = fitted.judged(runs)["rudder/3"]
    slip = screening.scores.anomalies[0]
    assert screening.reason.startswith("actuator slip: rudder jumped by -1.")
    assert abs(slip.size + 1.5) < 3.0 * slip.sd
    assert slip.sd < 0.4
    assert slip.at_s == pytest.approx(8.0, abs=2.0)
    assert fitted.left_out(runs) == {"rudder/3"}


def test_a_gain_error_is_named_or_its_next_of_kin(
    fitted: Fitted, again: Callable[..., Run]
) -> None:
    """More rudder and more speed do nearly the same to a turn; the reason says so."""
    runs = list(fitted.runs)
    runs[4] = again(4, Fault(gain=1.3))
    screening = fitted.judged(runs)["rudder/4"]
    gain = next(a for a in screening.scores.anomalies if a.kind == "gain error")
    assert "gain error: rudder moved" in screening.reason
    assert abs(gain.size - 30.0) < 3.0 * gain.sd
    assert fitted.left_out(runs) == {"rudder/4"}


def test_a_gust_is_told_from_a_slip(fitted: Fitted, again: Callable[..., Run]) -> None:
    pushed = sea.accelerations(sea.SETTLE_S + 20.0, sea.ROUGH, np.random.default_rng(3))
    time_s = np.arange(len(pushed)) / sea.RATE_HZ - sea.SETTLE_S
    pushed[:, 1] += math.radians(-1.0) * (
        (time_s > 6.0) & (time_s < 11.0)
    )  # the paper's z points up
    runs = list(fitted.runs)
    runs[1] = again(1, Fault(), sea_radps2=pushed)
    screening = fitted.judged(runs)["rudder/1"]
    gust = next(a for a in screening.scores.anomalies if a.kind == "gust")
    assert screening.reason.startswith("gust: a push of +")
    assert abs(gust.size - 1.0) < 4.0 * gust.sd
    assert gust.at_s == pytest.approx(6.0, abs=1.5)


def test_what_grows_with_size_is_structure_and_no_run_is_left_out_for_it(
    fitted: Fitted, again: Callable[..., Run]
) -> None:
    """A tail that answers the larger, the more: residuals are large in large tests, and every run
    is sound."""
    runs = list(fitted.runs)
    for k, degrees in enumerate(SIZES_DEG):
        runs[k] = again(k, Fault(gain=0.8 + 0.06 * abs(degrees)))
    result = find_outliers(fitted.of(runs), fitted.prior)
    assert [v.run for v in result.screenings if v.reason] == []
    assert any(
        text.startswith(
            "structure: the response to the largest yaw test differs from the model's by +"
        )
        for text in result.structure
    )


def test_the_largest_test_alone_is_kept_with_a_warning(
    fitted: Fitted, again: Callable[..., Run]
) -> None:
    """Without another test of its size, nobody can tell its anomaly from the model's structure."""
    runs = [run for k, run in enumerate(fitted.runs) if k not in (4, 5)]
    runs[4] = again(6, Fault(slip_rad=math.radians(2.5), slip_s=5.0))
    screening = fitted.judged(runs)["rudder/6"]
    assert screening.reason == ""
    assert screening.scores.p_value < 1e-4
    assert "no other test is as large" in screening.warnings[0]


def test_matched_runs_must_agree(fitted: Fitted, again: Callable[..., Run]) -> None:
    """Of either sign; the difference of a slipped run from its twin shows, that of clean twins does
    not."""
    runs = list(fitted.runs)
    before = fitted.judged(runs)
    assert before["rudder/2"].repeat is not None
    assert before["rudder/6"].repeat is None
    runs[2] = again(2, Fault(slip_rad=math.radians(2.0), slip_s=4.0))
    after = fitted.judged(runs)
    odd = after["rudder/2"].repeat
    assert odd is not None
    assert (
        odd.p_value
        < 0.001
        < 0.01
        < min(before[name].repeat.p_value for name in ("rudder/0", "rudder/4"))
    )  # type: ignore[union-attr]
    assert odd.anomalies[0].kind == "actuator slip"


def test_a_run_found_out_is_left_out_and_the_rest_fitted_again(
    fitted: Fitted, again: Callable[..., Run]
) -> None:
    """Once; and not at all where nothing was found."""
    runs, fits = list(fitted.runs), list[list[str]]()

    def fit_runs(chosen: Sequence[Run]) -> Fit:
        fits.append([run.name for run in chosen])
        return fitted.of(chosen)

    refitted = refit_until_clean(runs, fitted.prior, fit_runs)
    assert (len(fits), refitted.fit_of_all_runs, len(refitted.accepted_runs)) == (
        1,
        None,
        len(runs),
    )
    runs[3] = again(3, Fault(slip_rad=math.radians(1.5), slip_s=8.0))
    refitted = refit_until_clean(runs, fitted.prior, fit_runs)
    assert len(fits) == 3
    assert refitted.fit_of_all_runs is not None
    assert "rudder/3" not in fits[-1]
    assert [run.name for run in refitted.accepted_runs] == fits[-1]
    assert refitted.screenings["rudder/3"].reason
    assert set(refitted.screenings) == {run.name for run in runs}


def test_a_plane_keeps_what_a_fit_needs(fitted: Fitted, again: Callable[..., Run]) -> None:
    """Two runs are never parted: nothing says which of them is the odd one."""
    pair = [fitted.runs[2], again(3, Fault(slip_rad=math.radians(3.0), slip_s=5.0))]
    screenings = fitted.judged([*pair, *fitted.runs[7:]])
    assert all(not screening.reason for screening in screenings.values())
    assert screenings["rudder/3"].warnings


def test_one_of_two_is_left_out_and_the_other_is_told_of(
    fitted: Fitted, again: Callable[..., Run]
) -> None:
    """Two large tests that differ: small ones say little of which is odd, so whoever reads hears of
    both."""
    runs = [run for k, run in enumerate(fitted.runs) if k not in (2, 3, 6)]
    runs[3] = again(5, Fault(gain=1.3))
    screenings = fitted.judged(runs)
    alike = {name: screenings[name] for name in ("rudder/4", "rudder/5")}
    (out,) = [name for name, screening in alike.items() if screening.reason]
    (kept,) = set(alike) - {out}
    assert f"or it is {kept}: fly both again" in alike[out].reason
    assert (
        f"or it is {out}, which was left out: the tests do not determine which"
        in alike[kept].warnings[0]
    )
