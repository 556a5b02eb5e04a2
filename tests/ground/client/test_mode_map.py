"""Export of mode names for pymavlink programs; existing names are kept."""

import contextlib
import errno
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner, Result

from autopilot.control import modes
from ground.cli import modes as modes_cli
from ground.client import mode_map
from mavlink_io.errors import InputError

OURS = {"MANUAL": 65536, "DEPTH": 131072}
NUMBERS = st.integers(0, 2**32 - 1).map(str)
NAMES = st.text("ABCDEFGH", min_size=1, max_size=4)
MAPS = st.dictionaries(NUMBERS, st.dictionaries(NUMBERS, NAMES, max_size=4), max_size=3)


@given(MAPS, st.integers(0, 40), st.dictionaries(NAMES, st.integers(0, 2**32 - 1), max_size=4))
def test_merge_keeps_old_and_adds_new_names_or_refuses(
    present: mode_map.ModeMap, kind: int, modes: dict[str, int]
) -> None:
    before = json.dumps(present)
    with contextlib.suppress(InputError):
        merged = mode_map.merge(present, kind, modes, Path("map.json")).merged
        for key, names in present.items():
            assert names.items() <= merged[key].items()
        assert {str(number): name for name, number in modes.items()}.items() <= merged[
            str(kind)
        ].items()
    assert json.dumps(present) == before


@pytest.mark.parametrize(
    ("theirs", "named"),
    [
        ({"65536": "BOOST"}, "map.json: 12.65536: is 'BOOST' in the file, 'MANUAL' on the vehicle"),
        (
            {"19": "MANUAL"},
            "map.json: 12.19: is 'MANUAL' in the file, the vehicle's 'MANUAL' is 65536",
        ),
    ],
)
def test_merge_conflict_names_number_and_name(theirs: dict[str, str], named: str) -> None:
    with pytest.raises(InputError, match=named):
        mode_map.merge({"12": theirs}, 12, OURS, Path("map.json"))


def test_merge_twice_adds_nothing() -> None:
    once = mode_map.merge({"2": {"0": "HOVER"}}, 12, OURS, Path("map.json"))
    assert once.merged == {"2": {"0": "HOVER"}, "12": {"65536": "MANUAL", "131072": "DEPTH"}}
    assert once.added == {"12.65536": "MANUAL", "12.131072": "DEPTH"}
    assert mode_map.merge(once.merged, 12, OURS, Path("map.json")) == (once.merged, {})


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("{", "cannot be read"),
        ("[]", "holds no object"),
        ('{"SUB": {}}', "SUB: expected a MAV_TYPE number"),
        ('{"12": []}', "12: expected a MAV_TYPE number and an object"),
        ('{"12": {"MANUAL": 3}}', "12.MANUAL: expected a custom_mode number and a name"),
    ],
)
def test_read_malformed_file_refused(tmp_path: Path, text: str, named: str) -> None:
    path = tmp_path / "map.json"
    path.write_text(text)
    with pytest.raises(InputError, match=named) as refusal:
        mode_map.read(path)
    assert str(refusal.value).startswith(f"{path}: ")


def test_write_through_symlink_is_atomic(tmp_path: Path) -> None:
    real, link = tmp_path / "real.json", tmp_path / "deep" / "map.json"
    real.write_text("{}")
    real.chmod(0o600)
    link.parent.mkdir()
    link.symlink_to(real)
    mode_map.write(link, {"12": {"65536": "MANUAL"}})
    assert link.is_symlink()
    assert mode_map.read(real) == {"12": {"65536": "MANUAL"}}
    assert real.stat().st_mode & 0o777 == 0o600
    assert sorted(p.name for p in tmp_path.rglob("*")) == ["deep", "map.json", "real.json"]


def test_write_that_fails_leaves_the_old_file_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    path = tmp_path / "map.json"
    path.write_text("{}")
    monkeypatch.setattr(Path, "replace", refuse)
    with pytest.raises(InputError, match=r"map\.json: cannot be written: No space left"):
        mode_map.write(path, {"12": {"65536": "MANUAL"}})
    assert [file.name for file in tmp_path.iterdir()] == ["map.json"]
    assert path.read_text() == "{}"


def test_pymavlink_reads_the_default_file(tmp_path: Path) -> None:
    target = Path(str(mode_map.DEFAULT_PATH).replace("~", str(tmp_path)))
    mode_map.write(target, mode_map.merge({}, 12, OURS, target).merged)
    program = "from pymavlink import mavutil; print(mavutil.mode_mapping_byname(12))"
    environment = {**os.environ, "HOME": str(tmp_path)}
    told = subprocess.run(
        [sys.executable, "-c", program], env=environment, capture_output=True, text=True, check=True
    )
    assert told.stdout.strip() == str(OURS)


def test_install_without_vehicle_writes_every_mode(tmp_path: Path) -> None:
    path = tmp_path / "pymavlink" / "custom_mode_map.json"
    command = ("install", "--path", str(path))
    assert "would add" in run_modes(*command, "--dry-run").output
    assert not path.exists()
    first = run_modes(*command)
    assert first.exit_code == 0, first.output
    names = json.loads(path.read_text())["12"]
    assert names == {str(mode.number): mode.name for mode in modes.MODES}
    assert "nothing" in run_modes(*command).output
    path.write_text(json.dumps({"12": {"65536": "BOOST"}}))
    refused = run_modes(*command)
    assert isinstance(refused.exception, InputError)
    assert "12.65536: is 'BOOST' in the file" in str(refused.exception)


def run_modes(*arguments: str) -> Result:
    return CliRunner().invoke(modes_cli.app, list(arguments))
