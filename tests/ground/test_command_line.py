"""The command line with real processes: exit status, error messages and JSON."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from mcap.reader import make_reader

from ground.log_tools import mcap
from ground.simulation.processes import SimulatedVehicle, Simulation
from sysid.data import readers

pytestmark = pytest.mark.process
ROOT = Path(__file__).parents[2]
SHORT = """
name = "short"

[[step]]
depth_m = 1.5
heading_deg = 10.0
thrust_pct = 58.0
duration_s = 25.0

[[step]]
test = { signal = "step", axis = "rudder", magnitude_deg = 3.0, duration_s = 4 }

[[step]]
surface = true
"""


def ground(*words: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        command(*words), cwd=cwd, env=environment(), capture_output=True, text=True, check=False
    )


def start(*words: str, cwd: Path) -> subprocess.Popen[str]:
    return subprocess.Popen(
        command(*words),
        cwd=cwd,
        env=environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def command(*words: str) -> list[str]:
    return [sys.executable, "-m", "ground", *words]


def environment() -> dict[str, str]:
    return {**os.environ, "PYTHONPATH": str(ROOT), "TERM": "dumb"}


@pytest.fixture
def mission(tmp_path: Path) -> Path:
    path = tmp_path / "short.toml"
    path.write_text(SHORT)
    return path


def test_fly_simulated_loses_no_message(tmp_path: Path, mission: Path) -> None:
    done = ground("fly", "short.toml", "--sitl", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    assert told["lost_frames"] == 0
    assert told["texts"].count("SystemID Finished") == 1
    found = mcap.info(tmp_path / "short.mcap")
    assert found["lost_frames"] == 0
    assert found["attachments"] == ["mission.plan", "params.json"]
    assert readers.read(tmp_path / "short.mcap").parameters["HDG_P"] == pytest.approx(0.65)
    flown_s = told["vehicle_s"]
    assert found["topics"]["/mavlink/1/1/ATTITUDE"] >= 50 * flown_s - 2
    assert {"/log", "/tf", "/foxglove/location"} <= set(found["topics"])


def test_fly_same_seed_same_telemetry(tmp_path: Path, mission: Path) -> None:
    def flown(name: str, seed: str) -> list[tuple[str, bytes]]:
        words = (
            "fly",
            "short.toml",
            "--sitl",
            "--scenario",
            "disturbed",
            "--seed",
            seed,
            "--log",
            name,
        )
        done = ground(*words, cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        return telemetry(tmp_path / name)

    first, again, other = flown("a.mcap", "5"), flown("b.mcap", "5"), flown("c.mcap", "6")
    assert len(first) > 1000
    assert first == again
    assert first != other


def telemetry(path: Path) -> list[tuple[str, bytes]]:
    """Return messages that the vehicle sends unrequested.

    Without heartbeats (wall clock) and without home, which the vehicle publishes in two messages
    with its first sensor sample: the ground may not be connected yet.
    """
    answers = {
        "COMMAND_ACK",
        "PARAM_VALUE",
        "AVAILABLE_MODES",
        "MISSION_ACK",
        "MISSION_REQUEST_INT",
        "HOME_POSITION",
        "GPS_GLOBAL_ORIGIN",
    }
    with path.open("rb") as file:
        found = make_reader(file).iter_messages(log_time_order=False)
        sent = [
            (channel.topic, message.data)
            for _, channel, message in found
            if "/mavlink/1/1/" in channel.topic
        ]
    return [
        (topic, data) for topic, data in sent if topic.split("/")[-1] not in answers | {"HEARTBEAT"}
    ]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("fly", "absent.toml", "--sitl"), "absent.toml: no readable mission file"),
        (("fly", "wrong.toml", "--sitl"), "wrong.toml: step 1: depth_m = -3: must be 0 to 6000"),
        (("fly", "short.toml", "--sitl", "--vehicle", "whale"), "whale"),
        (("fly", "short.toml", "--sitl", "--scenario", "storm"), "storm"),
        (("fly", "short.toml", "--sitl", "--speed", "fast"), "fast"),
        (("fly", "short.toml", "--connect", "carrier:pigeon"), "carrier:pigeon"),
        (("fly", "short.toml", "--sitl", "--params", "wrong.param"), "wrong.param: line 2"),
        (("log", "info", "absent.mcap"), "absent.mcap: No such file"),
        (("log", "info", "short.toml"), "short.toml: not a log of a known format"),
        (("refit", "short.toml"), "short.toml"),
        (("redesign", "absent.json"), "absent.json"),
        (("report", "."), "holds no summary.json"),
        (("campaign", "--out", "."), "holds files that are no campaign"),
    ],
)
def test_invalid_input_is_one_line_and_status_2(
    words: tuple[str, ...], message: str, tmp_path: Path, mission: Path
) -> None:
    (tmp_path / "wrong.toml").write_text(SHORT.replace("1.5", "-3.0"))
    (tmp_path / "wrong.param").write_text("HDG_P,0.5\nHDG_D is 3\n")
    done = ground(*words, cwd=tmp_path)
    said = done.stderr.strip().splitlines()
    assert done.returncode == 2, done.stderr
    assert len(said) == 1, done.stderr
    assert said[0].startswith("ground: ")
    assert message in said[0]
    assert done.stdout == ""


def test_fly_unknown_parameter_fails(tmp_path: Path, mission: Path) -> None:
    (tmp_path / "odd.param").write_text("NO_SUCH,1\n")
    done = ground("fly", "short.toml", "--sitl", "--params", "odd.param", cwd=tmp_path)
    assert done.returncode == 1
    assert "NO_SUCH" in done.stderr
    assert "Traceback" not in done.stderr


@pytest.fixture
def flying(tmp_path: Path, mission: Path) -> Iterator[subprocess.Popen[str]]:
    """A long dive at ten times real time, some way into it."""
    (tmp_path / "short.toml").write_text(SHORT.replace("25.0", "2500.0"))
    process = start("fly", "short.toml", "--sitl", "--speed", "10", cwd=tmp_path)
    log = tmp_path / "short.mcap"
    try:
        while not log.exists() or log.stat().st_size < 150_000:
            assert process.poll() is None, process.communicate()[1]
            time.sleep(0.05)
        yield process
    finally:
        process.kill()
        process.communicate()


def children(process: subprocess.Popen[str]) -> dict[str, int]:
    """Process ids of sitl and autopilot by name."""
    listed = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
    names = {pid: Path(f"/proc/{pid}/cmdline").read_text().split("\0") for pid in listed}
    return {words[2]: int(pid) for pid, words in names.items()}


def is_alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().split()[2] != "Z"
    except FileNotFoundError:
        return False


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="reads child processes from /proc")
@pytest.mark.parametrize("victim", ["autopilot", "sitl"])
def test_fly_killed_process_is_named_and_log_closed(
    victim: str, flying: subprocess.Popen[str], tmp_path: Path
) -> None:
    started = children(flying)
    os.kill(started[victim], signal.SIGKILL)
    _, said = flying.communicate(timeout=60)
    assert flying.returncode == 1, said
    assert f"{victim} was killed by SIGKILL" in said
    assert "Traceback" not in said
    assert mcap.info(tmp_path / "short.mcap")["messages"] > 1000
    assert not any(is_alive(pid) for pid in started.values())


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="reads child processes from /proc")
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_fly_terminated_closes_log_and_processes(
    flying: subprocess.Popen[str], tmp_path: Path, number: signal.Signals
) -> None:
    started = children(flying)
    flying.send_signal(number)
    _, said = flying.communicate(timeout=60)
    assert flying.returncode == 1
    assert "interrupted" in said
    assert mcap.info(tmp_path / "short.mcap")["lost_frames"] == 0
    assert not any(is_alive(pid) for pid in started.values())


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="reads child processes from /proc")
def test_fly_killed_ends_processes_log_recoverable(
    flying: subprocess.Popen[str], tmp_path: Path
) -> None:
    started = children(flying)
    flying.kill()
    flying.wait()
    deadline = time.monotonic() + 20.0
    while any(is_alive(pid) for pid in started.values()):
        assert time.monotonic() < deadline, started
        time.sleep(0.05)
    done = ground("log", "recover", "short.mcap", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    saved = mcap.info(tmp_path / "short-recovered.mcap")
    assert saved["messages"] == json.loads(done.stdout)["messages"] > 1000
    assert saved["lost_frames"] == 0


def test_help_loads_no_numerical_library(tmp_path: Path) -> None:
    probe = (
        "import sys; import ground.cli.main; print([m for m in ('numpy', 'scipy', 'numba') if m in"
        " sys.modules])"
    )
    words = [sys.executable, "-c", probe]
    done = subprocess.run(
        words, cwd=tmp_path, env=environment(), capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "[]"


def test_params_save_set_load_and_rollback(tmp_path: Path) -> None:
    with SimulatedVehicle(Simulation()) as simulated:
        simulated.connect().close()
        link = ("--connect", simulated.address)
        assert ground("params", "save", "before.param", *link, cwd=tmp_path).returncode == 0
        assert (
            ground("params", "set", "HDG_P", "0.5", *link, cwd=tmp_path).stdout == "HDG_P = 0.5\n"
        )
        assert json.loads(
            ground("params", "get", "HDG_P", "--json", *link, cwd=tmp_path).stdout
        ) == {"HDG_P": 0.5}
        assert ground("params", "load", "before.param", *link, cwd=tmp_path).returncode == 0
        listed = json.loads(ground("params", "list", "--json", *link, cwd=tmp_path).stdout)
        assert listed["HDG_P"] == pytest.approx(0.65)
        (tmp_path / "new.param").write_text("HDG_P,0.75  # because\nDPT_P,0.2\n")
        loaded = ground("params", "load", "new.param", *link, cwd=tmp_path).stdout
        undone = ground("params", "rollback", "--json", *link, cwd=tmp_path).stdout
        other = ground("params", "load", "new.param", "--model", "absent.json", *link, cwd=tmp_path)
        refused = ground("params", "set", "HDG_P", "99", *link, cwd=tmp_path)
    assert [line.split() for line in loaded.splitlines()[:1]] == [
        ["HDG_P", "0.65", "->", "0.75", "because"]
    ]
    assert json.loads(undone)["parameters"]["HDG_P"]["now"] == pytest.approx(0.65)
    assert other.returncode == 2
    assert "absent.json" in other.stderr
    assert refused.returncode == 1
    assert "HDG_P" in refused.stderr
    assert "Traceback" not in refused.stderr


def test_paper_without_flights_reproduces_printed_numbers(tmp_path: Path) -> None:
    done = ground("paper", "--no-flights", "--json", "--out", "paper", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    assert told["reproduced"] is True
    assert told["items"]["Table 1"] == told["items"]["Table 4"]
    assert told["items"]["Figure 7"] == "not flown"
    assert len(told["table_4_radps"]) == len(told["table_4_alone"]) == 9
    assert all(reading["remain"] for reading in told["table_4_tailcones"])
    assert json.loads((tmp_path / "paper" / "paper.json").read_text()) == told
    for picture in ("root_locus", "bode", "delay"):
        assert (tmp_path / "paper" / f"table_4_{picture}.png").read_bytes().startswith(b"\x89PNG")
    assert "Table 4" in (tmp_path / "paper" / "paper.html").read_text(encoding="utf-8")
    again = ground("paper", "--no-flights", "--out", "paper", cwd=tmp_path)
    assert again.returncode == 2
    assert again.stderr == "ground: --out paper: is not an empty folder; give a new name\n"


def test_vehicle_gains_are_compared_with_the_papers(tmp_path: Path) -> None:
    done = ground("vehicle", "gains", "caribou_nominal", "--out", "first.param", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    stands, _, beside = done.stdout.partition("Compared with Table 3's initial gains")
    assert "stable" in stands
    for gain in ("HDG_P", "HDG_D", "HDG_I", "PTCH_P", "PTCH_D", "DPT_P", "DPT_I"):
        assert f"\n{gain}," in (tmp_path / "first.param").read_text()
        assert f"  {gain} " in beside
    refused = ground("vehicle", "gains", "caribou_nominal", "--out", "first.param", cwd=tmp_path)
    assert refused.returncode == 2
    assert refused.stderr == "ground: first.param: exists; give a new name\n"
