"""Outcomes of campaigns are read from summaries, kept, and judged by the targets."""

import json
from pathlib import Path

import pytest

from benchmarks.campaigns import __main__ as campaigns
from benchmarks.campaigns import drawn
from benchmarks.campaigns.__main__ import Outcome
from sitl.vehicle import config

GOOD = Outcome("caribou", 1, "", heading=0.5, depth=0.9)
SUMMARY = {
    "steady_error": {
        "initial": {"heading_deg": 1.0, "depth_m": 0.1},
        "redesigned": {"heading_deg": 0.5, "depth_m": 0.12},
    },
    "retests": [{}],
    "design": {"specification": {"pm_deg": 45.0}, "selection": {"kept_first": False}},
}


@pytest.mark.parametrize("name", [name for name in campaigns.VEHICLES if name != "caribou"])
def test_vehicle_files_can_be_read(name: str) -> None:
    assert config.load(campaigns.VEHICLES[name]).name


@pytest.mark.parametrize("number", range(1, 6))
def test_drawn_vehicle_is_a_valid_file(number: int, tmp_path: Path) -> None:
    path = tmp_path / "drawn.toml"
    path.write_text(drawn.text(number), encoding="utf-8")
    vehicle = config.load(path)
    assert vehicle.name == f"drawn_{number}"
    assert drawn.text(number) == drawn.text(number) != drawn.text(number + 1)


def test_summarise_compares_redesigned_with_first_gains() -> None:
    outcome = campaigns.summarise("heavy", 2, SUMMARY)
    assert outcome.heading == 0.5
    assert outcome.depth == pytest.approx(1.2)
    assert not outcome.at_least_as_good
    assert (outcome.retests, outcome.pm_deg, outcome.fit) == (1, 45.0, True)


def test_run_campaign_that_has_ended_is_not_flown_again(tmp_path: Path) -> None:
    folder = tmp_path / "caribou_1"
    folder.mkdir()
    (folder / campaigns.OUTCOME_FILE).write_text(json.dumps(GOOD._asdict()), encoding="utf-8")
    assert campaigns.run("caribou", 1, tmp_path, 1) == GOOD


@pytest.mark.parametrize(
    ("last", "met"),
    [
        (GOOD, [True, True, True]),
        (GOOD._replace(heading=1.01), [True, True, True]),
        (Outcome("caribou", 10, "the model is not fit for redesign: b1"), [False, True, True]),
        (Outcome("caribou", 10, "no first gains", refused=True), [False, True, True]),
    ],
    ids=["good", "worse heading", "not fit", "refused"],
)
def test_judge_one_bad_campaign_of_ten_meets_the_shares(last: Outcome, met: list[bool]) -> None:
    outcomes = [GOOD._replace(seed=seed) for seed in range(1, 10)]
    assert [reached for _, reached in campaigns.judge([*outcomes, last])] == met
    if last != GOOD and not last.refused:
        two_of_ten = [*outcomes[1:], last, last]
        assert [reached for _, reached in campaigns.judge(two_of_ten)] != [True, True, True]


def test_judge_three_of_four_other_vehicles_suffice() -> None:
    others = ("short_fat", "long_slow", "unstable_yaw", "heavy")
    good = [GOOD._replace(vehicle=name) for name in others[:3]]
    refused = Outcome("heavy", 1, "no first gains", refused=True)
    assert [met for _, met in campaigns.judge([*good, refused])] == [True, True, True]
    also = refused._replace(vehicle="short_fat")
    assert [met for _, met in campaigns.judge([*good, refused, also])] == [False, True, True]
