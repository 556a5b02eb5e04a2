"""Files that are replaced in one atomic step."""

import os
import stat
from contextlib import suppress
from pathlib import Path

import pytest

from mavlink_io.user_data_dir import open_output, write_output

OLD, NEW = b"old result", "new result, 1 \N{DEGREE SIGN}\n"
needs_full_device = pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")


def _fail(*arguments: object) -> None:
    raise OSError(28, "No space left on device")


def test_text_and_bytes_are_written(tmp_path: Path) -> None:
    path = tmp_path / "result"
    write_output(path, NEW)
    assert path.read_bytes() == NEW.encode()
    write_output(path, OLD)
    assert path.read_bytes() == OLD
    assert list(tmp_path.iterdir()) == [path]


def test_failure_keeps_old_file_and_names_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "result"
    path.write_bytes(OLD)
    monkeypatch.setattr(os, "fsync", _fail)
    with pytest.raises(OSError, match="No space left") as failure:
        write_output(path, NEW)
    assert failure.value.filename == str(path)
    assert path.read_bytes() == OLD
    assert list(tmp_path.iterdir()) == [path]


@needs_full_device
def test_full_device_is_named() -> None:
    with pytest.raises(OSError, match="No space left") as failure:
        write_output("/dev/full", NEW)
    assert failure.value.filename == "/dev/full"


@needs_full_device
def test_open_output_on_full_device_is_named() -> None:
    file = open_output(Path("/dev/full"))
    file.write(NEW.encode())
    with pytest.raises(OSError, match="No space left") as failure:
        file.flush()
    assert failure.value.filename == "/dev/full"
    with suppress(OSError):
        file.close()


@pytest.mark.skipif(os.name == "nt", reason="modes of POSIX")
def test_mode_is_that_of_old_file_or_umask(tmp_path: Path) -> None:
    old, new, plain = (tmp_path / name for name in ("old", "new", "plain"))
    old.write_bytes(OLD)
    old.chmod(0o640)
    plain.write_bytes(OLD)
    for path in (old, new):
        write_output(path, NEW)
    modes = [stat.S_IMODE(path.stat().st_mode) for path in (old, new, plain)]
    assert modes == [0o640, modes[2], modes[2]]


@pytest.mark.skipif(os.name == "nt", reason="links of POSIX")
def test_symbolic_link_keeps_its_target(tmp_path: Path) -> None:
    target, link = tmp_path / "target", tmp_path / "link"
    target.write_bytes(OLD)
    link.symlink_to(target)
    write_output(link, NEW)
    assert link.is_symlink()
    assert target.read_bytes() == NEW.encode()


@pytest.mark.skipif(os.name == "nt", reason="pipes of POSIX")
def test_pipe_is_written_in_place() -> None:
    reading, writing = os.pipe()
    try:
        write_output(f"/dev/fd/{writing}", NEW)
        assert os.read(reading, 100) == NEW.encode()
    finally:
        os.close(reading)
        os.close(writing)


def test_file_in_a_closed_folder_is_written_in_place(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "result"
    path.write_bytes(OLD)
    inode = path.stat().st_ino
    monkeypatch.setattr(os, "access", lambda path, mode: False)
    write_output(path, NEW)
    assert (path.read_bytes(), path.stat().st_ino) == (NEW.encode(), inode)


def test_longest_name_is_written(tmp_path: Path) -> None:
    path = tmp_path / ("x" * 255)
    write_output(path, NEW)
    assert path.read_bytes() == NEW.encode()
