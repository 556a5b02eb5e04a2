"""Files from outside: only regular files are opened; a byte-order mark is no text."""

import errno
import os
from collections.abc import Callable
from pathlib import Path

import pytest

from ground.bench_tests import incline
from ground.campaign import specification
from ground.client import param_file
from ground.missions import script
from ground.sweep import plan_file
from mavlink_io.errors import CaribouError
from mavlink_io.text_files import open_regular, parse_toml, read_limited, read_text
from sitl import scenario
from sitl.vehicle import config

READERS: dict[str, Callable[[Path], object]] = {
    "vehicle": config.load,
    "scenario": lambda path: scenario.load(str(path)),
    "mission": lambda path: script.load(str(path)),
    "sweep plan": plan_file.load,
    "moves": incline.load,
    "specification": lambda path: specification.read(path, {}),
}
"""Readers of the TOML files that users give."""


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="the system has no named pipes")
def test_pipe_without_a_writer_is_refused_at_once(tmp_path: Path) -> None:
    path = tmp_path / "fifo.csv"
    os.mkfifo(path)
    for read in (open_regular, read_limited):
        with pytest.raises(OSError, match="is no regular file") as refused:
            read(path)
        assert refused.value.errno == errno.EINVAL


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="the system has no named pipes")
@pytest.mark.parametrize("kind", READERS)
@pytest.mark.timeout(20)
def test_pipe_in_place_of_a_toml_file_is_refused(kind: str, tmp_path: Path) -> None:
    pipe = tmp_path / "pipe.toml"
    os.mkfifo(pipe)
    with pytest.raises(CaribouError, match=r"pipe\.toml") as refusal:
        READERS[kind](pipe)
    assert kind == "mission" or "is no regular file" in str(refusal.value)


@pytest.mark.skipif(os.name != "posix", reason="the system has no /dev/null")
def test_link_to_a_device_is_refused(tmp_path: Path) -> None:
    (tmp_path / "log.csv").symlink_to("/dev/null")
    with pytest.raises(OSError, match="is no regular file"):
        read_limited(tmp_path / "log.csv")


def test_directory_and_missing_file_keep_their_errors(tmp_path: Path) -> None:
    for path in (tmp_path, tmp_path / "missing"):
        with pytest.raises(OSError, match=r"\[Errno \d+\]") as refused:
            open_regular(path)
        assert refused.value.errno != errno.EINVAL


def test_name_with_a_nul_is_an_error_of_the_file(tmp_path: Path) -> None:
    """TOML and JSON hold such names, and `open` raises ValueError for them."""
    with pytest.raises(OSError, match="NUL character"):
        read_limited(tmp_path / "model\0.json")


def test_byte_order_mark_before_toml_is_ignored() -> None:
    assert parse_toml("\ufeffa = 1") == {"a": 1}


def test_vehicle_file_with_byte_order_mark_is_read(tmp_path: Path) -> None:
    """Editors of Windows write the mark."""
    shipped = Path(config.__file__).with_name("remus100.toml")
    marked = tmp_path / "marked.toml"
    marked.write_text(shipped.read_text(encoding="utf-8"), encoding="utf-8-sig")
    assert config.load(marked) == config.load("remus100")


def test_read_text_leaves_out_the_byte_order_mark(tmp_path: Path) -> None:
    path = tmp_path / "bom.param"
    path.write_bytes(b"\xef\xbb\xbfHDG_P,0.5\r\n")
    assert read_text(path) == "HDG_P,0.5\n"
    assert param_file.load(path) == {"HDG_P": 0.5}
