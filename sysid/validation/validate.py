"""Validation of a model against its runs: residual errors, frequency response and crossover."""

import math
from collections.abc import Mapping, Sequence
from functools import cache
from typing import NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from sitl.vehicle.config import VehicleConfig
from sysid.control_analysis.loop_transfer import GRID_RADPS
from sysid.data.runs import Run
from sysid.estimation.map import datasets, model_error, steady_state
from sysid.estimation.map.datasets import STEP_S, STRIDE
from sysid.models import delta_method, linear_planes, noise, parameters
from sysid.models import prediction as predict
from sysid.models.linear_planes import LinearPlane
from sysid.models.model_file import IdentifiedModel
from sysid.models.noise import Filter, Noise
from sysid.models.parameters import CandidateVehicle
from sysid.planes import Plane
from sysid.validation import crossover, frequency_response, noise_floor, second_opinion
from sysid.validation.crossover import LoopAtCrossover, UncertainVehicle
from sysid.validation.crossover_correction import corrections
from sysid.validation.frequency_response import NARROWBAND_WAVES, Pair
from sysid.validation.noise_floor import NoiseFloor
from sysid.validation.results import (
    Excess,
    FrequencyComparison,
    PlaneValidation,
    RunValidation,
    SecondOpinion,
    StructureError,
    Whiteness,
)
from sysid.validation.second_opinion import ComparedTest
from sysid.validation.whiteness import combined_p, whiteness

Array = NDArray[np.float64]

OCTAVE = 0.5, 2.0
"""Band in which runs must be coherent, relative to the crossover."""


class _NoiseReference(NamedTuple):
    """Noise of a model, computed for the longest of the runs."""

    level: Noise
    rate_covariance: Array
    whitener: Filter


class _PlaneModel(NamedTuple):
    """A model and one of its planes."""

    model: IdentifiedModel
    uncertain: UncertainVehicle
    prior_vehicle: CandidateVehicle
    plane: Plane
    vehicle: CandidateVehicle
    noise_reference: _NoiseReference | None
    """Noise of the model; None without a noise model."""


class _ComparedRun(NamedTuple):
    """One run with the predictions of model and prior.

    Rates during the test at ``RATE_HZ``, deg/s.
    """

    run: Run
    measured: Array
    model: Array
    prior: Array
    pair: Pair
    record: RunValidation


def uncertain_vehicle(
    model: IdentifiedModel, prior: VehicleConfig | None = None
) -> UncertainVehicle:
    """Return the identified vehicle as a function of its estimates.

    Parameters
    ----------
    model : IdentifiedModel
        Model.
    prior : VehicleConfig, optional
        Prior vehicle; by default the vehicle file in the model.

    Returns
    -------
    UncertainVehicle
        Vehicle, estimate and covariance. Method ``paper`` has a constant vehicle and no
        covariance.
    """
    z, covariance = np.array(model.joint.z), np.array(model.joint.covariance)
    if model.method == "paper":
        fixed_vehicle = _with_coefficients(model, predict.vehicles(model, prior)[1])
        return UncertainVehicle(lambda perturbed_z: fixed_vehicle, z, None)

    @cache  # both planes and all quantities are perturbed at the same points
    def vehicle(*perturbed_z: float) -> CandidateVehicle:
        """Return the vehicle at z."""
        return predict.perturb(model, np.array(perturbed_z), prior)

    return UncertainVehicle(
        lambda perturbed_z: vehicle(*perturbed_z.tolist()),
        z,
        covariance if np.any(covariance) else None,
    )


def _with_coefficients(model: IdentifiedModel, prior_vehicle: CandidateVehicle) -> CandidateVehicle:
    """Return the prior vehicle with the coefficients of a model that is not described by z."""
    linear = prior_vehicle.config.linear
    values = {
        field: model.coefficients[parameters.symbol(field)].value
        for field in linear.__struct_fields__
    }
    replaced = msgspec.structs.replace(linear, **values)
    return prior_vehicle._replace(
        config=msgspec.structs.replace(prior_vehicle.config, linear=replaced)
    )


def validate(
    model: IdentifiedModel,
    fitted: Sequence[Run],
    held_out: Sequence[Run],
    gains: Mapping[str, float] | None = None,
    prior: VehicleConfig | None = None,
) -> dict[Plane, PlaneValidation]:
    """Validate a model against fitted and held-out runs.

    Parameters
    ----------
    model : IdentifiedModel
        Model.
    fitted : sequence of Run
        Runs that were fitted.
    held_out : sequence of Run
        Runs that were not fitted.
    gains : mapping of str to float, optional
        Gains of the loops during the tests, by parameter name; by default those of
        `crossover.gains_for`.
    prior : VehicleConfig, optional
        Prior vehicle; by default the vehicle file in the model.

    Returns
    -------
    dict
        Validation of every plane that has runs.
    """
    uncertain = uncertain_vehicle(model, prior)
    prior_vehicle = predict.vehicles(model, prior)[1]
    loop_gains = gains or crossover.gains_for(prior_vehicle)
    vehicle = uncertain.vehicle(uncertain.z)
    validations: dict[Plane, PlaneValidation] = {}
    for plane in Plane:
        fitted_runs = [run for run in fitted if run.plane == plane]
        held_out_runs = [run for run in held_out if run.plane == plane]
        if not (fitted_runs or held_out_runs):
            continue
        noise_reference = None
        if level := model.noise.get(plane):
            linear = steady_state.linear_plane(vehicle, plane)
            noise_reference = _noise_reference(
                linear, noise.from_model(level), [*fitted_runs, *held_out_runs]
            )
        plane_model = _PlaneModel(
            model=model,
            uncertain=uncertain,
            prior_vehicle=prior_vehicle,
            plane=plane,
            vehicle=vehicle,
            noise_reference=noise_reference,
        )
        validations[plane] = _validate_plane(plane_model, fitted_runs, held_out_runs, loop_gains)
    crossovers_radps = {
        plane: validation.crossover.crossover_radps
        for plane, validation in validations.items()
        if validation.crossover
    }
    plane_corrections = corrections(model, held_out, crossovers_radps, prior)
    return {
        plane: msgspec.structs.replace(validation, correction=plane_corrections.get(plane))
        for plane, validation in validations.items()
    }


def _validate_plane(
    plane_model: _PlaneModel,
    fitted: Sequence[Run],
    held_out: Sequence[Run],
    gains: Mapping[str, float],
) -> PlaneValidation:
    """Validate one plane."""
    waves = {run.wave for run in fitted}
    fitted_compared = [_compare(plane_model, run, held_out=False, new_type=False) for run in fitted]
    held_out_compared = [
        _compare(plane_model, run, held_out=True, new_type=run.wave not in waves)
        for run in held_out
    ]
    compared = [*fitted_compared, *held_out_compared]
    swept_pairs = [item.pair for item in compared if item.run.wave not in NARROWBAND_WAVES]
    excess = None
    if held_out_compared:
        repeats = noise_floor.floor_from_repeats_deg2ps2([*fitted, *held_out])
        excess = _excess(held_out_compared, repeats)
    loop = crossover.at_crossover(plane_model.uncertain, plane_model.plane, gains)
    plane_crossover = loop and loop.record(plane_model.uncertain.covariance)
    comparison = coherence = opinion = None
    if plane_crossover:
        crossover_radps = plane_crossover.crossover_radps
        opinion = _second_opinion(plane_model, compared, swept_pairs, crossover_radps)
        if swept_pairs:
            response = crossover.response(plane_model.vehicle, plane_model.plane)
            comparison = frequency_response.compare_responses(
                swept_pairs, response, GRID_RADPS, crossover_radps
            )
            coherence = _coherence(comparison, crossover_radps)
    return PlaneValidation(
        runs=tuple(item.record for item in compared),
        held_out=excess,
        frequency_response=comparison,
        coherence_at_crossover=coherence,
        crossover=plane_crossover,
        correction=None,
        second_opinion=opinion,
        model_error=_model_error(plane_model, loop),
    )


def _model_error(plane_model: _PlaneModel, loop: LoopAtCrossover | None) -> StructureError | None:
    """Return the standard deviations by the error of the model structure alone."""
    joint, plane = plane_model.model.joint, plane_model.plane
    if joint.run_scatter == joint.prior_conflict == 0.0:
        return None
    structure = model_error.structure_covariance(joint.run_scatter, joint.prior_conflict)
    uncertain = plane_model.uncertain

    def b1_per_s2(z: Array) -> float:
        linear = steady_state.linear_plane(uncertain.vehicle(z), plane)
        return linear_planes.small_signal(linear).b1_per_s2

    slopes = delta_method.slopes(b1_per_s2, uncertain.z)
    b1_sd = float(delta_method.propagate_sd(slopes, structure))
    sds = loop.record(structure) if loop else None
    return StructureError(
        b1_percent=100.0 * b1_sd / abs(b1_per_s2(uncertain.z)),
        gain_db=sds.gain_sd_db if sds else None,
        phase_deg=sds.phase_sd_deg if sds else None,
    )


def _second_opinion(
    plane_model: _PlaneModel,
    compared: Sequence[_ComparedRun],
    swept: Sequence[Pair],
    crossover_radps: float,
) -> SecondOpinion:
    """Compare the model's response with those of other methods."""
    tests = [
        ComparedTest(
            command_rad=item.run.command_rad,
            measured_radps=item.run.rate_radps,
            simulated_radps=np.concatenate(
                [
                    item.run.rate_radps[: item.run.time_s.size - item.pair.simulated_radps.size],
                    item.pair.simulated_radps,
                ]
            ),
        )
        for item in compared
    ]
    return second_opinion.compare(
        plane_model.uncertain, plane_model.plane, tests, swept, crossover_radps
    )


def _noise_reference(linear: LinearPlane, level: Noise, runs: Sequence[Run]) -> _NoiseReference:
    """Compute rate covariance and noise filter for the longest test and run."""
    test_steps = [int(np.count_nonzero(~run.preroll)) // STRIDE for run in runs]
    lead_steps = round(predict.LEAD_S / STEP_S)
    max_steps = max(run.time_s.size // STRIDE + 1 for run in runs)
    covariance = noise_floor.rate_covariance(linear, level, STEP_S, lead_steps, max(1, *test_steps))
    return _NoiseReference(level, covariance, noise.build(linear, level, STEP_S, max_steps))


def _coherence(comparison: FrequencyComparison, crossover_radps: float) -> float:
    """Return the smallest coherence in the octave band about the crossover."""
    low, high = (share * crossover_radps for share in OCTAVE)
    return min(
        value
        for frequency, value in zip(comparison.frequency_radps, comparison.coherence, strict=True)
        if low <= frequency <= high
    )


def _compare(plane_model: _PlaneModel, run: Run, *, held_out: bool, new_type: bool) -> _ComparedRun:
    """Predict a run with model and prior, and compare both with the measurement."""
    in_test = ~run.preroll
    prediction = predict.predict_with(
        plane_model.vehicle, plane_model.prior_vehicle, run, plane_model.model
    )
    measured, simulated, prior_rate = (
        np.degrees(rate[in_test])
        for rate in (run.rate_radps, prediction.rate_radps, prediction.prior_rate_radps)
    )
    first_sample = int(np.searchsorted(run.time_s, -predict.LEAD_S - 1e-9))
    floor = _floor(plane_model.noise_reference, run) if plane_model.noise_reference else None
    record = RunValidation(
        run=run.name,
        wave=run.wave,
        held_out=held_out,
        new_type=new_type,
        floor_deg2ps2=floor.mean_deg2ps2 if floor else None,
        floor_sd_deg2ps2=floor.sd_deg2ps2 if floor else None,
        theil=noise_floor.theil(measured, simulated),
        whiteness=_whiteness(plane_model.vehicle, plane_model.noise_reference, run)
        if plane_model.noise_reference
        else None,
    )
    pair = Pair(run.name, prediction.rate_radps[first_sample:], run.rate_radps[first_sample:])
    return _ComparedRun(
        run=run, measured=measured, model=simulated, prior=prior_rate, pair=pair, record=record
    )


def _floor(noise_reference: _NoiseReference, run: Run) -> NoiseFloor:
    """Return the noise floor of a run.

    A 50 Hz sample has STRIDE times the white noise variance of the fit's means.
    """
    samples = max(1, np.count_nonzero(~run.preroll) // STRIDE)
    floor = noise_floor.noise_floor_of(noise_reference.rate_covariance[:samples, :samples])
    return floor._replace(
        mean_deg2ps2=floor.mean_deg2ps2
        + (STRIDE - 1) * math.degrees(noise_reference.level.rate_radps) ** 2
    )


def _whiteness(
    vehicle: CandidateVehicle, noise_reference: _NoiseReference, run: Run
) -> Whiteness | None:
    """Return the whiteness of the rate's innovations during the test."""
    return whiteness(rate_innovations(vehicle, run, noise_reference.whitener), STEP_S)


def rate_innovations(vehicle: CandidateVehicle, run: Run, whitener: Filter) -> Array:
    """Return the normalised innovations of the rate during a test.

    Parameters
    ----------
    vehicle : CandidateVehicle
        Vehicle to simulate.
    run : Run
        Run.
    whitener : Filter
        Noise filter of its plane.

    Returns
    -------
    ndarray, (steps,)
        One every ``STEP_S``; the filter settles before the test.
    """
    data = datasets.dataset(run, datasets.max_lead_s(vehicle, run.plane))
    (residual,) = datasets.residuals(vehicle, [data])
    white = noise.whiten_residual(residual, whitener)
    return np.asarray(white[int(np.count_nonzero(data.run.preroll)) // STRIDE :, 0], np.float64)


def _excess(compared_runs: Sequence[_ComparedRun], repeats_deg2ps2: float | None) -> Excess:
    """Combine the errors of the held-out runs."""

    def mse(predictor: str) -> float:
        """Return the mean square error of a predictor over all runs."""
        errors = (item.measured - getattr(item, predictor) for item in compared_runs)
        return float(np.mean([np.mean(error**2) for error in errors]))

    records = [item.record for item in compared_runs]
    floors = [r.floor_deg2ps2 for r in records if r.floor_deg2ps2 is not None]
    floor_sds = [r.floor_sd_deg2ps2 for r in records if r.floor_sd_deg2ps2 is not None]
    floor = float(np.mean(floors)) if floors else None
    ps = [r.whiteness.periodogram_p for r in records if r.whiteness]
    model_mse, prior_mse = mse("model"), mse("prior")
    return Excess(
        prior_mse_deg2ps2=prior_mse,
        model_mse_deg2ps2=model_mse,
        floor_deg2ps2=floor,
        repeats_deg2ps2=repeats_deg2ps2,
        prior_excess_deg2ps2=None if floor is None else prior_mse - floor,
        model_excess_deg2ps2=None if floor is None else model_mse - floor,
        excess_sd_deg2ps2=float(np.linalg.norm(floor_sds)) / len(floor_sds) if floor_sds else None,
        theil=noise_floor.theil(
            np.concatenate([item.measured for item in compared_runs]),
            np.concatenate([item.model for item in compared_runs]),
        ),
        whiteness_p=combined_p(ps) if ps else None,
        new_types=sum(record.new_type for record in records),
    )
