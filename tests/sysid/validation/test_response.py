"""The response that runs show is that of the vehicle which flew, and held-out runs say what a model
has wrong."""

import math

import msgspec
import numpy as np
import pytest
from numpy.typing import NDArray

from sitl.vehicle import config
from sysid.control_analysis.loop_transfer import GRID_RADPS
from sysid.data.segments import RATE_HZ, Plane, Run
from sysid.models import parameters, prediction
from sysid.models.model_file import IdentifiedModel
from sysid.models.parameters import NAMES, PARAMETERS, CandidateVehicle
from sysid.reproduction.paper_tables import TABLE_3_INITIAL
from sysid.validation import crossover, frequency_response
from sysid.validation.crossover import UncertainVehicle
from sysid.validation.crossover_correction import corrections
from sysid.validation.frequency_response import Pair
from tests.sysid import sea
from tests.sysid.estimation.map.test_fit import TRIM

NO_BIAS: dict[Plane, float] = {"yaw": 0.0, "pitch": 0.0}
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


def moved(bench: config.VehicleConfig, **z: float) -> CandidateVehicle:
    """The bench vehicle, whose tailcone has no play, some coefficients moved by prior standard
    deviations."""
    z["backlash"] = -8.0
    return parameters.candidate_vehicle(
        bench, NO_BIAS, np.array([z.get(name, 0.0) for name in NAMES])
    )


def pair(vehicle: CandidateVehicle, run: Run) -> Pair:
    flown = run.since(-prediction.LEAD_S)
    return Pair(run.name, prediction.simulate(vehicle, flown).rate_radps, flown.rate_radps)


@pytest.mark.parametrize("plane", ["yaw", "pitch"])
def test_a_known_plane_is_recovered_under_a_wrong_model(
    plane: Plane, bench: config.VehicleConfig
) -> None:
    """A model wrong by 20 % in its moment and by 0.1 s of delay is laid over runs of the right one,
    in still water."""
    truth = moved(bench)
    wrong = moved(bench, N_dr=1.0, M_de=1.0, delay_yaw=-1.0, delay_pitch=-1.0)
    run = sea.fly(
        bench,
        plane,
        chirp(1.5),
        wave="chirp",
        level=sea.CALM,
        sensors=sea.Sensors(1e-5, 1e-5, 1e-4, 0.0),
    )
    response = crossover.response(wrong, plane)
    found = frequency_response.compare_responses(
        [pair(wrong, run)], response, GRID_RADPS, CROSSOVER_RADPS
    )
    right = crossover.response(truth, plane)
    gain_db = np.interp(found.frequency_radps, GRID_RADPS, 20.0 * np.log10(np.abs(right)))
    phase_deg = np.interp(found.frequency_radps, GRID_RADPS, np.degrees(np.unwrap(np.angle(right))))
    np.testing.assert_allclose(found.gain_db, gain_db, atol=0.4)
    np.testing.assert_allclose(found.phase_deg, phase_deg, atol=4.5)
    assert np.max(np.abs(np.subtract(found.model_gain_db, gain_db))) > 1.5, (
        "the model itself is further off"
    )
    assert min(found.coherence) > 0.98


def test_bars_hold_what_the_sea_does(bench: config.VehicleConfig) -> None:
    """Errors of gain and phase over their stated standard deviations have a root mean square of
    about one."""
    truth, misses = moved(bench), []
    for seed in range(12):
        runs = [
            sea.fly(bench, "yaw", chirp(3.0), wave="chirp", seed=50 * seed + k) for k in range(3)
        ]
        laid = frequency_response.compare_responses(
            [pair(truth, run) for run in runs],
            crossover.response(truth, "yaw"),
            GRID_RADPS,
            CROSSOVER_RADPS,
        )
        misses.append(np.subtract(laid.gain_db, laid.model_gain_db) / laid.gain_sd_db)
        misses.append(np.subtract(laid.phase_deg, laid.model_phase_deg) / laid.phase_sd_deg)
    assert 0.7 < np.sqrt(np.mean(np.square(misses))) < 1.4


def test_the_mismatch_cost_is_that_of_its_book() -> None:
    """One decibel everywhere at full coherence: 20 times the weight at coherence 1, which is
    0.9974."""
    factor = 10.0 ** (1.0 / 20.0) * np.ones(5, dtype=np.complex128)
    one = np.ones(5)
    found = frequency_response.Spectra(np.arange(1.0, 6.0), one, np.abs(factor) ** 2, factor, one)
    assert frequency_response.mismatch_cost(found) == pytest.approx(
        20.0 * (1.58 * (1.0 - math.exp(-1.0))) ** 2, rel=1e-6
    )
    turned = found._replace(cross=np.exp(1j * math.radians(10.0)) * one, measured=one)
    assert frequency_response.mismatch_cost(turned) == pytest.approx(
        1.745 * 20.0 * (1.58 * (1.0 - math.exp(-1.0))) ** 2, rel=1e-6
    )
    deaf = found._replace(measured=10.0 * one)
    assert frequency_response.mismatch_cost(deaf) is None


SPOILT: dict[str, float] = {"N_dr": -1.2, "M_de": 1.0, "delay_yaw": -1.0, "delay_pitch": 0.8}
"""Prior standard deviations: surfaces too weak or too strong by a fourth, delays off by 0.1 and
0.08 s."""


@pytest.mark.parametrize("spoilt", [False, True])
def test_held_out_runs_say_what_a_model_has_wrong(
    spoilt: bool, model: IdentifiedModel, field: config.VehicleConfig
) -> None:
    """What they would change is what parts the model from the vehicle that flew, within the doubt
    that they state."""
    moves = np.array([spoilt * SPOILT.get(name, 0.0) for name in model.joint.names])
    joint = msgspec.structs.replace(
        model.joint, z=tuple((np.array(model.joint.z) + moves).tolist())
    )
    candidate = msgspec.structs.replace(model, joint=joint)
    tests: list[tuple[Plane, NDArray[np.float64]]] = [
        (plane, signal)
        for plane in ("yaw", "pitch")
        for signal in (sea.doublet(4.0, 4.0), sea.doublet(-3.0, 2.5), chirp(3.0, 25.0, 0.06))
    ]
    runs = [
        sea.fly(field, p, s, wave="3211", seed=40 + k, trim_rad=TRIM)
        for k, (p, s) in enumerate(tests)
    ]
    found = corrections(candidate, runs, {"yaw": CROSSOVER_RADPS, "pitch": CROSSOVER_RADPS})
    truth = parameters.candidate_vehicle(field, NO_BIAS, np.zeros(len(NAMES)))
    for plane, told in found.items():
        ratio = crossover.response(truth, plane) / crossover.response(
            prediction.vehicles(candidate)[0], plane
        )
        at = np.searchsorted(GRID_RADPS, CROSSOVER_RADPS)
        gain_db, phase_deg = 20.0 * math.log10(abs(ratio[at])), math.degrees(np.angle(ratio[at]))
        assert abs(told.gain_db - gain_db) < 3.0 * told.gain_sd_db, plane
        assert abs(told.phase_deg - phase_deg) < 3.0 * told.phase_sd_deg, plane
        assert told.gain_sd_db < 0.4
        assert told.phase_sd_deg < 2.5
        if spoilt:
            assert abs(told.gain_db) > 3.0 * told.gain_sd_db
    assert set(found) == {"yaw", "pitch"}
    assert corrections(candidate, [], {"yaw": CROSSOVER_RADPS}) == {}


@pytest.mark.parametrize("plane", ["yaw", "pitch"])
def test_doubt_at_crossover_is_that_of_samples(plane: Plane, bench: config.VehicleConfig) -> None:
    """The delta method against the scatter of loops drawn from the same covariance."""
    free = [i for i, p in enumerate(PARAMETERS) if plane in p.planes and p.kind == "ratio"]
    z, covariance = np.zeros(len(NAMES)), np.zeros((len(NAMES), len(NAMES)))
    covariance[free, free] = 0.04
    belief = UncertainVehicle(
        lambda at: parameters.candidate_vehicle(bench, NO_BIAS, at), z, covariance
    )
    found = crossover.crossover(belief, plane, TABLE_3_INITIAL)
    assert found is not None
    rng = np.random.default_rng(3)
    drawn = [
        crossover.loop(
            belief.vehicle(rng.multivariate_normal(z, covariance)), plane, TABLE_3_INITIAL
        )
        for _ in range(150)
    ]
    here = [np.interp(found.crossover_radps, GRID_RADPS, np.abs(loop)) for loop in drawn]
    turn = [
        np.interp(found.crossover_radps, GRID_RADPS, np.unwrap(np.angle(loop))) for loop in drawn
    ]
    assert found.gain_sd_db == pytest.approx(np.std(20.0 * np.log10(here)), rel=0.2)
    assert found.phase_sd_deg == pytest.approx(np.degrees(np.std(turn)), rel=0.2)
    unknown = crossover.crossover(belief._replace(covariance=None), plane, TABLE_3_INITIAL)
    assert unknown is not None
    assert unknown.gain_sd_db is None
