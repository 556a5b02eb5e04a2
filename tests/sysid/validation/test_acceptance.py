"""Acceptance: a good model passes every criterion, and one defect fails its criterion by name."""

from collections.abc import Callable
from typing import Any

import msgspec
import numpy as np
import pytest

from sitl.vehicle import config
from sysid.data.runs import Run
from sysid.estimation.map import model_error
from sysid.models.model_file import (
    IdentifiedModel,
    ParameterCovariance,
    ParameterEstimate,
    ScreenedRun,
)
from sysid.planes import PLANES, Plane
from sysid.validation.acceptance import OFF_BY, PHASE_CHECK, PHASE_DEG, assess, format_check
from sysid.validation.assess import with_assessment
from sysid.validation.results import (
    AcceptanceCheck,
    Correction,
    FrequencyComparison,
    PlaneValidation,
    StructureError,
)
from sysid.validation.validate import validate
from tests.sysid import sea
from tests.sysid.estimation.map.test_fit import TRIM

replace = msgspec.structs.replace
ModelChange = Callable[[IdentifiedModel], IdentifiedModel]


@pytest.fixture(scope="module")
def held_out(field: config.VehicleConfig) -> list[Run]:
    tests: list[tuple[Plane, Any]] = [
        (Plane.YAW, sea.doublet(5.0, 4.0)),
        (Plane.YAW, sea.doublet(-4.0, 2.5)),
        (Plane.YAW, sea.doublet(6.0, 3.0)),
        (Plane.PITCH, sea.doublet(4.0, 2.5)),
        (Plane.PITCH, sea.doublet(-3.0, 2.5)),
        (Plane.PITCH, sea.doublet(5.0, 3.0)),
    ]
    return [
        sea.fly(field, plane, signal, name=f"held/{k}", wave="doublet", seed=700 + k, trim_rad=TRIM)
        for k, (plane, signal) in enumerate(tests)
    ]


@pytest.fixture(scope="module")
def good_model(model: IdentifiedModel, campaign: list[Run], held_out: list[Run]) -> IdentifiedModel:
    return with_assessment(model, campaign, held_out)


def test_assess_good_model_is_accepted(good_model: IdentifiedModel) -> None:
    assert good_model.assessment is not None
    assert good_model.assessment.fit_for_redesign, good_model.assessment.reasons
    assert good_model.assessment.reasons == ()
    assert good_model.assessment.next_test is not None
    for plane in PLANES:
        excess = good_model.validation[plane].held_out
        assert excess is not None
        assert excess.new_types == 3
        assert excess.floor_deg2ps2 is not None
        assert excess.model_mse_deg2ps2 < excess.floor_deg2ps2 + 3.0 * (
            excess.excess_sd_deg2ps2 or 0.0
        )


def of_yaw(**changed: Any) -> ModelChange:
    """Return a change of the validation of the yaw plane."""
    return lambda m: replace(
        m, validation={**m.validation, Plane.YAW: replace(m.validation[Plane.YAW], **changed)}
    )


def within_yaw(part: str, **changed: Any) -> ModelChange:
    return lambda m: of_yaw(**{part: replace(getattr(m.validation[Plane.YAW], part), **changed)})(m)


def planes(**changed: Any) -> ModelChange:
    return lambda m: replace(
        m, planes={**m.planes, Plane.YAW: replace(m.planes[Plane.YAW], **changed)}
    )


def without_correlation(m: IdentifiedModel) -> IdentifiedModel:
    """Replace the covariance by one without correlations: 30 % for every number."""
    names = m.design[Plane.YAW].names
    rows = tuple(
        tuple((0.3 * abs(getattr(m.planes[Plane.YAW], n).value)) ** 2 * (n == o) for o in names)
        for n in names
    )
    return replace(m, design={**m.design, "yaw": ParameterCovariance(names, rows)})


def without_runs(kind: bool) -> ModelChange:
    def change(m: IdentifiedModel) -> IdentifiedModel:
        yaw = m.validation[Plane.YAW]
        remaining = tuple(run for run in yaw.runs if run.held_out != kind)
        return of_yaw(runs=remaining, held_out=None if kind else yaw.held_out)(m)

    return change


CHANGES: dict[str, ModelChange] = {
    "other starts that end elsewhere": lambda m: replace(
        m, convergence=replace(m.convergence, start_costs=(m.convergence.cost * 1.02,))
    ),
    "values at a bound": lambda m: replace(
        m, convergence=replace(m.convergence, at_bounds=("Y_v",))
    ),
    "failures of the fit": lambda m: replace(
        m,
        convergence=replace(m.convergence, failures=("failures of the fit are copied",)),
    ),
    "runs fitted": without_runs(kind=False),
    "runs held out": without_runs(kind=True),
    "b1, 1 sd": planes(b1_per_s2=ParameterEstimate(0.5, 0.11)),
    "b1, insensitivity": without_correlation,
    "gain at crossover, 1 sd": within_yaw("crossover", gain_sd_db=1.2),
    "phase at crossover, 1 sd": within_yaw("crossover", phase_sd_deg=6.0),
    "coherence about crossover": of_yaw(coherence_at_crossover=0.4),
    "mismatch of the response": of_yaw(
        frequency_response=FrequencyComparison(
            (), (1.0,), (1.0,), (0.0,), (0.0,), (0.1,), (0.1,), (0.0,), (0.0,), 140.0
        )
    ),
    "held-out error over the prior's": lambda m: within_yaw(
        "held_out",
        model_mse_deg2ps2=m.validation[Plane.YAW].held_out.prior_mse_deg2ps2 * 3.0,  # type: ignore[union-attr]
    )(m),
    "Theil's coefficient": lambda m: within_yaw(
        "held_out",
        theil=replace(m.validation[Plane.YAW].held_out.theil, coefficient=0.3),  # type: ignore[union-attr]
    )(m),
    "gain at crossover by held-out runs, off by": of_yaw(
        correction=Correction(-1.1, 0.2, 0.0, 0.5)
    ),
    "gain at crossover by held-out runs, 1 sd": of_yaw(correction=Correction(0.0, 0.6, 0.0, 0.5)),
    "phase at crossover by held-out runs, off by": of_yaw(
        correction=Correction(0.0, 0.2, 5.5, 0.5)
    ),
    "phase at crossover by held-out runs, 1 sd": of_yaw(correction=Correction(0.0, 0.2, 0.0, 2.6)),
}


@pytest.mark.parametrize("name", CHANGES)
def test_assess_each_criterion_can_fail(name: str, good_model: IdentifiedModel) -> None:
    assert good_model.assessment is not None
    failed_before = {check.name for check in good_model.assessment.checks if not check.passed}
    changed = CHANGES[name](good_model)
    assessment = assess(changed, changed.validation)
    assert not assessment.fit_for_redesign
    newly_failed = [
        check for check in assessment.checks if not check.passed and check.name not in failed_before
    ]
    assert [
        check.name for check in newly_failed if check.required and check.name.startswith(name)
    ], newly_failed
    assert any(name in reason for reason in assessment.reasons)


@pytest.mark.parametrize(
    ("phase_deg", "own_sd_deg", "structure_deg", "passes"),
    [
        (5.5, 0.5, 0.4, False),  # the model claims an error of 0.5 deg, and the tests show more
        (5.5, 2.2, 2.0, True),  # most likely error 2.7 deg
        (8.0, 2.2, 2.0, False),  # beyond 1.96 standard deviations of the difference
        (5.5, 2.2, 0.0, False),  # noise explains a difference of 4.7 deg
        (9.0, 4.9, 4.8, True),  # most likely error 4.5 deg
        (11.0, 4.9, 4.8, False),  # it agrees, but the most likely error is 5.5 deg
    ],
)
def test_correction_is_judged_with_the_uncertainty_of_both_fits(
    phase_deg: float,
    own_sd_deg: float,
    structure_deg: float,
    passes: bool,
    good_model: IdentifiedModel,
) -> None:
    changed = within_yaw("crossover", phase_sd_deg=own_sd_deg)(good_model)
    changed = of_yaw(
        correction=Correction(0.0, 0.2, -phase_deg, 1.0),
        model_error=StructureError(b1_percent=1.0, gain_db=0.1, phase_deg=structure_deg),
    )(changed)
    (check,) = (
        check
        for check in assess(changed, changed.validation).checks
        if (check.name, check.plane) == (f"{PHASE_CHECK}{OFF_BY}", Plane.YAW)
    )
    assert check.passed == passes
    assert check.limit >= PHASE_DEG


def test_assess_delay_without_variance_is_held_fixed(good_model: IdentifiedModel) -> None:
    """A delay at its limit of zero has no variance; the insensitivity of b1 holds it fixed.

    Regression: the correlation matrix held 0/0, and LinAlgError was raised.
    """
    names, rows = (
        good_model.design[Plane.YAW].names,
        [list(row) for row in good_model.design[Plane.YAW].matrix],
    )
    index = names.index("delay_s")
    for k in range(len(names)):
        rows[index][k] = rows[k][index] = 0.0
    covariance = ParameterCovariance(names, tuple(map(tuple, rows)))
    clipped = replace(good_model, design={**good_model.design, "yaw": covariance})
    with np.errstate(all="raise"):
        assessment = assess(clipped, clipped.validation)
    check = next(
        candidate
        for candidate in assessment.checks
        if (candidate.name, candidate.plane) == ("b1, insensitivity", "yaw")
    )
    assert check.value is not None
    assert 0.0 < check.value < 20.0


@pytest.mark.parametrize("value", [0.0, float("nan")])
def test_assess_b1_without_finite_variance_fails(value: float, good_model: IdentifiedModel) -> None:
    names, rows = (
        good_model.design[Plane.YAW].names,
        [list(row) for row in good_model.design[Plane.YAW].matrix],
    )
    index = names.index("b1_per_s2")
    rows[index][index] = value
    changed = replace(
        good_model,
        design={**good_model.design, "yaw": ParameterCovariance(names, tuple(map(tuple, rows)))},
    )
    assessment = assess(changed, changed.validation)
    assert "yaw: b1, insensitivity not known, at most 10 %" in assessment.reasons


def test_assess_all_required_criteria_are_tested(good_model: IdentifiedModel) -> None:
    assert good_model.assessment is not None
    required = {check.name for check in good_model.assessment.checks if check.required}
    assert {
        name for name in required if not any(name.startswith(tried) for tried in CHANGES)
    } == set()


@pytest.mark.parametrize(("lost", "left"), [("pitch", "yaw"), ("yaw", "pitch")])
def test_assess_one_plane_alone_has_own_verdict(
    lost: str, left: str, good_model: IdentifiedModel
) -> None:
    """Without tests of one plane the model fails as a whole, and the other plane passes."""
    validation = {Plane(left): good_model.validation[Plane(left)]}
    assessment = assess(good_model, validation)
    assert not assessment.fit_for_redesign
    verdict = assessment.planes[Plane(left)]
    assert (verdict.tested, verdict.fit_for_redesign, verdict.reasons) == (True, True, ())
    untested = assessment.planes[Plane(lost)]
    assert (untested.tested, untested.fit_for_redesign) == (False, False)
    assert "test was fitted: the" in untested.reasons[0]


def test_assess_failure_of_the_fit_fails_both_planes(good_model: IdentifiedModel) -> None:
    failed = replace(
        good_model, convergence=replace(good_model.convergence, failures=("it did not converge",))
    )
    verdicts = assess(failed, failed.validation).planes
    assert [v.fit_for_redesign for v in verdicts.values()] == [False, False]
    assert all(v.reasons == ("it did not converge",) for v in verdicts.values())


def test_assess_unknown_value_fails(good_model: IdentifiedModel) -> None:
    changed = planes(b1_per_s2=ParameterEstimate(0.5, None))(good_model)
    assessment = assess(changed, changed.validation)
    assert not assessment.fit_for_redesign
    assert assessment.reasons == ("yaw: b1, 1 sd not known, at most 20 %",)


@pytest.mark.parametrize(("name", "unit"), [("delay_s", "s"), ("p_slow_per_s", "1/s")])
def test_assess_number_near_zero_has_limit_in_its_unit(
    name: str, unit: str, good_model: IdentifiedModel
) -> None:
    """A campaign recommended its next test for "delay, 1 sd 3.43e+04 %, at most 20 %"."""
    crossover = good_model.validation[Plane.YAW].crossover
    assert crossover is not None
    phase_rad, w = np.radians(5.0), crossover.crossover_radps
    limit = phase_rad * w if unit == "1/s" else phase_rad / w
    for sd, passes in ((0.9 * limit, True), (1.1 * limit, False)):
        changed = planes(**{name: ParameterEstimate(1e-6, sd)})(good_model)
        checks = assess(changed, changed.validation).checks
        label = f"{name.rpartition('_per_')[0] or 'delay'}, 1 sd".replace("_", " ")
        check = next(c for c in checks if (c.name, c.plane) == (label, Plane.YAW))
        assert (check.value, check.unit, check.passed) == (sd, unit, passes)
        assert check.limit == pytest.approx(limit)
        assert not check.required


def test_assess_next_test_is_not_for_whiteness(good_model: IdentifiedModel) -> None:
    """Another test does not make innovations white; a campaign flew three, all for nothing."""
    changed = within_yaw("held_out", whiteness_p=1e-9)(good_model)
    next_test = assess(changed, changed.validation).next_test
    assert next_test is not None
    assert "whiteness" not in next_test.reason


PRIOR_IS_WRONG = "N_v at a bound, 5 prior standard deviations away: the prior is wrong"
ADMIT_TWO = "1 of 2 other starts end elsewhere: the tests admit more than one vehicle"


def test_assess_wrong_prior_recommends_no_test(good_model: IdentifiedModel) -> None:
    """A campaign of micro_3kg flew four tests for "every check is passed", and failed."""
    convergence = replace(
        good_model.convergence, at_bounds=("N_v",), failures=(PRIOR_IS_WRONG, ADMIT_TWO)
    )
    failed = replace(good_model, convergence=convergence)
    assessment = assess(failed, failed.validation)
    assert assessment.next_test is None
    assert assessment.obstacle == PRIOR_IS_WRONG


def test_assess_failure_that_tests_mend_is_the_reason_of_the_test(
    good_model: IdentifiedModel,
) -> None:
    failed = replace(good_model, convergence=replace(good_model.convergence, failures=(ADMIT_TWO,)))
    assessment = assess(failed, failed.validation)
    assert assessment.obstacle == ""
    assert assessment.next_test is not None
    assert assessment.next_test.reason == ADMIT_TWO
    dispersed = CHANGES["other starts that end elsewhere"](good_model)
    next_test = assess(dispersed, dispersed.validation).next_test
    assert next_test is not None
    assert next_test.reason == "other starts that end elsewhere 100 %, at most 50 %"


@pytest.mark.parametrize(
    ("reason", "remedy"),
    [
        ("cross-plane coupling: pitch moved 4.4 deg, at most 3.0", "; a vehicle that heels moves"),
        ("saturated", "; find its cause"),
    ],
)
def test_assess_chirps_that_are_all_left_out_recommend_no_further_one(
    reason: str, remedy: str, good_model: IdentifiedModel
) -> None:
    """A campaign of a heeling vehicle flew five dives of chirps that the screening left out."""
    chirp = ScreenedRun(
        "sweeps/1", Plane.YAW, "chirp", 3.0, 30.0, accepted=False, reasons=(reason,)
    )
    unknown = of_yaw(coherence_at_crossover=None)(good_model)
    first, second = (replace(unknown, screening=(chirp,) * count) for count in (4, 8))
    assert assess(first, first.validation).next_test is not None
    assessment = assess(second, second.validation)
    assert assessment.next_test is None
    assert assessment.obstacle.startswith(
        "yaw: coherence about crossover not known, at least 0.6: all 8 chirps of the rudder were"
        f" left out, the last one for {reason}{remedy}"
    )


def test_assess_next_test_addresses_worst_criterion(good_model: IdentifiedModel) -> None:
    without_coherence = of_yaw(coherence_at_crossover=None)(good_model)
    next_test = assess(without_coherence, without_coherence.validation).next_test
    assert next_test is not None
    assert (next_test.plane, next_test.signal) == ("yaw", "chirp")
    without_held_out = without_runs(kind=True)(good_model)
    next_test = assess(without_held_out, without_held_out.validation).next_test
    assert next_test is not None
    assert next_test.signal == "3211"
    assert "runs held out" in next_test.reason


def test_assess_contradicted_model_asks_for_tests_to_be_fitted(good_model: IdentifiedModel) -> None:
    """More held-out tests change a model that they know to be wrong as little as the first ones."""
    sure = Correction(gain_db=-1.6, gain_sd_db=0.4, phase_deg=0.0, phase_sd_deg=1.0)
    changed = of_yaw(correction=sure)(good_model)
    next_test = assess(changed, changed.validation).next_test
    assert next_test is not None
    assert "off by 1.6 dB" in next_test.reason
    assert next_test.signal == "chirp"
    unsure = replace(sure, gain_sd_db=0.7)
    changed = of_yaw(correction=unsure)(good_model)
    next_test = assess(changed, changed.validation).next_test
    assert next_test is not None
    assert next_test.signal == "3211"


def test_assess_contradiction_that_more_chirps_left_asks_for_held_out_tests(
    good_model: IdentifiedModel,
) -> None:
    """The held-out tests may be at fault: they began in motion, or are few."""
    chirp = ScreenedRun("sweeps/1", Plane.YAW, "chirp", 3.0, 30.0, True, ())
    held_out = replace(chirp, run="heldout/1", wave="3211")
    sure = Correction(gain_db=-1.6, gain_sd_db=0.4, phase_deg=0.0, phase_sd_deg=1.0)
    for chirps, tests, signal in ((4, 7, "chirp"), (8, 7, "3211")):
        changed = replace(
            of_yaw(correction=sure)(good_model),
            screening=(chirp,) * chirps,
            held_out_screening=(held_out,) * tests,
        )
        next_test = assess(changed, changed.validation).next_test
        assert next_test is not None
        assert next_test.signal == signal


@pytest.mark.parametrize(("excess_over_floor", "signal"), [(0.0, "3211"), (3.0, "chirp")])
def test_assess_theil_coefficient_by_noise_asks_for_held_out_tests(
    good_model: IdentifiedModel, excess_over_floor: float, signal: str
) -> None:
    excess = good_model.validation[Plane.YAW].held_out
    assert excess is not None
    assert excess.floor_deg2ps2 is not None
    changed = within_yaw(
        "held_out",
        theil=replace(excess.theil, coefficient=0.4),
        model_excess_deg2ps2=excess_over_floor * excess.floor_deg2ps2,
    )(good_model)
    next_test = assess(changed, changed.validation).next_test
    assert next_test is not None
    assert "Theil" in next_test.reason
    assert next_test.signal == signal


def test_assess_paper_method_is_rejected(
    campaign: list[Run], held_out: list[Run], bench: config.VehicleConfig
) -> None:
    from sysid import refit

    paper_model = with_assessment(
        refit.identify(campaign, bench, method="paper"), campaign, held_out, prior=bench
    )
    assert paper_model.assessment is not None
    assert not paper_model.assessment.fit_for_redesign
    assert any("not known" in reason for reason in paper_model.assessment.reasons)
    assert paper_model.validation[Plane.YAW].frequency_response is not None


def test_format_check_gives_one_line() -> None:
    check = AcceptanceCheck(
        "b1, 1 sd", Plane.YAW, 25.0, 20.0, "at most", "%", passed=False, required=True
    )
    assert format_check(check) == "yaw: b1, 1 sd 25 %, at most 20 %"
    assert (
        format_check(replace(check, value=None, plane=None, unit=""))
        == "b1, 1 sd not known, at most 20"
    )


def test_validation_json_round_trip(good_model: IdentifiedModel) -> None:
    raw = msgspec.json.encode(good_model.validation)
    assert msgspec.json.decode(raw, type=dict[str, PlaneValidation]) == good_model.validation


def with_phase_sd(
    model: IdentifiedModel, by_model_error_deg: float, without_run: float = 0.09
) -> IdentifiedModel:
    """Return the model with a phase error of 5.5 deg in yaw, of which the model error is a part."""
    error = StructureError(b1_percent=3.0, gain_db=0.3, phase_deg=by_model_error_deg)
    changed = of_yaw(model_error=error)(within_yaw("crossover", phase_sd_deg=5.5)(model))
    joint = replace(
        changed.joint, run_scatter=0.1, deviating_run="chirps/2", run_scatter_without=without_run
    )
    return replace(changed, joint=joint)


def test_assess_model_error_above_limit_recommends_no_test(good_model: IdentifiedModel) -> None:
    """The error of the model structure does not shrink with the number of tests."""
    changed = with_phase_sd(good_model, 5.2)
    assessment = assess(changed, changed.validation)
    assert not assessment.fit_for_redesign
    assert assessment.next_test is None
    assert assessment.obstacle.startswith(
        "yaw: phase at crossover, 1 sd 5.5 deg, at most 5 deg: 5.2"
    )
    assert "no single test stands out" in assessment.obstacle


def test_assess_model_error_by_one_run_names_it(good_model: IdentifiedModel) -> None:
    changed = with_phase_sd(good_model, 5.2, without_run=0.02)
    assert "test chirps/2 deviates most" in assess(changed, changed.validation).obstacle


def test_assess_model_error_by_the_prior_alone_names_no_test(good_model: IdentifiedModel) -> None:
    changed = with_phase_sd(good_model, 5.2)
    joint = replace(
        changed.joint,
        run_scatter=0.0,
        deviating_run="",
        run_scatter_without=0.0,
        prior_conflict=0.5,
    )
    changed = replace(changed, joint=joint)
    obstacle = assess(changed, changed.validation).obstacle
    assert "further from the prior than its uncertainty allows; no single test" in obstacle


def test_assess_model_error_below_limit_recommends_a_test(good_model: IdentifiedModel) -> None:
    changed = with_phase_sd(good_model, 4.0)
    assessment = assess(changed, changed.validation)
    assert assessment.next_test is not None
    assert assessment.obstacle == ""


def test_validate_model_error_alone_is_less_than_the_whole(
    good_model: IdentifiedModel, campaign: list[Run], held_out: list[Run]
) -> None:
    assert good_model.joint.run_scatter == 0.0
    assert good_model.validation[Plane.YAW].model_error is None
    covariance = np.array(good_model.joint.covariance) + model_error.structure_covariance(0.1, 0.3)
    joint = replace(
        good_model.joint,
        run_scatter=0.1,
        prior_conflict=0.3,
        covariance=tuple(map(tuple, covariance.tolist())),
    )
    validated = validate(replace(good_model, joint=joint), campaign, held_out)
    for plane in Plane:
        error, crossover = validated[plane].model_error, validated[plane].crossover
        assert error is not None
        assert crossover is not None
        assert error.gain_db is not None
        assert error.phase_deg is not None
        assert 0.5 * (crossover.gain_sd_db or 0.0) < error.gain_db < (crossover.gain_sd_db or 0.0)
        assert 0.0 < error.phase_deg < (crossover.phase_sd_deg or 0.0)
