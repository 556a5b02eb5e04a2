"""Files from outside: only regular files are opened."""

import errno
import os
from pathlib import Path

import pytest

from mavlink_io.text_files import open_regular, read_limited


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="the system has no named pipes")
def test_pipe_without_a_writer_is_refused_at_once(tmp_path: Path) -> None:
    path = tmp_path / "fifo.csv"
    os.mkfifo(path)
    for read in (open_regular, read_limited):
        with pytest.raises(OSError, match="is no regular file") as refused:
            read(path)
        assert refused.value.errno == errno.EINVAL


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
