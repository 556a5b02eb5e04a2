"""Checks of output files before the work of a command."""

import errno
import os
import resource
import subprocess
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest
from typer.testing import CliRunner

from ground.campaign.campaign_folder import CAMPAIGN_FILE
from ground.cli.main import app
from ground.output_files import check_output, open_new
from mavlink_io.errors import InputError
from tests.helpers.docs_blocks import DOCS

CONTENT = "the only copy"
VEHICLE = str(DOCS / "my_vehicle.toml")


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


@pytest.fixture(params=["refit a.csv --out", "redesign a.json --out", "report a.csv --out"])
def command(request: pytest.FixtureRequest) -> list[str]:
    """A command whose input is missing; its last word is the option of the output."""
    return str(request.param).split()


def test_missing_folder_of_output_is_refused_first(command: list[str], tmp_path: Path) -> None:
    path = tmp_path / "absent" / "result"
    assert run_refused(*command, path) == (
        f"--out {path}: there is no folder {path.parent}; make it, or give another name"
    )


def test_folder_as_output_is_refused_first(command: list[str], tmp_path: Path) -> None:
    assert run_refused(*command, tmp_path) == (
        f"--out {tmp_path}: is a folder; give the name of a file"
    )


def test_file_as_folder_of_output_is_refused_first(command: list[str], input_file: Path) -> None:
    message = run_refused(*command, input_file / "result")
    assert "there is no folder" in message


def test_long_name_of_output_is_refused_first(command: list[str], tmp_path: Path) -> None:
    message = run_refused(*command, tmp_path / ("x" * 300))
    assert message.startswith("--out ")
    assert message.endswith("File name too long; give another name")


def test_link_in_a_circle_is_refused_first(command: list[str], tmp_path: Path) -> None:
    path = tmp_path / "circle"
    path.symlink_to(path)
    assert run_refused(*command, path).endswith("; give another name")


def test_link_to_missing_folder_is_refused_first(command: list[str], tmp_path: Path) -> None:
    path = tmp_path / "link"
    path.symlink_to(tmp_path / "absent" / "result")
    assert "there is no folder" in run_refused(*command, path)


@pytest.mark.parametrize("exists", [True, False])
def test_output_that_is_not_writable_is_refused(
    exists: bool, command: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Root may write everywhere, so the answer of the system is replaced."""
    monkeypatch.setattr(os, "access", lambda path, mode: mode != os.W_OK)
    path = tmp_path / "result"
    if exists:
        path.touch()
    assert run_refused(*command, path).endswith("is not writable; give another name")


def test_redesign_refuses_export_without_folder_first(tmp_path: Path) -> None:
    export = tmp_path / "absent" / "loops"
    message = run_refused(
        "redesign", "a.json", "--out", tmp_path / "gains.param", "--export", export
    )
    assert message.startswith(f"--export {export}.json: there is no folder")


def test_report_refuses_picture_without_folder_first(tmp_path: Path) -> None:
    picture = tmp_path / "absent" / "a.png"
    message = run_refused("report", tmp_path, "--picture", picture)
    assert message.startswith(f"--picture {picture}: there is no folder")


def test_fly_refuses_truth_that_exists(input_file: Path) -> None:
    log = input_file.with_name("dive.mcap")
    message = run_refused("fly", "square", "--sitl", "--log", log, "--truth", input_file)
    assert message == f"{input_file}: exists; give a new name"


def test_full_disk_is_reported_with_the_file_which_is_removed(tmp_path: Path) -> None:
    """A write that fails names no file."""
    file = tmp_path / "x.mat"
    with pytest.raises(OSError, match="No space left") as raised, open_new(file):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    assert raised.value.filename == str(file)
    assert not file.exists()


@pytest.mark.process
@pytest.mark.parametrize(
    "command",
    [["log", "layout", "foxglove", "--out"], ["vehicle", "new", VEHICLE, "--out"]],
    ids=["layout", "vehicle new"],
)
def test_file_without_room_is_named_and_not_left(command: list[str], tmp_path: Path) -> None:
    """A limit of the size of files stands for a full disk."""
    out = tmp_path / "out"
    no_room = (0, resource.getrlimit(resource.RLIMIT_FSIZE)[1])
    done = subprocess.run(
        [sys.executable, "-m", "ground", *command, out],
        capture_output=True,
        text=True,
        check=False,
        preexec_fn=partial(resource.setrlimit, resource.RLIMIT_FSIZE, no_room),
    )
    assert done.returncode != 0
    assert done.stderr == f"ground: {out}: File too large\n"
    assert list(tmp_path.iterdir()) == []


def test_existing_file_is_not_opened_as_new(tmp_path: Path) -> None:
    file = tmp_path / "x.mat"
    file.write_text("mine")
    with pytest.raises(FileExistsError), open_new(file):
        pass
    assert file.read_text() == "mine"
