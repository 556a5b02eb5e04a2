"""Validation figures of an identified model: frequency response, predictions and residuals."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ground.campaign.campaign_folder import CampaignFolder
from ground.report.figures import Curve, Figure, Panel
from sysid.control_analysis.loop_transfer import GRID_RADPS
from sysid.data.runs import Run
from sysid.estimation.map.datasets import STEP_S
from sysid.models.model_file import IdentifiedModel
from sysid.models.prediction import predict, vehicles
from sysid.planes import PLANES, Plane
from sysid.validation import crossover
from sysid.validation.prediction_bands import innovations, rate_band
from sysid.validation.validate import uncertain_vehicle
from sysid.validation.whiteness import cumulative_periodogram

Array = NDArray[np.float64]
NORMAL_95 = 1.96
"""Half-width of the 95 % interval of a normal quantity, in standard deviations."""
KOLMOGOROV = 1.358
"""5 % critical value of the Kolmogorov-Smirnov distance, times the root of the sample size."""
SHOWN_HZ = 10.0
"""Sample rate of the drawn curves."""


def response_figures(campaign: CampaignFolder) -> list[Figure]:
    """Return gain (dB), phase (deg) and coherence of each plane with sweep runs."""
    model = campaign.model
    return [
        _response(model, plane, campaign.prior_config)
        for plane, validation in model.validation.items()
        if validation.frequency_response
    ]


def prediction_figures(campaign: CampaignFolder) -> list[Figure]:
    """Return two held-out runs per plane, a step and another signal, with the predicted band."""
    return [
        _prediction(campaign.model, run, campaign.prior_config)
        for traits in PLANES.values()
        for run in _select_runs(campaign.runs(f"{traits.surface}_heldout"))
    ]


def whiteness_figures(campaign: CampaignFolder) -> list[Figure]:
    """Return the cumulative periodogram of the whitened residuals of each plane's held-out runs."""
    model = campaign.model
    return [
        _whiteness(model, plane, campaign.runs(f"{traits.surface}_heldout"), campaign.prior_config)
        for plane, traits in PLANES.items()
        if plane in model.noise
    ]


def _response(model: IdentifiedModel, plane: Plane, prior: Any) -> Figure:
    """Draw the response from surface command to rate, measured and by both models."""
    validation = model.validation[plane]
    measurement, crossing = validation.frequency_response, validation.crossover
    assert measurement is not None
    w, points = GRID_RADPS, np.array(measurement.frequency_radps)
    in_range = (w >= points[0] / 1.3) & (w <= points[-1] * 1.3)
    estimate = uncertain_vehicle(model, prior)
    refitted = crossover.response(estimate.vehicle(estimate.z), plane)[in_range]
    initial = crossover.response(vehicles(model, prior)[1], plane)[in_range]
    gain_sd, phase_sd = (NORMAL_95 * sd[in_range] for sd in crossover.response_sd(estimate, plane))

    def line(name: str, role: str, values: Array, sd: Array | None = None) -> Curve:
        low, high = (None, None) if sd is None else (values - sd, values + sd)
        return Curve(name=name, role=role, x=w[in_range], y=values, low=low, high=high)

    def measured(values: Sequence[float], sds: Sequence[float]) -> Curve:
        y, sd = np.array(values), NORMAL_95 * np.array(sds)
        return Curve(
            name="measured", role="measured", x=points, y=y, low=y - sd, high=y + sd, look="marks"
        )

    return Figure(
        key=f"response-{plane}",
        title=f"{plane.capitalize()} rate over {PLANES[plane].surface} command",
        note=(
            f"From {len(measurement.runs)} sweep runs; bars and band: 95 %. Dotted line: crossover"
            " with the gains of the tests. Shaded: coherence below 0.6."
            f" Mismatch cost {measurement.mismatch_cost or 0:.0f}."
        ),
        x_label="rad/s",
        panels=(
            Panel(
                "gain",
                "dB",
                (
                    line("initial model", "initial", _db(initial)),
                    line("refitted model", "redesigned", _db(refitted), gain_sd),
                    measured(measurement.gain_db, measurement.gain_sd_db),
                ),
            ),
            Panel(
                "phase",
                "°",
                (
                    line("initial model", "initial", _degrees(initial)),
                    line("refitted model", "redesigned", _degrees(refitted), phase_sd),
                    measured(measurement.phase_deg, measurement.phase_sd_deg),
                ),
            ),
            Panel(
                title="coherence",
                y_label="",
                curves=(
                    Curve(
                        name="coherence",
                        role="measured",
                        x=points,
                        y=np.array(measurement.coherence),
                    ),
                    Curve(name="limit", role="set_point", x=points, y=np.full(points.size, 0.6)),
                ),
                limits=(0.0, 1.05),
            ),
        ),
        log_x=True,
        shaded=_incoherent_intervals(points, np.array(measurement.coherence)),
        upright=crossing.crossover_radps if crossing else None,
    )


def _prediction(model: IdentifiedModel, run: Run, prior: Any) -> Figure:
    """Draw the measured and the predicted rate of a held-out run with 95 % bands."""
    predicted, band = predict(model, run, prior), rate_band(model, run, prior)
    first = run.time_s.size - band.time_s.size
    thin = slice(first, None, int(50.0 / SHOWN_HZ))
    t = run.time_s[thin]
    inside = slice(None, None, int(50.0 / SHOWN_HZ))
    estimate_band = np.degrees(NORMAL_95 * band.estimate_radps[inside])
    total_band = np.degrees(NORMAL_95 * np.hypot(band.estimate_radps, band.noise_radps)[inside])
    predicted_degps = np.degrees(predicted.rate_radps[thin])
    outside = np.mean(
        np.abs(np.degrees(run.rate_radps[thin]) - predicted_degps)[t >= 0.0] > total_band[t >= 0.0]
    )
    return Figure(
        key=f"held-out-{run.name.replace('/', '-')}",
        title=(
            f"{run.wave.capitalize()} of {run.magnitude_deg:+g}°"
            f" on the {PLANES[run.plane].surface}, held out"
        ),
        note=(
            f"Narrow band: uncertainty of the estimate. {outside:.0%} of the measured samples lie"
            " outside the wide band."
        ),
        x_label="seconds since the test began",
        panels=(
            Panel(
                f"{run.plane} rate",
                "°/s",
                (
                    Curve(
                        name="incl. sea and sensors, 95 %",
                        role="redesigned",
                        x=t,
                        y=predicted_degps,
                        low=predicted_degps - total_band,
                        high=predicted_degps + total_band,
                        look="band",
                    ),
                    Curve(
                        name="refitted model",
                        role="redesigned",
                        x=t,
                        y=predicted_degps,
                        low=predicted_degps - estimate_band,
                        high=predicted_degps + estimate_band,
                    ),
                    Curve(
                        name="measured", role="measured", x=t, y=np.degrees(run.rate_radps[thin])
                    ),
                    Curve(
                        name="initial model",
                        role="initial",
                        x=t,
                        y=np.degrees(predicted.prior_rate_radps[thin]),
                    ),
                ),
            ),
        ),
    )


def _whiteness(model: IdentifiedModel, plane: Plane, runs: Sequence[Run], prior: Any) -> Figure:
    """Draw the cumulative periodogram of the innovations with its 95 % band."""
    residuals = np.concatenate(
        [i - np.mean(i) for i in (innovations(model, run, prior) for run in runs)]
    )
    cumulative_power = cumulative_periodogram(residuals)
    hz = np.linspace(0.0, 0.5 / STEP_S, cumulative_power.size)
    diagonal = np.linspace(0.0, 1.0, cumulative_power.size)
    half_width = KOLMOGOROV / np.sqrt(cumulative_power.size)
    return Figure(
        key=f"whiteness-{plane}",
        title=f"Residuals of held-out {PLANES[plane].surface} tests",
        note=(
            "Cumulative periodogram of the whitened rate: white noise stays within the band in 95 %"
            " of cases."
        ),
        x_label="Hz",
        panels=(
            Panel(
                title="share of power",
                y_label="",
                curves=(
                    Curve(
                        name="white noise",
                        role="set_point",
                        x=hz,
                        y=diagonal,
                        low=diagonal - half_width,
                        high=diagonal + half_width,
                    ),
                    Curve(name="whitened residual", role="redesigned", x=hz, y=cumulative_power),
                ),
                limits=(0.0, 1.0),
            ),
        ),
    )


def _select_runs(runs: Sequence[Run]) -> list[Run]:
    """Return the largest step and the largest of the other signals, as far as present."""
    kinds = [[run for run in runs if (run.wave == "step") == steps] for steps in (True, False)]
    return [max(kind, key=lambda run: abs(run.magnitude_deg)) for kind in kinds if kind]


def _incoherent_intervals(x: Array, coherence: Array) -> tuple[tuple[float, float], ...]:
    """Return the intervals of `x` (spaced logarithmically) with a coherence below 0.6."""
    half = np.sqrt(x[1] / x[0])
    return tuple(
        (float(centre / half), float(centre * half))
        for centre, c in zip(x, coherence, strict=True)
        if c < 0.6
    )


def _db(response: NDArray[np.complex128]) -> Array:
    return np.asarray(20.0 * np.log10(np.abs(response)))


def _degrees(response: NDArray[np.complex128]) -> Array:
    return np.degrees(np.unwrap(np.angle(response)))
