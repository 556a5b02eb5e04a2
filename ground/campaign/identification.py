"""Summary of an identified model, as plain numbers and as tables."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import msgspec
from rich import box
from rich.console import RenderableType
from rich.table import Table

from ground.terminal import Rendered, heading, render
from sysid.models.model_file import IdentifiedModel
from sysid.models.prediction import mean_rate_errors, opening_rate_errors
from sysid.reproduction.paper_tables import TABLE_1_ADJUSTED, TABLE_1_INITIAL
from sysid.validation.results import Gate

WIDTH = 118
"""Width of the tables in characters."""
PAPER_VEHICLE = "caribou_nominal"
"""Prior that is the paper's vehicle; for it the table shows the paper's coefficients too."""


def summarise_model(model: IdentifiedModel) -> dict[str, Any]:
    """Return the summary of a model for `--json` and `summary.json`."""
    validation: Any = msgspec.to_builtins(model.validation)
    for plane in validation.values():
        del plane["runs"], plane["overlay"]
    return {
        "method": model.method,
        "speed_mps": model.speed_mps,
        "planes": msgspec.to_builtins(model.planes),
        "coefficients": msgspec.to_builtins(model.coefficients),
        "rank": model.joint.rank,
        "condition_number": model.joint.condition_number,
        "fitted_rate_error": rate_errors(model.fit_quality),
        "held_out_rate_error": rate_errors(model.held_out),
        "runs_kept": sum(run.kept for run in model.screening),
        "runs_rejected": sum(not run.kept for run in model.screening),
        "validation": validation,
        "verdict": msgspec.to_builtins(model.verdict),
        "beside": {
            rival.method: {
                "planes": msgspec.to_builtins(rival.planes),
                "coefficients": rival.coefficients,
                "rank": rival.rank,
                "fitted_rate_error": rate_errors(rival.fit_quality),
                "held_out_rate_error": rate_errors(rival.held_out),
            }
            for rival in model.beside
        },
    }


def rate_errors(qualities: Any) -> dict[str, Any]:
    """Return the mean squared rate errors (deg/s)^2 by plane.

    They are those of the initial and of the refitted model, over whole tests and over their first
    10 s.
    """
    errors = {}
    for plane in ("yaw", "pitch"):
        whole, opening = mean_rate_errors(qualities, plane), opening_rate_errors(qualities, plane)
        if whole and opening:
            errors[plane] = {
                "initial_model_deg2ps2": whole[0],
                "refitted_model_deg2ps2": whole[1],
                "opening_initial_model_deg2ps2": opening[0],
                "opening_refitted_model_deg2ps2": opening[1],
            }
    return errors


def format_text(model: IdentifiedModel, out: Path) -> Rendered:
    """Return a model as tables: design numbers, errors, checks, other methods, assessment."""
    n_fitted, n_held_out = sum(run.kept for run in model.screening), len(model.held_out)
    lines: list[RenderableType] = [
        f"{out}: {n_fitted} of {len(model.screening)} runs fitted, {n_held_out} held out"
    ]
    lines += [
        f"  rejected {run.run}: {'; '.join(run.reasons)}" for run in model.screening if not run.kept
    ]
    lines += [
        f"  rejected {run.run} (held out): {'; '.join(run.reasons)}"
        for run in model.held_out_screening
        if not run.kept
    ]
    lines += [
        f"  kept {run.run}, with warnings: {'; '.join(run.warnings)}"
        for run in model.screening
        if run.warnings
    ]
    if model.left_out_moved:
        most = max(model.left_out_moved, key=lambda shift: abs(shift.sds))
        lines.append(
            f"  leaving them out changed {most.plane} {most.number} by {most.sds:+.1f} sd,"
            " the others less"
        )
    lines += [heading(f"design numbers at {model.speed_mps:g} m/s"), _numbers(model)]
    if model.beside:
        lines += [heading("coefficients"), _coefficients(model)]
    lines += [
        heading("mean squared rate error, (deg/s)²; in brackets the first 10 s"),
        _errors(model),
    ]
    if model.verdict:
        lines += [
            heading("checks; a value in brackets is a remark and not decisive"),
            _gates(model.verdict.gates),
        ]
    return _render([*lines, *verdict_lines(model)])


def verdict_lines(model: IdentifiedModel) -> list[str]:
    """Return the assessment of a model, and the test to fly next."""
    verdict = model.verdict
    if verdict is None:
        return ["this model has no assessment: refit it from its logs"]
    lines = ["fit for redesign"] if verdict.fit_for_redesign else ["not fit for redesign:"]
    lines += [f"  {reason}" for reason in verdict.reasons]
    if verdict.next_test:
        lines += [f"next test: {verdict.next_test}", f"  why: {verdict.next_test.reason}"]
    return lines


def _method_name(method: str) -> str:
    """Return the name of a method in table headings."""
    return "paper's method" if method == "paper" else method


def _numbers(model: IdentifiedModel) -> Table:
    """Return the table of design numbers, with standard deviations and other methods."""
    rivals = [(rival.method, rival.planes) for rival in model.beside]
    table = _table(
        "plane", "", f"{model.method}", "1 sd", *(_method_name(method) for method, _ in rivals)
    )
    for plane, estimates in model.planes.items():
        for name in estimates.__struct_fields__:
            estimate = getattr(estimates, name)
            if estimate is not None:
                sd = "not known" if estimate.sd is None else f"{estimate.sd:.2g}"
                others = [f"{getattr(planes[plane], name).value:.4g}" for _, planes in rivals]
                table.add_row(plane, name, f"{estimate.value:.4g}", sd, *others)
    return table


def _errors(model: IdentifiedModel) -> Table:
    """Return the table of rate errors, as in the paper's Table 2: whole tests and first 10 s."""
    table = _table(
        "plane",
        "runs",
        "first principles",
        model.method,
        *(_method_name(rival.method) for rival in model.beside),
    )
    for label, field in (("fitted", "fit_quality"), ("held out", "held_out")):
        ours = rate_errors(getattr(model, field))
        others = [rate_errors(getattr(rival, field)) for rival in model.beside]
        for plane, errors in ours.items():
            cells = [
                _error(errors, "initial"),
                *(_error(e[plane], "refitted") for e in (ours, *others)),
            ]
            table.add_row(plane, label, *cells)
    return table


def _error(errors: Mapping[str, float], model: str) -> str:
    """Return the errors of the `initial` or `refitted` model as a table cell."""
    whole, opening = errors[f"{model}_model_deg2ps2"], errors[f"opening_{model}_model_deg2ps2"]
    return f"{whole:.3f} ({opening:.3f})"


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
        "shrink",
        "",
        *(_method_name(rival.method) for rival in model.beside),
        "unit",
    )
    for name, c in model.coefficients.items():
        sd = f"{c.sd:.2g}" if c.sd else "-"
        shrink = f"{c.shrink:.2f}" if c.shrink is not None and c.prior_sd else "-"
        paper = [f"{getattr(column, name):.4g}" for column in columns]
        others = [f"{rival.coefficients[name]:.4g}" for rival in model.beside]
        table.add_row(
            name, *paper, f"{c.prior:.4g}", f"{c.value:.4g}", sd, shrink, c.status, *others, c.unit
        )
    return table


def _gates(gates: Sequence[Gate]) -> Table:
    """Return the table of checks, one row per check; values of optional checks are in brackets."""
    table = _table("", "yaw", "pitch", "limit", "")
    for (name, limit), row in _gates_by_name(gates).items():
        failed = [
            "remark" if not gate.required else "FAILED" for gate in row.values() if not gate.passed
        ]
        cells = [_format_value(row[p]) if p in row else "" for p in ("yaw", "pitch")]
        if None in row:
            cells[0] = _format_value(row[None])
        table.add_row(
            name,
            *cells,
            limit,
            "FAILED" if "FAILED" in failed else failed[0] if failed else "passed",
        )
    return table


def _gates_by_name(gates: Sequence[Gate]) -> dict[tuple[str, str], dict[str | None, Gate]]:
    """Return the checks by name and limit, then by plane (None: both planes)."""
    rows: dict[tuple[str, str], dict[str | None, Gate]] = {}
    for name in dict.fromkeys(gate.name for gate in gates):
        same: dict[str | None, Gate] = {gate.plane: gate for gate in gates if gate.name == name}
        limits = " / ".join(dict.fromkeys(f"{gate.limit:.3g}" for gate in same.values()))
        first = next(iter(same.values()))
        rows[name, f"{first.sense} {limits} {first.unit}".rstrip()] = same
    return rows


def _format_value(gate: Gate) -> str:
    """Return the value of a check as a table cell."""
    value = "not known" if gate.value is None else f"{gate.value:.3g}"
    return value if gate.required else f"({value})"


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
    return Rendered("\n".join(_without_blanks(render(parts, WIDTH).split("\n"))))


def _without_blanks(lines: Sequence[str]) -> Iterator[str]:
    """Yield lines without trailing spaces and without repeated empty lines."""
    previous = " "
    for line in (text.rstrip() for text in lines):
        if line or previous:
            yield line
        previous = line
