"""HTML report of one dive, or of several dives side by side: one file that needs no network."""

import json
from collections.abc import Sequence
from html import escape
from importlib.resources import files
from pathlib import Path

import numpy as np

from ground.client import verdict
from ground.client.assessment import AssessedLeg, format_heading, format_value
from ground.report import dive_charts, page
from ground.report.dive_data import ReportedDive, read_dives
from ground.report.tables import table
from ground.report.verdict_words import SIGNS, as_sentence
from mavlink_io.errors import InputError
from mavlink_io.user_data_dir import write_output
from sysid.data.readers.servo_channels import FROM_LOG, OutputOptions
from sysid.monitor import tracking_metrics

MAX_DIVES = 6
"""Dives of one report: more lines cannot be distinguished."""
MAX_LISTED = 400
"""Rows of a table of events or parameters."""
MAX_OPEN_ROWS = 25
"""Rows from which a table of events or parameters is folded."""
_HERE = files("ground.report")


def write(
    paths: Sequence[Path], target: Path | None = None, options: OutputOptions = FROM_LOG
) -> Path:
    """Write the report of one dive or of several.

    Parameters
    ----------
    paths : sequence of Path
        One to `MAX_DIVES` logs of any format that the readers know.
    target : Path, optional
        HTML file. Default: name of the first log with ``-report.html``, beside it.
    options : OutputOptions
        Output numbers of rudder, elevator and thrust of a log without them.

    Returns
    -------
    Path
        The file written; an existing one is overwritten.

    Raises
    ------
    InputError
        A log cannot be read, or there are too many.
    OSError
        The file cannot be written.
    """
    if len(paths) > MAX_DIVES:
        raise InputError(f"{len(paths)} logs: a report shows at most {MAX_DIVES} dives")
    target = target or default_target(paths[0])
    html = render(read_dives(paths, options))
    write_output(target, html)
    return target


def default_target(log: Path) -> Path:
    """Return the path of a report whose first log is `log`, beside it."""
    return log.with_name(f"{log.stem}-report.html")


def render(dives: Sequence[ReportedDive]) -> str:
    """Return the page of a report.

    Parameters
    ----------
    dives : sequence of ReportedDive
        Dives in the order of the page.

    Returns
    -------
    str
        HTML.
    """
    charts_by_id = {
        "motion": dive_charts.motion_chart(dives),
        "actuators": dive_charts.actuator_chart(dives),
    }
    known = all(dive.names_surfaces for dive in dives)
    if has_legs := any(dive.assessment.legs for dive in dives):
        charts_by_id["errors"] = dive_charts.error_chart(dives)
    names = " and ".join(dive.label for dive in dives) if len(dives) < 3 else f"{len(dives)} dives"
    track = json.dumps(dive_charts.track_data(dives), separators=(",", ":"))
    parts = {
        "title": escape(f"Dive report: {names}"),
        "verdicts": "".join(map(_card, range(len(dives)), dives)),
        "comparison": _comparison(dives) if len(dives) > 1 else "",
        "errors": _ERRORS if has_legs else "",
        "settling": f"{tracking_metrics.SETTLING_S:g}",
        "legs": "".join(map(_legs, dives)),
        "track_note": escape(_track_note(dives)),
        "track": track.replace("</", "<\\/"),
        "track_script": (_HERE / "track.js").read_text(encoding="utf-8"),
        "options": "".join(
            f'<option value="{number}">{escape(dive.label)}</option>'
            for number, dive in enumerate(dives)
        ),
        "setpoint_note": "" if len(dives) == 1 else " Dotted lines are the set-points.",
        "actuator_note": escape(_SURFACES if known else _OUTPUTS),
        "parameters": _parameters(dives),
        "events": "".join(map(_events, dives)),
        "footer": "<br>".join(map(_source, dives)),
    }
    return page.render(parts, charts_by_id, _HERE / "dives.html")


_ERRORS = (
    '<div class="figure"><h3>Errors by leg</h3><p class="note">Bars: 95 % of the error is smaller.'
    ' Dotted line: limit of a good leg.</p><div class="chart" id="errors"></div></div>'
)


_SURFACES = (
    "Commands after the autopilot's limits. Positive rudder turns the nose to starboard, positive"
    " elevator turns it up."
)
_OUTPUTS = (
    "The first three outputs of the autopilot, or rudder, elevator and thrust where they are known,"
    " in percent of full. A log without SERVOn_FUNCTION of rudder and throttle does not say which"
    " output is which; --servo-channels does."
)


def _card(number: int, dive: ReportedDive) -> str:
    """Return the verdict of a dive."""
    assessment = dive.assessment
    others = verdict.reasons(assessment)[1:]
    more = "".join(f"<li>{as_sentence(reason.message)}</li>" for reason in others)
    learned = (
        f"<p>Trims learned: {escape(assessment.trims_learned)}.</p>"
        if assessment.trims_learned
        else ""
    )
    return (
        f'<section class="verdict {assessment.outcome.name.lower()}">'
        f'<p class="dive"><span class="swatch {dive_charts.role(number)}"></span>'
        f"{escape(dive.label)}</p>"
        f'<p class="outcome"><span class="sign">{SIGNS[assessment.outcome]}</span>'
        f" {assessment.outcome.capitalize()}</p>"
        f"<p>{as_sentence(verdict.headline(assessment))}</p>"
        f"<p><b>Next:</b> {as_sentence(verdict.next_step(assessment))}</p>"
        + (f"<ul>{more}</ul>" if more else "")
        + learned
        + f'<p class="note">{_figures(dive)}</p></section>'
    )


def _figures(dive: ReportedDive) -> str:
    """Return duration, depth and distance of a dive."""
    track = dive.track
    steps_m = np.hypot(np.diff(track.north_m), np.diff(track.east_m))
    return (
        f"{track.time_s[-1]:.0f} s, {np.max(dive.log.depth.depth_m):.1f} m deep,"
        f" {np.sum(steps_m):.0f} m long."
    )


def _comparison(dives: Sequence[ReportedDive]) -> str:
    """Return the main figures of all dives side by side."""

    def worst(legs: Sequence[AssessedLeg], axis: str) -> str:
        """Return the largest 95 % error over the legs."""
        errors = [getattr(leg, axis).p95 for leg in legs]
        return format_value(max(errors)) if errors else "–"

    def mean(legs: Sequence[AssessedLeg], name: str) -> str:
        """Return the mean over the legs."""
        return f"{np.mean([getattr(leg, name) for leg in legs]):.1f}" if legs else "–"

    legs = [dive.assessment.legs for dive in dives]
    used = [dive.assessment.legs if dive.names_surfaces else () for dive in dives]
    rows = [
        ["verdict", *(f"<b>{dive.assessment.outcome}</b>" for dive in dives)],
        ["legs assessed", *(str(len(leg_set)) for leg_set in legs)],
        ["heading error, largest 95 %, °", *(worst(leg_set, "heading_deg") for leg_set in legs)],
        ["depth error, largest 95 %, m", *(worst(leg_set, "depth_m") for leg_set in legs)],
        ["mean rudder, °", *(mean(leg_set, "rudder_deg") for leg_set in used)],
        ["rudder activity, sd, °", *(mean(leg_set, "rudder_sd_deg") for leg_set in used)],
        ["mean elevator, °", *(mean(leg_set, "elevator_deg") for leg_set in used)],
        ["elevator activity, sd, °", *(mean(leg_set, "elevator_sd_deg") for leg_set in used)],
        ["mean pitch, °", *(mean(leg_set, "pitch_deg") for leg_set in legs)],
        ["at a stop, % of the time", *(mean(leg_set, "at_stop_pct") for leg_set in used)],
    ]
    heads = ["", *(escape(dive.label) for dive in dives)]
    return f"<h2>Side by side</h2>{table(heads, rows)}"


def _legs(dive: ReportedDive) -> str:
    """Return each leg of a dive with errors and use of the actuators."""
    legs = dive.assessment.legs
    title = f"<h3>Legs of {escape(dive.label)}</h3>"
    if not legs:
        return f'{title}<p class="note">{as_sentence(dive.assessment.reason)}</p>'
    rows = [
        [
            f"leg {number}",
            f"{leg.start_s - dive.start_s:.0f}–{leg.stop_s - dive.start_s:.0f}",
            format_heading(leg.heading_setpoint_deg),
            f"{leg.heading_deg.mean:+.1f}",
            f"<b>{leg.heading_deg.p95:.1f}</b>",
            f"{leg.depth_setpoint_m:.1f}",
            f"{leg.depth_m.mean:+.2f}",
            f"<b>{leg.depth_m.p95:.2f}</b>",
            *(_surfaces(leg) if dive.names_surfaces else "–" * 4),
            escape(verdict.remark(leg)),
        ]
        for number, leg in enumerate(legs, 1)
    ]
    heads = [
        "",
        "time&nbsp;s",
        "heading set-point&nbsp;°",
        "mean error&nbsp;°",
        "95&nbsp;%&nbsp;°",
        "depth set-point&nbsp;m",
        "mean error&nbsp;m",
        "95&nbsp;%&nbsp;m",
        "rudder&nbsp;°",
        "elevator&nbsp;°",
        "thrust&nbsp;%",
        "at a stop&nbsp;%",
        "verdict",
    ]
    return title + table(heads, rows, "prose")


def _surfaces(leg: AssessedLeg) -> tuple[str, str, str, str]:
    """Return the use of the actuators on a leg as cells."""
    return (
        f"{leg.rudder_deg:.1f} ± {leg.rudder_sd_deg:.1f}",
        f"{leg.elevator_deg:.1f} ± {leg.elevator_sd_deg:.1f}",
        f"{leg.thrust_pct:.0f}",
        f"{leg.at_stop_pct:.0f}",
    )


def _track_note(dives: Sequence[ReportedDive]) -> str:
    """Return where the tracks come from; with the names of the dives if it differs."""
    sources = dict.fromkeys(dive.track.source for dive in dives)
    if len(sources) > 1:
        return "Position: " + "; ".join(f"{d.label}: {d.track.source}" for d in dives) + "."
    return "Position: " + "; ".join(sources) + "."


def _parameters(dives: Sequence[ReportedDive]) -> str:
    """Return the parameters that differ between dives, or those of a single dive."""
    logs = [dive.log for dive in dives]
    names = sorted({name for log in logs for name in log.parameters})
    if len(dives) == 1:
        rows = [[escape(name), f"{logs[0].parameters[name]:g}"] for name in names]
        if not rows:
            return '<h2>Parameters</h2><p class="note">The log has no parameters.</p>'
        return "<h2>Parameters</h2>" + _folded(["parameter", "value"], rows, "parameters")
    values = {name: [log.parameters.get(name) for log in logs] for name in names}
    rows = [
        [escape(name), *("–" if value is None else f"{value:g}" for value in row)]
        for name, row in values.items()
        if len(set(row)) > 1
    ]
    title = "<h2>Parameter differences</h2>"
    if not rows:
        return f'{title}<p class="note">The {len(names)} parameters of the logs are equal.</p>'
    heads = ["parameter", *(escape(dive.label) for dive in dives)]
    note = f'<p class="note">{len(rows)} of {len(names)} parameters differ.</p>'
    return title + note + _folded(heads, rows, "differences")


def _events(dive: ReportedDive) -> str:
    """Return the events of a dive."""
    rows = [
        [f"{event.time_s:.1f}", event.kind, escape(event.text)]
        for event in dive.events[:MAX_LISTED]
    ]
    title = f"<h3>{escape(dive.label)}</h3>"
    if not rows:
        return f'{title}<p class="note">The log has no events.</p>'
    return title + _folded(["time, s", "kind", "event"], rows, "events", len(dive.events))


def _folded(heads: Sequence[str], rows: list[list[str]], noun: str, count: int = 0) -> str:
    """Return a table, folded if it is long."""
    count = count or len(rows)
    html = table(heads, rows[:MAX_LISTED], "prose" if noun == "events" else "")
    if count > MAX_LISTED:
        html += f'<p class="note">The first {MAX_LISTED} of {count} {noun}.</p>'
    if len(rows) <= MAX_OPEN_ROWS:
        return html
    return f"<details><summary>{count} {noun}</summary>{html}</details>"


def _source(dive: ReportedDive) -> str:
    """Return what the reader found in a file."""
    log = dive.log
    parts = [
        f"{escape(str(dive.label))}: {log.attitude.time_s.size} samples of attitude",
        f"{log.actuators.time_s.size} of commands",
        f"SHA-256 {log.sha256[:12]}",
    ]
    parts += [escape(log.damage)] if log.damage else []
    parts += [
        f"the clock of {escape(step.message)} went back {step.back_s:.1f} s at {step.time_s:.1f} s"
        for step in log.clock.steps[:3]
    ]
    return ", ".join(parts) + "."
