"""The LOG_* client with the LOG_* server over a lossy link."""

import io
import random
from pathlib import Path
from typing import TypeVar

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from mavlink_io.codec import Frame
from mavlink_io.request import Exchange
from mavlink_io.services.log_transfer.client import LogClient, RemoteLog
from tests.helpers.lossy_link import GROUND, VEHICLE, Wire, insist, settle
from tests.mavlink_io.services.log_transfer.test_server import Shelf, server_of

T = TypeVar("T")


@settings(max_examples=25, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.integers(0, 100_000), st.integers(0, 1000), st.floats(0.0, 0.1), st.integers(0, 1000))
def test_log_client_list_and_download_with_losses(
    tmp_path: Path, size: int, begun: int, share: float, seed: int
) -> None:
    chance, shelf = random.Random(seed), Shelf(tmp_path, 77, size)
    up, down = (Wire(party, lambda n, name: chance.random() < share) for party in (GROUND, VEHICLE))
    server, client = server_of(shelf), LogClient(up.send, GROUND, VEHICLE)

    def carry(exchange: Exchange[T]) -> T:
        def serve(frame: Frame, now_s: float) -> None:
            server.feed(frame, down.send, lambda: 10**6)

        return settle(exchange, up, down, serve, lambda now_s: server.poll())

    logs = insist(lambda: carry(client.list()), up, down)
    assert logs == [RemoteLog(0, 77, 1_700_000_007), RemoteLog(1, size, 1_700_000_008)]
    if size == 0:
        return
    content, start = shelf.logs[1].path.read_bytes(), min(90 * begun, size // 90 * 90)
    sink = io.BytesIO()
    if start == size:
        return
    assert (
        insist(lambda: carry(client.download(logs[1], sink, start + sink.tell())), up, down) == size
    )
    assert content[:start] + sink.getvalue() == content
