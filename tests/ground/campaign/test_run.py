"""A complete campaign with real processes."""

import json
import math
import multiprocessing
import re
import time
from html.parser import HTMLParser
from pathlib import Path
from threading import Event
from types import SimpleNamespace
from typing import Any

import msgspec
import pytest
from typer.testing import CliRunner

from ground.campaign import (
    computations,
    folder_setup,
    refit,
    run,
    summary_file,
)
from ground.campaign.campaign_folder import STAGES, CampaignFolder
from ground.campaign.dive_records import DiveRecords
from ground.campaign.dives import CampaignDives
from ground.campaign.request import (
    ALL_MISSIONS,
    IDENTIFICATION,
    TRIM_MISSION,
    CampaignRequest,
    dive_seed,
)
from ground.campaign.run import Campaign
from ground.campaign.summary_file import CampaignSummary
from ground.cli.main import app
from ground.client import param_file
from ground.log_tools import mcap
from ground.report import page, summary_picture
from mavlink_io.errors import InputError, OperationError
from sysid.refit import RefitRequest
from tests.browser import check_layout, needs_chromium, opened
from tests.helpers import node
from tests.helpers.subprocesses import process


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("campaign") / "out"
    Campaign(
        CampaignRequest(out, seed=1, include_paper_gains=True),
        lambda name, at: None,
        lambda words: None,
    ).run()
    page.write(out)
    return out


@pytest.fixture(scope="module")
def summary(flown: Path) -> CampaignSummary:
    return summary_file.read(flown / "summary.json")


@pytest.mark.process
@pytest.mark.timeout(600)
class CampaignTestCase:
    def test_the_folder_holds_what_was_asked_flown_and_found(self, flown: Path) -> None:
        files = {str(path.relative_to(flown)) for path in flown.rglob("*") if path.is_file()}
        missions = {f"{stage}/{m}.mcap" for stage in STAGES.values() for m in computations.MISSIONS}
        tests = {f"identification/{m}.mcap" for m in (*computations.FITTED, *computations.HELD_OUT)}
        results = {"campaign.toml", "model.json", "gains.param", "summary.json", "report.html"}
        assert files == missions | tests | results | {"prototype/trim.mcap"}

    def test_nothing_that_was_sent_is_missing(self, summary: CampaignSummary) -> None:
        assert summary.lost_frames == 0
        assert summary.vehicle_s > 2000

    def test_foxglove_packages_read_every_message_of_every_log(
        self, flown: Path, tmp_path_factory: pytest.TempPathFactory
    ) -> None:
        logs = sorted(flown.rglob("*.mcap"))
        counts = node.read_logs(tmp_path_factory.getbasetemp() / "node", *logs)
        assert len(logs) > 10
        for log in logs:
            assert counts[str(log)]["decoded"] == mcap.info(log)["topics"]

    def test_replay_of_the_first_dive_predicts_the_redesigned_one(
        self, flown: Path, tmp_path: Path
    ) -> None:
        words = ["replay", str(flown / "baseline" / "straight_run.mcap")]
        words += ["--params", str(flown / "gains.param"), "--model", str(flown / "model.json")]
        words += ["--out", str(tmp_path / "replay"), "--json"]
        done = CliRunner().invoke(app, words, catch_exceptions=False)
        assert done.exit_code == 0, done.stderr
        result = json.loads(done.stdout)
        assert len(result["parameters"]) > 5
        assert result["fidelity"]["heading_deg"] < 0.5
        assert result["fidelity"]["depth_m"] < 0.05
        assert result["finished"] == {"unchanged": True, "changed": True}
        errors = {name: errors["depth_m"] for name, errors in result["errors"].items()}
        assert errors["unchanged"] == pytest.approx(errors["recorded"], rel=0.3)
        assert errors["changed"] < errors["unchanged"]
        assert [Path(f).name for f in result["files"]] == [
            f"{name}.csv" for name in ("recorded", "unchanged", "changed")
        ]

    def test_the_trim_flight_finds_the_bent_rudder(self, summary: CampaignSummary) -> None:
        assert summary.trims["TRIM_RUD_DEG"] == pytest.approx(6.0, abs=0.5)

    def test_refit_predicts_held_out_runs_better_in_both_planes(
        self, summary: CampaignSummary
    ) -> None:
        errors = summary.model.held_out_rate_error
        assert set(errors) == {"yaw", "pitch"}
        for pair in errors.values():
            assert pair.refitted_model_deg2ps2 < pair.initial_model_deg2ps2

    def test_refit_of_the_logs_gives_the_same_model(self, flown: Path, tmp_path: Path) -> None:
        fitted, held_out = (
            [flown / "identification" / f"{name}.mcap" for name in names]
            for names in (computations.FITTED, computations.HELD_OUT)
        )
        request = RefitRequest(paths=fitted, held_out=held_out, alternative_methods=("paper",))
        refit.write_model(refit.refit(request), tmp_path / "model.json")
        assert (tmp_path / "model.json").read_bytes() == (flown / "model.json").read_bytes()

    def test_the_redesigned_gains_hold_heading_and_depth_better(
        self, summary: CampaignSummary
    ) -> None:
        steady = summary.steady_error
        assert steady["redesigned"].heading_deg < steady["initial"].heading_deg
        assert steady["redesigned"].depth_m < 0.5 * steady["initial"].depth_m

    def test_they_hold_both_better_than_the_papers_improved_gains(
        self, summary: CampaignSummary
    ) -> None:
        steady = summary.steady_error
        assert steady["redesigned"].heading_deg < steady["improved"].heading_deg
        assert steady["redesigned"].depth_m < steady["improved"].depth_m

    def test_the_same_seed_gives_the_same_model_and_gains_after_a_kill(
        self, flown: Path, tmp_path: Path
    ) -> None:
        out = tmp_path / "again"
        with process("-m", "ground", "campaign", "--out", str(out), "--seed", "1") as first:
            while first.running and not recorded_dives(out):
                time.sleep(0.01)
            first.kill()
        before = recorded_dives(out)
        assert before
        flown_again = set[str]()
        Campaign(
            CampaignRequest(out, seed=1, resume=True),
            lambda name, at: flown_again.add(name),
            lambda words: None,
        ).run()
        assert not before & flown_again
        for name in ("model.json", "gains.param"):
            assert (out / name).read_bytes() == (flown / name).read_bytes()

    def test_the_gains_file_holds_what_was_flown(
        self, flown: Path, summary: CampaignSummary
    ) -> None:
        written = param_file.load(flown / "gains.param")
        assert written
        for name, value in written.items():
            assert summary.gains["redesigned"][name] == pytest.approx(value, rel=1e-5)
        flown_gains = CampaignFolder(flown).log("verification", "straight_run").parameters
        for name, value in summary.gains["redesigned"].items():
            assert flown_gains[name] == pytest.approx(value, rel=1e-6)

    def test_every_set_of_gains_met_the_same_sea(self, flown: Path) -> None:
        notes = [_notes(flown / stage / "straight_run.mcap") for stage in STAGES.values()]
        assert len({note["seed"] for note in notes}) == 1

    def test_every_number_has_a_finite_value(self, summary: CampaignSummary) -> None:
        numbers = _numbers(msgspec.to_builtins(summary))
        assert [value for value in numbers if not math.isfinite(value)] == []

    def test_summary_read_and_written_has_the_same_bytes(
        self, flown: Path, summary: CampaignSummary, tmp_path: Path
    ) -> None:
        summary_file.write(summary, tmp_path / "summary.json")
        assert (tmp_path / "summary.json").read_bytes() == (flown / "summary.json").read_bytes()

    def test_the_page_needs_no_network_and_draws_every_chart(self, flown: Path) -> None:
        text = (flown / "report.html").read_text()
        assert len(text) < 6_000_000
        reader = _PageReader()
        reader.feed(text)
        assert reader.fetched == []
        charts = json.loads(reader.scripts["charts"])
        assert set(charts) == reader.chart_places
        for chart in charts.values():
            assert all(len(trace["x"]) == len(trace["y"]) > 0 for trace in chart["data"])
        for number in range(1, 6):
            assert f"Table {number}." in text

    @needs_chromium
    def test_page_in_a_browser_keeps_its_layout(self, flown: Path, tmp_path: Path) -> None:
        with opened(flown / "report.html", tmp_path / "profile") as report:
            check_layout(report)

    def test_the_picture_is_small_enough_for_a_readme(self, flown: Path, tmp_path: Path) -> None:
        target = summary_picture.draw(flown, tmp_path / "picture.png")
        assert target.read_bytes().startswith(b"\x89PNG")
        assert target.stat().st_size < 300_000


def recorded_dives(out: Path) -> set[str]:
    """Return the names of the finished dives of a campaign."""
    return set(DiveRecords(out)._records)


def test_campaign_worker_error_leaves_no_process(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(CampaignDives, "fly", lambda *dive: None)
    with pytest.raises(InputError, match=r"trim\.mcap"):
        Campaign(CampaignRequest(tmp_path / "out"), lambda name, at: None, lambda words: None).run()
    assert multiprocessing.active_children() == []


def test_campaign_failed_dive_ends_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def sink(*dive: object) -> None:
        raise OperationError("sunk")

    monkeypatch.setattr(CampaignDives, "fly", sink)
    with pytest.raises(OperationError, match="sunk"):
        Campaign(CampaignRequest(tmp_path / "out"), lambda name, at: None, lambda words: None).run()
    assert multiprocessing.active_children() == []


@pytest.mark.parametrize(
    ("vehicle", "prior"),
    [
        ("caribou_truth", "caribou_nominal"),
        ("caribou_nominal", "caribou_nominal"),
        ("xfin_auv", "xfin_auv"),
        ("docs/my_vehicle.toml", "docs/my_vehicle.toml"),
    ],
)
def test_campaign_prior_is_the_vehicles_own_file(
    vehicle: str, prior: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Caribou's prior was taken for every vehicle: xfin ended in a LinAlgError, my_vehicle in an
    error about bench.
    """
    handed = []
    monkeypatch.setattr(refit, "read_log", lambda path: None)

    def refit_logs(request: RefitRequest, *logs: object, force: bool) -> Any:
        handed.append(request.prior)
        return SimpleNamespace(assessment=None)

    def redesign(model: object, prior: str, *asked: object) -> Any:
        handed.append(prior)
        raise OperationError("no gains")

    monkeypatch.setattr(refit, "refit_logs", refit_logs)
    monkeypatch.setattr(refit, "write_model", lambda *asked: None)
    monkeypatch.setattr(refit, "check_converged", lambda model, remedy: None)
    monkeypatch.setattr(refit, "redesign_for_campaign", redesign)
    folder_setup.prepare_folder(CampaignRequest(tmp_path, vehicle=vehicle))
    computations.identify(tmp_path)
    computations._folder(tmp_path).__dict__["model"] = None
    with pytest.raises(OperationError, match="no gains"):
        computations.design(tmp_path, {}, ())
    assert handed == [prior, prior]


def test_campaign_failed_fit_names_no_option_of_refit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """`ground campaign` has neither --force nor --bench-result."""
    folder_setup.prepare_folder(CampaignRequest(tmp_path, vehicle="xfin_auv"))
    failed = SimpleNamespace(convergence=SimpleNamespace(failures=("delay at a bound",)))
    computations._folder(tmp_path).__dict__["model"] = failed
    with pytest.raises(OperationError) as error:
        computations.design(tmp_path, {}, ())
    assert str(error.value).startswith("the fit failed: delay at a bound; the failed model is ")
    assert "run the campaign again" in str(error.value)
    assert "--force" not in str(error.value)


def test_campaign_reads_each_log_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    read: list[str] = []
    fitted: list[list[str]] = []

    def read_log(path: Path) -> str:
        read.append(path.stem)
        return path.stem

    monkeypatch.setattr(refit, "read_log", read_log)

    def refit_logs(request: RefitRequest, *logs: Any, force: bool) -> Any:
        fitted.extend(logs)
        return SimpleNamespace(assessment=None)

    monkeypatch.setattr(refit, "refit_logs", refit_logs)
    monkeypatch.setattr(refit, "write_model", lambda *asked: None)
    folder_setup.prepare_folder(CampaignRequest(tmp_path))
    for mission in IDENTIFICATION:
        computations.read_log(tmp_path, "identification", mission)
    computations.identify(tmp_path)
    assert read == list(IDENTIFICATION)
    assert fitted == [list(computations.FITTED), list(computations.HELD_OUT)]


def test_campaign_unreadable_log_is_reported_by_the_refit(tmp_path: Path) -> None:
    folder_setup.prepare_folder(CampaignRequest(tmp_path))
    computations.read_log(tmp_path, "identification", computations.FITTED[0])
    with pytest.raises(InputError, match=r"rudder_steps\.mcap: No such file"):
        computations.identify(tmp_path)


def test_campaign_free_slot_flies_a_mission_during_the_last_test(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    begun, at_refit = list[str](), list[str]()
    baseline_begun, refit_begun = Event(), Event()

    def fly(self: CampaignDives, stage: str, mission: str, parameters: object) -> None:
        begun.append(f"{stage}/{mission}")
        if mission == IDENTIFICATION[-1]:
            assert baseline_begun.wait(30.0)
        if stage == "baseline":
            baseline_begun.set()
            assert refit_begun.wait(30.0)

    def redesign(self: Campaign, *asked: object) -> None:
        at_refit.extend(begun)
        refit_begun.set()
        raise OperationError("no model")

    monkeypatch.setattr(Campaign, "_measure_trims", lambda *asked: {})
    monkeypatch.setattr(CampaignDives, "fly", fly)
    monkeypatch.setattr(Campaign, "_redesign", redesign)
    request = CampaignRequest(tmp_path / "out", jobs=2)
    with pytest.raises(OperationError, match="no model"):
        Campaign(request, lambda name, at: None, lambda words: None).run()
    # One slot flies the first mission from the last test on, the other one refits.
    assert at_refit[:6] == [f"identification/{mission}" for mission in IDENTIFICATION]
    assert at_refit[6:] == [f"baseline/{computations.MISSIONS[0]}"]


def test_campaign_redesign_keeps_other_parameters() -> None:
    flown = {"HDG_P": 1.0, "ACT_TRAVEL_DEG": 13.6, "THR_CRUISE_PCT": 60.0, "TRIM_RUD_DEG": 0.1}
    assert run._not_designed({"HDG_P": 2.0, "ACT_LEAD_W": 5.0}, flown) == {
        "ACT_TRAVEL_DEG": 13.6,
        "THR_CRUISE_PCT": 60.0,
        "TRIM_RUD_DEG": 0.1,
    }


def test_campaign_papers_gains_on_another_vehicle_are_refused(tmp_path: Path) -> None:
    asked = CampaignRequest(tmp_path / "out", vehicle="xfin_auv", include_paper_gains=True)
    with pytest.raises(InputError, match="--include-paper-gains: the paper's gains are"):
        Campaign(asked, lambda name, at: None, lambda words: None).run()
    assert not (tmp_path / "out").exists()


@pytest.mark.process
@pytest.mark.timeout(600)
def test_campaign_impossible_sea_refused_before_dive(tmp_path: Path) -> None:
    """A user's scenario is not scaled: these moments accelerate remus100 by 34 deg/s2 rms."""
    sea = tmp_path / "rough.toml"
    sea.write_text("[disturbance.waves]\nyaw_rms_nm = 4.96\npitch_rms_nm = 4.57\n")
    options = ["--vehicle", "remus100", "--scenario", str(sea), "--out", str(tmp_path / "out")]
    ended = CliRunner().invoke(app, ["campaign", *options])
    assert isinstance(ended.exception, InputError)
    assert str(ended.exception).startswith(
        f"--vehicle remus100: cannot complete a campaign in scenario {sea}: trim"
    )
    assert "\n" not in str(ended.exception)
    assert not (tmp_path / "out").exists()


@pytest.mark.process
@pytest.mark.timeout(600)
def test_campaign_of_another_vehicle_completes(tmp_path: Path) -> None:
    """The prior of xfin_auv is its own file; a perturbed vehicle flies, and the prototype first."""
    out = tmp_path / "out"
    found = Campaign(
        CampaignRequest(out, vehicle="xfin_auv"), lambda name, at: None, lambda words: None
    ).run()
    model = CampaignFolder(out).model
    assert (model.vehicle.prior, model.speed_mps) == ("xfin_auv", 1.5)
    assert found.gains["initial"]["HDG_P"] == pytest.approx(
        2.115, abs=0.01
    )  # `ground vehicle gains xfin`
    assert found.gains["redesigned"]["SPD_CRUISE_MPS"] == 1.5
    assert {path.name for path in out.glob("*.toml")} == {
        "campaign.toml",
        "scenario.toml",
        "truth.toml",
    }
    assert {path.stem for path in (out / "missions").iterdir()} == set(ALL_MISSIONS)
    assert found.scaled[0].startswith("sea: moments of disturbed times the ratio of the moments")
    assert (out / "report.html").stat().st_size > 1_000_000


def test_dive_seed_differs_by_mission_and_seed(tmp_path: Path) -> None:
    names = (TRIM_MISSION, *computations.MISSIONS, *computations.FITTED, *computations.HELD_OUT)
    seeds = [dive_seed(seed, name) for seed in range(3) for name in names]
    assert len(set(seeds)) == len(seeds)


class _PageReader(HTMLParser):
    """Parser of a page: fetched addresses, chart places, inline scripts by id."""

    def __init__(self) -> None:
        super().__init__()
        self.fetched: list[str] = []
        self.chart_places: set[str] = set()
        self.scripts: dict[str, str] = {}
        self._script: str | None = None

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        found = {name: value or "" for name, value in attrs}
        self.fetched += [found[name] for name in ("src", "href") if name in found]
        if found.get("class") == "chart":
            self.chart_places.add(found["id"])
        self._script = found.get("id", "") if tag == "script" else None

    def handle_data(self, data: str) -> None:
        if self._script is not None:
            self.scripts[self._script] = self.scripts.get(self._script, "") + data
        elif re.search(r"\burl\(http", data):
            self.fetched.append(data)


def _notes(path: Path) -> dict[str, str]:
    from ground.log_tools import mcap as logs

    found: dict[str, str] = logs.info(path)["metadata"]["dive"]
    return found


def _numbers(value: Any) -> list[float]:
    if isinstance(value, dict):
        return [number for part in value.values() for number in _numbers(part)]
    if isinstance(value, list):
        return [number for part in value for number in _numbers(part)]
    return [float(value)] if isinstance(value, int | float) else []
