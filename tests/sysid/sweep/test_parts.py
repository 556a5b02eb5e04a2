"""Parts of a sweep on disk: complete or absent, replaced, and superseded."""

import csv
from pathlib import Path

import pytest

from mavlink_io.errors import InputError
from sysid.sweep import parts
from sysid.sweep.dives import COLUMNS, Part
from sysid.sweep.parts import HEADER, PartStore

FIRST, SECOND = "a" * 64, "b" * 64


def line(dive: int) -> str:
    return ",".join([str(dive), *["x"] * (len(COLUMNS) - 1)]) + "\n"


def stored(folder: Path, *keys: str) -> PartStore:
    """Return a store that expects these keys."""
    store = PartStore(folder)
    store.prepare(keys)
    return store


def test_added_part_is_found_by_a_later_store(tmp_path: Path) -> None:
    store = stored(tmp_path, FIRST, SECOND)
    assert store.add(FIRST, Part(0, 2, line(0) + line(1))) == Part(0, 2, "")
    later = stored(tmp_path, FIRST, SECOND)
    assert later.get(FIRST) == Part(0, 2, "")
    assert later.get(SECOND) is None


def test_texts_are_in_order_of_dives(tmp_path: Path) -> None:
    store = stored(tmp_path, FIRST, SECOND)
    store.add(FIRST, Part(1000, 1, line(1000)))
    store.add(SECOND, Part(8, 1, line(8)))
    assert list(parts.texts(tmp_path)) == [line(8), line(1000)]


def test_killed_while_writing_leaves_no_part(tmp_path: Path) -> None:
    stored(tmp_path, FIRST)
    unfinished = tmp_path / "parts" / f"part-000000000-{FIRST[:16]}.123.tmp"
    unfinished.write_text(HEADER + line(0))
    store = stored(tmp_path, FIRST)
    assert store.get(FIRST) is None
    assert not unfinished.exists()
    assert list(parts.texts(tmp_path)) == []


@pytest.mark.parametrize("content", ["", HEADER[:9], HEADER + line(0)[:-1], "other\n" + line(0)])
def test_damaged_part_is_flown_again(tmp_path: Path, content: str) -> None:
    store = stored(tmp_path, FIRST)
    store.add(FIRST, Part(0, 1, line(0)))
    (path,) = (tmp_path / "parts").iterdir()
    path.write_text(content)
    assert stored(tmp_path, FIRST).get(FIRST) is None
    with pytest.raises(InputError, match="no part of a sweep"):
        parts.digest(tmp_path)
    stored(tmp_path, FIRST).add(FIRST, Part(0, 1, line(0)))
    assert list(parts.texts(tmp_path)) == [line(0)]


def test_parts_of_other_inputs_are_moved_away(tmp_path: Path) -> None:
    stored(tmp_path, FIRST).add(FIRST, Part(0, 1, line(0)))
    stored(tmp_path, SECOND)
    assert list(parts.texts(tmp_path)) == []
    assert [path.name for path in (tmp_path / "superseded").iterdir()] == [
        f"part-000000000-{FIRST[:16]}.csv"
    ]


def test_part_is_csv_with_one_header(tmp_path: Path) -> None:
    stored(tmp_path, FIRST).add(FIRST, Part(0, 2, line(0) + line(1)))
    (path,) = (tmp_path / "parts").iterdir()
    with path.open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [row["dive"] for row in rows] == ["0", "1"]
    assert tuple(rows[0]) == COLUMNS
