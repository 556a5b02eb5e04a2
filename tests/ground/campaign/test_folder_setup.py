"""Folder of a campaign: what is refused, kept and removed."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

from ground.campaign import folder_setup
from ground.campaign.preparation import Preparation
from ground.campaign.request import CampaignRequest
from ground.campaign.run import Campaign
from ground.cli.main import app
from mavlink_io.errors import InputError


@pytest.mark.parametrize(("resume", "force"), [(False, False), (True, False), (False, True)])
def test_campaign_folder_of_running_campaign_refused(
    resume: bool, force: bool, tmp_path: Path
) -> None:
    folder_setup.prepare_folder(CampaignRequest(tmp_path))
    (log := tmp_path / "identification" / "rudder_steps.mcap").parent.mkdir()
    log.write_bytes(b"being written")
    request = CampaignRequest(tmp_path, resume=resume, force=force)
    second = Campaign(request, lambda name, at: None, lambda words: None)
    with folder_setup.FolderLock(tmp_path):
        for _ in range(2):
            with pytest.raises(InputError, match="another campaign is running in this folder"):
                second.run()
    assert log.read_bytes() == b"being written"
    with second._lock:  # the first one has ended
        pass


def test_campaign_folder_with_other_files_refused(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("years of work")
    with pytest.raises(InputError, match="no campaign"):
        folder_setup.prepare_folder(CampaignRequest(tmp_path))
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.tex"]


def old_campaign(out: Path, *, finished: bool) -> dict[str, str]:
    """Write files of an earlier campaign and of another program; return them by path."""
    files = {
        "campaign.toml": 'vehicle = "caribou_truth"\n',
        "model.json": "{}",
        "prototype/trim.mcap": "log",
        "identification/rudder_steps.mcap": "log",
        "improved/combined.mcap": "log",
        "notes.txt": "mine",
        "identification/notes.txt": "mine",
        "identification/more.mcap": "mine",
    }
    if finished:
        files |= {"summary.json": "{}", "report.html": "<html>"}
    for name, text in files.items():
        (out / name).parent.mkdir(parents=True, exist_ok=True)
        (out / name).write_text(text)
    return files


def content(out: Path) -> dict[str, str]:
    return {
        str(path.relative_to(out)): path.read_text() for path in out.rglob("*") if path.is_file()
    }


@pytest.mark.parametrize(("finished", "said"), [(True, "a finished"), (False, "an interrupted")])
def test_campaign_second_in_folder_refused_before_flying(
    finished: bool, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = old_campaign(tmp_path, finished=finished)
    monkeypatch.setattr(Campaign, "_executors", lambda *asked: pytest.fail("something was started"))
    asked = ["campaign", "--out", str(tmp_path)]
    ended = CliRunner().invoke(app, asked)
    assert isinstance(ended.exception, InputError)  # exit status 2
    hint = "" if finished else ", --resume to continue it"
    assert (
        str(ended.exception)
        == f"--out {tmp_path}: holds {said} campaign (3 logs); give a new folder{hint}, or --force"
        " to replace it"
    )
    assert content(tmp_path) == before


def test_campaign_by_force_removes_only_what_a_campaign_writes(tmp_path: Path) -> None:
    old_campaign(tmp_path, finished=True)
    folder_setup.prepare_folder(CampaignRequest(tmp_path, seed=7, force=True))
    after = content(tmp_path)
    assert "seed = 7" in after.pop("campaign.toml")
    assert after == dict.fromkeys(
        ("notes.txt", "identification/notes.txt", "identification/more.mcap"), "mine"
    )
    assert not (tmp_path / "prototype").exists()
    with pytest.raises(InputError, match="interrupted campaign"):
        folder_setup.prepare_folder(CampaignRequest(tmp_path))


def test_campaign_force_bad_scenario_keeps_old_campaign(tmp_path: Path) -> None:
    before = old_campaign(tmp_path, finished=True)
    with pytest.raises(InputError, match="clamped"):
        Campaign(
            CampaignRequest(tmp_path, scenario="bench", force=True),
            lambda name, at: None,
            lambda words: None,
        ).run()
    assert content(tmp_path) == before


def test_campaign_stopped_while_reporting_leaves_no_result(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def stopped(self: Campaign) -> None:
        self._write_folder(Preparation({}, {}, ()))
        (tmp_path / "out" / "summary.json").write_text("{}")
        raise KeyboardInterrupt

    monkeypatch.setattr(Campaign, "_run", stopped)
    with pytest.raises(KeyboardInterrupt):
        Campaign(CampaignRequest(tmp_path / "out"), lambda name, at: None, lambda words: None).run()
    assert set(content(tmp_path / "out")) == {"campaign.toml"}
