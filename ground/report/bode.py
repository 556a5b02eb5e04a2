"""Bode plot of a bench test at several amplitudes, as in Figure 4 of the paper."""

from collections.abc import Mapping
from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np

from ground.report import mpl_canvas
from sysid.estimation import bench_test
from sysid.estimation.bench_test import AxisBench, FrequencyPoint
from sysid.models import actuator
from sysid.models.bench_priors import AxisName

COLORS = ("#0f6e84", "#c2542d", "#7a8b2f", "#7b4b94", "#b08a1e")
GREY = "#4b4f55"
TICKS_HZ = (0.05, 0.1, 0.25, 0.5, 0.75, 1.0, 1.5)


def draw(bench: Mapping[AxisName, AxisBench], target: Path) -> Path:
    """Draw the measured and modelled actuator response of each axis.

    Parameters
    ----------
    bench : Mapping
        Bench-test result by axis.
    target : Path
        PNG or SVG file to write.

    Returns
    -------
    Path
        `target`.
    """
    with mpl_canvas.new_figure(target, (5.6 * len(bench), 7.0)) as figure:
        axes = figure.subplots(2, len(bench), sharex=True, sharey="row", squeeze=False)
        for column, (name, axis) in enumerate(bench.items()):
            _axis(axes[:, column], name, axis)
        handles, names = axes[0, 0].get_legend_handles_labels()
        figure.legend(
            handles, names, loc="outside lower center", ncols=2 * len(bench), frameon=False
        )
    return target


def _axis(panels: Any, name: str, axis: AxisBench) -> None:
    """Draw magnitude (dB) and phase (deg) of one axis over frequency (Hz)."""
    magnitude, phase = panels
    sizes = sorted({point.amplitude_deg for point in axis.points})
    for color, size in zip(cycle(COLORS), sizes, strict=False):
        points = sorted(
            (p for p in axis.points if p.amplitude_deg == size), key=lambda p: p.frequency_hz
        )
        _amplitude(magnitude, phase, points, f"{size:g} deg peak to peak", color)
    hz = np.geomspace(
        min(p.frequency_hz for p in axis.points), max(p.frequency_hz for p in axis.points), 200
    )
    for model, line, label in (
        (axis.model.axis, "-", "fitted, linear"),
        (actuator.PAPER, ":", "the paper's model"),
    ):
        _small_motion(magnitude, phase, hz, model, line, label)
    magnitude.plot([], [], "--", color=GREY, linewidth=1.1, label="fitted, same commands")
    magnitude.axhline(-3.0, color=GREY, linewidth=0.6, linestyle=(0, (1, 3)))
    magnitude.set_title(name, loc="left")
    magnitude.set_ylabel("duct angle over command, dB")
    phase.set_ylabel("phase, deg")
    phase.set_xlabel("Hz")
    for panel in panels:
        panel.set_xscale("log")
        panel.set_xticks(TICKS_HZ, [f"{tick:g}" for tick in TICKS_HZ])
        panel.minorticks_off()
        panel.grid(which="both", color=mpl_canvas.GRID, linewidth=0.8)


def _amplitude(
    magnitude: Any, phase: Any, points: list[FrequencyPoint], label: str, color: str
) -> None:
    """Draw the measured points of one amplitude (circles) and the fitted model (dashes)."""
    hz = [p.frequency_hz for p in points]
    gain, gain_sd = np.array([p.gain for p in points]), np.array([p.gain_sd for p in points])
    bars: Any = {"fmt": "o", "color": color, "markersize": 4.5, "elinewidth": 1.0, "label": label}
    magnitude.errorbar(hz, 20.0 * np.log10(gain), 20.0 / np.log(10.0) * gain_sd / gain, **bars)
    phase.errorbar(hz, [p.phase_deg for p in points], [p.phase_sd_deg for p in points], **bars)
    dashes: Any = {"linestyle": "--", "color": color, "linewidth": 1.1}
    magnitude.plot(hz, 20.0 * np.log10([p.model_gain for p in points]), **dashes)
    phase.plot(hz, [p.model_phase_deg for p in points], **dashes)


def _small_motion(magnitude: Any, phase: Any, hz: Any, model: Any, line: str, label: str) -> None:
    """Draw the response of the linear part of a model."""
    response = np.array([bench_test.linear_response(model, float(f)) for f in hz])
    magnitude.plot(
        hz, 20.0 * np.log10(np.abs(response)), line, color=GREY, linewidth=1.2, label=label
    )
    phase.plot(hz, np.degrees(np.unwrap(np.angle(response))), line, color=GREY, linewidth=1.2)
