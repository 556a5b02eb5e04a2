"""Campaigns as tasks of a sweep."""

from pathlib import Path

import pytest

from autopilot.control import params
from ground.missions import plans
from sysid.design.specification import Spec
from sysid.monte_carlo.simulate import MissionRejectedError, Sea
from sysid.sweep import campaigns, dives
from sysid.sweep.campaigns import CampaignPlan, SweepMission
from sysid.sweep.dives import fly_chunk, rows_of
from sysid.sweep.sweep_request import Chunks, SweepVehicle
from sysid.trials import map_trials
from tests.sysid.monte_carlo.conftest import HELD
from tests.sysid.sweep.conftest import SHORT, Sweep

NO_TESTS = CampaignPlan(HELD, (SweepMission("short", SHORT),))
STEPS = tuple(
    SweepMission(name, plans.load_items(name)) for name in ("rudder_steps", "elevator_steps")
)
LENIENT = Spec(
    damping=0.3,
    gm_db=5.0,
    pm_deg=30.0,
    max_sensitivity=2.5,
    robust_gm_db=3.0,
    robust_pm_deg=20.0,
    pitch_rms_ratio=3.0,
    integral_residual=0.5,
)


def test_without_tests_first_gains_are_flown_with_reason(vehicle: SweepVehicle) -> None:
    truth = vehicle.prior.vehicle(vehicle.prior.mean)
    result = campaigns.run(NO_TESTS, truth, vehicle.prior, Sea(), (1, 2))
    assert result.failure == "no test passed the screening"
    assert result.config.heading_p == HELD["HDG_P"]
    assert result.tests_s == 42.0, "the time of the mission without a test counts"


def test_rejected_test_mission_names_the_gains(vehicle: SweepVehicle, request_of: Sweep) -> None:
    empty = NO_TESTS._replace(tests=(SweepMission("empty", ()),))
    sets = (vehicle.gains[0]._replace(campaign=empty),)
    chunks = Chunks(request_of(vehicles=(vehicle._replace(gains=sets),)))
    with pytest.raises(MissionRejectedError, match="tests of held"):
        fly_chunk(chunks[0])


def test_one_campaign_for_all_faults_of_a_vehicle(
    vehicle: SweepVehicle, request_of: Sweep, monkeypatch: pytest.MonkeyPatch
) -> None:
    seas = list[Sea]()
    config = params.config(HELD)

    def count(*args: object) -> campaigns.CampaignResult:
        seas.append(args[3])  # type: ignore[arg-type]
        return campaigns.CampaignResult(config, 100.0)

    monkeypatch.setattr(campaigns, "run", count)
    sets = (vehicle.gains[0]._replace(campaign=NO_TESTS),)
    conditions = {"rudder_bias_deg": (0.0, 2.0), "disturbance_scale": (1.0, 1.5)}
    request = request_of(
        vehicles=(vehicle._replace(gains=sets),), conditions=conditions, samples=1, chunk=4
    )
    rows = list(rows_of(fly_chunk(Chunks(request)[0]).text))
    assert seas == [Sea(times=1.0), Sea(times=1.5)], "the tests are flown before the fault"
    assert [row["tests_s"] for row in rows] == ["100.0"] * 4


@pytest.mark.slow
def test_redesigned_gains_are_flown_and_same_on_processes(
    tmp_path: Path, vehicle: SweepVehicle, request_of: Sweep
) -> None:
    plan = CampaignPlan(HELD, STEPS, spec=LENIENT)
    sets = (vehicle.gains[0], vehicle.gains[0]._replace(name="steps", campaign=plan))
    request = request_of(vehicles=(vehicle._replace(gains=sets),), samples=1)
    parts = [
        map_trials(fly_chunk, Chunks(request), dives.Part, jobs=jobs)[0].text for jobs in (1, 2)
    ]
    assert parts[0] == parts[1]
    first, redesigned = rows_of(parts[0])
    assert (first["tests_s"], first["not_redesigned"]) == ("", "")
    assert redesigned["not_redesigned"] == ""
    assert float(redesigned["tests_s"]) == pytest.approx(1235.0, abs=20.0)
    assert float(redesigned["heading_deg"]) < float(first["heading_deg"])
