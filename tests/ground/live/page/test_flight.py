"""A simulated dive with the live page and without: the same bytes."""

import re
import socket
import subprocess
import sys
import threading
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

import pytest
from mcap.reader import make_reader

MISSION = """
name = "short"
about = "a short leg"

[[step]]
depth_m = 2.0
heading_deg = 30.0
thrust_pct = 58.0
duration_s = 30.0

[[step]]
surface = true
"""
STAMPS = {
    "ATTITUDE": (4, 1e-3),
    "ACTUATOR_OUTPUT_STATUS": (8, 1e-6),
    "LOCAL_POSITION_NED": (4, 1e-3),
}
"""Messages that follow vehicle time, with the bytes and the unit (s) of their time stamp, which
comes first. Before arming and after the dive their number depends on the wall clock."""
DIVE_S = 30.0
REQUEST = b"GET /events HTTP/1.1\r\nHost: localhost\r\n\r\n"


class Browser:
    """A connection to the events of a page, which reads them or has stopped."""

    def __init__(self, port: int, *, reads: bool) -> None:
        self._socket = socket.create_connection(("127.0.0.1", port))
        self._socket.sendall(REQUEST)
        self.received = b""
        self._thread = threading.Thread(target=self._read) if reads else None
        if self._thread is not None:
            self._thread.start()

    def _read(self) -> None:
        while part := self._socket.recv(65_536):
            self.received += part

    def close(self) -> None:
        if self._thread is not None:
            self._thread.join()
        self._socket.close()


class Flight(NamedTuple):
    truth: list[bytes]
    telemetry: dict[str, list[bytes]]
    browsers: Sequence[Browser]


def payloads(path: Path) -> dict[str, list[bytes]]:
    """The messages of a log by the last part of their topic."""
    found: dict[str, list[bytes]] = {}
    with path.open("rb") as stream:
        for _, channel, message in make_reader(stream).iter_messages():
            found.setdefault(channel.topic.rpartition("/")[2], []).append(message.data)
    return found


def dive(name: str, recorded: list[bytes]) -> list[bytes]:
    """The payloads of the first `DIVE_S` after the first second."""
    length, unit_s = STAMPS[name]
    stamped = [(int.from_bytes(data[:length], "little") * unit_s, data) for data in recorded]
    return [data for time_s, data in stamped if 1.0 < time_s <= DIVE_S]


def fly(folder: Path, *options: str) -> Flight:
    folder.mkdir()
    (folder / "short.toml").write_text(MISSION)
    log, truth = folder / "log.mcap", folder / "truth.mcap"
    command = [sys.executable, "-m", "ground", "fly", str(folder / "short.toml"), "--sitl"]
    command += ["--scenario", "disturbed", "--log", str(log), "--truth", str(truth), *options]
    browsers: list[Browser] = []
    with subprocess.Popen(
        command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    ) as child:
        assert child.stderr is not None
        for line in child.stderr:
            if match := re.search(r"live page: http://127\.0\.0\.1:(\d+)/", line):
                port = int(match[1])
                browsers = [Browser(port, reads=reads) for reads in (True, True, False)]
    for browser in browsers:
        browser.close()
    assert child.returncode == 0
    recorded = payloads(log)
    return Flight(
        [data for all_of_one in payloads(truth).values() for data in all_of_one],
        {name: dive(name, recorded[name]) for name in STAMPS},
        browsers,
    )


@pytest.mark.process
def test_flight_with_three_browsers_gives_the_same_bytes(tmp_path: Path) -> None:
    with ThreadPoolExecutor() as threads:
        flights = [
            threads.submit(fly, tmp_path / "alone"),
            threads.submit(fly, tmp_path / "shown", "--live"),
        ]
        alone, shown = (flight.result() for flight in flights)
    assert alone.browsers == []
    assert len(shown.browsers) == 3
    assert len(alone.truth) > DIVE_S * 10
    assert shown.truth == alone.truth
    assert min(len(recorded) for recorded in alone.telemetry.values()) > DIVE_S * 5
    assert shown.telemetry == alone.telemetry
    for browser in shown.browsers[:2]:
        assert b'"columns"' in browser.received
        assert b"the dive has ended" in browser.received
        assert b"event: end" in browser.received
