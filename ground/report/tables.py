"""HTML tables of the report: the paper's Tables 1 to 5 with our values, and all others."""

from collections.abc import Iterable, Mapping, Sequence
from html import escape
from typing import Any

from ground.campaign.identification import assessment_lines, initial_error, refitted_error
from ground.campaign.summary_file import LoopAnalysis, ModelSummary, SteadyErrorEntry
from ground.client.assessment import format_value
from sysid.control_analysis.control_systems import MarginsComparison
from sysid.models.model_file import IdentifiedModel, RunQuality
from sysid.monitor.tracking_metrics import TrackingMetrics
from sysid.planes import PLANES, Plane
from sysid.reproduction.paper_poles import dominant
from sysid.reproduction.paper_poles import rows as computed_rows
from sysid.reproduction.paper_tables import (
    TABLE_1_ADJUSTED,
    TABLE_1_INITIAL,
    TABLE_2,
    TABLE_3_IMPROVED,
    TABLE_5_IMPROVED,
    TABLE_5_INITIAL,
)
from sysid.validation.results import AcceptanceCheck

_SUBSCRIPTS = {"dr": "δr", "de": "δe", "vdot": "v̇", "rdot": "ṙ", "wdot": "ẇ", "qdot": "q̇"}
_LOOP_OF = {"heading": "Heading", "pitch": "Pitch to elevator", "depth": "Depth to pitch"}
_GAIN_PREFIX = {"heading": "HDG", "pitch": "PTCH", "depth": "DPT"}
_METHOD_NAMES = {"paper": "the paper's method"}
_GAIN_SET_NAMES = {
    "initial": "initial gains",
    "improved": "the paper's improved gains",
}
PAPER = "paper"
"""Begin of the head of a column with the paper's values."""
_FITTED_TAG = '<span class="tag measured">fitted</span>'
_HELD_OUT_TAG = '<span class="tag">held out</span>'
_REJECTED_TAG = '<span class="tag prior">rejected</span>'
_CASES = {
    "I/I": "initial model, initial gains",
    "A/I": "adjusted, initial",
    "A/A": "adjusted, improved",
}


def table(head: Sequence[str], rows: Iterable[Sequence[str]], name: str = "") -> str:
    """Return an HTML table of CSS class `name`; heads and cells are HTML and are not escaped."""
    cells = "".join(f"<th>{label}</th>" for label in head)
    body = "".join("<tr>" + "".join(f"<td>{cell}</td>" for cell in row) + "</tr>" for row in rows)
    kind = f' class="{name}"' if name else ""
    return (
        f'<div class="scroll"><table{kind}><thead><tr>{cells}</tr></thead>'
        f"<tbody>{body}</tbody></table></div>"
    )


def _without_paper(
    head: Sequence[str], rows: Iterable[Sequence[str]]
) -> tuple[list[str], list[list[str]]]:
    """Return head and rows without the columns of the paper's values."""
    own = [number for number, label in enumerate(head) if not label.startswith(PAPER)]
    return [head[n] for n in own], [[row[n] for n in own] for row in rows]


def symbol(name: str) -> str:
    """Return a coefficient's symbol as HTML, as the paper prints it."""
    letter, _, index = name.partition("_")
    return f"<i>{letter}</i><sub>{_SUBSCRIPTS.get(index, index)}</sub>"


def table_1(model: IdentifiedModel, *, with_paper: bool = True) -> str:
    """Return the coefficients: the paper's, the identified ones, and those of other methods."""
    rows = []
    for name, c in model.coefficients.items():
        sd = "–" if not c.sd else f"± {_short(c.sd)}"
        sd_ratio = (
            "–"
            if c.posterior_to_prior_sd is None or not c.prior_sd
            else f"{c.posterior_to_prior_sd:.2f}"
        )
        paper = [_short(getattr(column, name)) for column in (TABLE_1_INITIAL, TABLE_1_ADJUSTED)]
        status = f'<span class="tag {c.status}">{c.status}</span>'
        others = [_short(other.coefficients[name]) for other in model.alternative_methods]
        rows.append(
            [
                symbol(name),
                *paper,
                f"<b>{_short(c.value)}</b>",
                sd,
                sd_ratio,
                status,
                *others,
                escape(c.unit),
            ]
        )
    methods = [_METHOD_NAMES.get(other.method, other.method) for other in model.alternative_methods]
    head = [
        "",
        "paper, initial",
        "paper, adjusted",
        "identified",
        "1 sd",
        "sd/prior sd",
        "",
        *methods,
        "unit",
    ]
    return table(head, rows) if with_paper else table(*_without_paper(head, rows))


def table_2(model: ModelSummary, *, with_paper: bool = True) -> str:
    """Return the mean squared rate errors, (deg/s)^2, of all models on held-out runs."""
    paper = dict(zip(Plane, TABLE_2.values(), strict=True))
    methods = {
        _METHOD_NAMES.get(m, m): other.held_out_rate_error
        for m, other in model.alternative_methods.items()
    }
    rows = [
        [
            f"{PLANES[Plane(plane)].surface} tests",
            f"{paper[plane].initial:g}",
            f"{paper[plane].adjusted:g}",
            initial_error(pair),
            f"<b>{refitted_error(pair)}</b>",
            *(refitted_error(errors[plane]) for errors in methods.values()),
        ]
        for plane, pair in model.held_out_rate_error.items()
    ]
    head = ["", "paper, initial", "paper, improved", "initial model", "refitted model", *methods]
    return table(head, rows) if with_paper else table(*_without_paper(head, rows))


def assessment(model: IdentifiedModel) -> str:
    """Return the assessment of the model, its reasons and the next test, as paragraphs."""
    first, *others = (escape(line.strip()) for line in assessment_lines(model))
    lead = f'<p class="lead">{first.capitalize().rstrip(":")}.</p>'
    return lead + "".join(f"<p>{line[:1].upper()}{line[1:]}</p>" for line in others)


def checks(model: IdentifiedModel) -> str:
    """Return each acceptance criterion with its value per plane, its limit and its result."""
    if model.assessment is None:
        return ""
    rows = []
    for name in dict.fromkeys(check.name for check in model.assessment.checks):
        same = [check for check in model.assessment.checks if check.name == name]
        cells = {check.plane or Plane.YAW: _figure(check) for check in same}
        limit = f"{same[0].sense} {same[0].limit:.3g} {same[0].unit}"
        missed = [check for check in same if not check.passed]
        kind = "measured" if not missed else "prior" if missed[0].required else ""
        result = "passed" if not missed else "failed" if missed[0].required else "remark"
        tag = f'<span class="tag {kind}">{result}</span>'
        rows.append([escape(name), *(cells.get(plane, "") for plane in Plane), escape(limit), tag])
    return table(["criterion", *Plane, "limit", ""], rows)


def _figure(check: AcceptanceCheck) -> str:
    return "not known" if check.value is None else f"{check.value:.3g}"


def runs_table(model: IdentifiedModel) -> str:
    """Return each run's rate error, noise floor, Theil coefficient and whiteness p-values."""
    errors = {q.run: q.model_mse_deg2ps2 for q in (*model.fit_quality, *model.held_out)}
    rows = []
    for validation in model.validation.values():
        for run in validation.runs:
            floor = (
                ""
                if run.floor_deg2ps2 is None
                else f"{run.floor_deg2ps2:.3f} ± {run.floor_sd_deg2ps2:.3f}"
            )
            white = (
                ["", ""]
                if run.whiteness is None
                else [f"{run.whiteness.periodogram_p:.2f}", f"{run.whiteness.ljung_box_p:.2f}"]
            )
            use = (
                '<span class="tag">held out</span>'
                if run.held_out
                else '<span class="tag measured">fitted</span>'
            )
            rows.append(
                [
                    run.run,
                    run.wave,
                    f"{errors[run.run]:.3f}",
                    floor,
                    f"{run.theil.coefficient:.3f}",
                    *white,
                    use,
                ]
            )
    head = [
        "run",
        "signal",
        "rate error, (°/s)²",
        "noise floor, (°/s)²",
        "Theil",
        "periodogram, p",
        "Ljung–Box, p",
        "",
    ]
    return table(head, rows, "named")


def table_3(gains: Mapping[str, Mapping[str, float]], *, with_paper: bool, final_set: str) -> str:
    """Return the controller gains: initial, the paper's improved, redesigned or kept."""
    sets = {
        "initial": gains["initial"],
        **({"paper, improved": TABLE_3_IMPROVED} if with_paper else {}),
        final_set: gains["redesigned"],
    }
    rows = []
    for loop, prefix in _GAIN_PREFIX.items():
        for number, (name, values) in enumerate(sets.items()):
            numbers = [f"{values[f'{prefix}_{part}']:.4g}" for part in ("P", "D", "I", "IMAX")]
            rows.append(
                [
                    _LOOP_OF[loop] if number == 0 else "",
                    name,
                    *_strong(numbers, name == final_set),
                ]
            )
    return table(["loop", "gains", "Kp", "Kd", "Ki", "Ki limit"], rows, "named")


def table_4(poles: Mapping[str, Any], *, with_paper: bool, final_set: str) -> str:
    """Return the dominant closed-loop poles (rad/s): printed, computed, and of our vehicle.

    Parameters
    ----------
    poles : Mapping
        Visible poles of our vehicle as (real, imaginary), by set of gains and loop.
    with_paper : bool
        Whether to show the paper's poles.
    final_set : str
        Word for the gains of the last dives, as in `DesignSummary`.
    """
    rows = [
        [
            _LOOP_OF[r.loop].split()[0] if r.case == "I/I" else "",
            _CASES[r.case],
            _pole(r.paper),
            _pole(r.ours),
            f"{_damping(r.paper):.2f}",
            f"{_damping(r.ours):.2f}",
        ]
        for r in (computed_rows() if with_paper else ())
    ]
    for role in ("initial", "redesigned"):
        for loop, visible in poles[role].items():
            pole = dominant(tuple(complex(*p) for p in visible))
            name = f"identified, {final_set if role == 'redesigned' else role}"
            rows.append(
                [
                    loop.capitalize(),
                    name,
                    "",
                    f"<b>{_pole(pole)}</b>",
                    "",
                    f"<b>{_damping(pole):.2f}</b>",
                ]
            )
    head = ["loop", "model, gains", "paper", "ours", "paper, damping", "ours, damping"]
    return table(*((head, rows) if with_paper else _without_paper(head, rows)), "named")


def table_5(steady: Mapping[str, SteadyErrorEntry], *, with_paper: bool, final_set: str) -> str:
    """Return the steady errors of the straight run, 95 % bounds."""
    units = {"heading_deg": "°", "pitch_deg": "°", "depth_m": " m"}
    rows = [
        [
            key.split("_")[0].capitalize(),
            f"± {getattr(TABLE_5_INITIAL, key):g}{unit}",
            f"± {getattr(TABLE_5_IMPROVED, key):g}{unit}",
            *(
                _strong([f"± {format_value(getattr(errors, key))}{unit}"], name == "redesigned")[0]
                for name, errors in steady.items()
            ),
        ]
        for key, unit in units.items()
    ]
    sets = (final_set if name == "redesigned" else _GAIN_SET_NAMES[name] for name in steady)
    head = ["error", "paper, initial", "paper, improved", *sets]
    return table(head, rows) if with_paper else table(*_without_paper(head, rows))


def small_signal(model: IdentifiedModel) -> str:
    """Return the small-signal parameters of each plane that the control design uses."""
    rows = []
    for plane, estimates in model.planes.items():
        for name in estimates.__struct_fields__:
            estimate = getattr(estimates, name)
            if estimate is not None:
                quantity, unit = _split_unit(name)
                sd = "not known" if estimate.sd is None else f"± {estimate.sd:.2g}"
                rows.append([plane, quantity, f"<b>{estimate.value:.4g}</b>", sd, unit])
    return table(["plane", "quantity", "value", "1 sd", "unit"], rows, "named")


def margins(
    analyses: Mapping[str, LoopAnalysis],
    second: Mapping[str, MarginsComparison],
    final_set: str = "redesigned",
) -> str:
    """Return the stability margins at each cut.

    Parameters
    ----------
    analyses : Mapping
        Analysis of the initial and of the redesigned gains.
    second : Mapping
        Margins by python-control, by set of gains.
    final_set : str
        Word for the gains of the last dives, as in `DesignSummary`.
    """
    rows = []
    for cut in analyses["redesigned"].margins:
        for role in ("initial", "redesigned"):
            m = analyses[role].margins[cut]
            numbers = [
                _number(m.gm_db, 1),
                _number(m.pm_deg, 0),
                _number(m.max_sensitivity, 2),
            ]
            numbers.append(_number(m.crossover_radps, 2))
            cells = _strong(numbers, role == "redesigned")
            own = second[role].margins[cut]
            control = f"{own.gm_db:.1f} dB, {own.pm_deg:.0f}°, {own.max_sensitivity:.2f}"
            if cut in second[role].differences:
                control = f'<span class="tag prior">differs</span> {control}'
            name = final_set if role == "redesigned" else role
            rows.append([cut if role == "initial" else "", name, *cells, control])
    head = ["loop opened at", "gains", "gain margin, dB", "phase margin, °", "Ms"]
    return table([*head, "crossover, rad/s", "python-control"], rows, "named")


def screening(model: IdentifiedModel) -> str:
    """Return every run with its screening result, the reason, and the rate error of both models."""
    quality = {q.run: q for q in (*model.fit_quality, *model.held_out)}
    rows = [
        [
            run.run,
            f"{run.wave} {run.magnitude_deg:+g}°",
            f"{run.duration_s:.1f} s",
            *_errors(quality.get(run.run)),
            tag if run.accepted else _REJECTED_TAG,
            escape("; ".join((*run.reasons, *run.warnings))),
        ]
        for runs, tag in ((model.screening, _FITTED_TAG), (model.held_out_screening, _HELD_OUT_TAG))
        for run in runs
    ]
    head = ["run", "test", "length", "initial model", "refitted model", "", "reason"]
    return table(head, rows, "named prose")


def _errors(quality: RunQuality | None) -> list[str]:
    """Return the rate errors of both models; empty for a run that was rejected."""
    if quality is None:
        return ["", ""]
    return [f"{quality.prior_mse_deg2ps2:.3f}", f"{quality.model_mse_deg2ps2:.3f}"]


def tracking(missions: Mapping[str, Mapping[str, TrackingMetrics]]) -> str:
    """Return the steady errors of every leg of every mission, 95 % bounds."""
    rows = []
    for mission, sets in missions.items():
        for number, windows in enumerate(
            zip(*(metrics.windows for metrics in sets.values()), strict=False)
        ):
            errors = (
                [getattr(window, e).p95 for window in windows]
                for e in ("heading_deg", "pitch_deg", "depth_m")
            )
            cells = [
                " → ".join((*(f"{p95:.2f}" for p95 in before), f"<b>{now:.2f}</b>"))
                for *before, now in errors
            ]
            window = f"{windows[-1].start_s:.0f}–{windows[-1].stop_s:.0f} s"
            rows.append([mission.replace("_", " ") if number == 0 else "", window, *cells])
    return table(
        ["mission", "steady window", "heading, °", "pitch about its mean, °", "depth, m"],
        rows,
        "named",
    )


def _strong(cells: Sequence[str], strong: bool) -> list[str]:
    return [f"<b>{cell}</b>" for cell in cells] if strong else list(cells)


def _short(value: float) -> str:
    return f"{value:.3g}" if abs(value) < 10 else f"{value:.0f}"


def _number(value: float | None, digits: int) -> str:
    return "∞" if value is None else f"{value:.{digits}f}"


def _pole(pole: complex) -> str:
    if pole.imag != pole.imag:
        return "no oscillating pair"
    return f"{pole.real:.3f} ± {pole.imag:.3f}i".replace("-", "−")


def _damping(pole: complex) -> float:
    return -pole.real / abs(pole) if abs(pole) else float("nan")


def _split_unit(name: str) -> tuple[str, str]:
    """Return a quantity's name and unit from its field name."""
    units = {"per_s2": "1/s²", "per_s": "1/s", "deg": "°", "s": "s"}
    for suffix, unit in units.items():
        if name.endswith(f"_{suffix}"):
            return name.removesuffix(f"_{suffix}").replace("_", " "), unit
    return name.replace("_", " "), ""
