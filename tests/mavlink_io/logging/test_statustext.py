"""Long texts in chunks: lost chunks, copies, and texts of other senders in between."""

from typing import NamedTuple

import pytest

from mavlink_io.logging.statustext import CHUNK_LENGTH, MISSING, TextJoiner

SENDER, GIMBAL = (1, 1), (1, 154)
FULL = {name: name * CHUNK_LENGTH for name in "abcd"}


class Chunk(NamedTuple):
    """Fields of STATUSTEXT that decide how chunks are joined."""

    text: str
    id: int = 0
    chunk_seq: int = 0


BEGIN, MIDDLE, END = Chunk(FULL["a"], 7, 0), Chunk(FULL["b"], 7, 1), Chunk("end", 7, 2)


@pytest.mark.parametrize(
    ("chunks", "expected"),
    [
        ([BEGIN, MIDDLE, END], f"{FULL['a']}{FULL['b']}end"),
        ([BEGIN, END], f"{FULL['a']}{MISSING}end"),
        ([MIDDLE, END], f"{MISSING}{FULL['b']}end"),
        ([END], f"{MISSING}end"),
        ([BEGIN, BEGIN, MIDDLE, MIDDLE, END], f"{FULL['a']}{FULL['b']}end"),
        ([Chunk(FULL["c"], 6), BEGIN, MIDDLE, END], f"{FULL['a']}{FULL['b']}end"),
        ([Chunk(FULL["c"], 7), BEGIN, MIDDLE, END], f"{FULL['a']}{FULL['b']}end"),
        ([Chunk(FULL["d"])], FULL["d"]),
    ],
    ids=[
        "whole",
        "middle lost",
        "begin lost",
        "only end",
        "copies",
        "end of another lost",
        "same id after a restart",
        "one message",
    ],
)
def test_text_is_complete_after_its_last_chunk(chunks: list[Chunk], expected: str) -> None:
    joiner = TextJoiner()
    results = [joiner.add(SENDER, chunk) for chunk in chunks]
    assert results == [None] * (len(chunks) - 1) + [expected]


def test_texts_of_others_between_two_chunks_change_nothing() -> None:
    joiner = TextJoiner()
    assert joiner.add(SENDER, BEGIN) is None
    assert joiner.add(SENDER, Chunk("short")) == "short"
    assert joiner.add(GIMBAL, Chunk(FULL["c"], 7)) is None
    assert joiner.add(SENDER, MIDDLE) is None
    assert joiner.add(GIMBAL, Chunk("gimbal", 7, 1)) == f"{FULL['c']}gimbal"
    assert joiner.add(SENDER, END) == f"{FULL['a']}{FULL['b']}end"
