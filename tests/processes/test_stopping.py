"""Ctrl-C in `ground fly --connect`, and the commands that stop the vehicle, with real processes."""

import json
import signal
import socket
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from ground.log_tools import mcap
from tests.helpers.subprocesses import Finished, autopilot, free_port, process

pytestmark = pytest.mark.process

LONGEST_S = 200.0
"""Wall time for one command on a busy machine, in s."""
SPEED = "5"
MISSION = """
name = "long"

[[step]]
depth_m = 3.0
heading_deg = 0.0
thrust_pct = 58.0
duration_s = 5000.0

[[step]]
surface = true
"""


def ground(*words: str) -> Finished:
    with process("-m", "ground", *words) as child:
        return child.finish(timeout_s=LONGEST_S)


@pytest.fixture
def address() -> Iterator[str]:
    """The ground link of a vehicle whose simulator runs longer than every ground program."""
    hil, link = free_port(), free_port(socket.SOCK_STREAM)
    sea = ("-m", "sitl", "--hil", f"udpout:127.0.0.1:{hil}", "--speed", SPEED, "--wait-for-arm")
    with autopilot(f"udpin:127.0.0.1:{hil}", f"tcpin:127.0.0.1:{link}"), process(*sea):
        yield f"tcp:127.0.0.1:{link}"


def interrupted_dive(address: str, folder: Path) -> Finished:
    """Fly until the log shows that the dive has begun, then press Ctrl-C."""
    (folder / "long.toml").write_text(MISSION)
    log = folder / "long.mcap"
    words = ("fly", str(folder / "long.toml"), "--connect", address, "--log", str(log))
    with process("-m", "ground", *words) as child:
        deadline = time.monotonic() + LONGEST_S
        while not log.exists() or log.stat().st_size < 150_000:
            assert child.running, child.finish()
            assert time.monotonic() < deadline
            time.sleep(0.05)
        child.signal(signal.SIGINT)
        return child.finish(timeout_s=LONGEST_S)


def test_interrupted_dive_is_held_and_ended_by_commands(address: str, tmp_path: Path) -> None:
    flown = interrupted_dive(address, tmp_path)
    assert flown.status == 130, flown
    assert (
        flown.stderr.splitlines()[-1]
        == "ground: interrupted; what was written is kept; the vehicle is still under way in mode"
        f" MISSION: `ground surface --connect {address}` ends the dive, `ground hold --connect"
        f" {address}` keeps depth, heading and thrust"
    )
    assert mcap.info(tmp_path / "long.mcap")["messages"] > 1000

    held = ground("hold", "--connect", address, "--json")
    assert held.status == 0, held
    report = json.loads(held.stdout)
    assert (report["mode"], report["armed"]) == ("HOLD", True)

    surfaced = ground("surface", "--connect", address, "--wait", "--json")
    assert surfaced.status == 0, surfaced
    report = json.loads(surfaced.stdout)
    assert not report["armed"]
    assert report["depth_m"] < 0.6, (
        "the vehicle disarms itself where SURF_DEPTH_M counts as the surface"
    )
