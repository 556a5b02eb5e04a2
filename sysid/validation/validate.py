"""A model against its runs: what it leaves unexplained and whether that is the sea, its response,
its crossover."""

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray
from scipy import stats

from sitl.vehicle.config import VehicleConfig
from sysid.control_analysis.loop_transfer import GRID_RADPS
from sysid.data.segments import RATE_HZ, Plane, Run
from sysid.estimation.map import fit
from sysid.estimation.map.fit import STRIDE
from sysid.models import noise, parameters
from sysid.models import prediction as predict
from sysid.models.linear_planes import LinearPlane
from sysid.models.model_file import IdentifiedModel
from sysid.models.noise import Filter, Noise
from sysid.models.parameters import CandidateVehicle
from sysid.validation import crossover, frequency_response, noise_floor
from sysid.validation.crossover import UncertainVehicle
from sysid.validation.crossover_correction import corrections
from sysid.validation.frequency_response import Pair
from sysid.validation.noise_floor import NoiseFloor
from sysid.validation.results import (
    Excess,
    FrequencyComparison,
    PlaneValidation,
    RunValidation,
    Whiteness,
)
from sysid.validation.whiteness import whiteness

Array = NDArray[np.float64]

PLANES: tuple[Plane, ...] = ("yaw", "pitch")
DT_S = STRIDE / RATE_HZ
NARROWBAND_WAVES = ("step",)
"""Signals that hold still tell little of a response over frequency; any other counts as a sweep."""
OCTAVE = 0.5, 2.0
"""Of the crossover: where the runs must be coherent."""


class _NoiseReference(NamedTuple):
    """A model's noise, worked out for the longest of the runs."""

    level: Noise
    rate_covariance: Array
    whitener: Filter


class _PlaneModel(NamedTuple):
    """A model and one of its planes."""

    model: IdentifiedModel
    belief: UncertainVehicle
    first: CandidateVehicle
    plane: Plane
    vehicle: CandidateVehicle
    sea: _NoiseReference | None
    """None for a model that knows nothing of it."""


class _ComparedRun(NamedTuple):
    """One run beside what the models make of it; rates at ``RATE_HZ``, once the test has begun,
    deg/s."""

    run: Run
    measured: Array
    model: Array
    prior: Array
    pair: Pair
    record: RunValidation


def uncertain_vehicle(
    model: IdentifiedModel, prior: VehicleConfig | None = None
) -> UncertainVehicle:
    """The identified vehicle as its estimates move. ``prior`` as for ``predict.predict``."""
    z, covariance = np.array(model.joint.z), np.array(model.joint.covariance)
    if model.method == "paper":
        only = _with_coefficients(model, predict.vehicles(model, prior)[1])
        return UncertainVehicle(lambda moved: only, z, None)
    return UncertainVehicle(
        lambda moved: predict.perturb(model, moved, prior),
        z,
        covariance if np.any(covariance) else None,
    )


def _with_coefficients(model: IdentifiedModel, first: CandidateVehicle) -> CandidateVehicle:
    """The prior vehicle with the coefficients of a model that is not given by z."""
    linear = first.config.linear
    values = {
        field: model.coefficients[parameters.symbol(field)].value
        for field in linear.__struct_fields__
    }
    moved = msgspec.structs.replace(linear, **values)
    return first._replace(config=msgspec.structs.replace(first.config, linear=moved))


def validate(
    model: IdentifiedModel,
    fitted: Sequence[Run],
    held_out: Sequence[Run],
    gains: Mapping[str, float] | None = None,
    prior: VehicleConfig | None = None,
) -> dict[Plane, PlaneValidation]:
    """Of every plane that has runs.

    Args:
        gains: aboard when the tests were run, by parameter name; where they are not known, the
        prototype's as strong
            as the vehicle's tail allows.
        prior: needed when the model was refitted from a vehicle file that is not shipped.
    """
    belief = uncertain_vehicle(model, prior)
    first = predict.vehicles(model, prior)[1]
    known = gains or crossover.gains_for(first)
    vehicle = belief.vehicle(belief.z)
    found: dict[Plane, PlaneValidation] = {}
    for plane in PLANES:
        seen = [run for run in fitted if run.plane == plane]
        unseen = [run for run in held_out if run.plane == plane]
        if seen or unseen:
            level = model.noise.get(plane)
            sea = (
                _noise_reference(
                    fit.linear_plane(vehicle, plane), noise.from_model(level), [*seen, *unseen]
                )
                if level
                else None
            )
            asked = _PlaneModel(model, belief, first, plane, vehicle, sea)
            found[plane] = _plane(asked, seen, unseen, known)
    crossed = {plane: it.crossover.crossover_radps for plane, it in found.items() if it.crossover}
    changed = corrections(model, held_out, crossed, prior)
    return {
        plane: msgspec.structs.replace(it, correction=changed.get(plane))
        for plane, it in found.items()
    }


def _plane(
    asked: _PlaneModel, fitted: Sequence[Run], held_out: Sequence[Run], gains: Mapping[str, float]
) -> PlaneValidation:
    waves = {run.wave for run in fitted}
    seen = [_compare(asked, run, held_out=False, new_type=False) for run in fitted]
    unseen = [
        _compare(asked, run, held_out=True, new_type=run.wave not in waves) for run in held_out
    ]
    crossed = crossover.crossover(asked.belief, asked.plane, gains)
    swept = [j.pair for j in (*seen, *unseen) if j.run.wave not in NARROWBAND_WAVES]
    laid = None
    if crossed and swept:
        response = crossover.response(asked.vehicle, asked.plane)
        laid = frequency_response.compare_responses(
            swept, response, GRID_RADPS, crossed.crossover_radps
        )
    return PlaneValidation(
        runs=tuple(j.record for j in (*seen, *unseen)),
        held_out=_excess(unseen, noise_floor.floor_from_repeats_deg2ps2([*fitted, *held_out]))
        if unseen
        else None,
        overlay=laid,
        coherence_at_crossover=_coherence(laid, crossed.crossover_radps)
        if laid and crossed
        else None,
        crossover=crossed,
        correction=None,
    )


def _noise_reference(linear: LinearPlane, level: Noise, runs: Sequence[Run]) -> _NoiseReference:
    tests = [int(np.count_nonzero(~run.preroll)) // STRIDE for run in runs]
    lead, whole = round(predict.LEAD_S / DT_S), max(run.time_s.size // STRIDE + 1 for run in runs)
    covariance = noise_floor.rate_covariance(linear, level, DT_S, lead, max(1, *tests))
    return _NoiseReference(level, covariance, noise.build(linear, level, DT_S, whole))


def _coherence(laid: FrequencyComparison, crossover_radps: float) -> float:
    low, high = (share * crossover_radps for share in OCTAVE)
    return min(
        c for w, c in zip(laid.frequency_radps, laid.coherence, strict=True) if low <= w <= high
    )


def _compare(asked: _PlaneModel, run: Run, *, held_out: bool, new_type: bool) -> _ComparedRun:
    after = ~run.preroll
    prediction = predict.predict_with(asked.vehicle, asked.first, run, asked.model)
    measured, simulated, first = (
        np.degrees(rate[after])
        for rate in (run.rate_radps, prediction.rate_radps, prediction.prior_rate_radps)
    )
    start = int(np.searchsorted(run.time_s, -predict.LEAD_S - 1e-9))
    floor = _floor(asked.sea, run) if asked.sea else None
    record = RunValidation(
        run=run.name,
        wave=run.wave,
        held_out=held_out,
        new_type=new_type,
        floor_deg2ps2=floor.mean_deg2ps2 if floor else None,
        floor_sd_deg2ps2=floor.sd_deg2ps2 if floor else None,
        theil=noise_floor.theil(measured, simulated),
        whiteness=_whiteness(asked.vehicle, asked.sea, run) if asked.sea else None,
    )
    pair = Pair(run.name, prediction.rate_radps[start:], run.rate_radps[start:])
    return _ComparedRun(run, measured, simulated, first, pair, record)


def _floor(sea: _NoiseReference, run: Run) -> NoiseFloor:
    """On the run's own grid, whose samples carry STRIDE times the white noise of the fit's
    means."""
    samples = max(1, np.count_nonzero(~run.preroll) // STRIDE)
    found = noise_floor.noise_floor_of(sea.rate_covariance[:samples, :samples])
    return found._replace(
        mean_deg2ps2=found.mean_deg2ps2 + (STRIDE - 1) * math.degrees(sea.level.rate_radps) ** 2
    )


def _whiteness(vehicle: CandidateVehicle, sea: _NoiseReference, run: Run) -> Whiteness | None:
    """Of the rate's innovations once the test has begun; before it the filter settles."""
    (residual,) = fit.residuals(vehicle, [fit.dataset(run)])
    white = noise.whiten_residual(residual, sea.whitener)
    return whiteness(white[int(np.count_nonzero(run.preroll)) // STRIDE :, 0], DT_S)


def _excess(unseen: Sequence[_ComparedRun], repeats_deg2ps2: float | None) -> Excess:
    def mse(model_of: str) -> float:
        return float(np.mean([np.mean((j.measured - getattr(j, model_of)) ** 2) for j in unseen]))

    floors = [j.record.floor_deg2ps2 for j in unseen if j.record.floor_deg2ps2 is not None]
    sds = [j.record.floor_sd_deg2ps2 for j in unseen if j.record.floor_sd_deg2ps2 is not None]
    floor = float(np.mean(floors)) if floors else None
    ps = [j.record.whiteness.periodogram_p for j in unseen if j.record.whiteness]
    return Excess(
        prior_mse_deg2ps2=mse("prior"),
        model_mse_deg2ps2=mse("model"),
        floor_deg2ps2=floor,
        repeats_deg2ps2=repeats_deg2ps2,
        prior_excess_deg2ps2=None if floor is None else mse("prior") - floor,
        model_excess_deg2ps2=None if floor is None else mse("model") - floor,
        excess_sd_deg2ps2=float(np.linalg.norm(sds)) / len(sds) if sds else None,
        theil=noise_floor.theil(
            np.concatenate([j.measured for j in unseen]), np.concatenate([j.model for j in unseen])
        ),
        whiteness_p=float(stats.combine_pvalues(ps).pvalue) if ps else None,
        new_types=sum(j.record.new_type for j in unseen),
    )
