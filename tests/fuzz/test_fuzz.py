"""Short form of the fuzz targets: the corpus, and a few hundred cases of each."""

import functools
import itertools
import os
from collections.abc import Iterator
from pathlib import Path
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mavlink_io import dialect
from mavlink_io.codec import Framer, encode
from tests.fuzz.files import CORPUS, FILES, corpus_of, seeds_of
from tests.fuzz.frames import stream
from tests.fuzz.links import HIL_MESSAGES, MAX_TICK_CPU_S, LinkFuzz
from tests.fuzz.mutate import mutated

MUTATIONS = 40
SHORT = settings(max_examples=60)


@pytest.fixture(scope="module")
def links() -> Iterator[LinkFuzz]:
    fuzz = LinkFuzz()
    yield fuzz
    fuzz.close()


@SHORT
@given(st.binary(max_size=1500))
def test_fuzzed_ground_frames_leave_vehicle_in_service(links: LinkFuzz, data: bytes) -> None:
    assert links.ground(data).tick_cpu_s < MAX_TICK_CPU_S


@SHORT
@given(st.binary(max_size=1500))
def test_fuzzed_hil_frames_leave_vehicle_in_service(links: LinkFuzz, data: bytes) -> None:
    assert links.hil(data).tick_cpu_s < MAX_TICK_CPU_S


@SHORT
@given(st.binary(max_size=600))
def test_fuzzed_file_requests_leave_vehicle_in_service(links: LinkFuzz, data: bytes) -> None:
    assert links.file_transfer(data).tick_cpu_s < MAX_TICK_CPU_S


@SHORT
@given(st.binary(max_size=2000), st.lists(st.integers(0, 2000), max_size=6))
def test_framer_result_does_not_depend_on_pieces(data: bytes, cuts: list[int]) -> None:
    sent = stream(data, HIL_MESSAGES)
    whole = Framer().feed(sent)
    places, framer, found = [0, *sorted(cuts), len(sent)], Framer(), []
    for first, last in itertools.pairwise(places):
        found += framer.feed(sent[first:last])
    assert found == whole


@SHORT
@given(st.binary(max_size=800))
def test_decoded_frame_encodes_to_the_same_bytes(data: bytes) -> None:
    for frame in Framer().feed(stream(data, HIL_MESSAGES)):
        message = dialect.by_id(frame.message_id)
        assert message is not None
        again = encode(message, frame.decode(), frame.sequence, frame.system, frame.component)
        (read,) = Framer().feed(again)
        assert repr(read.decode()) == repr(frame.decode())


@functools.cache
def seeds(name: str) -> list[bytes]:
    return seeds_of(name)


@pytest.mark.parametrize("name", FILES)
def test_valid_files_are_accepted(name: str, tmp_path: Path) -> None:
    valid = seeds(name)[: len(seeds(name)) - len(corpus_of(name))]
    assert all(FILES[name].run(data, tmp_path / f"valid{FILES[name].suffix}") for data in valid)


@pytest.mark.parametrize("name", FILES)
def test_corpus_and_mutated_files_are_read_or_refused(name: str, tmp_path: Path) -> None:
    path = tmp_path / f"file{FILES[name].suffix}"
    for data in corpus_of(name):
        FILES[name].run(data, path)
    for case in range(MUTATIONS):
        rng = Random(f"{name} {case}")
        FILES[name].run(mutated(rng, rng.choice(seeds(name))), path)


def test_corpus_belongs_to_targets() -> None:
    assert {entry.name for entry in os.scandir(CORPUS)} <= set(FILES)
