"""Summary of an identified model, as a record and as tables."""

from collections.abc import Iterator, Sequence
from pathlib import Path

from rich import box
from rich.console import RenderableType
from rich.table import Table

from ground.campaign.summary_file import (
    PAPER_VEHICLE,
    AlternativeSummary,
    ModelSummary,
    RateErrors,
    ValidationSummary,
)
from ground.rendered import Rendered
from ground.terminal import heading, render
from sysid.models.model_file import IdentifiedModel, RunQuality
from sysid.models.prediction import mean_rate_errors, opening_rate_errors
from sysid.planes import Plane
from sysid.reproduction.paper_tables import TABLE_1_ADJUSTED, TABLE_1_INITIAL
from sysid.validation.results import AcceptanceCheck, PlaneVerdict


def summarise_model(model: IdentifiedModel) -> ModelSummary:
    """Return the summary of a model for `--json` and `summary.json`."""
    return ModelSummary(
        method=model.method,
        speed_mps=model.speed_mps,
        planes=model.planes,
        coefficients=model.coefficients,
        rank=model.joint.rank,
        condition_number=model.joint.condition_number,
        fitted_rate_error=rate_errors(model.fit_quality),
        held_out_rate_error=rate_errors(model.held_out),
        runs_accepted=sum(run.accepted for run in model.screening),
        runs_rejected=sum(not run.accepted for run in model.screening),
        validation={
            plane: ValidationSummary(
                held_out=validation.held_out,
                coherence_at_crossover=validation.coherence_at_crossover,
                crossover=validation.crossover,
                correction=validation.correction,
            )
            for plane, validation in model.validation.items()
        },
        assessment=model.assessment,
        alternative_methods={
            other.method: AlternativeSummary(
                planes=other.planes,
                coefficients=other.coefficients,
                rank=other.rank,
                fitted_rate_error=rate_errors(other.fit_quality),
                held_out_rate_error=rate_errors(other.held_out),
            )
            for other in model.alternative_methods
        },
    )


def rate_errors(qualities: Sequence[RunQuality]) -> dict[Plane, RateErrors]:
    """Return the mean squared rate errors (deg/s)^2 by plane.

    They are those of the initial and of the refitted model, over whole tests and over their first
    10 s.
    """
    errors = {}
    for plane in Plane:
        whole, opening = mean_rate_errors(qualities, plane), opening_rate_errors(qualities, plane)
        if whole and opening:
            errors[plane] = RateErrors(
                initial_model_deg2ps2=whole[0],
                refitted_model_deg2ps2=whole[1],
                opening_initial_model_deg2ps2=opening[0],
                opening_refitted_model_deg2ps2=opening[1],
            )
    return errors


def format_text(model: IdentifiedModel, out: Path) -> Rendered:
    """Return a model as tables: design numbers, errors, checks, other methods, assessment."""
    n_fitted, n_held_out = sum(run.accepted for run in model.screening), len(model.held_out)
    lines: list[RenderableType] = [
        f"{out}: {n_fitted} of {len(model.screening)} runs fitted, {n_held_out} held out"
    ]
    lines += [
        f"  rejected {run.run}: {'; '.join(run.reasons)}"
        for run in model.screening
        if not run.accepted
    ]
    lines += [
        f"  rejected {run.run} (held out): {'; '.join(run.reasons)}"
        for run in model.held_out_screening
        if not run.accepted
    ]
    lines += [
        f"  fitted {run.run}, with warnings: {'; '.join(run.warnings)}"
        for run in model.screening
        if run.warnings
    ]
    lines += [f"  note: {note}" for note in model.notes]
    if model.dropped_run_influence:
        most = max(model.dropped_run_influence, key=lambda shift: abs(shift.sds))
        lines.append(
            f"  leaving them out changed {most.plane} {most.number} by {most.sds:+.1f} sd,"
            " the others less"
        )
    lines += [heading(f"design numbers at {model.speed_mps:g} m/s"), _numbers(model)]
    if model.alternative_methods:
        lines += [heading("coefficients"), _coefficients(model)]
    lines += [
        heading("mean squared rate error, (deg/s)²; in brackets the first 10 s"),
        _errors(model),
    ]
    if model.assessment:
        lines += [
            heading("checks; a value in brackets is a remark and not decisive"),
            _checks(model.assessment.checks),
        ]
    return _render([*lines, *assessment_lines(model)])


def assessment_lines(model: IdentifiedModel) -> list[str]:
    """Return the assessment of a model, and the test to fly next."""
    assessment = model.assessment
    if assessment is None:
        return ["this model has no assessment: refit it from its logs"]
    lines = ["fit for redesign"] if assessment.fit_for_redesign else ["not fit for redesign:"]
    lines += [f"  {reason}" for reason in assessment.reasons]
    if not assessment.fit_for_redesign:
        lines += [_plane_line(plane, verdict) for plane, verdict in assessment.planes.items()]
    if assessment.obstacle:
        lines.append(f"no test can make it fit: {assessment.obstacle}")
    if assessment.next_test:
        lines += [f"next test: {assessment.next_test}", f"  why: {assessment.next_test.reason}"]
    return lines


def _plane_line(plane: Plane, verdict: PlaneVerdict) -> str:
    """Return the decision about one plane."""
    if verdict.fit_for_redesign:
        return f"{plane} by itself: fit"
    return f"{plane} by itself: {'not fit' if verdict.tested else verdict.reasons[0]}"


def _method_name(method: str) -> str:
    """Return the name of a method in table headings."""
    return "paper's method" if method == "paper" else method


def _numbers(model: IdentifiedModel) -> Table:
    """Return the table of design numbers, with standard deviations and other methods."""
    alternatives = [(other.method, other.planes) for other in model.alternative_methods]
    table = _table(
        "plane",
        "",
        f"{model.method}",
        "1 sd",
        *(_method_name(method) for method, _ in alternatives),
    )
    for plane, estimates in model.planes.items():
        for name in estimates.__struct_fields__:
            estimate = getattr(estimates, name)
            if estimate is not None:
                sd = "not known" if estimate.sd is None else f"{estimate.sd:.2g}"
                others = [f"{getattr(planes[plane], name).value:.4g}" for _, planes in alternatives]
                table.add_row(plane, name, f"{estimate.value:.4g}", sd, *others)
    return table


def _errors(model: IdentifiedModel) -> Table:
    """Return the table of rate errors, as in the paper's Table 2: whole tests and first 10 s."""
    table = _table(
        "plane",
        "runs",
        "first principles",
        model.method,
        *(_method_name(other.method) for other in model.alternative_methods),
    )
    for label, field in (("fitted", "fit_quality"), ("held out", "held_out")):
        by_method = [
            rate_errors(getattr(fit, field)) for fit in (model, *model.alternative_methods)
        ]
        for plane, errors in by_method[0].items():
            cells = [initial_error(errors), *(refitted_error(e[plane]) for e in by_method)]
            table.add_row(plane, label, *cells)
    return table


def initial_error(errors: RateErrors) -> str:
    """Return the errors of the initial model as a table cell."""
    return f"{errors.initial_model_deg2ps2:.3f} ({errors.opening_initial_model_deg2ps2:.3f})"


def refitted_error(errors: RateErrors) -> str:
    """Return the errors of the refitted model as a table cell."""
    return f"{errors.refitted_model_deg2ps2:.3f} ({errors.opening_refitted_model_deg2ps2:.3f})"


def _coefficients(model: IdentifiedModel) -> Table:
    """Return the table of coefficients: paper (Table 1), prior, estimate and other methods."""
    columns = (TABLE_1_INITIAL, TABLE_1_ADJUSTED) if model.vehicle.prior == PAPER_VEHICLE else ()
    heads = ("paper, initial", "paper, adjusted")[: len(columns)]
    table = _table(
        "",
        *heads,
        "prior",
        model.method,
        "1 sd",
        "sd/prior sd",
        "",
        *(_method_name(other.method) for other in model.alternative_methods),
        "unit",
    )
    for name, c in model.coefficients.items():
        sd = f"{c.sd:.2g}" if c.sd else "-"
        sd_ratio = (
            f"{c.posterior_to_prior_sd:.2f}"
            if c.posterior_to_prior_sd is not None and c.prior_sd
            else "-"
        )
        paper = [f"{getattr(column, name):.4g}" for column in columns]
        others = [f"{other.coefficients[name]:.4g}" for other in model.alternative_methods]
        table.add_row(
            name,
            *paper,
            f"{c.prior:.4g}",
            f"{c.value:.4g}",
            sd,
            sd_ratio,
            c.status,
            *others,
            c.unit,
        )
    return table


def _checks(checks: Sequence[AcceptanceCheck]) -> Table:
    """Return the table of checks, one row per check; values of optional checks are in brackets."""
    table = _table("", *Plane, "limit", "")
    for (name, limit), row in _checks_by_name(checks).items():
        failed = [
            "remark" if not check.required else "FAILED"
            for check in row.values()
            if not check.passed
        ]
        cells = [_format_value(row[p]) if p in row else "" for p in Plane]
        if None in row:
            cells[0] = _format_value(row[None])
        table.add_row(
            name,
            *cells,
            limit,
            "FAILED" if "FAILED" in failed else failed[0] if failed else "passed",
        )
    return table


def _checks_by_name(
    checks: Sequence[AcceptanceCheck],
) -> dict[tuple[str, str], dict[str | None, AcceptanceCheck]]:
    """Return the checks by name and limit, then by plane (None: both planes)."""
    rows: dict[tuple[str, str], dict[str | None, AcceptanceCheck]] = {}
    for name in dict.fromkeys(check.name for check in checks):
        same: dict[str | None, AcceptanceCheck] = {
            check.plane: check for check in checks if check.name == name
        }
        limits = " / ".join(dict.fromkeys(f"{check.limit:.3g}" for check in same.values()))
        first = next(iter(same.values()))
        rows[name, f"{first.sense} {limits} {first.unit}".rstrip()] = same
    return rows


def _format_value(check: AcceptanceCheck) -> str:
    """Return the value of a check as a table cell."""
    value = "not known" if check.value is None else f"{check.value:.3g}"
    return value if check.required else f"({value})"


def _table(*heads: str) -> Table:
    """Return an empty table with these columns."""
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    for number, head in enumerate(heads):
        table.add_column(
            head, justify="left" if number == 0 or not head or head == "runs" else "right"
        )
    return table


def _render(parts: Sequence[RenderableType]) -> Rendered:
    """Return the parts as text, in colour if stdout is a terminal."""
    return Rendered("\n".join(_without_blanks(render(parts).split("\n"))))


def _without_blanks(lines: Sequence[str]) -> Iterator[str]:
    """Yield lines without trailing spaces and without repeated empty lines."""
    previous = " "
    for line in (text.rstrip() for text in lines):
        if line or previous:
            yield line
        previous = line
