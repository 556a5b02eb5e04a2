"""Checks of output files before the work of a command."""

import os
from collections.abc import Callable
from pathlib import Path

import pytest
from typer.testing import CliRunner

from ground.__main__ import app
from ground.campaign.campaign_folder import CAMPAIGN_FILE
from ground.output_files import check_output
from mavlink_io.errors import InputError

CONTENT = "the only copy"


def run_refused(*arguments: str | Path) -> str:
    """Run `ground` and return the message of the InputError that it raises."""
    with pytest.raises(InputError) as refusal:
        CliRunner().invoke(app, [str(word) for word in arguments], catch_exceptions=False)
    return str(refusal.value)


@pytest.fixture
def input_file(tmp_path: Path) -> Path:
    path = tmp_path / "input.csv"
    path.write_text(CONTENT)
    return path


def _symbolic(file: Path) -> Path:
    link = file.with_name("symbolic.csv")
    link.symlink_to(file)
    return link


def _hard(file: Path) -> Path:
    link = file.with_name("hard.csv")
    os.link(file, link)
    return link


@pytest.mark.parametrize(
    "spelling",
    [
        lambda file: file,
        lambda file: Path(f"{file.parent}/../{file.parent.name}/./{file.name}"),
        lambda file: Path(os.path.relpath(file)),
        _symbolic,
        _hard,
    ],
    ids=["same", "dots", "relative", "symbolic link", "hard link"],
)
def test_output_equal_to_input_is_refused(
    spelling: Callable[[Path], Path], input_file: Path
) -> None:
    path = spelling(input_file)
    with pytest.raises(InputError, match=r"^--out .*same file as .*input\.csv.*give another name"):
        check_output("--out", path, [None, "caribou_nominal", input_file])


def test_two_new_outputs_of_one_name_are_refused(tmp_path: Path) -> None:
    (tmp_path / "folder").mkdir()
    with pytest.raises(InputError, match="same file"):
        check_output("--export", tmp_path / "folder" / ".." / "a.json", [tmp_path / "a.json"])


def test_output_beside_inputs_is_accepted(input_file: Path) -> None:
    other = input_file.with_name("other.csv")
    assert check_output("--out", other, [input_file, "caribou_nominal", None]) == other
    other.write_text("old result")
    assert check_output("--out", other, [input_file, "caribou_nominal", None]) == other


@pytest.mark.parametrize(
    ("arguments", "option"),
    [
        ("refit FILE --out FILE", "--out"),
        ("refit absent.csv --held-out FILE --out FILE", "--out"),
        ("refit absent.csv --prior FILE --out FILE", "--out"),
        ("refit absent.csv --bench-result FILE --out FILE", "--out"),
        ("refit absent.csv --inclining-result FILE --out FILE", "--out"),
        ("redesign FILE --out FILE", "--out"),
        ("redesign absent.json --prior FILE --out FILE", "--out"),
        ("redesign absent.json --spec FILE --out FILE", "--out"),
        ("redesign absent.json --sign FILE --out FILE", "--out"),
        ("redesign absent.json --method lqg --spec FILE --out FILE", "--out"),
        ("report FILE --out FILE", "--out"),
        ("report absent.csv FILE --out FILE", "--out"),
        ("simulate FILE --gains absent.param --keep FILE", "--keep"),
        ("simulate absent.json --gains FILE --keep FILE", "--keep"),
        ("simulate absent.json --gains absent.param --compare FILE --keep FILE", "--keep"),
        ("simulate absent.json --gains absent.param --mission FILE --keep FILE", "--keep"),
        ("simulate absent.json --gains absent.param --prior FILE --keep FILE", "--keep"),
    ],
)
def test_command_refuses_output_equal_to_input(
    arguments: str, option: str, input_file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(input_file.parent)
    message = run_refused(*arguments.replace("FILE", input_file.name).split())
    assert message.startswith(f"{option} {input_file.name}: is the same file as")
    assert input_file.read_text() == CONTENT


@pytest.mark.parametrize("suffix", ["", ".json", ".mat"])
def test_redesign_refuses_export_over_model(suffix: str, tmp_path: Path) -> None:
    model = tmp_path / f"model{suffix or '.json'}"
    model.write_text(CONTENT)
    message = run_refused("redesign", model, "--export", tmp_path / f"model{suffix}")
    assert message.startswith(f"--export {model}: is the same file as")
    assert model.read_text() == CONTENT


def test_redesign_refuses_export_over_its_output(tmp_path: Path) -> None:
    out = tmp_path / "loops.json"
    message = run_refused("redesign", "absent.json", "--out", out, "--export", tmp_path / "loops")
    assert message.startswith(f"--export {out}: is the same file as {out}")


def test_report_refuses_picture_over_file_of_campaign(tmp_path: Path) -> None:
    model = tmp_path / "model.json"
    model.write_text(CONTENT)
    (tmp_path / "picture.png").symlink_to(model)
    message = run_refused("report", tmp_path, "--picture", tmp_path / "picture.png")
    assert message.startswith("--picture ")
    assert "model.json" in message
    assert model.read_text() == CONTENT


def test_fly_refuses_two_logs_of_one_name(tmp_path: Path) -> None:
    log = tmp_path / "dive.mcap"
    assert run_refused("fly", "square", "--log", log, "--tlog", log).startswith("--tlog ")
    assert run_refused("fly", "square", "--sitl", "--log", log, "--truth", log).startswith(
        "--truth "
    )


@pytest.mark.parametrize("option", ["--vehicle", "--truth", "--scenario"])
def test_campaign_refuses_to_remove_its_input(option: str, tmp_path: Path) -> None:
    (tmp_path / CAMPAIGN_FILE).write_text("seed = 1\n")
    file = tmp_path / {"--scenario": "scenario.toml"}.get(option, "truth.toml")
    file.write_text(CONTENT)
    message = run_refused("campaign", option, file, "--out", tmp_path, "--force")
    assert message.startswith(f"--out {tmp_path}: --force would remove {file}")
    assert file.read_text() == CONTENT
