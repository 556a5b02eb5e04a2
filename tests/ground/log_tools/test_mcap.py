"""``ground log`` with damaged and unfinished logs."""

import json
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from ground.cli.main import app
from ground.log_tools import export, mcap
from sysid.data import readers as identification
from sysid.data.dataset import LogError
from tests.sysid import recording
from tests.sysid.data.readers import test_damage as damaged
from tests.sysid.data.test_dataset import dive


@pytest.fixture
def log(tmp_path: Path) -> Path:
    """Log with damage in the middle of its second chunk."""
    path = damaged.write_own(tmp_path / "dive.mcap")
    data = bytearray(path.read_bytes())
    second = data.index(b"zstd", data.index(b"zstd") + 4)
    data[second + 500] ^= 1
    path.write_bytes(data)
    return path


def run(*words: str) -> Any:
    done = CliRunner().invoke(app, ["log", *words, "--json"], catch_exceptions=False)
    return json.loads(done.stdout)


def test_info_reports_damage_with_its_time_range(log: Path) -> None:
    result = run("info", str(log))
    (damage,) = result["damage"]
    assert damage.startswith("chunk at byte ")
    assert " s of the log are lost)" in damage
    lines = CliRunner().invoke(app, ["log", "info", str(log)]).stdout.splitlines()
    assert lines[-1] == f"  damaged   {damage}"


def test_info_of_intact_log_reports_no_damage(tmp_path: Path) -> None:
    assert run("info", str(damaged.write_own(tmp_path / "dive.mcap")))["damage"] == []


def test_export_of_damaged_log_is_refused(log: Path, tmp_path: Path) -> None:
    with pytest.raises(LogError, match=r"dive\.mcap: is damaged: chunk at byte .*log recover"):
        export.export_csv(log, tmp_path / "csv")
    assert not (tmp_path / "csv").exists()


def test_recover_saves_intact_messages_and_lists_damage(log: Path, tmp_path: Path) -> None:
    whole = damaged.write_own(tmp_path / "whole.mcap")
    saved = run("recover", str(log), "--out", str(tmp_path / "saved.mcap"))
    lost = mcap.info(whole)["messages"] - saved["messages"]
    assert 100 < lost < 250  # a chunk contains 150 messages and their views
    assert len(saved["damage"]) == 1
    recovered, intact = identification.read(tmp_path / "saved.mcap"), identification.read(whole)
    assert 0 < recovered.attitude.time_s.size < intact.attitude.time_s.size
    assert set(recovered.attitude.r_radps) <= set(intact.attitude.r_radps)
    assert recovered.parameters == intact.parameters


def test_recover_of_other_file_leaves_no_output(tmp_path: Path) -> None:
    (tmp_path / "a.mcap").write_bytes(b"no log at all, but long enough")
    with pytest.raises(mcap.McapFileError, match=r"a\.mcap: not a readable MCAP file"):
        mcap.recover(tmp_path / "a.mcap", tmp_path / "saved.mcap")
    assert not (tmp_path / "saved.mcap").exists()


def test_bomb_is_refused_by_info_and_recover(tmp_path: Path) -> None:
    path = tmp_path / "bomb.mcap"
    path.write_bytes(damaged.messages_in_many_chunks())
    with pytest.raises(mcap.McapFileError, match="bytes unpack to more than"):
        mcap.info(path)
    with pytest.raises(mcap.McapFileError, match="bytes unpack to more than"):
        mcap.recover(path, tmp_path / "saved.mcap")
    assert not (tmp_path / "saved.mcap").exists()


def test_info_reports_a_gap_of_an_mcap(tmp_path: Path) -> None:
    entries = [(t + 500.0 * (t > 2.0), message) for t, message in dive(4.0, (1.0, 3.0, "x"))]
    (gap,) = run("info", str(recording.write(tmp_path / "gap.mcap", entries, {})))["gaps"]
    assert gap["start_s"] == pytest.approx(2.0, abs=0.1)
    assert gap["length_s"] == pytest.approx(500.0, abs=0.1)
