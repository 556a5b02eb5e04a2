"""Parameters on disk: stored soon after a change, whole or not at all, without delaying ticks."""

import time
from collections.abc import Callable
from errno import EACCES
from pathlib import Path

import pytest

from autopilot.control.params import ParamTable
from autopilot.param_store import FILE, ParamStore


def restart(folder: Path) -> tuple[ParamTable, ParamStore]:
    """Return what a restarted program loads."""
    store = ParamStore(folder)
    stored = store.load()
    return ParamTable(stored, stored), store


def settle(store: ParamStore, table: ParamTable, until: Callable[[], bool]) -> list[str]:
    """Poll as the autopilot does."""
    sent_texts: list[str] = []
    deadline_s = time.monotonic() + 5.0
    while not until() and time.monotonic() < deadline_s:
        store.poll(table, sent_texts.append)
        time.sleep(0.005)
    assert until(), sent_texts
    return sent_texts


def test_values_are_loaded_at_next_start(tmp_path: Path) -> None:
    table, store = restart(tmp_path / "not" / "yet")
    table.set("HDG_P", 0.1)
    table.set("MIS_END_ACT", 2.0)
    table.set("HDG_P", 0.7)
    assert store.close(table) == ""
    again, store = restart(tmp_path / "not" / "yet")
    assert (again.get("HDG_P"), again.get("MIS_END_ACT"), store.problems) == (0.7, 2.0, [])
    assert again.get("HDG_D") == ParamTable().get("HDG_D")
    again.set("DPT_P", 0.2)
    store.close(again)
    assert restart(tmp_path / "not" / "yet")[0].stored == {
        "HDG_P": 0.7,
        "MIS_END_ACT": 2.0,
        "DPT_P": 0.2,
    }


def test_values_are_stored_without_close(tmp_path: Path) -> None:
    table, store = restart(tmp_path)
    table.set("HDG_P", 0.7)
    settle(store, table, (tmp_path / FILE).exists)
    table.set("HDG_P", 0.8)
    settle(store, table, lambda: restart(tmp_path)[0].get("HDG_P") == 0.8)
    assert [path.name for path in tmp_path.iterdir()] == [FILE]


def test_unchanged_values_are_not_written_again(tmp_path: Path) -> None:
    table, store = restart(tmp_path)
    table.set("HDG_P", 0.7)
    settle(store, table, (tmp_path / FILE).exists)
    first = (tmp_path / FILE).stat().st_ino
    keep = tmp_path / "keep"
    keep.hardlink_to(tmp_path / FILE)
    deadline_s = time.monotonic() + 0.5
    while time.monotonic() < deadline_s:
        store.poll(table, pytest.fail)
        time.sleep(0.01)
    assert store.close(table) == ""
    assert (tmp_path / FILE).stat().st_ino == first


def test_no_change_writes_no_file(tmp_path: Path) -> None:
    table, store = restart(tmp_path)
    store.poll(table, pytest.fail)
    assert store.close(table) == ""
    assert list(tmp_path.iterdir()) == []


def test_values_set_to_defaults_are_stored(tmp_path: Path) -> None:
    table, store = restart(tmp_path)
    table.set("HDG_P", 0.7)
    store.close(table)
    table, store = restart(tmp_path)
    assert table.reset() == ["HDG_P"]
    store.close(table)
    assert restart(tmp_path)[0].get("HDG_P") == ParamTable().get("HDG_P")


def test_no_folder_stores_no_values() -> None:
    store, table = ParamStore(None), ParamTable()
    assert store.load() == {}
    table.set("HDG_P", 0.7)
    store.poll(table, pytest.fail)
    assert store.close(table) == ""


@pytest.mark.parametrize(
    "content",
    [b"\xff\xfe\x00", b"HDG_P,0.7\nGARBAGE\nHDG_D,99\nGONE_WITH_AN_UPDATE,1\nDPT_P,0.2\n"],
)
def test_broken_file_is_renamed_and_valid_lines_are_used(tmp_path: Path, content: bytes) -> None:
    for turn in (1, 2):
        (tmp_path / FILE).write_bytes(content)
        table, store = restart(tmp_path)
        assert len(store.problems) == (4 if b"HDG_P" in content else 2)
        assert (tmp_path / f"{FILE}.broken-{turn}").read_bytes() == content
        assert not (tmp_path / FILE).exists()
        assert table.stored == ({"HDG_P": 0.7, "DPT_P": 0.2} if b"HDG_P" in content else {})


@pytest.mark.parametrize("ends", [True, False])
def test_valid_lines_of_broken_file_are_stored_again(tmp_path: Path, ends: bool) -> None:
    (tmp_path / FILE).write_text("HDG_P,0.7\nnonsense\n")
    table, store = restart(tmp_path)
    if ends:
        assert store.close(table) == ""
    else:
        settle(store, table, (tmp_path / FILE).exists)
    assert restart(tmp_path)[0].stored == {"HDG_P": 0.7}


def test_unreadable_folder_is_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise PermissionError(EACCES, "Permission denied")

    for name in ("exists", "open", "replace"):
        monkeypatch.setattr(Path, name, refuse)
    store = ParamStore(tmp_path)
    assert store.load() == {}
    assert store.problems == [
        f"{tmp_path / FILE}: Permission denied",
        "cannot be renamed: Permission denied",
    ]


def test_unwritable_disk_is_reported_and_value_applies(tmp_path: Path) -> None:
    blocked = tmp_path / "file"
    blocked.write_text("in the way")
    table, store = restart(blocked)
    table.set("HDG_P", 0.7)
    sent_texts: list[str] = []
    deadline_s = time.monotonic() + 5.0
    while not sent_texts and time.monotonic() < deadline_s:
        store.poll(table, sent_texts.append)
        time.sleep(0.005)
    assert len(sent_texts) == 1
    assert sent_texts[0] == (
        f"Parameters not stored: File exists: {blocked}; check the disk; the dive goes on"
    )
    assert table.get("HDG_P") == 0.7
    assert ParamStore(blocked).close(table).startswith("parameters are not stored: File exists")
    blocked.unlink()
    settle(store, table, (blocked / FILE).exists)
    assert restart(blocked)[0].get("HDG_P") == 0.7
