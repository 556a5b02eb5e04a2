"""FTP downloads over a lossy link are complete, and contiguous at any moment."""

import io
import random
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from mavlink_io.codec import Frame
from mavlink_io.request import Exchange, ExchangeError
from mavlink_io.services.ftp import payload
from mavlink_io.services.ftp.client import FileClient
from mavlink_io.services.ftp.payload import Packet, crc32
from mavlink_io.services.ftp.server import FileServer
from mavlink_io.services.ftp.tree import FileTree, ListingEntry
from tests.helpers.lossy_link import GROUND, VEHICLE, Wire, insist, settle

T = TypeVar("T")
QUIET = settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture])


class Rig:
    """A client and a server with a seeded loss rate in each direction."""

    def __init__(self, files: dict[str, bytes], share: float = 0.0, seed: int = 0) -> None:
        chance = random.Random(seed)
        self.up, self.down = (
            Wire(party, lambda n, name: chance.random() < share) for party in (GROUND, VEHICLE)
        )
        tree = FileTree()
        for path, content in files.items():
            tree.add_file(path, lambda content=content: content)  # type: ignore[misc]
        self.server = FileServer(tree)
        self.client = FileClient(self.up.send, GROUND, VEHICLE)

    def settle(self, exchange: Exchange[T]) -> T:
        return settle(exchange, self.up, self.down, self._serve, self.server.poll)

    def insist(self, ask: Callable[[], Exchange[T]]) -> T:
        return insist(lambda: self.settle(ask()), self.up, self.down)

    def _serve(self, frame: Frame, now_s: float) -> None:
        self.server.feed(frame, self.down.send, lambda: 10**6, now_s)


@QUIET
@given(st.integers(0, 40_000), st.integers(0, 40_000), st.floats(0.0, 0.2), st.integers(0, 1000))
def test_ftp_download_resumed_is_complete(size: int, start: int, share: float, seed: int) -> None:
    content = random.Random(seed).randbytes(size)
    rig, start = Rig({"/logs/a": content}, share, seed), min(start, size)
    sink = Prefix(content, start)
    assert rig.insist(lambda: rig.client.download("/logs/a", sink, start + sink.tell())) == size
    assert sink.getvalue() == content[start:]


class Prefix(io.BytesIO):
    """A sink that accepts only the next bytes of the file."""

    def __init__(self, content: bytes, start: int) -> None:
        super().__init__()
        self._content, self._start = content, start

    def write(self, data: bytes, /) -> int:  # type: ignore[override]
        position = self._start + self.tell()
        assert data == self._content[position : position + len(data)]
        return super().write(data)


def test_ftp_download_vehicle_restart_reopens_file() -> None:
    content = random.Random(1).randbytes(100_000)
    rig, sink, watched = Rig({"/a": content}), io.BytesIO(), list[int]()

    def watch(received: int, size_: int) -> None:
        assert size_ == len(content)
        watched.append(received)
        if received > 30_000 and rig.server._sessions and len(watched) < 1000:
            rig.server._sessions.clear()
            rig.server._jobs.clear()
            watched.extend([received] * 1000)

    assert rig.settle(rig.client.download("/a", sink, 0, watch)) == len(content)
    assert sink.getvalue() == content
    assert sorted(watched) == watched


@QUIET
@given(st.integers(0, 1000), st.floats(0.0, 0.1))
def test_ftp_list_and_checksum_with_losses_are_correct(seed: int, share: float) -> None:
    files = {f"/logs/{n:04d}-a-rather-long-name": bytes(n) for n in range(30)}
    rig = Rig(files, share, seed)
    listed = rig.insist(lambda: rig.client.list("/logs"))
    assert listed == [
        ListingEntry(path.rsplit("/", 1)[1], len(content)) for path, content in files.items()
    ]
    assert rig.insist(lambda: rig.client.checksum("/logs/0007-a-rather-long-name")) == crc32(
        bytes(7)
    )


@pytest.mark.parametrize("ask", ["list", "checksum", "download"])
def test_ftp_missing_file_raises_error(ask: str, tmp_path: Path) -> None:
    rig = Rig({"/logs/a": b"x"})
    requests: dict[str, Callable[[], Exchange[Any]]] = {
        "list": lambda: rig.client.list("/nowhere"),
        "checksum": lambda: rig.client.checksum("/logs/b"),
        "download": lambda: rig.client.download("/logs/b", io.BytesIO()),
    }
    exchange = requests[ask]()
    with pytest.raises(ExchangeError, match="filenotfound"):
        rig.settle(exchange)


def test_ftp_resume_of_shorter_file_raises_error() -> None:
    rig = Rig({"/logs/a": b"short"})
    with pytest.raises(ExchangeError, match="holds 5 bytes, fewer than the 9 that are here"):
        rig.settle(rig.client.download("/logs/a", io.BytesIO(), 9))


class Script:
    """A client whose answers are written by the test."""

    def __init__(self) -> None:
        self.requests: list[Packet] = []
        self._wire = Wire(VEHICLE)
        self.client = FileClient(self._record, GROUND, VEHICLE)

    def _record(self, name: str, **fields: Any) -> None:
        self.requests.append(payload.decode(fields["payload"]))

    def answer(
        self,
        exchange: Exchange[Any],
        data: bytes,
        offset: int = 0,
        number: int = 0,
        *,
        opcode: int = payload.ACK,
        request: Packet | None = None,
    ) -> None:
        """Answer a request, by default the last one; ``number`` counts the packets of a burst."""
        request = request or self.requests[-1]
        packet = Packet(
            sequence=payload.next_sequence(request.sequence + number),
            session=0,
            opcode=opcode,
            size=len(data),
            requested=request.opcode,
            offset=offset,
            data=data,
        )
        target = {"target_network": 0, "target_system": 250, "target_component": 190}
        self._wire.send("FILE_TRANSFER_PROTOCOL", payload=packet.encode(), **target)
        for frame in self._wire.take():
            exchange.feed(frame)


def test_ftp_data_after_the_end_of_the_file_are_ignored() -> None:
    """Before, a packet at 20 MB of a file of 300 bytes caused 83,683 requests."""
    script, sink = Script(), io.BytesIO()
    download = script.client.download("/a", sink)
    download.poll(0.0)
    script.answer(download, (300).to_bytes(4, "little"))
    before = len(script.requests)
    script.answer(download, b"x" * 239, offset=20_000_000)
    assert len(script.requests) == before
    script.answer(download, b"a" * 239)
    script.answer(download, b"b" * 61, offset=239, number=1)
    assert download.result() == 300
    assert sink.getvalue() == b"a" * 239 + b"b" * 61


@pytest.mark.parametrize(("offset", "number"), [(0, 7), (23_900, 50), (239, 0)])
def test_ftp_data_that_no_request_explains_are_ignored(offset: int, number: int) -> None:
    """Late data of an earlier transfer; at 23,900 bytes they caused 101 requests for pieces."""
    script, sink = Script(), io.BytesIO()
    download = script.client.download("/a", sink)
    download.poll(0.0)
    script.answer(download, (30_000).to_bytes(4, "little"))
    before = len(script.requests)
    script.answer(download, b"x" * 239, offset, number)
    assert len(script.requests) == before
    assert sink.getvalue() == b""
    script.answer(download, b"a" * 239)
    assert sink.getvalue() == b"a" * 239


OLD_LENGTH, NEW_LENGTH = 200, 239
"""Bytes in each packet of a vehicle that sends fewer than requested; bytes that are requested."""


def second_download(size: int) -> tuple[Script, Exchange[int], io.BytesIO, Packet]:
    """Return a download with an open burst, and the burst of the download before it.

    The vehicle gave both files the same session.
    """
    script, sink = Script(), io.BytesIO()
    first = script.client.download("/old", io.BytesIO())
    first.poll(0.0)
    script.answer(first, (10 * OLD_LENGTH).to_bytes(4, "little"))
    old_burst = script.requests[-1]
    for number in range(10):
        script.answer(first, b"o" * OLD_LENGTH, number * OLD_LENGTH, number)
    assert first.result() == 10 * OLD_LENGTH
    download = script.client.download("/new", sink)
    download.poll(0.0)
    script.answer(download, size.to_bytes(4, "little"))
    return script, download, sink, old_burst


@pytest.mark.parametrize("number", [20, 60, 200])
def test_ftp_late_data_of_the_burst_before_are_ignored(number: int) -> None:
    """With packets of 200 bytes they lie within the 239 bytes per packet that are requested."""
    script, download, sink, old_burst = second_download(100_000)
    before = len(script.requests)
    offset = number * OLD_LENGTH
    script.answer(download, b"o" * OLD_LENGTH, offset, number, request=old_burst)
    assert len(script.requests) == before
    script.answer(download, b"n" * OLD_LENGTH)
    script.answer(download, b"n" * OLD_LENGTH, OLD_LENGTH, number=1)
    assert sink.getvalue() == b"n" * 2 * OLD_LENGTH


def test_ftp_late_end_of_the_burst_before_is_ignored() -> None:
    """It caused requests for 32 pieces, and then for 32 pieces a second instead of bursts."""
    script, download, _, old_burst = second_download(100_000)
    before, end = len(script.requests), bytes((payload.END_OF_FILE,))
    script.answer(download, end, number=10, opcode=payload.NAK, request=old_burst)
    assert len(script.requests) == before


def test_ftp_late_error_of_the_download_before_is_ignored() -> None:
    script, download, sink, old_burst = second_download(100)
    error = bytes((payload.INVALID_SESSION,))
    script.answer(download, error, opcode=payload.NAK, request=old_burst)
    script.answer(download, b"n" * 100)
    assert download.result() == 100
    assert sink.getvalue() == b"n" * 100


@pytest.mark.parametrize("length", [OLD_LENGTH, NEW_LENGTH])
def test_ftp_end_of_the_own_burst_requests_the_lost_pieces(length: int) -> None:
    size = 10 * NEW_LENGTH
    script, download, _, _ = second_download(size)
    before, burst = len(script.requests), script.requests[-1]
    packets = -(-size // length)
    end = bytes((payload.END_OF_FILE,))
    script.answer(download, end, number=packets, opcode=payload.NAK, request=burst)
    assert [r.opcode for r in script.requests[before:]] == [payload.READ] * 10


def test_ftp_list_without_complete_entry_fails() -> None:
    """Before, the same request was repeated at once and without end."""
    script = Script()
    listing = script.client.list("/logs")
    listing.poll(0.0)
    script.answer(listing, b"Fincomplete")
    with pytest.raises(ExchangeError, match="the list of /logs: the answer has no complete entry"):
        listing.result()
