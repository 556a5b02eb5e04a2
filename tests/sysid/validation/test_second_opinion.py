"""ARX estimate and second opinion, on systems whose response python-control computes."""

import control
import numpy as np
import pytest
from numpy.typing import NDArray

from sysid.control_analysis.loop_transfer import Lag
from sysid.data.runs import RATE_HZ, Run
from sysid.models import linear_planes, prediction
from sysid.models.model_file import IdentifiedModel
from sysid.planes import Plane
from sysid.reproduction.paper_tables import TABLE_1_ADJUSTED
from sysid.validation import arx, second_opinion, validate
from sysid.validation.arx import Record
from sysid.validation.frequency_response import Pair
from sysid.validation.second_opinion import ComparedTest

LAG = Lag(0.3)
RADPS = np.array([0.4, 0.8, 1.6])


def yaw_system() -> control.StateSpace:
    """Yaw plane of Table 1 behind the tailcone, assembled by python-control alone."""
    plane = linear_planes.yaw_plane(TABLE_1_ADJUSTED)
    body = control.ss(plane.A, plane.B[:, None], [[0.0, 1.0, 0.0]], 0.0)
    duct = control.tf2ss(control.tf([9.0], [1.0, 3.6, 9.0]))
    return control.series(control.tf2ss(*control.pade(LAG.delay_s, 6)), duct, body)


def records(noise_radps: float, count: int = 8) -> list[Record]:
    """Steps and chirps of 5 deg simulated by control.forced_response, with white noise."""
    system, rng = yaw_system(), np.random.default_rng(3)
    time_s = np.arange(0.0, 35.0, 1.0 / RATE_HZ)
    made = []
    for k in range(count):
        phase = 2.0 * np.pi * (0.05 + 0.005 * time_s) * time_s
        command = np.radians(5.0) * (np.sin(phase + k) if k % 2 else np.sign(np.sin(0.3 * phase)))
        command[time_s < 5.0] = 0.0
        rate = control.forced_response(system, time_s, command).outputs
        made.append(Record(command, rate + 0.01 + noise_radps * rng.standard_normal(rate.size)))
    return made


def exact() -> NDArray[np.complex128]:
    return np.asarray(control.frequency_response(yaw_system(), RADPS).complex)


def test_arx_noiseless_response_equals_python_control() -> None:
    fitted = arx.fit(records(1e-5))
    assert fitted is not None
    ratio = arx.response(fitted, RADPS).response / exact()
    assert np.abs(20.0 * np.log10(np.abs(ratio))).max() < 0.05
    assert np.abs(np.degrees(np.angle(ratio))).max() < 0.3


def test_arx_intervals_cover_python_control_in_noise() -> None:
    """All six values within 4 sd, and the intervals are no wider than 1 dB and 6 deg."""
    fitted = arx.fit(records(np.radians(0.3)))
    assert fitted is not None
    found = arx.response(fitted, RADPS)
    ratio = found.response / exact()
    assert np.all(np.abs(np.log(np.abs(ratio))) < 4.0 * found.magnitude_sd)
    assert np.all(np.abs(np.angle(ratio)) < 4.0 * found.phase_sd_rad)
    assert found.magnitude_sd.max() * second_opinion.DB_PER_UNIT < 1.0
    assert np.degrees(found.phase_sd_rad.max()) < 6.0


def test_arx_short_or_unexcited_tests_give_none() -> None:
    record = records(1e-3, count=1)[0]
    assert arx.fit([Record(record.command_rad[:200], record.rate_radps[:200])]) is None
    assert arx.fit([Record(0.0 * record.command_rad, 0.0 * record.rate_radps)]) is None
    assert arx.fit([]) is None


def test_arx_noiseless_high_order_still_has_the_response() -> None:
    """Rates of a linear model satisfy many equations of order 16; any of them has its response."""
    fitted = arx.fit(records(0.0), (16,))
    assert fitted is not None
    assert np.allclose(arx.response(fitted, RADPS).response, exact(), rtol=5e-3)


def compared(
    model: IdentifiedModel, runs: list[Run], plane: Plane, scale: float
) -> tuple[list[ComparedTest], list[Pair]]:
    """Tests with the model's simulated rates times `scale`."""
    vehicle, first = prediction.vehicles(model)
    tests, pairs = [], []
    for run in runs:
        if run.plane != plane:
            continue
        simulated = scale * prediction.predict_with(vehicle, first, run, model).rate_radps
        tests.append(ComparedTest(run.command_rad, run.rate_radps, simulated))
        if run.wave != "step":
            pairs.append(Pair(run.name, simulated, run.rate_radps))
    return tests, pairs


@pytest.mark.parametrize("plane", list(Plane))
def test_good_model_is_not_contradicted(
    model: IdentifiedModel, campaign: list[Run], plane: Plane
) -> None:
    tests, pairs = compared(model, campaign, plane, 1.0)
    uncertain = validate.uncertain_vehicle(model)
    opinion = second_opinion.compare(uncertain, plane, tests, pairs, 0.8)
    assert opinion.differences == ()
    by_method = {other.method: other for other in opinion.opinions}
    assert set(by_method) >= {"ARX", "python-control"}
    exact_evaluation = by_method["python-control"]
    assert np.allclose(exact_evaluation.gain_db, opinion.gain_db, atol=0.01)
    assert np.allclose(exact_evaluation.phase_deg, opinion.phase_deg, atol=0.05)


def test_model_with_wrong_gain_is_contradicted(model: IdentifiedModel, campaign: list[Run]) -> None:
    """Simulated rates 30 % too small: the data ask for 3.1 dB more gain."""
    tests, pairs = compared(model, campaign, Plane.YAW, 0.7)
    uncertain = validate.uncertain_vehicle(model)
    opinion = second_opinion.compare(uncertain, Plane.YAW, tests, pairs, 0.8)
    assert any(text.startswith("ARX: gain at") for text in opinion.differences)
    found = next(other for other in opinion.opinions if other.method == "ARX")
    errors = np.array(found.gain_db) - np.array(opinion.gain_db)
    assert errors == pytest.approx(3.1, abs=1.0)


def test_validation_holds_second_opinion_of_each_plane(
    model: IdentifiedModel, campaign: list[Run]
) -> None:
    validation = validate.validate(model, campaign, [])
    for plane in Plane:
        opinion = validation[plane].second_opinion
        assert opinion is not None
        assert len(opinion.frequency_radps) == len(opinion.gain_db) == 3
        crossover = validation[plane].crossover
        assert crossover is not None
        assert opinion.frequency_radps[1] == pytest.approx(crossover.crossover_radps)


def test_unknown_covariance_gives_no_model_interval(
    model: IdentifiedModel, campaign: list[Run]
) -> None:
    uncertain = validate.uncertain_vehicle(model)._replace(covariance=None)
    tests, pairs = compared(model, campaign, Plane.YAW, 1.0)
    opinion = second_opinion.compare(uncertain, Plane.YAW, tests, pairs, 0.8)
    assert opinion.gain_sd_db is None
    assert opinion.phase_sd_deg is None


def test_rates_of_zero_leave_only_the_evaluation(
    model: IdentifiedModel, campaign: list[Run]
) -> None:
    """No estimate without motion, and no numpy warning (warnings are errors in the tests)."""
    tests, pairs = compared(model, campaign, Plane.YAW, 0.0)
    still = [test._replace(measured_radps=0.0 * test.measured_radps) for test in tests]
    opinion = second_opinion.compare(
        validate.uncertain_vehicle(model), Plane.YAW, still, pairs, 0.8
    )
    assert [other.method for other in opinion.opinions] == ["python-control"]
    assert opinion.differences == ()
