"""Model file from linear estimates of a vehicle that was simulated with disturbances."""

import math
import warnings
from pathlib import Path

import msgspec
import numpy as np
import pytest

from sitl.vehicle import config
from sysid import prior_knowledge, refit
from sysid.data.runs import Run
from sysid.estimation.linear import estimate, records, report, response
from sysid.models import linear_planes, prediction
from sysid.models import model_file as models
from sysid.models.model_file import IdentifiedModel
from sysid.planes import PLANES, Plane
from sysid.reproduction.paper_tables import Table1Column
from tests.sysid import sea

TRIM = (math.radians(6.0), math.radians(1.0))


@pytest.fixture(scope="module")
def flown() -> list[Run]:
    """Small tests of the nominal vehicle, in the range in which it is nearly linear."""
    bench = config.load("caribou_nominal")
    runs = []
    for number, sign in enumerate((1.0, -1.0, 1.0, -1.0)):
        shape = sea.doublet(sign * 3.0, 4.0) if number > 1 else sea.step(sign * 1.5, 15.0)
        signal = np.concatenate([shape, sea.step(0.0, 8.0)])
        for plane in PLANES:
            name = f"{plane}/{number}"
            runs.append(
                sea.fly(bench, plane, signal, name=name, seed=70 + number, level=0.3, trim_rad=TRIM)
            )
    return runs


@pytest.fixture(scope="module")
def model(flown: list[Run]) -> IdentifiedModel:
    return refit.identify(flown, config.load("caribou_nominal"), "caribou_nominal", "filter-error")


def test_identify_known_vehicle_recovers_planes(model: IdentifiedModel) -> None:
    """Tolerance: four stated standard deviations, plus 5 % for nonlinearity."""
    vehicle = config.load("caribou_nominal")
    true = linear_planes.small_signal(linear_planes.yaw_plane(coefficients(vehicle)))
    yaw = model.planes[Plane.YAW]
    for name in ("b1_per_s2", "p_slow_per_s", "p_fast_per_s"):
        estimated, value = getattr(yaw, name), getattr(true, name)
        assert abs(estimated.value - value) < 4.0 * estimated.sd + 0.05 * abs(value), name
    assert yaw.delay_s.sd is not None
    assert abs(yaw.delay_s.value - 0.3) < 4.0 * yaw.delay_s.sd + 0.02
    assert yaw.b1_per_s2.sd is not None
    assert yaw.b1_per_s2.sd < 0.1 * true.b1_per_s2


def coefficients(vehicle: config.VehicleConfig) -> Table1Column:
    from sysid.models import parameters

    return parameters.to_table_1_column(vehicle.linear)


def test_identify_coefficients_reproduce_planes(model: IdentifiedModel) -> None:
    """Redesign uses the coefficients, which must reproduce the identified planes."""
    column = Table1Column(
        **{name: coefficient.value for name, coefficient in model.coefficients.items()}
    )
    reproduced = {
        Plane.YAW: linear_planes.small_signal(
            linear_planes.yaw_plane(column, model.speed_mps, model.vehicle.mass_kg)
        ),
        Plane.PITCH: linear_planes.small_signal(
            linear_planes.pitch_plane(column, model.speed_mps, model.vehicle.mass_kg)
        ),
    }
    for plane, signal in reproduced.items():
        for name in ("static_gain_per_s", "b1_per_s2", "p_slow_per_s"):
            estimated = getattr(model.planes[plane], name)
            assert abs(estimated.value - getattr(signal, name)) < 0.5 * estimated.sd, (plane, name)


def test_identify_undetermined_coefficients_are_marked(model: IdentifiedModel) -> None:
    for name in ("Y_vdot", "Z_wdot"):
        assert model.coefficients[name].status == "unidentifiable"
    assert model.coefficients["N_rdot"].status == "prior"
    assert model.coefficients["N_dr"].status == "measured"


def test_model_file_keeps_method_and_predicts(
    model: IdentifiedModel, flown: list[Run], tmp_path: Path
) -> None:
    models.write(model, tmp_path / "model.json")
    stored = models.read(tmp_path / "model.json")
    assert stored.method == "filter-error"
    assert stored == model
    assert {q.run for q in stored.fit_quality} == {run.name for run in flown}
    yaw = [q.model_mse_deg2ps2 for q in prediction.quality(stored, flown) if q.plane == Plane.YAW]
    assert max(yaw) < 0.3


def test_of_estimates_plane_without_runs_is_the_prior(flown: list[Run]) -> None:
    """Output error, by `descend`: with disturbances the minimum need not be unique."""
    yaw = [run for run in flown if run.plane == Plane.YAW]
    prior = prior_knowledge.prior_of(yaw, config.load("caribou_nominal"))
    linear_prior = records.linear_prior(prior, Plane.YAW)
    records_of_yaw = [records.linear_run(run, estimate.LEADS_S["output-error"]) for run in yaw]
    yaw_estimate = estimate.descend(
        records_of_yaw, linear_prior, "output-error", linear_prior.model.values
    )
    identified = report.of_estimates(
        {Plane.YAW: yaw_estimate}, prior, "caribou_nominal", "output-error"
    )
    assert identified.method == "output-error"
    assert identified.noise == {}
    assert any("no run in pitch" in note for note in identified.notes)
    assert identified.planes[Plane.YAW].b1_per_s2.value == pytest.approx(
        yaw_estimate.model.values[0]
    )
    pitch_sd, yaw_sd = (identified.planes[p].b1_per_s2.sd for p in (Plane.PITCH, Plane.YAW))
    assert pitch_sd is not None
    assert yaw_sd is not None
    assert pitch_sd > yaw_sd


@pytest.mark.parametrize("plane", ["yaw", "pitch"])
def test_linear_run_starts_at_its_lead(flown: list[Run], plane: Plane) -> None:
    """Heading and depth start at zero; outputs are at every fifth sample after the lead."""
    run = next(run for run in flown if run.plane == plane)
    record = records.linear_run(run, 4.0)
    begins_s = run.time_s[record.command.lead]
    assert begins_s == pytest.approx(-1.0, abs=0.02)
    assert response.steps(record.command) == len(record.measured)
    assert record.measured.shape[1] == PLANES[plane].n_outputs
    assert record.measured[0, -1] == 0.0
    sample = record.command.lead + 5 * 40
    assert record.measured[40, 0] == pytest.approx(
        np.mean(run.rate_radps[sample - 2 : sample + 3]), abs=1e-12
    )


@pytest.mark.parametrize("method", ["output-error", "filter-error"])
def test_identify_delay_of_zero_is_a_result(method: estimate.Method) -> None:
    """A tailcone without delay, and a prior of 0.1 s: the search ends at its bound of zero."""
    prior, truth = (
        with_tailcone(config.load(name), delay_s)
        for name, delay_s in (("caribou_nominal", 0.1), ("caribou_truth", 0.0))
    )
    signals = [sea.doublet(5.0), sea.doublet(-7.0, 3.0), sea.step(5.0, 20.0)]
    runs = [
        sea.fly(truth, Plane.YAW, signal, name=f"r/{k}", seed=1 + k, level=0.5, trim_rad=TRIM)
        for k, signal in enumerate(signals)
    ]
    with np.errstate(all="raise", under="ignore"), warnings.catch_warnings():
        warnings.simplefilter("error")
        found = refit.identify(runs, prior, "own", method)
    delay = found.planes[Plane.YAW].delay_s
    assert (delay.value, delay.sd) == (0.0, None)
    assert "yaw: delay_s is at its limit of zero and has no standard deviation" in found.notes
    b1_sd = found.planes[Plane.YAW].b1_per_s2.sd
    assert b1_sd is not None
    assert b1_sd > 0.0


def with_tailcone(vehicle: config.VehicleConfig, delay_s: float) -> config.VehicleConfig:
    """Return a vehicle with another delay and a fast lag, so that the delay is observable."""
    tail = msgspec.structs.replace(vehicle.tailcone, delay_s=delay_s, natural_frequency_radps=12.0)
    return msgspec.structs.replace(vehicle, tailcone=tail)
