"""The vehicle's own log, with real processes: a dive without a link, broken downloads, kills."""

import json
import random
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from typing import Any

import pytest
from mcap.exceptions import McapError
from mcap.records import Channel, Message
from mcap.stream_reader import StreamReader

from ground.client import flight
from ground.client.flight import Dive
from ground.client.vehicle import VehicleClient
from ground.log_tools import mcap
from ground.simulation.processes import SimulatedVehicle, Simulation
from mavlink_io.logging.mcap import MAGIC
from sysid.data import readers as identification
from sysid.data.events import PlainText
from tests.helpers.fake_hil import TICK_US
from tests.helpers.pty_pair import Noise, line
from tests.helpers.subprocesses import Finished, autopilot, free_port, process
from tests.processes.test_autopilot import Harness

pytestmark = pytest.mark.process

LONGEST_S = 200.0
"""Wall time for a dive or a fit on a busy machine, in s."""

MISSION = """
name = "one test of each"

[[step]]
depth_m = 3.0
heading_deg = 0.0
thrust_pct = 58.0
duration_s = 40.0

[[step]]
test = { signal = "step", axis = "rudder", magnitude_deg = 5.0, duration_s = 15 }

[[step]]
depth_m = 3.0
heading_deg = 0.0
duration_s = 30.0

[[step]]
test = { signal = "doublet", axis = "elevator", magnitude_deg = 4.0, duration_s = 12 }

[[step]]
surface = true
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("dives")


@pytest.fixture(scope="module")
def mission(folder: Path) -> str:
    file = folder / "mission.toml"
    file.write_text(MISSION)
    return str(file)


def simulated(board: Path) -> SimulatedVehicle:
    return SimulatedVehicle(Simulation(scenario="disturbed", seed=5, logs=board))


@pytest.fixture(scope="module")
def told(folder: Path, mission: str) -> tuple[Path, Path]:
    """A dive with a link: ground's log of it, and the vehicle's."""
    dive = Dive.load(mission, folder / "ground.mcap")
    outcome = flight.fly_simulated(dive, simulated(folder / "told"))
    assert outcome.failsafes == ()
    (board,) = (folder / "told").glob("*.mcap")
    return dive.log, board


def ground(*words: str) -> Finished:
    done = subprocess.run(
        [sys.executable, "-m", "ground", *words], capture_output=True, text=True, timeout=LONGEST_S
    )
    return Finished(done.returncode, done.stdout, done.stderr)


def ask(*words: str) -> dict[str, Any]:
    answer = ground(*words, "--json")
    assert answer.status == 0, answer.stderr
    result: dict[str, Any] = json.loads(answer.stdout)
    return result


def until_finished(board: Path) -> Path:
    """Return the log on the vehicle, after the vehicle has ended it."""
    deadline = time.monotonic() + LONGEST_S
    while time.monotonic() < deadline:
        for path in board.glob("*.mcap"):
            if path.read_bytes()[-8:] == MAGIC and path.stat().st_size > 1000:
                return path
        time.sleep(0.1)
    raise AssertionError("the dive never came to an end")


def test_dive_without_link_is_recorded_and_identified(
    folder: Path, mission: str, told: tuple[Path, Path]
) -> None:
    board, home = folder / "silent", folder / "home"
    with simulated(board) as boat:
        with closing(boat.connect()) as transport:
            vehicle = VehicleClient(transport)
            vehicle.connect()
            flight.prepare(vehicle, Dive.load(mission, folder / "none.mcap"))
            vehicle.arm()
        kept = until_finished(board)
        (fetched,) = ask("log", "download", "--connect", boat.address, "--out", str(home))["logs"]
    assert (fetched["checked"], fetched["finished"]) == (True, True)
    here = Path(fetched["file"])
    assert here.read_bytes() == kept.read_bytes()

    silent, spoken, grounds = (identification.read(path) for path in (here, told[1], told[0]))
    assert silent.sha256 == spoken.sha256, "the record must not depend on the link"
    texts = [event.value.text for event in silent.events if isinstance(event.value, PlainText)]
    assert texts[-1] == "Surfaced: disarmed"
    assert silent.attitude.time_s.size == pytest.approx(50.0 * silent.attitude.time_s[-1], abs=150)
    assert set(grounds.attitude.time_s) <= set(silent.attitude.time_s)

    ours, theirs = refitted(here), refitted(told[0])
    assert ours.keys() == theirs.keys() > {"yaw static_gain_per_s", "pitch static_gain_per_s"}
    assert ours == pytest.approx(theirs, rel=1e-6)


def refitted(log: Path) -> dict[str, float]:
    """Return the model from a log alone, by the fast fit."""
    out = log.with_suffix(".json")
    finished = ground("refit", str(log), "--method", "paper", "--out", str(out))
    assert finished.status == 0, finished.stderr
    planes = json.loads(out.read_text())["planes"]
    return {
        f"{plane} {name}": found["value"]
        for plane, row in planes.items()
        for name, found in row.items()
        if found
    }


@contextmanager
def moored(folder: Path, *bytes_on_board: int, links: tuple[str, ...] = ()) -> Iterator[str]:
    """Return the address of a vehicle with incompressible logs of these sizes."""
    folder.mkdir()
    for number, size in enumerate(bytes_on_board, 1):
        (folder / f"{number:05d}-20260131T120000Z.mcap").write_bytes(content(number, size))
    port = free_port(socket.SOCK_STREAM)
    hil = f"udpin:127.0.0.1:{free_port()}"
    with autopilot(hil, f"tcpin:127.0.0.1:{port}", *links, options=("--logs", str(folder))):
        yield f"tcp:127.0.0.1:{port}"


def content(number: int, size: int) -> bytes:
    return random.Random(number).randbytes(size)


def test_logs_are_listed_and_selected(tmp_path: Path) -> None:
    with moored(tmp_path / "board", 1000, 0, 239) as address:
        link = ("--connect", address)
        listed = ask("log", "list", *link)["logs"]
        assert [(log["number"], log["bytes"]) for log in listed] == [(1, 1000), (2, 0), (3, 239)]
        out = tmp_path / "home"
        (latest,) = ask("log", "download", *link, "--out", str(out))["logs"]
        assert Path(latest["file"]).read_bytes() == content(3, 239)
        (out / "00001-20260131T120000Z.mcap").write_bytes(b"another vehicle's")
        every = ask("log", "download", "all", *link, "--out", str(out))["logs"]
        assert [Path(log["file"]).name for log in every] == [
            "00001-20260131T120000Z-2.mcap",
            "00002-20260131T120000Z.mcap",
            "00003-20260131T120000Z.mcap",
        ]
        assert (out / "00001-20260131T120000Z.mcap").read_bytes() == b"another vehicle's"
        refused = ground("log", "download", "7", *link, "--out", str(out))
        assert (refused.status, refused.stdout) == (2, "")
        assert (
            refused.stderr
            == "ground: log 7: the vehicle has 1, 2, 3; give one of these, latest or all\n"
        )


def test_killed_download_is_resumed(tmp_path: Path) -> None:
    size, out = 3_000_000, tmp_path / "home"
    part = out / "00001-20260131T120000Z.mcap.part"
    with moored(tmp_path / "board", size) as address:
        words = ("log", "download", "--connect", address, "--out", str(out))
        with process("-m", "ground", *words) as child:
            deadline = time.monotonic() + LONGEST_S
            while not part.exists() or part.stat().st_size < 200_000:
                assert child.running
                assert time.monotonic() < deadline
                time.sleep(0.01)
            child.signal(signal.SIGKILL)
        there = part.stat().st_size
        assert 200_000 <= there < size
        assert part.read_bytes() == content(1, size)[:there]
        (fetched,) = ask(*words)["logs"]
    assert (fetched["resumed_at"], fetched["bytes"], fetched["checked"]) == (there, size, True)
    assert Path(fetched["file"]).read_bytes() == content(1, size)
    assert not part.exists()


def test_download_rest_of_other_log_fails_checksum(tmp_path: Path) -> None:
    out = tmp_path / "home"
    out.mkdir()
    (out / "00001-20260131T120000Z.mcap.part").write_bytes(content(9, 5000))
    with moored(tmp_path / "board", 20_000) as address:
        (fetched,) = ask("log", "download", "--connect", address, "--out", str(out))["logs"]
    assert Path(fetched["file"]).read_bytes() == content(1, 20_000)
    assert fetched["checked"]


def test_log_download_over_slow_lossy_line_is_complete(tmp_path: Path) -> None:
    with line(tmp_path, 57_600, Noise(drop=3e-4, flip=3e-4)) as cable:
        links = (f"serial:{cable.device['vehicle']}:57600",)
        with moored(tmp_path / "board", 30_000, links=links):
            words = ("log", "download", "--connect", f"serial:{cable.device['ground']}:57600")
            (fetched,) = ask(*words, "--out", str(tmp_path / "home"))["logs"]
        assert cable.spoilt("vehicle") > 10
    assert Path(fetched["file"]).read_bytes() == content(1, 30_000)
    assert fetched["checked"]


def attitudes_on_disk(path: Path) -> int:
    """Return the number of attitudes in a log that is being written."""
    count = 0
    with path.open("rb") as file, suppress(McapError):
        channels = {}
        for record in StreamReader(file).records:
            if isinstance(record, Channel):
                channels[record.id] = record.topic
            elif isinstance(record, Message):
                count += channels[record.channel_id] == "/mavlink/1/1/ATTITUDE"
    return count


def test_killed_autopilot_loses_last_moment_only(tmp_path: Path) -> None:
    hil, port = free_port(), free_port(socket.SOCK_STREAM)
    options = ("--logs", str(tmp_path))
    with autopilot(f"udpin:127.0.0.1:{hil}", f"tcpin:127.0.0.1:{port}", options=options) as child:
        harness = Harness(child, hil, port)
        with closing(harness.simulator), closing(harness.ground):
            harness.simulator.ask(0)
            assert harness.ground.command(400, 1) == 0
            for tick in range(1, 101):
                harness.simulator.ask(tick * TICK_US)
            (path,) = tmp_path.glob("*.mcap")
            deadline = time.monotonic() + LONGEST_S
            while attitudes_on_disk(path) < 100:
                assert time.monotonic() < deadline
                time.sleep(0.05)
            child.signal(signal.SIGKILL)
    with pytest.raises(mcap.McapFileError, match="recover"):
        mcap.info(path)
    saved = ask("log", "recover", str(path), "--out", str(tmp_path / "saved.mcap"))
    read = identification.read(tmp_path / "saved.mcap")
    assert read.attitude.time_s == pytest.approx([0.02 * tick for tick in range(1, 101)])
    assert read.parameters["MAV_SYS_ID"] == 1.0
    assert saved["messages"] > 500
