"""Plots of the paper's Table 4: root loci, loop responses and the delay that each pole implies."""

from pathlib import Path
from typing import Any

import numpy as np

from ground.report import mpl_canvas
from ground.report.paper_poles import PolesComparison
from sysid.control_analysis import loop_state_space, loop_transfer, root_locus
from sysid.reproduction import paper_poles
from sysid.reproduction.paper_poles import Case
from sysid.reproduction.paper_poles.search import FIGURE_4, LAGS
from sysid.reproduction.paper_tables import TABLE_4

COLORS = {"I/I": "#c2542d", "A/I": "#b08a1e", "A/A": "#7a8b2f", "ours/P": "#0f6e84"}
NAMES = {
    "I/I": "initial model, initial gains",
    "A/I": "adjusted model, initial gains",
    "A/A": "adjusted model, improved gains",
    "ours/P": "our first-principles model, our prototype's gains",
}
CUTS = {"heading": "rudder", "pitch": "pitch", "depth": "elevator"}
GREY, INK = "#9aa3ab", "#4b4f55"
FORM_COLORS = ("#c2542d", "#0f6e84", "#7a8b2f", "#9aa3ab", "#111111")
FORM_LINES = ("-", "-", "-", "-", ":")
DAMPINGS = (0.4, 0.6, 0.8)
LEFT, RIGHT, TOP = -3.4, 0.8, 3.2


def draw(comparison: PolesComparison, folder: Path) -> list[Path]:
    """Write three PNG files into `folder` and return their paths."""
    cases = [*paper_poles.printed_cases(), comparison.ours[-1]]
    files = [folder / f"table_4_{name}.png" for name in ("root_locus", "bode", "delay")]
    _root_loci(cases, files[0])
    _bode(cases, files[1])
    _delays(comparison, files[2])
    return files


def _root_loci(cases: list[Case], target: Path) -> None:
    """Draw one panel per loop (rows) and case (columns)."""
    with mpl_canvas.new_figure(target, (3.4 * len(cases), 9.6)) as figure:
        panels = figure.subplots(len(paper_poles.LOOPS), len(cases), sharex=True, sharey=True)
        for row, loop in zip(panels, paper_poles.LOOPS, strict=True):
            for panel, case in zip(row, cases, strict=True):
                _locus(panel, loop, case)
            row[0].set_ylabel(f"{loop}: imaginary, rad/s")
        for panel, case in zip(panels[0], cases, strict=True):
            panel.set_title(NAMES[case.name].replace(", ", ",\n"), loc="left", fontsize=10)
        for panel in panels[-1]:
            panel.set_xlabel("real, rad/s")
        handles, names = panels[0, 0].get_legend_handles_labels()
        figure.legend(handles, names, loc="outside lower center", ncols=5, frameon=False)


def _locus(panel: Any, loop: str, case: Case) -> None:
    """Draw the root locus, upper half-plane, for 0 to 3 times the loop gain."""
    closed = paper_poles.close_case(loop, case)
    cut = paper_poles.open_loop(loop, closed)
    branches = root_locus.poles(cut, np.concatenate([[0.0], np.geomspace(1e-3, 3.0, 400)]))
    _draw_damping_rays(panel)
    for branch in branches.T:
        upper = np.where(branch.imag >= -1e-9, branch, np.nan)
        panel.plot(upper.real, upper.imag, color=COLORS[case.name], linewidth=1.4)
    _marks(panel, branches[0], "x", GREY, "zero gain", 6)
    _marks(panel, root_locus.zeros(cut), "o", GREY, "zeros", 6)
    _marks(panel, loop_state_space.poles(closed), "s", INK, "designed gain", 5)
    if (loop, case.name) in TABLE_4:
        _marks(
            panel, np.array([TABLE_4[loop, case.name]]), "*", "#111111", "printed in Table 4", 12
        )
    panel.set_xlim(LEFT, RIGHT)
    panel.set_ylim(-0.1, TOP)
    panel.grid(color=mpl_canvas.GRID, linewidth=0.8)


def _marks(panel: Any, poles: Any, marker: str, color: str, label: str, size: float) -> None:
    """Draw poles or zeros that lie within the axes."""
    inside = poles[
        (poles.imag >= -1e-9) & (poles.real > LEFT) & (poles.real < RIGHT) & (poles.imag < TOP)
    ]
    panel.plot(
        inside.real,
        inside.imag,
        marker,
        color=color,
        markersize=size,
        fillstyle="none",
        label=label,
        markeredgewidth=1.3,
        linestyle="none",
        clip_on=False,
        zorder=3,
    )


def _draw_damping_rays(panel: Any) -> None:
    """Draw rays of equal damping ratio."""
    panel.axvline(0.0, color=GREY, linewidth=0.8)
    for ratio in DAMPINGS:
        reach = min(-LEFT, TOP * ratio / np.sqrt(1.0 - ratio**2))
        end = -reach, reach * np.sqrt(1.0 - ratio**2) / ratio
        panel.plot([0.0, end[0]], [0.0, end[1]], color=GREY, linewidth=0.7, linestyle=(0, (1, 3)))
        panel.annotate(
            f"{ratio:g}",
            (0.9 * end[0], 0.9 * end[1]),
            color=GREY,
            fontsize=8,
            ha="left",
            va="bottom",
        )


def _bode(cases: list[Case], target: Path) -> None:
    """Draw Bode plots of the loops opened at rudder and elevator, with the exact delay."""
    with mpl_canvas.new_figure(target, (13.0, 7.4)) as figure:
        panels = figure.subplots(2, len(paper_poles.LOOPS), sharex=True, sharey="row")
        for (magnitude, phase), loop in zip(panels.T, paper_poles.LOOPS, strict=True):
            for case in cases:
                _response(magnitude, phase, loop, case)
            magnitude.set_title(
                f"{loop}, opened at the {'rudder' if loop == 'heading' else 'elevator'}", loc="left"
            )
            magnitude.axhline(0.0, color=GREY, linewidth=0.8)
            phase.axhline(-180.0, color=GREY, linewidth=0.8)
            phase.set_xlabel("rad/s")
            phase.legend(
                frameon=False,
                fontsize=8,
                loc="lower left",
                title="gain and phase margin",
                title_fontsize=8,
            )
        panels[0, 0].set(ylabel="loop gain, dB", ylim=(-40, 40), xlim=(0.02, 10.0), xscale="log")
        panels[1, 0].set(ylabel="phase, deg", ylim=(-450, 0), yticks=range(-450, 1, 90))
        for panel in panels.flat:
            panel.grid(which="both", color=mpl_canvas.GRID, linewidth=0.7)
        handles, _ = panels[0, 0].get_legend_handles_labels()
        figure.legend(
            handles,
            [NAMES[case.name] for case in cases],
            loc="outside lower center",
            ncols=2,
            frameon=False,
        )


def _response(magnitude: Any, phase: Any, loop: str, case: Case) -> None:
    """Draw the open-loop gain (dB) and phase (deg) of one case."""
    plane, lag = (
        (case.planes.yaw, case.yaw_lag)
        if loop == "heading"
        else (case.planes.pitch, case.pitch_lag)
    )
    open_loop = loop_transfer.heading_loops if loop == "heading" else loop_transfer.depth_loops
    cut = open_loop(loop_transfer.responses(plane, lag), case.gains)[CUTS[loop]]
    margins = loop_transfer.margins(cut)
    color, label = COLORS[case.name], f"{case.name}: {margins.gm_db:.1f} dB, {margins.pm_deg:.0f}°"
    magnitude.plot(
        loop_transfer.GRID_RADPS,
        20.0 * np.log10(np.abs(cut)),
        color=color,
        linewidth=1.4,
        label=label,
    )
    angle = np.degrees(np.unwrap(np.angle(cut)))
    # The integrators give a phase of -90 or -180 deg at low frequency: remove the whole turns that
    # unwrapping may add.
    angle -= 360.0 * np.ceil((angle[0] - 1.0) / 360.0)
    phase.plot(loop_transfer.GRID_RADPS, angle, color=color, linewidth=1.4, label=label)


def _delays(comparison: PolesComparison, target: Path) -> None:
    """Draw the misfit over the delay, and the delay implied by each printed pole."""
    with mpl_canvas.new_figure(target, (11.0, 4.6)) as figure:
        by_form, by_row = figure.subplots(1, 2, width_ratios=(1.15, 1.0))
        _draw_misfits(by_form)
        _draw_single_pole_conditions(by_row, comparison)
        for panel in (by_form, by_row):
            panel.grid(color=mpl_canvas.GRID, linewidth=0.8)


def _draw_misfits(panel: Any) -> None:
    """Draw the rms distance of printed and computed poles (rad/s) over the delay (s)."""
    search, delays_s = paper_poles.TailconeSearch(), np.linspace(0.02, 0.8, 40)
    for form, color, line in zip(paper_poles.FORMS, FORM_COLORS, FORM_LINES, strict=True):
        misfits = [
            search.misfit(LAGS[FIGURE_4]._replace(delay_s=float(delay_s)), form)
            for delay_s in delays_s
        ]
        panel.plot(delays_s, misfits, line, color=color, linewidth=1.5, label=form.name)
    panel.set(xlabel="delay, s", ylabel="rad/s", ylim=(0.0, 1.2), xlim=(0.0, 0.8))
    panel.set_title(
        f"printed minus computed poles, rms, lag of {FIGURE_4}", loc="left", fontsize=10
    )
    panel.legend(frameon=False, fontsize=9)


def _draw_single_pole_conditions(panel: Any, comparison: PolesComparison) -> None:
    """Draw the delay (s) and loop gain with which the model has each printed pole."""
    rows = comparison.alone[::-1]
    for height, row in enumerate(rows):
        bars: Any = {"fmt": "o", "color": COLORS[row.case], "elinewidth": 1.4, "capsize": 3}
        panel.errorbar(row.delay_s, height, xerr=row.delay_sd_s, **bars)
        panel.annotate(
            f"gain × {row.loop_gain:.2f}", (0.7, height), va="center", fontsize=9, color=INK
        )
    panel.axvline(0.3, color=GREY, linewidth=1.0, linestyle="--")
    panel.set_yticks(range(len(rows)), [f"{row.loop} {row.case}" for row in rows])
    panel.set(xlabel="delay, s (dashed: the paper's value)", xlim=(0.0, 0.88))
    panel.set_title(
        "delay implied by each printed pole, ± 1 sd of the lag", loc="left", fontsize=10
    )
