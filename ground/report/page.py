"""HTML report of a campaign: one file that needs no network."""

import json
import math
from collections.abc import Callable, Mapping
from html import escape
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path
from string import Template
from typing import NamedTuple

from ground.campaign import design_summary
from ground.campaign.campaign_folder import CampaignFolder
from ground.campaign.summary_file import (
    PAPER_VEHICLE,
    CampaignSummary,
    DesignSummary,
    LoopAnalysis,
    MarginsSummary,
    SteadyErrorEntry,
)
from ground.client.assessment import format_value
from ground.live.monitor_view import ROWS
from ground.report import (
    campaign_verdict,
    charts,
    figures,
    loop_charts,
    second_opinion,
    tables,
    validation_figures,
)
from ground.report.figures import Figure
from mavlink_io.user_data_dir import write_output
from sysid.control_analysis import control_systems
from sysid.control_analysis.control_systems import MarginsComparison
from sysid.control_analysis.loop_transfer import Margins
from sysid.design import design_model
from sysid.design.design_model import DesignModel
from sysid.monitor import MonitorReport
from sysid.monitor.sequential import RmsComparison, describe_agreement

SUBTITLE = "from first trial to precise control"
TITLE = f"Caribou: {SUBTITLE}"
NOTES = {
    "steady_note": " The paper's values were measured with its vehicle in its sea.",
    "table_2_note": "The paper gives its values for one 15° step and without a unit. Its time"
    " window is unknown, but at most about ten seconds: over a longer one its two models differ by"
    " more than its values allow. Our values are",
    "table_4_note": "The paper's rows are computed from its Tables 1 and 3 with its actuator and a"
    " delay of 0.3 s. The paper does not give its mass or the delay of each row, so they do not"
    " agree exactly; the added damping of the redesign does.",
}
"""Sentences about the paper's values, by their place in the template."""
OTHER_NOTES = {"steady_note": "", "table_2_note": "Values are", "table_4_note": ""}
"""The same places for another vehicle than the paper's."""
_HERE = files("ground.report")
_PAPER = {"heading_deg": "2.5° → 2.0°", "pitch_deg": "10° → 2.5°", "depth_m": "50 cm → 10 cm"}


class ModelFigures(NamedTuple):
    """Figures of tests and model, which need no dive after the tests."""

    steps: list[Figure]
    responses: list[Figure]
    whiteness: list[Figure]
    predictions: list[Figure]


def model_figures(campaign: CampaignFolder) -> ModelFigures:
    """Return the figures of tests and model.

    Parameters
    ----------
    campaign : CampaignFolder
        Folder with the logs of the tests and `model.json`.

    Raises
    ------
    InputError
        If a file is missing.
    """
    return ModelFigures(
        steps=figures.step_figures(campaign),
        responses=validation_figures.response_figures(campaign),
        whiteness=validation_figures.whiteness_figures(campaign),
        predictions=validation_figures.prediction_figures(campaign),
    )


def write(
    folder: Path | CampaignFolder,
    prepared: ModelFigures | None = None,
    compared: Mapping[str, MarginsComparison] | None = None,
) -> Path:
    """Write `report.html` into a campaign's folder.

    Parameters
    ----------
    folder : Path or CampaignFolder
        Folder of a finished campaign.
    prepared : ModelFigures, optional
        Result of `model_figures` for this folder, if it is already known.
    compared : Mapping, optional
        Result of `compare_margins` for its model, analyses and gains, if it is already known.

    Returns
    -------
    Path
        The file written.

    Raises
    ------
    InputError
        If the folder is not that of a finished campaign.
    """
    campaign = folder if isinstance(folder, CampaignFolder) else CampaignFolder(folder)
    target = campaign.path / "report.html"
    write_output(target, _page(campaign, prepared, compared))
    return target


def _page(
    campaign: CampaignFolder,
    prepared: ModelFigures | None,
    compared: Mapping[str, MarginsComparison] | None,
) -> str:
    """Return the HTML of the report."""
    summary, model = campaign.summary, campaign.model
    of_model = prepared or model_figures(campaign)
    with_paper, final_set = summary.vehicle == PAPER_VEHICLE, summary.design.final_set
    missions = figures.mission_figures(campaign, list(summary.tracking))
    steps, responses, whiteness, predictions = of_model
    analyses = loop_analyses(summary.design)
    comparisons = compared or compare_margins(campaign, analyses, summary.gains)
    poles = {role: analysis.poles_radps for role, analysis in analyses.items()}
    placed_figures = (*missions, *steps, *responses, *predictions, *whiteness)
    charts_by_id = {figure.key: charts.figure_chart(figure) for figure in placed_figures}
    charts_by_id |= {f"poles-{loop}": charts.poles_chart(poles, loop) for loop in poles["initial"]}
    loops = loop_charts.loop_charts(_design_model(campaign), summary.gains)
    charts_by_id |= loops.charts
    charts_by_id["estimates"] = charts.estimates_chart(summary.model.coefficients)
    charts_by_id["posterior"] = charts.posterior_chart(summary.model.coefficients)
    parts = {
        **(NOTES if with_paper else OTHER_NOTES),
        "title": escape(TITLE if with_paper else f"{campaign.prior_config.name}: {SUBTITLE}"),
        "final_set": final_set,
        "lead": _lead(summary),
        "verdict": campaign_verdict.card(summary),
        "headline": _headline(summary.steady_error, with_paper=with_paper),
        "missions": "".join(map(place_figure, missions)),
        "steps": "".join(map(place_figure, steps)),
        "poles": places(
            {f"poles-{loop}": f"{loop.capitalize()} loop" for loop in poles["initial"]}
        ),
        "table_1": tables.table_1(model, with_paper=with_paper),
        "table_2": tables.table_2(summary.model, with_paper=with_paper),
        "assessment": tables.assessment(model),
        "criteria": tables.checks(model),
        "validation_runs": tables.runs_table(model),
        "responses": "".join(map(place_figure, responses)),
        "second_opinion": second_opinion.html(model),
        "predictions": "".join(map(place_figure, predictions)),
        "whiteness": "".join(map(place_figure, whiteness)),
        "table_3": tables.table_3(summary.gains, with_paper=with_paper, final_set=final_set),
        "table_4": tables.table_4(
            {role: analysis.visible_modes_radps for role, analysis in analyses.items()},
            with_paper=with_paper,
            final_set=final_set,
        ),
        "table_5": tables.table_5(summary.steady_error, with_paper=with_paper, final_set=final_set),
        "tracking": tables.tracking(summary.tracking),
        "small_signal": tables.small_signal(model),
        "screening": tables.screening(model),
        "specification": specification(summary.design),
        "margins": tables.margins(analyses, comparisons, final_set),
        "reasons": reasons(summary.design),
        "bode": places(loops.bode),
        "nyquist": places(loops.nyquist),
        "closed_steps": places(loops.steps),
        "loci": places(loops.loci),
        "monitoring": monitoring(summary.monitoring),
        "trims": ", ".join(f"{name} {value:g}°" for name, value in summary.trims.items()),
        "speed": f"{model.speed_mps:g}",
        "asked": escape(campaign.request_text),
        "footer": _footer(summary),
    }
    return render(parts, _name_final_set(charts_by_id, final_set))


def _name_final_set(
    charts_by_id: Mapping[str, charts.Chart], final_set: str
) -> dict[str, charts.Chart]:
    """Return the charts of loops with the word for the gains of the last dives in their legends."""
    names = {"redesigned gains": f"{final_set} gains"}
    return {
        key: {
            **chart,
            "data": [
                {**trace, "name": names.get(trace.get("name", ""), trace.get("name"))}
                for trace in chart["data"]
            ],
        }
        for key, chart in charts_by_id.items()
    }


def loop_analyses(design: DesignSummary) -> dict[str, LoopAnalysis]:
    """Return the analyses of a design by set of gains."""
    return {"initial": design.initial, "redesigned": design.redesigned}


def _design_model(campaign: CampaignFolder) -> DesignModel:
    """Return the design model of a campaign, with the vehicle file of its refit."""
    return design_model.from_model(campaign.model, campaign.prior_config)


def compare_margins(
    campaign: CampaignFolder,
    analyses: Mapping[str, LoopAnalysis],
    gains: Mapping[str, Mapping[str, float]],
) -> dict[str, MarginsComparison]:
    """Compare the margins of each set of gains with those of python-control.

    Parameters
    ----------
    campaign : CampaignFolder
        Folder with the model of the design.
    analyses : Mapping
        Analysis by set of gains, with the margins that the report gives.
    gains : Mapping
        Gains by set.

    Returns
    -------
    dict
        Margins by python-control and differences, by set of gains.
    """
    vehicle = _design_model(campaign)
    lags = vehicle.yaw_lag, vehicle.pitch_lag
    return {
        role: control_systems.compare_margins(
            control_systems.open_loops(vehicle.planes, lags, gains[role]),
            {cut: _margins(summary) for cut, summary in analysis.margins.items()},
        )
        for role, analysis in analyses.items()
    }


def _margins(summary: MarginsSummary) -> Margins:
    """Return margins with infinity or NaN for null."""
    return Margins(
        gm_db=math.inf if summary.gm_db is None else summary.gm_db,
        pm_deg=math.inf if summary.pm_deg is None else summary.pm_deg,
        max_sensitivity=summary.max_sensitivity,
        crossover_radps=math.nan if summary.crossover_radps is None else summary.crossover_radps,
    )


def render(
    parts: Mapping[str, str],
    charts_by_id: Mapping[str, charts.Chart],
    template: Traversable = _HERE / "page.html",
) -> str:
    """Return a whole page: the shell with style, scripts and charts around a filled template.

    Parameters
    ----------
    parts : Mapping
        HTML of each place of the template, by its name, and the page's `title`.
    charts_by_id : Mapping
        Charts by the id of the element that shows each.
    template : Traversable
        File with the page's content.
    """
    return Template(_text("shell.html")).substitute(
        title=parts["title"],
        body=Template(template.read_text(encoding="utf-8")).substitute(parts),
        style=_text("style.css"),
        script=_text("charts.js"),
        plotly=_plotly(),
        charts=json.dumps(charts_by_id, separators=(",", ":")).replace("</", "<\\/"),
    )


def _lead(summary: CampaignSummary) -> str:
    """Return the summary of a campaign in one sentence."""
    model = summary.model
    result = "first gains were kept" if summary.design.kept_first else "gains were redesigned"
    return (
        f"A prototype controller was flown, {model.runs_accepted} tests were run, the model was"
        f" refitted to them, the {result}, and the missions were flown again:"
        f" {summary.vehicle_s / 60:.0f} minutes at sea, {summary.wall_s:.0f} seconds of"
        " computing."
    )


def _headline(steady: Mapping[str, SteadyErrorEntry], *, with_paper: bool) -> str:
    """Return the boxes with the steady errors before and after the redesign."""

    def box(what: str, key: str, show: Callable[[float], str]) -> str:
        """Return the box of one error."""
        paper = f'<br><span class="paper">the paper: {_PAPER[key]}</span>' if with_paper else ""
        was, now = (show(getattr(steady[name], key)) for name in ("initial", "redesigned"))
        return (
            f'<div><span class="what">{what}</span><br><span class="big"><span'
            f' class="was">{was}</span> → <span class="is">{now}</span></span>{paper}</div>'
        )

    return (
        box("Heading error", "heading_deg", lambda v: f"{format_value(v)}°")
        + box("Depth error", "depth_m", lambda v: f"{format_value(100 * v)} cm")
        + box("Pitch about its mean", "pitch_deg", lambda v: f"{format_value(v)}°")
    )


def place_figure(figure: Figure) -> str:
    """Return the title, note and place of a figure as HTML."""
    return (
        f'<div class="figure"><h3>{escape(figure.title)}</h3>'
        f'<p class="note">{escape(figure.note)}</p>'
        f'<div class="chart" id="{figure.key}"></div></div>'
    )


def places(titles: Mapping[str, str]) -> str:
    """Return the places of charts by their ids, each below its title, as HTML."""
    return "".join(
        f'<div class="figure"><h4>{escape(title)}</h4><div class="chart" id="{key}"></div></div>'
        for key, title in titles.items()
    )


def _footer(summary: CampaignSummary) -> str:
    """Return seed, number of messages and model of a campaign."""
    return (
        f"Seed {summary.seed}. {summary.messages} MAVLink messages recorded,"
        f" {summary.lost_frames} lost. Model {summary.design.model_sha256[:12]}."
    )


def _plotly() -> str:
    """Return plotly.js in its basic bundle (npm: plotly.js-basic-dist-min 4.1.1, MIT licence).

    It is part of the page, so the page needs no network. The Python package `plotly` would add
    64 MB of which nothing else is used.
    """
    return _text("plotly-basic.min.js")


def _text(name: str) -> str:
    return (_HERE / name).read_text(encoding="utf-8")


def specification(design: DesignSummary) -> str:
    """Return each limit of the specification with the value reached by the design."""
    rows = [
        [escape(row.limit), escape(row.asked), f"<b>{escape(row.reached)}</b>", escape(row.where)]
        for row in design_summary.rows(design)
    ]
    note = (
        '<p class="note">Other limits that are met:'
        f" {escape(design_summary.describe_other_limits(design.specification))}.</p>"
    )
    return tables.table(["", "asked", "reached", "at"], rows, "named prose") + note


def reasons(design: DesignSummary) -> str:
    """Return each parameter of the redesign with its reason."""
    rows = [
        [name, f"{value:.4g}", escape(design.reasons[name])] for name, value in design.gains.items()
    ]
    return tables.table(["parameter", "value", "reason"], rows, "named prose")


def monitoring(missions: Mapping[str, MonitorReport]) -> str:
    """Return measured and predicted rms errors of each mission in steady flight, and causes."""
    rows = []
    for mission, result in missions.items():
        cells = [_measured_and_predicted(result.rms.get(name)) for name in ROWS]
        causes = "; ".join(cause.message for cause in result.causes) or describe_agreement(
            result.rms, result.windows
        )
        rows.append([mission.replace("_", " "), f"{result.steady_s:.0f} s", *cells, escape(causes)])
    return tables.table(["mission", "steady flight", *ROWS.values(), ""], rows, "named prose")


def _measured_and_predicted(rms: RmsComparison | None) -> str:
    """Return the measured and, in brackets, the predicted rms as one cell."""
    return "–" if rms is None else f"<b>{rms.measured:.2f}</b> ({rms.predicted:.2f})"
