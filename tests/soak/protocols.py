"""Soak row: loss, duplication, reordering and delay on every protocol."""

import heapq
import io
import random
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from mavlink_io import dialect
from mavlink_io.codec import Frame, Framer, encode
from mavlink_io.mission_items import MissionItem
from mavlink_io.real32 import as_real32
from mavlink_io.request import Exchange, ExchangeError, MavlinkId
from mavlink_io.services.ftp.client import FileClient
from mavlink_io.services.ftp.payload import crc32
from mavlink_io.services.ftp.server import FileServer
from mavlink_io.services.ftp.tree import FileTree
from mavlink_io.services.log_transfer.client import LogClient
from mavlink_io.services.mission_server import MissionServer
from mavlink_io.services.missions import MissionClient
from mavlink_io.services.params import ParamClient, ParamServer
from tests.helpers.lossy_link import GROUND, VEHICLE
from tests.mavlink_io.services.log_transfer.test_server import Shelf, server_of
from tests.mavlink_io.services.test_missions import Store
from tests.mavlink_io.services.test_params import Table
from tests.soak.row import Batch, Row

STEP_S, MAX_STEPS = 0.05, 12_000
"""Step and number of steps of simulated wall time in which an exchange has to end."""


class Water:
    """One direction of a link that loses, repeats, delays and reorders messages."""

    def __init__(self, sender: MavlinkId, rng: random.Random) -> None:
        self._sender, self._rng, self._framer = sender, rng, Framer()
        self._loss, self._repeat, self._delay_s = (rng.choice((0.0, x)) for x in (0.3, 0.3, 1.5))
        self._waiting: list[tuple[float, int, Frame]] = []
        self._count = self._sent = 0
        self.now_s = 0.0

    def send(self, name: str, **fields: Any) -> None:
        """Send a message."""
        message = dialect.by_name(name)
        values, sequence = message.values(**fields), self._sent & 0xFF
        (frame,) = self._framer.feed(encode(message, values, sequence, *self._sender))
        self._sent += 1
        for _ in range(1 + (self._rng.random() < self._repeat)):
            if self._rng.random() >= self._loss:
                self._count += 1
                due_s = self.now_s + self._rng.random() * self._delay_s
                heapq.heappush(self._waiting, (due_s, self._count, frame))

    def take(self) -> list[Frame]:
        """Return the messages that have arrived."""
        arrived = []
        while self._waiting and self._waiting[0][0] <= self.now_s:
            arrived.append(heapq.heappop(self._waiting)[2])
        return arrived


class Link:
    """Client and server with water between them."""

    def __init__(self, rng: random.Random) -> None:
        self.up, self.down = Water(GROUND, rng), Water(VEHICLE, rng)
        self.now_s = 0.0

    def settle(
        self,
        exchange: Exchange[Any],
        serve: Callable[[Frame, float], None],
        poll: Callable[[float], None],
    ) -> Any:
        """Run an exchange to its end. Raises ExchangeError, or AssertionError without an end."""
        for _ in range(MAX_STEPS):
            self.now_s += STEP_S
            self.up.now_s = self.down.now_s = self.now_s
            exchange.poll(self.now_s)
            for frame in self.up.take():
                serve(frame, self.now_s)
            poll(self.now_s)
            for frame in self.down.take():
                if not exchange.done:
                    exchange.feed(frame)
            if exchange.done:
                return exchange.result()
        raise AssertionError("the exchange does not end")


def mission(rng: random.Random) -> None:
    """Upload two missions one after the other; download what was accepted."""
    link, store = Link(rng), Store()
    server, client = MissionServer(store), MissionClient(link.up.send, GROUND, VEHICLE)

    def carry(exchange: Exchange[Any]) -> Any:
        return link.settle(
            exchange, lambda f, now_s: server.feed(f, link.down.send, now_s), server.poll
        )

    for _ in range(2):
        items = tuple(
            MissionItem(n, 2, 93, p1=float(rng.randrange(100))) for n in range(rng.randrange(1, 12))
        )
        before = store.items
        try:
            carry(client.upload(items))
        except ExchangeError:
            assert store.items in (before, items), "a mission of other items"
            continue
        assert store.items == items, "accepted, but another mission"
    try:
        read = tuple(carry(client.download()))
    except ExchangeError:
        return
    assert read == store.items, "another mission was read"


def parameters(rng: random.Random) -> None:
    """Set and read values, then read all."""
    link, table = Link(rng), Table()
    server = ParamServer(table, link.down.send, lambda _: None)
    client = ParamClient(link.up.send, GROUND, VEHICLE)

    def carry(exchange: Exchange[Any]) -> Any:
        return link.settle(
            exchange,
            lambda f, _: server.feed(f, link.down.send, lambda: 1000),
            lambda _: server.poll(),
        )

    for _ in range(3):
        name, value = f"P_{rng.randrange(50):02}", as_real32(rng.uniform(0.0, 10.0))
        before = table.values[name]
        try:
            assert carry(client.set(name, value)) == value, "another value was confirmed"
        except ExchangeError:
            assert table.values[name] in (before, value), "another value was stored"
            continue
        assert table.values[name] == value, "confirmed, but another value"
    try:
        values = carry(client.list())
    except ExchangeError:
        return
    assert set(values) == set(table.values), "another list of names"
    wrong = [n for n, v in values.items() if v != as_real32(table.values[n])]
    assert not wrong, f"another value of {wrong}"


def files(rng: random.Random) -> None:
    """List, check and download a file."""
    link, content = Link(rng), rng.randbytes(rng.randrange(5000))
    tree = FileTree()
    tree.add_file("/logs/a", lambda: content)
    server, client = FileServer(tree), FileClient(link.up.send, GROUND, VEHICLE)

    def carry(exchange: Exchange[Any]) -> Any:
        return link.settle(
            exchange,
            lambda f, now_s: server.feed(f, link.down.send, lambda: 10**6, now_s),
            server.poll,
        )

    sink = io.BytesIO()
    try:
        assert [entry.name for entry in carry(client.list("/logs"))] == ["a"]
        assert carry(client.checksum("/logs/a")) == crc32(content), "another checksum"
        assert carry(client.download("/logs/a", sink, 0)) == len(content), "another size"
    except ExchangeError:
        assert content.startswith(sink.getvalue()), "other bytes"
        return
    assert sink.getvalue() == content, "other bytes"


def logs(rng: random.Random) -> None:
    """List and download a log."""
    with tempfile.TemporaryDirectory() as folder:
        link, size = Link(rng), rng.randrange(1, 5000)
        shelf = Shelf(Path(folder), 77, size)
        server, client = server_of(shelf), LogClient(link.up.send, GROUND, VEHICLE)

        def carry(exchange: Exchange[Any]) -> Any:
            return link.settle(
                exchange,
                lambda f, _: server.feed(f, link.down.send, lambda: 10**6),
                lambda _: server.poll(),
            )

        content, sink = shelf.logs[1].path.read_bytes(), io.BytesIO()
        try:
            listed = carry(client.list())
            assert [log.bytes for log in listed] == [77, size], "another list"
            carry(client.download(listed[1], sink, 0))
        except ExchangeError:
            assert content.startswith(sink.getvalue()), "other bytes"
            return
        assert sink.getvalue() == content, "other bytes"


PROTOCOLS = {"mission": mission, "parameters": parameters, "files": files, "logs": logs}


def run(first: int, count: int) -> Batch:
    """Run each protocol once per case."""
    batch = Batch()
    for case in range(first, first + count):
        for name, exercise in PROTOCOLS.items():
            batch.add("exchanges")
            try:
                exercise(random.Random(f"{name} {case}"))
            except Exception as error:
                batch.fail(case, f"{name}: {type(error).__name__}: {error}")
    return batch


def describe(counts: Mapping[str, float]) -> str:
    """Return the result."""
    return (
        f"{counts.get('exchanges', 0):.0f} exchanges of {len(PROTOCOLS)} protocols,"
        f" {counts.get('failures', 0):.0f} wrong or without an end"
    )


ROW = Row(
    title="loss, duplication, reordering, delay",
    full_size=10_000,
    batch_size=20,
    run=run,
    describe=describe,
    holds=lambda counts: not counts.get("failures"),
    requirement="completes or fails with a reason; no wrong item, value or byte",
)
