"""Measured frequency response against the simulated vehicle, and corrections by held-out runs."""

import math

import msgspec
import numpy as np
import pytest
from numpy.typing import NDArray

from sitl.vehicle import config
from sysid.control_analysis.loop_transfer import GRID_RADPS
from sysid.data.runs import RATE_HZ, Run
from sysid.models import parameters, prediction
from sysid.models.model_file import IdentifiedModel
from sysid.models.parameters import NAMES, PARAMETERS, CandidateVehicle
from sysid.planes import PLANES, Plane
from sysid.reproduction.paper_tables import TABLE_3_INITIAL
from sysid.validation import crossover, frequency_response
from sysid.validation.crossover import UncertainVehicle
from sysid.validation.crossover_correction import corrections
from sysid.validation.frequency_response import Pair
from tests.sysid import sea
from tests.sysid.estimation.map.test_fit import TRIM

NO_BIAS: dict[Plane, float] = dict.fromkeys(PLANES, 0.0)
CROSSOVER_RADPS = 1.0


def chirp(
    degrees: float, seconds: float = 40.0, start_hz: float = 0.03, stop_hz: float = 0.6
) -> NDArray[np.float64]:
    t = np.arange(int(seconds * RATE_HZ)) / RATE_HZ
    swept = (
        start_hz
        * seconds
        / math.log(stop_hz / start_hz)
        * ((stop_hz / start_hz) ** (t / seconds) - 1.0)
    )
    return math.radians(degrees) * np.sin(2.0 * math.pi * swept)


def perturbed_vehicle(bench: config.VehicleConfig, **z: float) -> CandidateVehicle:
    """Nominal vehicle without backlash, with parameters at the given prior standard deviations."""
    z["backlash"] = -8.0
    return parameters.candidate_vehicle(
        bench, NO_BIAS, np.array([z.get(name, 0.0) for name in NAMES])
    )


def pair(vehicle: CandidateVehicle, run: Run) -> Pair:
    predicted_run = run.since(-prediction.LEAD_S)
    return Pair(
        run.name, prediction.simulate(vehicle, predicted_run).rate_radps, predicted_run.rate_radps
    )


@pytest.mark.parametrize("plane", ["yaw", "pitch"])
def test_compare_responses_wrong_model_recovers_truth(
    plane: Plane, bench: config.VehicleConfig
) -> None:
    """The model has errors of 20 % in its moment and 0.1 s in its delay; the water is still."""
    truth = perturbed_vehicle(bench)
    wrong = perturbed_vehicle(bench, N_dr=1.0, M_de=1.0, delay_yaw=-1.0, delay_pitch=-1.0)
    run = sea.fly(
        bench,
        plane,
        chirp(1.5),
        wave="chirp",
        level=sea.CALM,
        sensors=sea.Sensors(1e-5, 1e-5, 1e-4, 0.0),
    )
    response = crossover.response(wrong, plane)
    comparison = frequency_response.compare_responses(
        [pair(wrong, run)], response, GRID_RADPS, CROSSOVER_RADPS
    )
    true_response = crossover.response(truth, plane)
    gain_db = np.interp(
        comparison.frequency_radps, GRID_RADPS, 20.0 * np.log10(np.abs(true_response))
    )
    phase_deg = np.interp(
        comparison.frequency_radps, GRID_RADPS, np.degrees(np.unwrap(np.angle(true_response)))
    )
    np.testing.assert_allclose(comparison.gain_db, gain_db, atol=0.4)
    np.testing.assert_allclose(comparison.phase_deg, phase_deg, atol=4.5)
    assert np.max(np.abs(np.subtract(comparison.model_gain_db, gain_db))) > 1.5, (
        "the model itself is further off"
    )
    assert min(comparison.coherence) > 0.98


def test_compare_responses_sd_matches_scatter(bench: config.VehicleConfig) -> None:
    """Errors of gain and phase over their stated standard deviations have an rms of about one."""
    truth, normalised_errors = perturbed_vehicle(bench), []
    for seed in range(12):
        runs = [
            sea.fly(bench, Plane.YAW, chirp(3.0), wave="chirp", seed=50 * seed + k)
            for k in range(3)
        ]
        comparison = frequency_response.compare_responses(
            [pair(truth, run) for run in runs],
            crossover.response(truth, Plane.YAW),
            GRID_RADPS,
            CROSSOVER_RADPS,
        )
        normalised_errors.append(
            np.subtract(comparison.gain_db, comparison.model_gain_db) / comparison.gain_sd_db
        )
        normalised_errors.append(
            np.subtract(comparison.phase_deg, comparison.model_phase_deg) / comparison.phase_sd_deg
        )
    assert 0.7 < np.sqrt(np.mean(np.square(normalised_errors))) < 1.4


def test_mismatch_cost_matches_definition() -> None:
    """One decibel: 20 times the weight of the coherence (Tischler and Remple 2006)."""
    factor = 10.0 ** (1.0 / 20.0) * np.ones(5, dtype=np.complex128)
    ones = np.ones(5)
    spectra = frequency_response.Spectra(
        np.arange(1.0, 6.0), ones, np.abs(factor) ** 2, factor, ones
    )
    assert frequency_response.mismatch_cost(spectra) == pytest.approx(
        20.0 * (1.58 * (1.0 - math.exp(-1.0))) ** 2, rel=1e-6
    )
    rotated = spectra._replace(cross=np.exp(1j * math.radians(10.0)) * ones, measured=ones)
    assert frequency_response.mismatch_cost(rotated) == pytest.approx(
        1.745 * 20.0 * (1.58 * (1.0 - math.exp(-1.0))) ** 2, rel=1e-6
    )
    noisy = spectra._replace(measured=np.abs(factor) ** 2 / 0.7)  # coherence 0.7
    assert frequency_response.mismatch_cost(noisy) == pytest.approx(
        20.0 * (1.58 * (1.0 - math.exp(-0.7))) ** 2, rel=1e-6
    )
    incoherent = spectra._replace(measured=10.0 * ones)
    assert frequency_response.mismatch_cost(incoherent) is None


PARAMETER_ERRORS: dict[str, float] = {
    "N_dr": -1.2,
    "M_de": 1.0,
    "delay_yaw": -1.0,
    "delay_pitch": 0.8,
}
"""Parameter errors in prior standard deviations.

About 25 % in moments, 0.1 and 0.08 s in delays.
"""


@pytest.mark.parametrize("with_errors", [False, True])
def test_corrections_match_model_errors(
    with_errors: bool, model: IdentifiedModel, field: config.VehicleConfig
) -> None:
    """The correction is the difference of model and vehicle, within its standard deviations."""
    parameter_errors = np.array(
        [with_errors * PARAMETER_ERRORS.get(name, 0.0) for name in model.joint.names]
    )
    joint = msgspec.structs.replace(
        model.joint, z=tuple((np.array(model.joint.z) + parameter_errors).tolist())
    )
    candidate = msgspec.structs.replace(model, joint=joint)
    tests: list[tuple[Plane, NDArray[np.float64]]] = [
        (plane, signal)
        for plane in PLANES
        for signal in (sea.doublet(4.0, 4.0), sea.doublet(-3.0, 2.5), chirp(3.0, 25.0, 0.06))
    ]
    runs = [
        sea.fly(field, p, s, wave="3211", seed=40 + k, trim_rad=TRIM)
        for k, (p, s) in enumerate(tests)
    ]
    plane_corrections = corrections(
        candidate, runs, {Plane.YAW: CROSSOVER_RADPS, Plane.PITCH: CROSSOVER_RADPS}
    )
    truth = parameters.candidate_vehicle(field, NO_BIAS, np.zeros(len(NAMES)))
    for plane, correction in plane_corrections.items():
        ratio = crossover.response(truth, plane) / crossover.response(
            prediction.vehicles(candidate)[0], plane
        )
        index = np.searchsorted(GRID_RADPS, CROSSOVER_RADPS)
        gain_db = 20.0 * math.log10(abs(ratio[index]))
        phase_deg = math.degrees(np.angle(ratio[index]))
        assert abs(correction.gain_db - gain_db) < 3.0 * correction.gain_sd_db, plane
        assert abs(correction.phase_deg - phase_deg) < 3.0 * correction.phase_sd_deg, plane
        assert correction.gain_sd_db < 0.4
        assert correction.phase_sd_deg < 2.5
        if with_errors:
            assert abs(correction.gain_db) > 3.0 * correction.gain_sd_db
    assert set(plane_corrections) == {"yaw", "pitch"}
    assert corrections(candidate, [], {Plane.YAW: CROSSOVER_RADPS}) == {}


@pytest.mark.parametrize("plane", ["yaw", "pitch"])
def test_crossover_sd_matches_samples(plane: Plane, bench: config.VehicleConfig) -> None:
    """The delta method against the scatter of loops sampled from the covariance."""
    free = [
        i
        for i, parameter in enumerate(PARAMETERS)
        if plane in parameter.planes and parameter.kind == "ratio"
    ]
    z, covariance = np.zeros(len(NAMES)), np.zeros((len(NAMES), len(NAMES)))
    covariance[free, free] = 0.04
    uncertain = UncertainVehicle(
        lambda z_sample: parameters.candidate_vehicle(bench, NO_BIAS, z_sample), z, covariance
    )
    at_crossover = crossover.at_crossover(uncertain, plane, TABLE_3_INITIAL)
    assert at_crossover is not None
    nominal = at_crossover.record(covariance)
    rng = np.random.default_rng(3)
    loops = [
        crossover.loop(
            uncertain.vehicle(rng.multivariate_normal(z, covariance)), plane, TABLE_3_INITIAL
        )
        for _ in range(150)
    ]
    gains = [np.interp(nominal.crossover_radps, GRID_RADPS, np.abs(loop)) for loop in loops]
    phases = [
        np.interp(nominal.crossover_radps, GRID_RADPS, np.unwrap(np.angle(loop))) for loop in loops
    ]
    assert nominal.gain_sd_db == pytest.approx(np.std(20.0 * np.log10(gains)), rel=0.2)
    assert nominal.phase_sd_deg == pytest.approx(np.degrees(np.std(phases)), rel=0.2)
    unknown = crossover.at_crossover(uncertain._replace(covariance=None), plane, TABLE_3_INITIAL)
    assert unknown is not None
    assert unknown.record(None).gain_sd_db is None
