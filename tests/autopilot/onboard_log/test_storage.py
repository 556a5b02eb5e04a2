"""Log folder: the oldest logs are removed, but never the open one."""

from pathlib import Path
from typing import Any

import pytest

from autopilot.onboard_log.storage import LogStore, StorageLimits

PLENTY = StorageLimits(1000.0, 0.0)
START_S = 1_700_000_000.0


def fill(store: LogStore, *kilobytes: int) -> list[Path]:
    paths = []
    for number, size in enumerate(kilobytes):
        path, file = store.create(START_S + number, PLENTY)
        with file:
            file.write(bytes(1000 * size))
        paths.append(path)
    return paths


def test_log_names_have_number_and_date(tmp_path: Path) -> None:
    store = LogStore(tmp_path / "made" / "on demand")
    assert store.files() == []
    fill(store, 3, 0)
    assert [(log.path.name, log.number, log.bytes, log.began_unix_s) for log in store.files()] == [
        ("00001-20231114T221320Z.mcap", 1, 3000, 1_700_000_000),
        ("00002-20231114T221321Z.mcap", 2, 0, 1_700_000_001),
    ]


def test_other_files_are_ignored(tmp_path: Path) -> None:
    store = LogStore(tmp_path)
    fill(store, 1)
    for name in ("notes.txt", "1.mcap", "00009-20231114T221320Z.mcap.part"):
        (tmp_path / name).write_text("mine")
    (tmp_path / "00077-20231114T221320Z.mcap").mkdir()
    (tmp_path / "00078-20231114T221320Z.mcap").symlink_to(tmp_path / "notes.txt")
    assert [log.number for log in store.files()] == [1]
    assert store.erase() == ""
    assert (tmp_path / "notes.txt").exists()
    assert store.files() == []


def test_two_vehicles_in_one_folder_use_different_logs(tmp_path: Path) -> None:
    stores = LogStore(tmp_path), LogStore(tmp_path)
    paths = [fill(store, 1)[0] for store in stores for _ in range(3)]
    assert len(set(paths)) == 6


def test_oldest_logs_are_removed_above_size_limit(tmp_path: Path) -> None:
    paths = fill(LogStore(tmp_path), 400, 400, 400)
    store = LogStore(tmp_path, lambda: paths[0])
    store.make_room(StorageLimits(1.0, 0.0))
    assert [path.exists() for path in paths] == [True, False, True]
    with pytest.raises(OSError, match="no room left for logs"):
        store.make_room(StorageLimits(0.3, 0.0))
    assert [path.exists() for path in paths] == [True, False, False]


def test_oldest_logs_are_removed_below_free_space_limit(tmp_path: Path, monkeypatch: Any) -> None:
    store = LogStore(tmp_path)
    paths = fill(store, 400, 400, 400)
    free_bytes = [700_000, 700_000, 700_000, 1_100_000]
    monkeypatch.setattr(
        "shutil.disk_usage", lambda folder: type("Usage", (), {"free": free_bytes.pop(0)})
    )
    store.make_room(StorageLimits(1000.0, 1.0))
    assert [path.exists() for path in paths] == [False, False, True]


def test_no_log_is_removed_if_other_data_fill_the_disk(tmp_path: Path, monkeypatch: Any) -> None:
    store = LogStore(tmp_path)
    paths = fill(store, 400, 400)
    monkeypatch.setattr(
        "shutil.disk_usage", lambda folder: type("Usage", (), {"free": 100_000_000})
    )
    with pytest.raises(OSError, match="no room left for logs"):
        store.create(START_S, StorageLimits(10_000.0, 500.0))
    assert [path.exists() for path in paths] == [True, True]


def test_open_log_of_another_vehicle_is_kept(tmp_path: Path) -> None:
    path, file = LogStore(tmp_path).create(START_S, PLENTY)
    other = LogStore(tmp_path)
    with file:
        file.write(bytes(1000))
        file.flush()
        assert other.erase() == ""
        with pytest.raises(OSError, match="no room left for logs"):
            other.make_room(StorageLimits(0.0, 0.0))
        assert path.exists()
    assert other.erase() == ""
    assert not path.exists()


def test_erase_keeps_open_log(tmp_path: Path) -> None:
    paths = fill(LogStore(tmp_path), 1, 1, 1)
    assert LogStore(tmp_path, lambda: paths[1]).erase() == ""
    assert [path.exists() for path in paths] == [False, True, False]
