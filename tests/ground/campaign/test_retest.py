"""A model that is not fit leads to the test that its assessment names, within the water time."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from ground.campaign import computations, folder_setup, retest
from ground.campaign.dive_records import DiveRecords
from ground.campaign.dives import CampaignDives
from ground.campaign.request import ALL_MISSIONS, CampaignRequest, dive_seed
from ground.campaign.run import Campaign
from ground.client.flight import FlightResult
from ground.missions import scaling, script
from ground.missions.script import Script
from mavlink_io.errors import OperationError
from sysid.planes import Plane
from sysid.validation.results import NextTest

TESTS = {name: script.load(name) for name in (*computations.FITTED, *computations.HELD_OUT)}
CHIRP = NextTest(
    plane=Plane.YAW, signal="chirp", magnitude_deg=5.0, duration_s=30.0, reason="gain not known"
)
TO_HOLD_OUT = NextTest(
    plane=Plane.PITCH, signal="3211", magnitude_deg=12.0, duration_s=20.0, reason="not held out"
)


def signals_of(mission: Script) -> list[Any]:
    return [step.test for step in mission.step if step.test is not None]


def test_plan_flies_the_named_test_with_the_campaigns_frequencies() -> None:
    dive = retest.plan(TESTS, CHIRP, "retest_1")
    assert dive is not None
    assert not dive.held_out
    flown = signals_of(dive.script)
    assert {(test.signal, test.axis) for test in flown} == {("chirp", "rudder")}
    assert [test.magnitude_deg for test in flown] == [5.0, -5.0, 5.0, -5.0]
    assert {(test.f_start_hz, test.f_stop_hz) for test in flown} == {(0.06, 0.35)}
    assert dive.script.step[-1].surface
    # 60 s of approach, four tests of 28 s, four legs of 30 s
    assert dive.planned_s == pytest.approx(60.0 + 4 * (28.0 + 30.0))


def test_plan_size_stays_within_the_adapted_tests() -> None:
    dive = retest.plan(TESTS, TO_HOLD_OUT, "retest_1")
    assert dive is not None
    assert dive.held_out
    sizes = {abs(test.magnitude_deg) for test in signals_of(dive.script)}
    known = [t for t in signals_of(TESTS["elevator_heldout"]) if t.signal == "3211"]
    assert sizes == {max(abs(test.magnitude_deg) for test in known)}


def test_plan_after_a_descent_at_full_thrust_settles_before_the_first_test() -> None:
    faster = {name: scaling.descend_at_full_thrust(mission) for name, mission in TESTS.items()}
    slow, fast = (retest.plan(missions, CHIRP, "retest_1") for missions in (TESTS, faster))
    assert slow is not None
    assert fast is not None
    assert fast.script.step == scaling.descend_at_full_thrust(slow.script).step


class FakeWorker:
    """Runs the planning; the fit is not fit for redesign until so many retests were flown."""

    def __init__(self, needed: int) -> None:
        self.needed, self.fits = needed, list[tuple[Any, ...]]()

    def call(self, function: Any, out: Path, *args: Any) -> Any:
        if function is not computations.identify:
            return retest.plan(TESTS, *args)
        self.fits.append(args)
        flown = len(args[0]) if args else 0
        return SimpleNamespace(fit_for_redesign=flown >= self.needed, next_test=CHIRP)


@pytest.mark.parametrize(
    ("needed", "extra_water_s", "flown"), [(0, 1800.0, 0), (2, 1800.0, 2), (9, 700.0, 2), (1, 0, 0)]
)
def test_campaign_flies_retests_within_the_water_time(
    needed: int, extra_water_s: float, flown: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A dive takes 292 s of legs and tests; 300 s are counted when it is flown."""
    said: list[str] = []
    campaign = Campaign(
        CampaignRequest(tmp_path, extra_water_s=extra_water_s), lambda *at: None, said.append
    )
    campaign.dives.records = DiveRecords(tmp_path)

    def fly(self: CampaignDives, stage: str, mission: str, parameters: object) -> None:
        assert script.load(str(tmp_path / "missions" / f"{mission}.toml")).step
        self.outcomes[f"{stage}/{mission}"] = SimpleNamespace(vehicle_s=300.0)  # type: ignore[assignment]

    monkeypatch.setattr(CampaignDives, "fly", fly)
    worker = FakeWorker(needed)
    campaign._identify(worker, {})  # type: ignore[arg-type]
    assert [dive.mission for dive in campaign.retests] == list(computations.RETESTS[:flown])
    assert len(worker.fits) == flown + 1
    left_s = max(extra_water_s - 300.0 * flown, 0.0)
    ended_by_time = any(f"needs 292 s of the {left_s:.0f} s left" in words for words in said)
    assert ended_by_time == (flown < needed)
    assert [dive.fit_for_redesign for dive in campaign.retests] == [
        number >= needed for number in range(1, flown + 1)
    ]


def test_retest_is_limited_to_the_pitch_of_the_tests_that_it_repeats(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two failsafes of the rudder sweeps: 35 deg times 0.36."""
    pitches: list[float] = []

    def fly(self: CampaignDives, stage: str, mission: str, parameters: dict[str, float]) -> None:
        pitches.append(parameters["SID_PITCH_MAX"])
        self.outcomes[f"{stage}/{mission}"] = SimpleNamespace(vehicle_s=300.0)  # type: ignore[assignment]

    monkeypatch.setattr(CampaignDives, "fly", fly)
    campaign = Campaign(CampaignRequest(tmp_path), lambda *at: None, lambda words: None)
    campaign.dives.records = DiveRecords(tmp_path)
    (tmp_path / "log").write_text("")
    ended = FlightResult(tmp_path / "log", 10.0, 1.0, 5, 0, (), ("Failsafe: pitch",), "")
    for number in (1, 2):
        campaign.dives.records.add(f"identification/rudder_sweeps, attempt {number}", "", ended)
    campaign._identify(FakeWorker(1), {})  # type: ignore[arg-type]
    assert pitches == [12.6]


def test_campaign_model_error_flies_no_retest(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    said: list[str] = []
    assessment = SimpleNamespace(fit_for_redesign=False, next_test=None, obstacle="model error")
    worker = SimpleNamespace(call=lambda *asked: assessment)
    campaign = Campaign(CampaignRequest(tmp_path), lambda *at: None, said.append)
    campaign._identify(worker, {})  # type: ignore[arg-type]
    assert campaign.retests == []
    assert said == ["not fit, and no test can make it fit: model error"]


def test_retest_logs_belong_to_the_campaign(tmp_path: Path) -> None:
    """A replaced campaign leaves none of them; each has its own seed."""
    folder_setup.prepare_folder(CampaignRequest(tmp_path))
    log = tmp_path / "identification" / "retest_1.mcap"
    log.parent.mkdir()
    log.write_bytes(b"")
    folder_setup.prepare_folder(CampaignRequest(tmp_path, force=True))
    assert not log.exists()
    seeds = {dive_seed(1, mission) for mission in (*ALL_MISSIONS, *computations.RETESTS)}
    assert len(seeds) == len(ALL_MISSIONS) + len(computations.RETESTS)


def test_failed_retest_ends_the_campaign(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fly(self: CampaignDives, stage: str, mission: str, parameters: object) -> None:
        raise OperationError("failsafe")

    monkeypatch.setattr(CampaignDives, "fly", fly)
    campaign = Campaign(CampaignRequest(tmp_path), lambda *at: None, lambda words: None)
    campaign.dives.records = DiveRecords(tmp_path)
    with pytest.raises(OperationError, match="failsafe"):
        campaign._identify(FakeWorker(1), {})  # type: ignore[arg-type]
