"""What an identified model rests on, as figures: its response laid over the runs', predictions, and
what is left."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ground.campaign.campaign_folder import CampaignFolder
from ground.report.figures import Curve, Figure, Panel

if TYPE_CHECKING:
    from sysid.data.segments import Plane, Run
    from sysid.models.model_file import IdentifiedModel

Array = NDArray[np.float64]
NORMAL_95 = 1.96
"""Standard deviations on either side that hold 95 % of a normal quantity."""
KOLMOGOROV = 1.358
"""Over the root of the number of ordinates: the distance that 5 % of white series exceed."""
MOTIONS = {"yaw": "yaw", "pitch": "pitch"}
SURFACES = {"yaw": "rudder", "pitch": "elevator"}
HELD_OUT_MISSIONS = {"yaw": "rudder_heldout", "pitch": "elevator_heldout"}
SHOWN_HZ = 10.0


def response_figures(model: "IdentifiedModel") -> list[Figure]:
    """Gain, phase and coherence of each plane that has runs which sweep."""
    return [_response(model, plane) for plane, found in model.validation.items() if found.overlay]


def prediction_figures(campaign: CampaignFolder) -> list[Figure]:
    """Held-out runs of each plane with the band that the model allows them: the largest step, and
    another signal."""
    return [
        _prediction(campaign.model, run)
        for mission in HELD_OUT_MISSIONS.values()
        for run in _select_runs(campaign.runs(mission))
    ]


def whiteness_figures(campaign: CampaignFolder) -> list[Figure]:
    """Cumulative periodogram of what the held-out runs of each plane leave, whitened."""
    model = campaign.model
    return [
        _whiteness(model, plane, campaign.runs(mission))
        for plane, mission in HELD_OUT_MISSIONS.items()
        if plane in model.noise
    ]


def _response(model: "IdentifiedModel", plane: "Plane") -> Figure:
    from sysid.control_analysis.loop_transfer import GRID_RADPS
    from sysid.models import prediction as predict
    from sysid.validation import crossover
    from sysid.validation.validate import uncertain_vehicle

    laid, crossed = model.validation[plane].overlay, model.validation[plane].crossover
    assert laid is not None
    w, points = GRID_RADPS, np.array(laid.frequency_radps)
    shown = (w >= points[0] / 1.3) & (w <= points[-1] * 1.3)
    belief = uncertain_vehicle(model)
    ours = crossover.response(belief.vehicle(belief.z), plane)[shown]
    first = crossover.response(predict.vehicles(model)[1], plane)[shown]
    gain_sd, phase_sd = (NORMAL_95 * sd[shown] for sd in crossover.response_sd(belief, plane))

    def line(name: str, role: str, values: Array, sd: Array | None = None) -> Curve:
        low, high = (None, None) if sd is None else (values - sd, values + sd)
        return Curve(name, role, w[shown], values, low, high)

    def measured(values: Sequence[float], sds: Sequence[float]) -> Curve:
        y, sd = np.array(values), NORMAL_95 * np.array(sds)
        return Curve("measured", "measured", points, y, y - sd, y + sd, look="marks")

    surface, motion = SURFACES[plane], MOTIONS[plane]
    return Figure(
        key=f"response-{plane}",
        title=f"{motion.capitalize()} rate over {surface} command",
        note=(
            f"From {len(laid.runs)} runs that sweep; bars and band hold 95 %. The dotted line is"
            " the crossover of the gains aboard. Frequencies of coherence below 0.6 are shaded."
            f" Mismatch cost {laid.mismatch_cost or 0:.0f}."
        ),
        x_label="rad/s",
        panels=(
            Panel(
                "gain",
                "dB",
                (
                    line("initial model", "initial", _db(first)),
                    line("refitted model", "redesigned", _db(ours), gain_sd),
                    measured(laid.gain_db, laid.gain_sd_db),
                ),
            ),
            Panel(
                "phase",
                "°",
                (
                    line("initial model", "initial", _degrees(first)),
                    line("refitted model", "redesigned", _degrees(ours), phase_sd),
                    measured(laid.phase_deg, laid.phase_sd_deg),
                ),
            ),
            Panel(
                "coherence",
                "",
                (
                    Curve("coherence", "measured", points, np.array(laid.coherence)),
                    Curve("least that counts", "set_point", points, np.full(points.size, 0.6)),
                ),
                (0.0, 1.05),
            ),
        ),
        log_x=True,
        shaded=_incoherent_intervals(points, np.array(laid.coherence)),
        upright=crossed.crossover_radps if crossed else None,
    )


def _prediction(model: "IdentifiedModel", run: "Run") -> Figure:
    from sysid.models.prediction import predict
    from sysid.validation.prediction_bands import rate_band

    predicted, band = predict(model, run), rate_band(model, run)
    first = run.time_s.size - band.time_s.size
    thin = slice(first, None, int(50.0 / SHOWN_HZ))
    t = run.time_s[thin]
    inside = slice(None, None, int(50.0 / SHOWN_HZ))
    doubt = np.degrees(NORMAL_95 * band.estimate_radps[inside])
    whole = np.degrees(NORMAL_95 * np.hypot(band.estimate_radps, band.sea_radps)[inside])
    ours = np.degrees(predicted.rate_radps[thin])
    outside = np.mean(np.abs(np.degrees(run.rate_radps[thin]) - ours)[t >= 0.0] > whole[t >= 0.0])
    return Figure(
        key=f"held-out-{run.name.replace('/', '-')}",
        title=(
            f"{run.wave.capitalize()} of {run.magnitude_deg:+g}° on the {SURFACES[run.plane]},"
            " held out"
        ),
        note=(
            f"Narrow band: the estimate's doubt alone. Of what was measured, {outside:.0%} lie"
            " outside the wide one."
        ),
        x_label="seconds since the test began",
        panels=(
            Panel(
                f"{MOTIONS[run.plane]} rate",
                "°/s",
                (
                    Curve(
                        "with sea and sensors, 95 %",
                        "redesigned",
                        t,
                        ours,
                        ours - whole,
                        ours + whole,
                        look="band",
                    ),
                    Curve("refitted model", "redesigned", t, ours, ours - doubt, ours + doubt),
                    Curve("measured", "measured", t, np.degrees(run.rate_radps[thin])),
                    Curve(
                        "initial model", "initial", t, np.degrees(predicted.prior_rate_radps[thin])
                    ),
                ),
            ),
        ),
    )


def _whiteness(model: "IdentifiedModel", plane: "Plane", runs: "Sequence[Run]") -> Figure:
    from sysid.validation.prediction_bands import innovations
    from sysid.validation.validate import DT_S
    from sysid.validation.whiteness import cumulative_periodogram

    left = np.concatenate([i - np.mean(i) for i in (innovations(model, run) for run in runs)])
    rising = cumulative_periodogram(left)
    hz = np.linspace(0.0, 0.5 / DT_S, rising.size)
    diagonal, room = np.linspace(0.0, 1.0, rising.size), KOLMOGOROV / np.sqrt(rising.size)
    return Figure(
        key=f"whiteness-{plane}",
        title=f"What held-out {SURFACES[plane]} tests leave",
        note=(
            "Cumulative periodogram of the whitened rate: white noise stays within the band in 95 %"
            " of cases."
        ),
        x_label="Hz",
        panels=(
            Panel(
                "share of power",
                "",
                (
                    Curve(
                        "white noise", "set_point", hz, diagonal, diagonal - room, diagonal + room
                    ),
                    Curve("whitened residual", "redesigned", hz, rising),
                ),
                (0.0, 1.0),
            ),
        ),
    )


def _select_runs(runs: "Sequence[Run]") -> "list[Run]":
    """The largest step and the largest of the other signals, where there are both."""
    kinds = [[run for run in runs if (run.wave == "step") == steps] for steps in (True, False)]
    return [max(kind, key=lambda run: abs(run.magnitude_deg)) for kind in kinds if kind]


def _incoherent_intervals(x: Array, coherence: Array) -> tuple[tuple[float, float], ...]:
    """Stretches of ``x``, evenly spaced by ratio, whose coherence is too low to count."""
    half = np.sqrt(x[1] / x[0])
    return tuple(
        (float(at / half), float(at * half)) for at, c in zip(x, coherence, strict=True) if c < 0.6
    )


def _db(response: NDArray[np.complex128]) -> Array:
    return np.asarray(20.0 * np.log10(np.abs(response)))


def _degrees(response: NDArray[np.complex128]) -> Array:
    return np.degrees(np.unwrap(np.angle(response)))
