"""Dives of a campaign that are repeated with other limits after a failsafe."""

from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import pytest

from ground.campaign import (
    computations,
    dives,
    failsafe_limits,
    folder_setup,
    refit,
)
from ground.campaign.campaign_folder import CampaignFolder
from ground.campaign.dive_records import DiveRecords
from ground.campaign.dives import CampaignDives
from ground.campaign.failsafe_limits import AfloatError, FailsafeError
from ground.campaign.preparation import Preparation
from ground.campaign.request import (
    ALL_MISSIONS,
    CampaignRequest,
)
from ground.campaign.run import Campaign
from ground.client.dive_symptoms import Symptom, SymptomKind
from ground.client.flight import FlightProgress, FlightResult
from ground.missions import scaling, script
from mavlink_io.errors import OperationError
from mavlink_io.mission_items import MavCmd


@pytest.mark.parametrize(("largest_deg", "attempts"), [(5.0, 1), (3.0, 2), (0.1, 4)])
def test_dive_with_tests_is_repeated_with_smaller_ones_after_a_failsafe(
    largest_deg: float, attempts: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The shipped rudder sweeps have tests of 4, 7 and 5 deg; here their first one is too large."""
    sizes: list[float] = []
    pitches: list[float] = []

    def fly(dive: Any, *_: object, **__: object) -> FlightResult:
        assert not dive.log.exists(), "the log of the attempt before"
        sizes.append(next(item.p2 for item in dive.items if item.command == MavCmd.USER_1))
        pitches.append(dive.parameters.get("SID_PITCH_MAX", 35.0))
        dive.log.write_bytes(b"")
        failsafes = ("Failsafe: pitch 60 deg",) if sizes[-1] > largest_deg else ()
        return FlightResult(dive.log, 10.0, 1.0, 5, 0, (), failsafes, "")

    monkeypatch.setattr(dives, "fly_simulated", fly)
    monkeypatch.setattr(CampaignDives, "_launch", lambda *_: None)
    campaign = Campaign(CampaignRequest(tmp_path), lambda name, at: None, lambda words: None)
    campaign.dives.records = DiveRecords(tmp_path)
    with nullcontext() if attempts < 4 else pytest.raises(OperationError, match="pitch 60"):
        campaign.dives.fly("identification", "rudder_sweeps", {})
    assert sizes == pytest.approx([4.0 * 0.6**n for n in range(attempts)], abs=0.11)
    assert pitches == pytest.approx([35.0 * 0.6**n for n in range(attempts)], abs=0.06)
    assert campaign._totals().vehicle_s == 10.0 * attempts


@pytest.mark.parametrize(
    ("failsafes", "ended"),
    [
        (("Failsafe: no rise for 20 s -> propeller stopped",), ""),
        (("Failsafe: no rise for 20 s -> propeller stopped", "Failsafe: pitch 60 deg"), "no rise"),
        (("Failsafe: surface not reached, no rise for 600 s -> disarmed",), "surface not reached"),
    ],
)
def test_dive_that_floats_up_after_its_last_step_is_complete(
    failsafes: tuple[str, ...], ended: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Weak first gains held a hull of 1.35 m at 0.7 m, below SURF_DEPTH_M.

    The campaign ended there, although every leg of the mission was recorded.
    """

    def fly(dive: Any, *_: object, **__: object) -> FlightResult:
        dive.log.write_bytes(b"")
        return FlightResult(dive.log, 10.0, 1.0, 5, 0, (), failsafes, "")

    monkeypatch.setattr(dives, "fly_simulated", fly)
    monkeypatch.setattr(CampaignDives, "_launch", lambda *_: None)
    said: list[str] = []
    campaign = Campaign(CampaignRequest(tmp_path), lambda name, at: None, said.append)
    campaign.dives.records = DiveRecords(tmp_path)
    with pytest.raises(OperationError, match=ended) if ended else nullcontext():
        campaign.dives.fly("baseline", "combined", {})
    assert said == ([] if ended else [f"baseline/combined: all steps flown; then {failsafes[0]}"])


def test_resumed_dive_continues_with_the_pitch_of_its_repetition(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pitches: list[float] = []

    def fly(dive: Any, *_: object, **__: object) -> FlightResult:
        pitches.append(dive.parameters.get("SID_PITCH_MAX", 35.0))
        dive.log.write_bytes(b"")
        failsafes = ("Failsafe: pitch 60 deg",) if pitches[-1] > 30.0 else ()
        return FlightResult(dive.log, 10.0, 1.0, 5, 0, (), failsafes, "")

    monkeypatch.setattr(dives, "fly_simulated", fly)
    monkeypatch.setattr(CampaignDives, "_launch", lambda *_: None)
    for _ in range(2):
        campaign = Campaign(CampaignRequest(tmp_path), lambda name, at: None, lambda words: None)
        campaign.dives.records = DiveRecords(tmp_path)
        campaign.dives.fly("identification", "rudder_sweeps", {})
    assert pitches == [35.0, 21.0]


@pytest.mark.parametrize(
    ("first_deg", "repeated_deg"), [(None, [12.0, 8.0, 8.0]), (10.0, [8.0] * 3), (5.0, [5.0] * 3)]
)
def test_repeated_dive_changes_depth_with_less_pitch(
    first_deg: float | None, repeated_deg: list[float]
) -> None:
    """20 deg times 0.6 for each repetition, at least 8 deg, never more than at first."""
    first = {} if first_deg is None else {"PTCH_LIM_DEG": first_deg}
    assert failsafe_limits.limit_pitch(first, 0) == first
    limits = [failsafe_limits.limit_pitch(first, number)["PTCH_LIM_DEG"] for number in (1, 2, 3)]
    assert limits == repeated_deg


def test_depth_reference_is_slower_in_proportion_to_a_smaller_pitch() -> None:
    gains = {"DPT_REF_RATE": 0.3, "PTCH_LIM_DEG": 15.0}
    once = failsafe_limits.limit_dives(gains, 1)
    assert once["DPT_REF_RATE"] == pytest.approx(0.3 * 9.0 / 15.0)
    again = failsafe_limits.limit_dives(once, 1)  # 8 deg is the least pitch
    assert again["DPT_REF_RATE"] == pytest.approx(0.3 * 8.0 / 15.0)
    assert failsafe_limits.limit_dives(again, 1) == again


def _without_simulation(
    out: Path, monkeypatch: pytest.MonkeyPatch, largest_deg: float
) -> tuple[Campaign, list[tuple[str, float]]]:
    """Return a campaign and its dives, which end with a failsafe above a largest pitch."""
    flown: list[tuple[str, float]] = []

    def fly(dive: Any, *_: object, **__: object) -> FlightResult:
        pitch_deg = dive.parameters.get("PTCH_LIM_DEG", 20.0)
        flown.append((f"{dive.log.parent.name}/{dive.log.stem}", pitch_deg))
        dive.log.write_bytes(b"")
        failsafes = ("Failsafe: no effect",) if pitch_deg > largest_deg else ()
        return FlightResult(dive.log, 10.0, 1.0, 5, 0, (), failsafes, "")

    monkeypatch.setattr(dives, "fly_simulated", fly)
    monkeypatch.setattr(CampaignDives, "_launch", lambda *_: None)
    campaign = Campaign(CampaignRequest(out), lambda name, at: None, lambda words: None)
    campaign.dives.records = DiveRecords(out)
    return campaign, flown


@pytest.mark.parametrize(("largest_deg", "expected_deg"), [(20.0, None), (15.0, 12.0), (8.0, 8.0)])
def test_missions_of_all_gains_repeated_with_less_pitch_after_a_failsafe(
    largest_deg: float,
    expected_deg: float | None,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    campaign, flown = _without_simulation(tmp_path, monkeypatch, largest_deg)
    gains: dict[str, dict[str, float]] = {"initial": {}, "redesigned": {}}
    both = [(name, mission) for name in gains for mission in computations.MISSIONS]
    with ThreadPoolExecutor(1) as slots:
        missions = campaign._begin_missions(slots, both, gains)
        limited = campaign._finish_missions(slots, missions, gains)
    assert [values.get("PTCH_LIM_DEG") for values in limited.values()] == [expected_deg] * 2
    last = [pitch_deg for _, pitch_deg in flown[-len(both) :]]
    assert last == [expected_deg or 20.0] * len(both)


@pytest.mark.parametrize(
    ("largest_degps", "expected_degps"), [(10.0, 10.0), (8.0, 6.0), (3.5, 3.0), (2.0, None)]
)
def test_missions_repeated_with_slower_turns_after_the_rudder_had_no_effect(
    largest_degps: float,
    expected_degps: float | None,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """10 deg/s times 0.6 for each repetition, at least 3 deg/s."""

    def fly(dive: Any, *_: object, **__: object) -> FlightResult:
        dive.log.write_bytes(b"")
        failsafes = ("critical state",) if dive.parameters["HDG_REF_RATE"] > largest_degps else ()
        return FlightResult(dive.log, 10.0, 1.0, 5, 0, (), failsafes, "")

    stuck = Symptom(SymptomKind.STUCK, "heading", "the rudder is stuck", "check it")
    monkeypatch.setattr(dives, "fly_simulated", fly)
    monkeypatch.setattr(CampaignDives, "_launch", lambda *_: None)
    monkeypatch.setattr(CampaignDives, "_symptom", lambda *_: stuck)
    campaign = Campaign(CampaignRequest(tmp_path), lambda name, at: None, lambda words: None)
    campaign.dives.records = DiveRecords(tmp_path)
    gains = {"redesigned": {"HDG_REF_RATE": 10.0, "PTCH_LIM_DEG": 15.0}}
    with ThreadPoolExecutor(1) as slots:
        missions = campaign._begin_missions(slots, [("redesigned", "combined")], gains)
        if expected_degps is None:
            with pytest.raises(FailsafeError, match="the rudder is stuck"):
                campaign._finish_missions(slots, missions, gains)
        else:
            limited = campaign._finish_missions(slots, missions, gains)
            slower = {"HDG_REF_RATE": expected_degps, "PTCH_LIM_DEG": 15.0}
            assert limited == {"redesigned": slower}


def test_missions_with_failsafe_at_least_pitch_end_the_campaign(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    campaign, _ = _without_simulation(tmp_path, monkeypatch, 5.0)
    gains: dict[str, dict[str, float]] = {"redesigned": {}}
    with ThreadPoolExecutor(1) as slots:
        missions = campaign._begin_missions(slots, [("redesigned", "depth_change")], gains)
        with pytest.raises(FailsafeError, match="Failsafe: no effect"):
            campaign._finish_missions(slots, missions, gains)


CRITICAL = ("mission left in a critical state",)


def _never_afloat_at(
    thrust_pct: float,
    out: Path,
    monkeypatch: pytest.MonkeyPatch,
    failsafes: tuple[str, ...] = CRITICAL,
) -> tuple[Campaign, list[tuple[str, float]]]:
    """Return a campaign and the thrust of the first leg of its dives.

    A dive does not leave the surface if it begins with less than `thrust_pct`; it ends with
    `failsafes` then.
    """
    flown: list[tuple[str, float]] = []

    def fly(dive: Any, simulated: Any, on_progress: Any, **_: object) -> FlightResult:
        first_pct = next(item.p3 for item in dive.items if item.command == MavCmd.DO_CHANGE_SPEED)
        flown.append((f"{dive.log.parent.name}/{dive.log.stem}", first_pct))
        dive.log.write_bytes(b"")
        is_afloat = first_pct < thrust_pct
        for vehicle_s in range(0, 700, 20):
            depth_m = 0.2 if is_afloat or not 10 < vehicle_s < 690 else 3.0
            on_progress(FlightProgress(4, 5, float(vehicle_s), 1.0, depth_m, 0.0))
        return FlightResult(dive.log, 700.0, 1.0, 5, 0, (), failsafes if is_afloat else (), "")

    afloat = Symptom(SymptomKind.AFLOAT, "depth", "does not leave the surface", "fly faster")
    monkeypatch.setattr(dives, "fly_simulated", fly)
    monkeypatch.setattr(CampaignDives, "_launch", lambda *_: None)
    monkeypatch.setattr(CampaignDives, "_symptom", lambda *_: afloat)
    campaign = Campaign(CampaignRequest(out), lambda name, at: None, lambda words: None)
    campaign.dives.records = DiveRecords(out)
    return campaign, flown


@pytest.mark.parametrize("failsafes", [CRITICAL, ()])
def test_vehicle_that_stays_afloat_dives_at_full_thrust_from_then_on(
    failsafes: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Legs with a duration end at the surface, too, without a failsafe.

    A vehicle of 5.5 by 0.35 m with 12 N of net buoyancy flew them with its elevator hard down.
    """
    campaign, flown = _never_afloat_at(80.0, tmp_path, monkeypatch, failsafes)
    campaign.dives.fly("prototype", "trim", {})
    campaign.dives.fly("identification", "rudder_steps", {})
    campaign.dives.fly("verification", "combined", {})
    assert flown == [
        ("prototype/trim", 58.0),
        ("prototype/trim", 100.0),
        ("identification/rudder_steps", 100.0),
        ("verification/combined", 100.0),
    ]
    assert campaign._totals().vehicle_s == 4 * 700.0


@pytest.mark.parametrize("failsafes", [CRITICAL, ()])
def test_resumed_campaign_keeps_the_descent_at_full_thrust(
    failsafes: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The missions are written again at the beginning; the record of the failed dive remains."""
    campaign, flown = _never_afloat_at(80.0, tmp_path, monkeypatch, failsafes)
    campaign.dives.fly("prototype", "trim", {})
    options = folder_setup._campaign_toml(campaign.request._replace(resume=True), ())
    (tmp_path / "campaign.toml").write_text(options)
    resumed, flown = _never_afloat_at(80.0, tmp_path, monkeypatch, failsafes)
    resumed.request = resumed.dives.request = resumed.request._replace(resume=True)
    resumed._write_folder(Preparation({}, {}, ()))
    resumed.dives.fly("prototype", "trim", {})
    assert flown == []
    resumed.dives.fly("identification", "rudder_steps", {})
    assert flown == [("identification/rudder_steps", 100.0)]
    assert resumed._totals().vehicle_s == 3 * 700.0


def test_test_dive_that_stays_afloat_changes_its_own_and_all_gains_missions(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    campaign, flown = _never_afloat_at(80.0, tmp_path, monkeypatch)
    campaign.dives.fly("identification", "rudder_steps", {})
    folder = CampaignFolder(tmp_path)
    faster = {
        mission
        for mission in ALL_MISSIONS
        if scaling.descends_at_full_thrust(script.load(folder.mission_file(mission)))
    }
    assert faster == {"rudder_steps", *computations.MISSIONS}
    assert [thrust for _, thrust in flown] == [58.0, 100.0]


@pytest.mark.parametrize("failsafes", [CRITICAL, ()])
def test_missions_of_all_gains_repeated_at_full_thrust_after_one_stays_afloat(
    failsafes: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    campaign, flown = _never_afloat_at(80.0, tmp_path, monkeypatch, failsafes)
    gains: dict[str, dict[str, float]] = {"initial": {}, "redesigned": {}}
    both = [(name, mission) for name in gains for mission in computations.MISSIONS]
    with ThreadPoolExecutor(1) as slots:
        missions = campaign._begin_missions(slots, both, gains)
        assert campaign._finish_missions(slots, missions, gains) == gains
    assert [thrust for _, thrust in flown[-len(both) :]] == [100.0] * len(both)


def test_missions_that_a_test_changed_meanwhile_are_flown_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A recommended test stays afloat while the missions fly as they were before."""
    campaign, flown = _never_afloat_at(80.0, tmp_path, monkeypatch)
    gains: dict[str, dict[str, float]] = {"initial": {}, "redesigned": {}}
    both = [(name, mission) for name in gains for mission in computations.MISSIONS]
    with ThreadPoolExecutor(1) as slots:
        missions = campaign._begin_missions(slots, both, gains)
        wait(missions)
        assert campaign.dives.speed_up_descents()
        assert campaign._finish_missions(slots, missions, gains) == gains
    assert [thrust for _, thrust in flown[-len(both) :]] == [100.0] * len(both)


@pytest.mark.parametrize("failsafes", [CRITICAL, ()])
def test_vehicle_that_stays_afloat_at_full_thrust_ends_the_campaign(
    failsafes: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    campaign, flown = _never_afloat_at(101.0, tmp_path, monkeypatch, failsafes)
    with pytest.raises(AfloatError, match="add ballast; a descent at full thrust is not"):
        campaign.dives.fly("prototype", "trim", {})
    assert len(flown) == 2


def test_log_is_not_read_after_a_dive_that_left_the_surface(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """20 s at the surface before and after a dive are less than 60 s."""
    campaign, _ = _never_afloat_at(50.0, tmp_path, monkeypatch)
    read: list[object] = []
    monkeypatch.setattr(CampaignDives, "_symptom", lambda *args: read.append(args))
    campaign.dives.fly("prototype", "trim", {})
    assert read == []


def test_log_of_a_repeated_dive_is_read_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The worker reads each log when its dive ends; the missions may be flown again after that."""
    reads: list[bytes] = []

    def read(path: Path) -> bytes:
        reads.append(path.read_bytes())
        return reads[-1]

    monkeypatch.setattr(refit, "read_log", read)
    folder = CampaignFolder(tmp_path)
    log = folder.log_path("verification", "combined")
    log.parent.mkdir()
    for content in (b"afloat", b"dived below"):
        log.write_bytes(content)
        for _ in range(2):
            folder.log("verification", "combined")
    assert reads == [b"afloat", b"dived below"]


def test_pitch_limit_of_repeated_tests_is_kept_for_all_gains(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    campaign, _ = _without_simulation(tmp_path, monkeypatch, 12.0)
    gains = {"initial": {"HDG_P": 1.0}, "improved": {"HDG_P": 2.0}}
    assert campaign._apply_failsafe_limits(gains) == gains
    campaign.dives.fly("identification", "elevator_steps", {})
    campaign.dives.fly("identification", "rudder_steps", {"PTCH_LIM_DEG": 12.0})
    limited = campaign._apply_failsafe_limits(gains)
    assert limited == {name: {**values, "PTCH_LIM_DEG": 12.0} for name, values in gains.items()}


def test_dive_that_does_not_end_is_given_up(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A vehicle that power holds below the surface would be flown until its battery is weak."""
    seen: list[float] = []

    def fly(dive: Any, simulated: Any, on_progress: Any, **_: object) -> FlightResult:
        for vehicle_s in range(0, 100_000, 100):
            on_progress(FlightProgress(4, 5, float(vehicle_s), 1.0, 0.5, 0.0))
        raise AssertionError("the dive was not given up")

    monkeypatch.setattr(dives, "fly_simulated", fly)
    monkeypatch.setattr(CampaignDives, "_launch", lambda *_: None)
    campaign = Campaign(
        CampaignRequest(tmp_path), lambda name, at: seen.append(at.vehicle_s), lambda words: None
    )
    campaign.dives.records = DiveRecords(tmp_path)
    with pytest.raises(OperationError, match=r"prototype/trim: 0\.5 m deep \d+ s after"):
        campaign.dives.fly("prototype", "trim", {})
    assert 1000.0 < seen[-1] < 5000.0
