"""The LOG_* server with requests of MAVProxy and MAVSDK, over lossy and full links."""

import random
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from mavlink_io.request import MavlinkId
from mavlink_io.services.log_transfer.server import ALL, LogServer
from mavlink_io.services.log_transfer.source import LogFile
from tests.helpers.lossy_link import GROUND, VEHICLE, Lost, Wire, nothing


class Shelf:
    """Logs in a folder."""

    def __init__(self, folder: Path, *sizes: int) -> None:
        self.logs = []
        for number, size in enumerate(sizes, 7):
            path = folder / f"{number}.mcap"
            path.write_bytes(bytes((number + n * n // 3) % 256 for n in range(size)))
            self.logs.append(LogFile(path, number, size, 1_700_000_000 + number))

    def files(self) -> Sequence[LogFile]:
        return tuple(self.logs)

    def erase(self) -> str:
        self.logs = []
        return ""


class Client:
    def __init__(self, server: LogServer, party: MavlinkId = GROUND, lost: Lost = nothing) -> None:
        self.server, self.party, self.down, self.room = server, party, Wire(VEHICLE, lost), 10**9

    def send(self, name: str, **fields: int) -> None:
        up = Wire(self.party)
        up.send(name, target_system=1, target_component=1, **fields)
        self.server.feed(up.take()[0], self.down.send, lambda: self.room)

    def receive(self, polls: int = 1) -> list[Any]:
        for _ in range(polls):
            self.server.poll()
        return [frame.decode() for frame in self.down.take()]

    def list(self) -> list[Any]:
        self.send("LOG_REQUEST_LIST", start=0, end=0xFFFF)
        return self.receive()


def server_of(shelf: Shelf, armed: bool = False, texts: list[str] | None = None) -> LogServer:
    return LogServer(shelf, ([] if texts is None else texts).append, lambda: armed)


def put_together(messages: Sequence[Any]) -> bytes:
    data = bytearray()
    for m in sorted(messages, key=lambda m: m.ofs):
        assert m.ofs % 90 == 0
        assert len(data) == m.ofs
        data += bytes(m.data[: m.count])
    return bytes(data)


def test_log_list_counts_from_zero_without_gaps(tmp_path: Path) -> None:
    client = Client(server_of(Shelf(tmp_path, 10, 0, 500)))
    entries = client.list()
    assert [(e.id, e.num_logs, e.last_log_num, e.size) for e in entries] == [
        (0, 3, 2, 10),
        (1, 3, 2, 0),
        (2, 3, 2, 500),
    ]
    assert [e.time_utc for e in entries] == [1_700_000_007, 1_700_000_008, 1_700_000_009]
    client.send("LOG_REQUEST_LIST", start=1, end=1)
    assert [e.id for e in client.receive()] == [1]


def test_log_list_without_logs_is_answered(tmp_path: Path) -> None:
    (entry,) = Client(server_of(Shelf(tmp_path))).list()
    assert (entry.id, entry.num_logs, entry.last_log_num, entry.size) == (0, 0, 0, 0)


@pytest.mark.parametrize("size", [0, 1, 89, 90, 91, 180, 40_000])
def test_log_data_whole_log_arrives(tmp_path: Path, size: int) -> None:
    shelf = Shelf(tmp_path, size)
    client = Client(server_of(shelf))
    client.list()
    client.send("LOG_REQUEST_DATA", id=0, ofs=0, count=ALL)
    received = client.receive(10)
    assert put_together(received) == shelf.logs[0].path.read_bytes()
    assert [m.count for m in received] == [90] * (size // 90) + (
        [size % 90] if size % 90 or not size else []
    )
    client.send("LOG_REQUEST_DATA", id=0, ofs=size, count=ALL)
    assert [(m.ofs, m.count) for m in client.receive()] == [(size, 0)]


def test_log_data_requested_range_arrives(tmp_path: Path) -> None:
    shelf = Shelf(tmp_path, 1000)
    client = Client(server_of(shelf))
    client.send("LOG_REQUEST_DATA", id=0, ofs=180, count=270)
    received = client.receive(3)
    assert [(m.ofs, m.count) for m in received] == [(180, 90), (270, 90), (360, 90)]
    assert b"".join(bytes(m.data) for m in received) == shelf.logs[0].path.read_bytes()[180:450]
    client.send("LOG_REQUEST_DATA", id=0, ofs=1000, count=90)
    assert [(m.ofs, m.count) for m in client.receive()] == [(1000, 0)]
    client.send("LOG_REQUEST_DATA", id=5, ofs=0, count=90)
    assert [(m.id, m.count) for m in client.receive()] == [(5, 0)]


def test_log_data_full_link_does_not_delay_others(tmp_path: Path) -> None:
    server = server_of(Shelf(tmp_path, 3000))
    slow, fast = Client(server), Client(server, MavlinkId(255, 190))
    slow.room = 100
    for client in (slow, fast):
        client.send("LOG_REQUEST_DATA", id=0, ofs=0, count=900)
    server.poll()
    assert (len(slow.receive(0)), len(fast.receive(0))) == (0, 10)
    slow.room = 1000
    assert len(slow.receive()) == 10


def test_log_clients_with_same_ids_differ_by_link(tmp_path: Path) -> None:
    shelf = Shelf(tmp_path, 40_000)
    server = server_of(shelf)
    first, second = Client(server), Client(server)
    for client in (first, second):
        client.list()
        client.send("LOG_REQUEST_DATA", id=0, ofs=0, count=ALL)
    server.poll()
    second.send("LOG_REQUEST_END")
    assert put_together(first.receive(10)) == shelf.logs[0].path.read_bytes()
    assert 0 < len(second.receive()) < 40_000 // 90


def test_log_request_end_stops_data(tmp_path: Path) -> None:
    client = Client(server_of(Shelf(tmp_path, 200_000)))
    client.send("LOG_REQUEST_DATA", id=0, ofs=0, count=ALL)
    assert client.receive()
    client.send("LOG_REQUEST_END")
    assert client.receive() == []


def test_log_numbers_stay_valid_after_deletion(tmp_path: Path) -> None:
    shelf = Shelf(tmp_path, 100, 200)
    client = Client(server_of(shelf))
    client.list()
    expected = shelf.logs.pop(0).path.with_name("8.mcap").read_bytes()
    client.send("LOG_REQUEST_DATA", id=1, ofs=0, count=ALL)
    assert put_together(client.receive()) == expected
    assert [e.size for e in client.list()] == [200]


def test_log_data_of_deleted_log_is_empty(tmp_path: Path) -> None:
    shelf = Shelf(tmp_path, 100)
    client = Client(server_of(shelf))
    client.list()
    shelf.logs[0].path.unlink()
    client.send("LOG_REQUEST_DATA", id=0, ofs=0, count=ALL)
    assert [m.count for m in client.receive(3)] == [0]


def test_log_erase_while_armed_is_refused(tmp_path: Path) -> None:
    shelf, texts = Shelf(tmp_path, 100), list[str]()
    client = Client(server_of(shelf, armed=True, texts=texts))
    client.send("LOG_ERASE")
    assert texts == ["Logs not erased: armed"]
    assert [e.num_logs for e in client.list()] == [1]
    client = Client(server_of(shelf))
    client.send("LOG_ERASE")
    assert [e.num_logs for e in client.list()] == [0]


@settings(max_examples=25, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.integers(0, 9000), st.integers(0, 1000))
@pytest.mark.parametrize("download", ["mavproxy", "mavsdk"])
def test_log_data_with_losses_is_completed_by_clients(
    tmp_path: Path, download: str, size: int, seed: int
) -> None:
    shelf, chance = Shelf(tmp_path, size), random.Random(seed)
    client = Client(server_of(shelf), lost=lambda count, name: chance.random() < 1 / 6)
    client.list()
    ways: dict[str, Callable[[Client, int], bytes]] = {"mavproxy": as_mavproxy, "mavsdk": as_mavsdk}
    assert ways[download](client, size) == shelf.logs[0].path.read_bytes()


def as_mavproxy(client: Client, size: int) -> bytes:
    """Request everything, then up to 20 gaps at a time, until a LOG_DATA that is not full."""
    parts: dict[int, bytes] = {}
    client.send("LOG_REQUEST_DATA", id=0, ofs=0, count=ALL)
    for _ in range(200):
        for m in client.receive(5):
            if m.count:
                parts[m.ofs // 90] = bytes(m.data[: m.count])
            if m.count == 0 or (m.count < 90 and len(parts) == 1 + m.ofs // 90):
                return b"".join(parts[n] for n in sorted(parts))
        highest = max(parts, default=-1)
        missing = sorted(set(range(highest)) - set(parts))
        if not missing:
            client.send("LOG_REQUEST_DATA", id=0, ofs=(1 + highest) * 90, count=ALL)
        for n in missing[:20]:
            client.send("LOG_REQUEST_DATA", id=0, ofs=n * 90, count=90)
    raise AssertionError("never done")


def as_mavsdk(client: Client, size: int) -> bytes:
    """Request chunks of 512 messages, and the first gap of a chunk until there is none."""
    data = b""
    while len(data) < size:
        bins = (min(512 * 90, size - len(data)) + 89) // 90
        parts: dict[int, bytes] = {}
        while missing := sorted(set(range(bins)) - set(parts)):
            run = next(
                (n for n in range(len(missing)) if missing[n] != missing[0] + n), len(missing)
            )
            client.send("LOG_REQUEST_DATA", id=0, ofs=len(data) + missing[0] * 90, count=run * 90)
            for m in client.receive(5):
                parts[(m.ofs - len(data)) // 90] = bytes(m.data[: m.count])
        data += b"".join(parts[n] for n in sorted(parts))
    return data
