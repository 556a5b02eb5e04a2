"""The whole afternoon at sea, flown once by real processes, and what it leaves behind."""

import json
import math
import multiprocessing
import re
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest

from ground.campaign import run
from ground.campaign.campaign_folder import STAGES, CampaignFolder
from ground.campaign.run import Campaign, CampaignRequest
from ground.client import param_file
from ground.errors import InputError, OperationError
from ground.report import page, summary_picture


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("campaign") / "out"
    Campaign(
        CampaignRequest(out, seed=1, beside_paper=True), lambda name, at: None, lambda words: None
    ).run()
    page.write(out)
    return out


@pytest.fixture(scope="module")
def summary(flown: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((flown / "summary.json").read_text())
    return found


@pytest.mark.process
@pytest.mark.timeout(600)
class CampaignTestCase:
    def test_the_folder_holds_what_was_asked_flown_and_found(self, flown: Path) -> None:
        files = {str(path.relative_to(flown)) for path in flown.rglob("*") if path.is_file()}
        missions = {f"{stage}/{m}.mcap" for stage in STAGES.values() for m in run.MISSIONS}
        tests = {f"identification/{m}.mcap" for m in (*run.FITTED, *run.HELD_OUT)}
        results = {"campaign.toml", "model.json", "gains.param", "summary.json", "report.html"}
        assert files == missions | tests | results | {"prototype/trim.mcap"}

    def test_nothing_that_was_sent_is_missing(self, summary: dict[str, Any]) -> None:
        assert summary["lost_frames"] == 0
        assert summary["vehicle_s"] > 2000

    def test_the_trim_flight_finds_the_bent_rudder(self, summary: dict[str, Any]) -> None:
        assert summary["trims"]["TRIM_RUD_DEG"] == pytest.approx(6.0, abs=0.5)

    def test_the_refitted_model_predicts_held_out_runs_better_in_both_planes(
        self, summary: dict[str, Any]
    ) -> None:
        errors = summary["model"]["held_out_rate_error"]
        assert set(errors) == {"yaw", "pitch"}
        for pair in errors.values():
            assert pair["refitted_model_deg2ps2"] < pair["initial_model_deg2ps2"]

    def test_the_redesigned_gains_hold_heading_and_depth_better(
        self, summary: dict[str, Any]
    ) -> None:
        steady = summary["steady_error"]
        assert steady["redesigned"]["heading_deg"] < steady["initial"]["heading_deg"]
        assert steady["redesigned"]["depth_m"] < 0.5 * steady["initial"]["depth_m"]

    def test_they_hold_both_better_than_the_papers_improved_gains(
        self, summary: dict[str, Any]
    ) -> None:
        steady = summary["steady_error"]
        assert steady["redesigned"]["heading_deg"] < steady["improved"]["heading_deg"]
        assert steady["redesigned"]["depth_m"] < steady["improved"]["depth_m"]

    def test_the_same_seed_gives_the_same_model_and_gains(
        self, flown: Path, tmp_path: Path
    ) -> None:
        Campaign(
            CampaignRequest(tmp_path / "again", seed=1), lambda name, at: None, lambda words: None
        ).run()
        for name in ("model.json", "gains.param"):
            assert (tmp_path / "again" / name).read_bytes() == (flown / name).read_bytes()

    def test_the_gains_file_holds_what_was_flown(
        self, flown: Path, summary: dict[str, Any]
    ) -> None:
        written = param_file.load(flown / "gains.param")
        for name, value in written.items():
            assert summary["gains"]["redesigned"][name] == pytest.approx(value, rel=1e-5)
        flown_gains = CampaignFolder(flown).log("verification", "straight_run").parameters
        for name, value in summary["gains"]["redesigned"].items():
            assert flown_gains[name] == pytest.approx(value, rel=1e-6)

    def test_every_set_of_gains_met_the_same_sea(self, flown: Path) -> None:
        notes = [_notes(flown / stage / "straight_run.mcap") for stage in STAGES.values()]
        assert len({note["seed"] for note in notes}) == 1

    def test_every_number_has_a_finite_value(self, summary: dict[str, Any]) -> None:
        assert [value for value in _numbers(summary) if not math.isfinite(value)] == []

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

    def test_the_picture_is_small_enough_for_a_readme(self, flown: Path, tmp_path: Path) -> None:
        target = summary_picture.draw(flown, tmp_path / "picture.png")
        assert target.read_bytes().startswith(b"\x89PNG")
        assert target.stat().st_size < 300_000


def test_what_fails_elsewhere_ends_the_campaign_and_leaves_no_process(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Campaign, "_fly", lambda *dive: None)
    with pytest.raises(InputError, match=r"trim\.mcap"):
        Campaign(CampaignRequest(tmp_path / "out"), lambda name, at: None, lambda words: None).run()
    assert multiprocessing.active_children() == []


def test_a_dive_that_fails_ends_the_campaign(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def sink(*dive: object) -> None:
        raise OperationError("sunk")

    monkeypatch.setattr(Campaign, "_fly", sink)
    with pytest.raises(OperationError, match="sunk"):
        Campaign(CampaignRequest(tmp_path / "out"), lambda name, at: None, lambda words: None).run()
    assert multiprocessing.active_children() == []


def test_a_folder_of_something_else_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("years of work")
    with pytest.raises(InputError, match="no campaign"):
        run.prepare_folder(CampaignRequest(tmp_path))
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.tex"]


def test_a_mission_has_its_own_sea_and_a_seed_another(tmp_path: Path) -> None:
    names = (run.TRIM_MISSION, *run.MISSIONS, *run.FITTED, *run.HELD_OUT)
    seeds = [run.dive_seed(seed, name) for seed in range(3) for name in names]
    assert len(set(seeds)) == len(seeds)


@pytest.mark.parametrize(
    "text",
    ["HDG_P,0.5\n", "# gains\nHDG_P,0.5  # why\n", "HDG_P 0.5\n", "1\t1\tHDG_P\t0.5\t9\n"],
)
def test_parameter_files_of_other_tools_are_read(text: str, tmp_path: Path) -> None:
    path = tmp_path / "gains.param"
    path.write_text(text)
    assert param_file.load(path) == {"HDG_P": 0.5}


def test_parameters_survive_a_file(tmp_path: Path) -> None:
    values = {"HDG_P": 0.65, "MAV_SYS_ID": 1.0, "DPT_I": 0.001, "NEGATIVE": -1e-7}
    param_file.save(tmp_path / "p.param", values)
    assert param_file.load(tmp_path / "p.param") == values


@pytest.mark.parametrize("line", ["HDG_P", "HDG_P,nan", "HDG_P,x", "a,b,c"])
def test_a_wrong_line_is_named(line: str, tmp_path: Path) -> None:
    path = tmp_path / "gains.param"
    path.write_text(f"HDG_D,1\n{line}\n")
    with pytest.raises(InputError, match=r"gains\.param: line 2: .* expected NAME,VALUE"):
        param_file.load(path)


class _PageReader(HTMLParser):
    """What a page fetches, where its charts go, and its inline scripts by id."""

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
    from ground.log_tools import mcap

    found: dict[str, str] = mcap.info(path)["metadata"]["dive"]
    return found


def _numbers(value: Any) -> list[float]:
    if isinstance(value, dict):
        return [number for part in value.values() for number in _numbers(part)]
    if isinstance(value, list):
        return [number for part in value for number in _numbers(part)]
    return [float(value)] if isinstance(value, int | float) else []
