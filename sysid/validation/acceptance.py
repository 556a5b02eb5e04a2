"""Acceptance of a model for control design: criteria with limits, and the most useful next test.

Sources of the limits: Cramer-Rao bounds below 20 % and insensitivities below 10 % of a value,
coherence above 0.6 and mismatch cost below 100 (Tischler and Remple 2006, chapters 7, 11 and 12);
Theil's coefficient below 0.25 (Jategaonkar 2015, chapter 11). Gain and phase at crossover must be
known to 1 dB and 5 degrees, a sixth of the smallest margins that a redesign aims at.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Literal

import numpy as np

from sysid.data.events import TestWave
from sysid.estimation.map.convergence import MAX_SHARE_ELSEWHERE, MENDED_BY_TESTS, SearchCosts
from sysid.models.model_file import IdentifiedModel, PlaneModel
from sysid.planes import PLANES, Plane
from sysid.screening.cross_plane import COUPLING
from sysid.validation.results import (
    AcceptanceCheck,
    Excess,
    ModelAssessment,
    NextTest,
    PlaneValidation,
    PlaneVerdict,
)

Sense = Literal["at most", "at least"]

CRAMER_RAO_PERCENT, INSENSITIVITY_PERCENT = 20.0, 10.0
"""Largest standard deviation and largest insensitivity of a number, in percent of its value."""
GAIN_DB, PHASE_DEG = 1.0, 5.0
"""Largest error of gain (dB) and phase (deg) at crossover, one standard deviation."""
THEIL, COHERENCE, MISMATCH = 0.25, 0.6, 100.0
"""Largest Theil coefficient, smallest coherence about crossover, largest mismatch cost."""
WHITE_P = 0.01
"""Smallest p value of the whiteness test of held-out innovations."""
MAX_EXCESS_OVER_FLOOR = 0.2
"""Largest excess of the held-out mean squared error over the noise floor, over the floor."""
AGREEMENT_SD = 1.96
"""Largest difference of two estimates that agree, in its standard deviations (95 %)."""
CONFIDENCE_SD = 1.645
"""Standard deviations added to a limit, so that a value at the limit passes with 95 %."""
DECISIVE_NUMBER = "b1_per_s2"
"""Number that a model must know: the bandwidth of any loop depends on it.

The other numbers count by their effect on gain and phase at crossover. The relative error of a
delay near zero, or of a pole near zero, is large without effect on a loop.
"""
OTHER_NUMBERS = ("static_gain_per_s", "p_fast_per_s", "p_slow_per_s", "delay_s")
"""Numbers whose precision is reported and not required."""
NEAR_ZERO_UNITS = {"delay_s": "s", "p_slow_per_s": "1/s"}
"""Units of the numbers that may be near zero, where a percentage of the value means nothing."""
WAVE_FOR_DYNAMICS, WAVE_FOR_GAIN, WAVE_TO_HOLD_OUT = "chirp", "step", "3211"
"""Recommended signals: for dynamics about crossover, for slow numbers, for a held-out run."""
SLOW_NUMBERS = ("static gain", "p slow")
"""Beginnings of the names of criteria about slow numbers."""
LONG_S, SHORT_S = 30.0, 20.0
"""Recommended durations of a test, s."""
FAILURES_CHECK = "failures of the fit"
"""Name of the criterion that counts the failures of the fit."""
FITTED_CHECK = "runs fitted"
"""Name of the criterion that counts the fitted runs of a plane."""
MODEL_ERROR_OF_CHECK = {
    f"{DECISIVE_NUMBER.removesuffix('_per_s2')}, 1 sd": "b1_percent",
    "gain at crossover, 1 sd": "gain_db",
    "phase at crossover, 1 sd": "phase_deg",
}
"""Field of `StructureError` by the criterion whose value contains it."""
RATIO_CHECK, THEIL_CHECK = "held-out error over the prior's", "Theil's coefficient, held out"
FLOOR_CHECK = "held-out error above sea and sensors"
"""Names of the criteria of the error on held-out runs."""
GAIN_CHECK, PHASE_CHECK = (f"{name} at crossover by held-out runs, " for name in ("gain", "phase"))
OFF_BY = "off by"
"""Names of the criteria of the correction by held-out runs; the others end with "1 sd"."""
WHITENESS_CHECK = "whiteness of held-out innovations, p"
"""Name of the criterion of the innovations."""
STANDS_OUT = 0.5
"""Largest scatter without a test, over that with it, at which this test is named as the cause."""
MIN_LEFT_OUT = 8
"""Number of chirps, all of them left out, after which more are of no use: two dives of four."""
DEFAULT_SIZE_DEG = 4.0
"""Recommended magnitude if no run of the plane was accepted, deg."""


def assess(model: IdentifiedModel, validation: Mapping[Plane, PlaneValidation]) -> ModelAssessment:
    """Assess a model by all criteria.

    Parameters
    ----------
    model : IdentifiedModel
        Model with its convergence and covariances.
    validation : mapping of plane to PlaneValidation
        Validation results of each plane that has runs.

    Returns
    -------
    ModelAssessment
        Whether the model may be used for redesign, the criteria, and the recommended next test.

    Notes
    -----
    The decision requires every criterion with ``required``; the others are reported only.
    """
    checks = (
        *_of_fit(model),
        *(check for plane in Plane for check in _of_plane(model, plane, validation.get(plane))),
    )
    failed_checks = [check for check in checks if check.required and not check.passed]
    obstacle = _obstacle(model, validation, failed_checks)
    return ModelAssessment(
        fit_for_redesign=not failed_checks,
        reasons=_describe_failures(model, failed_checks),
        checks=checks,
        next_test=None if obstacle else _next_test(model, failed_checks, checks),
        planes={plane: _verdict(plane, model, checks) for plane in Plane},
        obstacle=obstacle,
    )


def _obstacle(
    model: IdentifiedModel,
    validation: Mapping[Plane, PlaneValidation],
    failed_checks: Sequence[AcceptanceCheck],
) -> str:
    """Return why no test can make the model fit, and what can; empty otherwise.

    No test mends a wrong prior or logs of two vehicles. The error of the model structure does not
    become smaller with the number of tests: where it alone exceeds a limit, they are of no use. Nor
    are further chirps where the screening leaves all of them out.
    """
    unmended = [
        failure
        for failure in model.convergence.failures
        if not any(part in failure for part in MENDED_BY_TESTS)
    ]
    if unmended:
        return "; ".join(unmended)
    for check in failed_checks:
        plane_validation = validation.get(check.plane) if check.plane else None
        error = plane_validation.model_error if plane_validation else None
        part = getattr(error, MODEL_ERROR_OF_CHECK.get(check.name, ""), None)
        if part is not None and part > check.limit:
            return f"{format_check(check)}: {_model_error(model, check, part)}"
        if check.plane and check.value is None and (cause := _left_out(model, check.plane)):
            return f"{format_check(check)}: {cause}"
    return ""


def _left_out(model: IdentifiedModel, plane: Plane) -> str:
    """Return why the chirps of a plane are left out, if all of several are; empty otherwise."""
    chirps = [
        run for run in model.screening if run.plane == plane and run.wave == WAVE_FOR_DYNAMICS
    ]
    if len(chirps) < MIN_LEFT_OUT or any(run.accepted for run in chirps):
        return ""
    cause = chirps[-1].reasons[0]
    remedy = (
        "a vehicle that heels moves both planes: balance it"
        if COUPLING in cause
        else "find its cause"
    )
    return (
        f"all {len(chirps)} chirps of the {PLANES[plane].surface} were left out, the last one for"
        f" {cause}; {remedy}"
    )


def _model_error(model: IdentifiedModel, check: AcceptanceCheck, part: float) -> str:
    """Return the cause of a model error, and what can lower it."""
    joint = model.joint
    signs = []
    if joint.run_scatter > 0.0:
        signs.append(
            f"the tests disagree by {joint.run_scatter:.2g} prior standard deviations beyond noise"
        )
    if joint.prior_conflict > 0.0:
        signs.append("the parameters lie further from the prior than its uncertainty allows")
    cause = (
        f"the test {joint.deviating_run} deviates most, without it they disagree by"
        f" {joint.run_scatter_without:.2g}: look for its cause, or refit without it"
        if joint.deviating_run and joint.run_scatter_without <= STANDS_OUT * joint.run_scatter
        else "no single test stands out: replace the largest tests by smaller ones"
    )
    return (
        f"{part:.3g} {check.unit} of it is error of the model structure, which more tests of this"
        f" kind do not lower; {' and '.join(signs)}; {cause}, and check the values of the vehicle"
        " file (`ground bench-test`, `ground inclining-test`)"
    )


def _verdict(
    plane: Plane, model: IdentifiedModel, checks: Sequence[AcceptanceCheck]
) -> PlaneVerdict:
    """Return the decision about one plane."""
    fitted = next(c.value for c in checks if c.plane == plane and c.name == FITTED_CHECK)
    if not fitted:
        surface = PLANES[plane].surface
        reason = f"no {surface} test was fitted: the {plane} numbers are the prior's"
        return PlaneVerdict(tested=False, fit_for_redesign=False, reasons=(reason,))
    failed_checks = [
        check
        for check in checks
        if check.plane in (None, plane) and check.required and not check.passed
    ]
    return PlaneVerdict(
        tested=True,
        fit_for_redesign=not failed_checks,
        reasons=_describe_failures(model, failed_checks),
    )


def _describe_failures(
    model: IdentifiedModel, failed_checks: Sequence[AcceptanceCheck]
) -> tuple[str, ...]:
    """Return the failures of the fit, and each failed criterion in one line."""
    return (
        *model.convergence.failures,
        *(format_check(check) for check in failed_checks if check.name != FAILURES_CHECK),
    )


def format_check(check: AcceptanceCheck) -> str:
    """Format a criterion in one line: plane, name, value and limit.

    Parameters
    ----------
    check : AcceptanceCheck
        Criterion.

    Returns
    -------
    str
        For example "yaw: b1, 1 sd 25 %, at most 20 %".
    """
    prefix = f"{check.plane}: " if check.plane else ""
    unit = check.unit and f" {check.unit}"
    value = "not known" if check.value is None else f"{check.value:.3g}{unit}"
    return f"{prefix}{check.name} {value}, {check.sense} {check.limit:.3g}{unit}"


def _check(
    name: str,
    plane: Plane | None,
    value: float | None,
    sense: Sense,
    limit: float,
    unit: str = "",
    *,
    required: bool = True,
) -> AcceptanceCheck:
    """Evaluate a criterion; it fails if its value is unknown."""
    passed = value is not None and (value <= limit if sense == "at most" else value >= limit)
    return AcceptanceCheck(
        name=name,
        plane=plane,
        value=value,
        limit=limit,
        sense=sense,
        unit=unit,
        passed=passed,
        required=required,
    )


def _of_fit(model: IdentifiedModel) -> Iterator[AcceptanceCheck]:
    """Yield the criteria of the fit as a whole."""
    convergence = model.convergence
    costs = SearchCosts(convergence.cost, convergence.start_costs)
    yield _check(
        "other starts that end elsewhere",
        None,
        100.0 * costs.elsewhere / len(costs.others) if costs.others else None,
        "at most",
        100.0 * MAX_SHARE_ELSEWHERE,
        "%",
    )
    yield _check("values at a bound", None, float(len(convergence.at_bounds)), "at most", 0.0)
    yield _check(FAILURES_CHECK, None, float(len(convergence.failures)), "at most", 0.0)


def _of_plane(
    model: IdentifiedModel, plane: Plane, validation: PlaneValidation | None
) -> Iterator[AcceptanceCheck]:
    """Yield the criteria of one plane.

    Without fitted or held-out runs, the criteria that need them are left out.
    """
    fitted = sum(not run.held_out for run in validation.runs) if validation else 0
    yield _check(FITTED_CHECK, plane, float(fitted), "at least", 1.0)
    if validation and fitted:
        yield from _precision(model, plane, validation)
        yield from _response(plane, validation)
    held_out = len(validation.runs) - fitted if validation else 0
    yield _check("runs held out", plane, float(held_out), "at least", 1.0)
    if validation and validation.held_out:
        yield from _held_out(plane, validation.held_out, validation)


def _response(plane: Plane, validation: PlaneValidation) -> Iterator[AcceptanceCheck]:
    """Yield the criteria of the response at crossover."""
    crossover = validation.crossover
    gain_sd_db, phase_sd_deg = (
        (crossover.gain_sd_db, crossover.phase_sd_deg) if crossover else (None, None)
    )
    yield _check("gain at crossover, 1 sd", plane, gain_sd_db, "at most", GAIN_DB, "dB")
    yield _check("phase at crossover, 1 sd", plane, phase_sd_deg, "at most", PHASE_DEG, "deg")
    yield _check(
        "coherence about crossover", plane, validation.coherence_at_crossover, "at least", COHERENCE
    )
    cost = validation.frequency_response.mismatch_cost if validation.frequency_response else None
    yield _check("mismatch of the response", plane, cost, "at most", MISMATCH)


def _precision(
    model: IdentifiedModel, plane: Plane, validation: PlaneValidation
) -> Iterator[AcceptanceCheck]:
    """Yield the criteria of the standard deviations of the plane's numbers."""
    plane_model = model.planes[plane]
    for name in (DECISIVE_NUMBER, *OTHER_NUMBERS):
        if name in NEAR_ZERO_UNITS:
            yield _absolute_precision(plane_model, plane, name, validation)
            continue
        sd_percent = _cramer_rao_percent(plane_model, name)
        is_decisive = name == DECISIVE_NUMBER
        yield _check(
            f"{_label(name)}, 1 sd",
            plane,
            sd_percent,
            "at most",
            CRAMER_RAO_PERCENT,
            "%",
            required=is_decisive,
        )
        if is_decisive:
            insensitivity = _insensitivity_percent(model, plane, name)
            yield _check(
                f"{_label(name)}, insensitivity",
                plane,
                insensitivity,
                "at most",
                INSENSITIVITY_PERCENT,
                "%",
            )


def _label(name: str) -> str:
    """Return the name of a number without its unit."""
    return (name.rpartition("_per_")[0] or name.removesuffix("_s")).replace("_", " ")


def _absolute_precision(
    plane_model: PlaneModel, plane: Plane, name: str, validation: PlaneValidation
) -> AcceptanceCheck:
    """Return the criterion of a number that may be near zero, in the unit of the number.

    The limit is 20 % of the value, and at least the standard deviation that changes the phase at
    the crossover w (rad/s) by `PHASE_DEG` = phi: a delay changes it by sd w, a slow pole by sd / w.
    """
    estimate = getattr(plane_model, name)
    limit = CRAMER_RAO_PERCENT / 100.0 * abs(estimate.value)
    if validation.crossover:
        crossover_radps = validation.crossover.crossover_radps
        scale = crossover_radps if name == "p_slow_per_s" else 1.0 / crossover_radps
        limit = max(limit, math.radians(PHASE_DEG) * scale)
    unit = NEAR_ZERO_UNITS[name]
    label = f"{_label(name)}, 1 sd"
    return _check(label, plane, estimate.sd, "at most", limit, unit, required=False)


def _cramer_rao_percent(plane_model: PlaneModel, name: str) -> float | None:
    """Return the standard deviation in percent of the value; None if unknown."""
    estimate = getattr(plane_model, name)
    return (
        100.0 * estimate.sd / abs(estimate.value)
        if estimate.sd is not None and estimate.value
        else None
    )


def _insensitivity_percent(model: IdentifiedModel, plane: Plane, name: str) -> float | None:
    """Insensitivity in percent of the value.

    Standard deviation with the plane's other numbers held fixed.

    With P the covariance of the plane's numbers it is 1 / sqrt((P^-1)_ii) (Tischler and Remple
    2006). Numbers without variance are at a limit (a delay of zero) and stay fixed. None if the
    variance of the number itself is unknown.
    """
    covariance = model.design.get(plane)
    if covariance is None:
        return None
    matrix = np.array(covariance.matrix)
    has_variance = np.diag(matrix) > 0.0
    i = covariance.names.index(name)
    if not (has_variance[i] and np.all(np.isfinite(matrix))):
        return None
    matrix, i = matrix[np.ix_(has_variance, has_variance)], int(np.count_nonzero(has_variance[:i]))
    sds = np.sqrt(np.diag(matrix))
    precision = np.linalg.pinv(matrix / np.outer(sds, sds), hermitian=True)[i, i]
    value = getattr(model.planes[plane], name).value
    return float(100.0 * sds[i] / math.sqrt(precision) / abs(value)) if value else None


def _held_out(
    plane: Plane, excess: Excess, validation: PlaneValidation
) -> Iterator[AcceptanceCheck]:
    """Yield the criteria of the errors on held-out runs.

    A limit on a ratio with a random error of standard deviation s is 1 + 1.645 s. Marked runs are
    of an unknown type.
    """
    error_ratio = excess.model_mse_deg2ps2 / excess.prior_mse_deg2ps2
    random_share = CONFIDENCE_SD * (excess.excess_sd_deg2ps2 or 0.0) / excess.prior_mse_deg2ps2
    yield _check(RATIO_CHECK, plane, error_ratio, "at most", 1.0 + random_share)
    yield _check(THEIL_CHECK, plane, excess.theil.coefficient, "at most", THEIL)
    yield from _by_held_out(plane, validation)
    excess_ratio, limit = None, MAX_EXCESS_OVER_FLOOR
    if excess.floor_deg2ps2 and excess.model_excess_deg2ps2 is not None:
        excess_ratio = excess.model_excess_deg2ps2 / excess.floor_deg2ps2
        limit += CONFIDENCE_SD * (excess.excess_sd_deg2ps2 or 0.0) / excess.floor_deg2ps2
    yield _check(
        FLOOR_CHECK,
        plane,
        excess_ratio,
        "at most",
        limit,
        required=False,
    )
    yield _check(
        WHITENESS_CHECK,
        plane,
        excess.whiteness_p,
        "at least",
        WHITE_P,
        required=False,
    )
    if any(run.held_out and run.wave != TestWave.MARKED for run in validation.runs):
        new_types = float(excess.new_types)
        yield _check(
            "held-out runs of a type not fitted", plane, new_types, "at least", 1.0, required=False
        )


def _by_held_out(plane: Plane, validation: PlaneValidation) -> Iterator[AcceptanceCheck]:
    """Yield the criteria of the correction of gain and phase at crossover by the held-out runs."""
    found, own, structure = validation.correction, validation.crossover, validation.model_error
    changes = (found.gain_db, found.phase_deg) if found else (None, None)
    sds = (found.gain_sd_db, found.phase_sd_deg) if found else (None, None)
    own_sds = (own.gain_sd_db, own.phase_sd_deg) if own else (None, None)
    structure_sds = (structure.gain_db, structure.phase_deg) if structure else (None, None)
    criteria = (GAIN_CHECK, GAIN_DB, "dB"), (PHASE_CHECK, PHASE_DEG, "deg")
    for (name, limit, unit), change, sd, own_sd, structure_sd in zip(
        criteria, changes, sds, own_sds, structure_sds, strict=True
    ):
        largest = _max_change(limit, sd or 0.0, own_sd or 0.0, structure_sd or 0.0)
        size = None if change is None else abs(change)
        yield _check(f"{name}{OFF_BY}", plane, size, "at most", largest, unit)
        yield _check(f"{name}1 sd", plane, sd, "at most", 0.5 * limit, unit)


def _max_change(limit: float, sd: float, own_sd: float, structure_sd: float) -> float:
    """Return the largest correction by held-out runs that leaves the model's error within a limit.

    Parameters
    ----------
    limit : float
        Largest error of the model.
    sd : float
        Standard deviation of the correction h by noise.
    own_sd : float
        Standard deviation s_m of the model's response, by its own intervals.
    structure_sd : float
        That by the error of the structure alone, which the fit of the held-out runs has as well.

    Returns
    -------
    float
        Largest magnitude of the correction, at least ``limit``.

    Notes
    -----
    With s the standard deviation of the correction by noise and structure, the two estimates agree
    while |h| < 1.96 sqrt(s^2 + s_m^2); the most likely error is then h s_m^2 / (s^2 + s_m^2).
    Beyond, the model's intervals are wrong, and the error is h.
    """
    if not own_sd:
        return limit
    correction_sd = math.hypot(sd, structure_sd)
    agreeing = AGREEMENT_SD * math.hypot(correction_sd, own_sd)
    return max(limit, min(agreeing, limit * (1.0 + (correction_sd / own_sd) ** 2)))


def _next_test(
    model: IdentifiedModel,
    failed_checks: Sequence[AcceptanceCheck],
    checks: Sequence[AcceptanceCheck],
) -> NextTest | None:
    """Recommend the test that improves the worst criterion of a plane.

    Failed criteria come first, then unmet ones that are not required, then the met one nearest to
    its limit. Unmet whiteness does not count: another test does not reduce an error of the
    disturbance model. If only criteria of the whole fit failed, they are the reason.
    """
    failed_of_planes = [check for check in failed_checks if check.plane]
    unmet_optional = [
        check
        for check in checks
        if check.plane and not check.required and not check.passed and check.name != WHITENESS_CHECK
    ]
    candidates = (
        failed_of_planes
        or unmet_optional
        or [check for check in checks if check.plane and check.required]
    )
    worst = max(candidates, key=_relative_violation)
    if worst.plane is None:
        return None
    signal, duration_s = _recommended_signal(worst, checks, model)
    if failed_checks and not failed_of_planes:
        reason = "; ".join(_describe_failures(model, failed_checks))
    elif worst.passed:
        reason = f"every check is passed; closest to its limit: {format_check(worst)}"
    else:
        reason = format_check(worst)
    return NextTest(
        plane=worst.plane,
        signal=signal,
        magnitude_deg=_median_size_deg(model, worst.plane),
        duration_s=duration_s,
        reason=reason,
    )


def _relative_violation(check: AcceptanceCheck) -> float:
    """Value over limit, or limit over value for a lower limit; infinite for an unknown value."""
    if check.value is None:
        return math.inf
    numerator, denominator = (
        (check.value, check.limit) if check.sense == "at most" else (check.limit, check.value)
    )
    return numerator / denominator if denominator > 0.0 else math.inf


def _recommended_signal(
    check: AcceptanceCheck, checks: Sequence[AcceptanceCheck], model: IdentifiedModel
) -> tuple[str, float]:
    """Return the recommended signal and its duration (s).

    A chirp is for the dynamics about crossover, long steps are for slow numbers. If held-out tests
    contradict the model, a chirp is to be fitted. If they are too few to decide, or contradict it
    although more chirps were fitted than tests held out, another test is to be held out.
    """
    if "held" in check.name and (
        not _contradicted(check, checks) or _has_more_chirps(model, check.plane)
    ):
        return WAVE_TO_HOLD_OUT, SHORT_S
    if check.name.startswith(SLOW_NUMBERS):
        return WAVE_FOR_GAIN, LONG_S
    return WAVE_FOR_DYNAMICS, LONG_S


def _has_more_chirps(model: IdentifiedModel, plane: Plane | None) -> bool:
    """Return whether more chirps of a plane were fitted than tests held out."""
    chirps = sum(
        run.accepted and run.plane == plane and run.wave == WAVE_FOR_DYNAMICS
        for run in model.screening
    )
    held_out = sum(run.accepted and run.plane == plane for run in model.held_out_screening)
    return chirps > held_out


def _contradicted(check: AcceptanceCheck, checks: Sequence[AcceptanceCheck]) -> bool:
    """Return whether a failed criterion on held-out tests is an error of the model, not noise."""
    if check.passed:
        return False
    of_plane = {other.name: other for other in checks if other.plane == check.plane}
    if check.name.endswith(OFF_BY):
        return of_plane[f"{check.name.removesuffix(OFF_BY)}1 sd"].passed
    if check.name in (RATIO_CHECK, THEIL_CHECK):
        above_floor = of_plane[FLOOR_CHECK]
        return above_floor.value is not None and not above_floor.passed
    return False


def _median_size_deg(model: IdentifiedModel, plane: Plane) -> float:
    """Median magnitude of the plane's accepted runs, rounded to half a degree."""
    magnitudes_deg = [
        abs(run.magnitude_deg) for run in model.screening if run.plane == plane and run.accepted
    ]
    return (
        max(0.5, round(2.0 * float(np.median(magnitudes_deg))) / 2.0)
        if magnitudes_deg
        else DEFAULT_SIZE_DEG
    )
