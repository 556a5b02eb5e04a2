"""A model.json of linear planes: what it says of a vehicle that the sea flew, and what it may be
used for."""

import math
from pathlib import Path

import numpy as np
import pytest

from sitl.vehicle import config
from sysid import refit
from sysid.data.segments import Plane, Run
from sysid.estimation.linear import estimate, records, report, response
from sysid.models import linear_planes, prediction
from sysid.models import model_file as models
from sysid.models.model_file import IdentifiedModel
from sysid.reproduction.paper_tables import Table1Column
from tests.sysid import sea

TRIM = (math.radians(6.0), math.radians(1.0))


@pytest.fixture(scope="module")
def flown() -> list[Run]:
    """Small tests of the bench vehicle, small enough for her to be nearly linear."""
    bench = config.load("caribou_nominal")
    runs = []
    for number, sign in enumerate((1.0, -1.0, 1.0, -1.0)):
        shape = sea.doublet(sign * 3.0, 4.0) if number > 1 else sea.step(sign * 1.5, 15.0)
        signal = np.concatenate([shape, sea.step(0.0, 8.0)])
        for plane in ("yaw", "pitch"):
            name = f"{plane}/{number}"
            runs.append(
                sea.fly(bench, plane, signal, name=name, seed=70 + number, level=0.3, trim_rad=TRIM)
            )
    return runs


@pytest.fixture(scope="module")
def model(flown: list[Run]) -> IdentifiedModel:
    return refit.identify(flown, config.load("caribou_nominal"), "caribou_nominal", "filter-error")


def test_planes_are_the_vehicles_own(model: IdentifiedModel) -> None:
    """Within four of the standard deviations it claims, and a twentieth for what is not linear."""
    c = config.load("caribou_nominal")
    true = linear_planes.small_signal(linear_planes.yaw_plane(coefficients(c)))
    found = model.planes["yaw"]
    for name in ("b1_per_s2", "p_slow_per_s", "p_fast_per_s"):
        told, value = getattr(found, name), getattr(true, name)
        assert abs(told.value - value) < 4.0 * told.sd + 0.05 * abs(value), name
    assert abs(found.delay_s.value - 0.3) < 4.0 * found.delay_s.sd + 0.02
    assert found.b1_per_s2.sd < 0.1 * true.b1_per_s2


def coefficients(vehicle: config.VehicleConfig) -> Table1Column:
    from sysid.models import parameters

    return parameters.to_table_1_column(vehicle.linear)


def test_coefficients_reproduce_the_planes(model: IdentifiedModel) -> None:
    """Redesign takes the coefficients; they must be the planes that were identified."""
    c = Table1Column(**{name: found.value for name, found in model.coefficients.items()})
    again = {
        "yaw": linear_planes.small_signal(
            linear_planes.yaw_plane(c, model.speed_mps, model.vehicle.mass_kg)
        ),
        "pitch": linear_planes.small_signal(
            linear_planes.pitch_plane(c, model.speed_mps, model.vehicle.mass_kg)
        ),
    }
    for plane, numbers in again.items():
        for name in ("static_gain_per_s", "b1_per_s2", "p_slow_per_s"):
            told = getattr(model.planes[plane], name)
            assert abs(told.value - getattr(numbers, name)) < 0.5 * told.sd, (plane, name)


def test_what_motion_cannot_tell_says_so(model: IdentifiedModel) -> None:
    for name in ("Y_vdot", "Z_wdot"):
        assert model.coefficients[name].status == "unidentifiable"
    assert model.coefficients["N_rdot"].status == "prior"
    assert model.coefficients["N_dr"].status == "measured"


def test_file_keeps_the_method_and_predicts(
    model: IdentifiedModel, flown: list[Run], tmp_path: Path
) -> None:
    models.write(model, tmp_path / "model.json")
    again = models.read(tmp_path / "model.json")
    assert again.method == "filter-error"
    assert again == model
    assert {q.run for q in again.fit_quality} == {run.name for run in flown}
    yaw = [q.model_mse_deg2ps2 for q in prediction.quality(again, flown) if q.plane == "yaw"]
    assert max(yaw) < 0.3


def test_a_plane_without_runs_is_the_priors(flown: list[Run]) -> None:
    """By output error, which knows of no sea; in one it need not find one plane, so nobody asks
    here."""
    yaw = [run for run in flown if run.plane == "yaw"]
    prior = refit.prior_of(yaw, config.load("caribou_nominal"))
    belief = records.linear_prior(prior, "yaw")
    records_of_yaw = [records.linear_run(run, estimate.LEADS_S["output-error"]) for run in yaw]
    one = estimate.descend(records_of_yaw, belief, "output-error", belief.model.values)
    found = report.of_estimates({"yaw": one}, prior, "caribou_nominal", "output-error")
    assert found.method == "output-error"
    assert found.noise == {}
    assert any("no run in pitch" in note for note in found.notes)
    assert found.planes["yaw"].b1_per_s2.value == pytest.approx(one.model.values[0])
    assert found.planes["pitch"].b1_per_s2.sd > found.planes["yaw"].b1_per_s2.sd


@pytest.mark.parametrize("plane", ["yaw", "pitch"])
def test_a_record_holds_the_run_from_its_lead_on(flown: list[Run], plane: Plane) -> None:
    """Heading and depth from where they begin; outputs stand at every fifth sample after the
    command's lead."""
    run = next(run for run in flown if run.plane == plane)
    what = records.linear_run(run, 4.0)
    begins_s = run.time_s[what.command.lead]
    assert begins_s == pytest.approx(-1.0, abs=0.02)
    assert response.steps(what.command) == len(what.measured)
    assert what.measured.shape[1] == (3 if plane == "pitch" else 2)
    assert what.measured[0, 1 if plane == "yaw" else 2] == 0.0
    at = what.command.lead + 5 * 40
    assert what.measured[40, 0] == pytest.approx(
        np.mean(run.rate_radps[at - 2 : at + 3]), abs=1e-12
    )
