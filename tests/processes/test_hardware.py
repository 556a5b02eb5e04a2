"""Hardware in the loop: the simulator on one serial line, ground on another, without lockstep.

The dives run in real time, therefore in parallel.
"""

import json
import re
import signal
import socket
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack, closing, contextmanager
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from mcap.reader import make_reader

from ground.client import flight, vehicle
from ground.missions import plans
from mavlink_io.endpoint import Endpoint
from mavlink_io.transport import open_transport
from tests.helpers.pty_pair import Line, Noise, line
from tests.helpers.subprocesses import (
    REAL_TIME_NICENESS,
    Finished,
    Process,
    autopilot,
    free_port,
    process,
)

pytestmark = pytest.mark.process

DEPTH_M, LEG_S = 1.5, 22
MISSION = f"""
name = "short"

[[step]]
depth_m = {DEPTH_M}
heading_deg = 0.0
thrust_pct = 58.0
duration_s = {LEG_S}

[[step]]
surface = true
"""
NOISE = Noise(drop=3e-4, flip=3e-4)
OUTAGE_S = 3.0
EXAMPLE = str(Path(__file__).parents[2] / "examples" / "tailcone.py")
SERVO_1, DUCT = 33, 140


class Truth(NamedTuple):
    """The true state, one row per tick."""

    rows: list[Any]

    @classmethod
    def read(cls, log: Path) -> "Truth":
        with log.open("rb") as file:
            return cls(
                [json.loads(message.data) for _, _, message in make_reader(file).iter_messages()]
            )

    @property
    def depths_m(self) -> list[float]:
        return [row["position_ned_m"][2] for row in self.rows]


class Rig(NamedTuple):
    """Simulator and autopilot, connected by a serial line."""

    autopilot: Process
    simulator: Process
    hil: Line
    truth: Path

    def stop(self) -> tuple[str, str]:
        """End both programs; return their output on stderr."""
        outputs = []
        for child in (self.autopilot, self.simulator):
            child.signal(signal.SIGTERM)
            finished = child.finish()
            assert finished.status == 0, finished
            outputs.append(finished.stderr)
        return outputs[0], outputs[1]


@contextmanager
def rig(folder: Path, baud: int, ground: str, noise: Noise) -> Iterator[Rig]:
    truth = folder / "truth.mcap"
    with (
        line(folder, baud, noise) as hil,
        autopilot(
            f"serial:{hil.device['vehicle']}:{baud}", ground, options=("--logs", "off")
        ) as child,
        process(
            "-m",
            "sitl",
            "--hil",
            f"serial:{hil.device['ground']}:{baud}",
            "--no-lockstep",
            "--truth",
            str(truth),
        ) as simulator,
    ):
        for program in (child, simulator):
            program.set_niceness(REAL_TIME_NICENESS)
        yield Rig(child, simulator, hil, truth)


class Flown(NamedTuple):
    """Result of a dive with ``ground fly`` over a second serial line."""

    ground: Finished
    stderr: tuple[str, str]
    """Output of the autopilot and of the simulator."""
    truth: Truth
    log: Path
    wall_s: float
    """Wall time between the start of the first program and the end of the last one."""


def fly(folder: Path, hil_baud: int, ground_baud: int) -> Flown:
    cables, script, log = folder / "radio", folder / "short.toml", folder / "dive.mcap"
    cables.mkdir()
    script.write_text(MISSION)
    start_s = time.monotonic()
    with (
        line(cables, ground_baud, NOISE, seed=2) as radio,
        rig(
            folder, hil_baud, f"serial:{radio.device['vehicle']}:{ground_baud}", NOISE
        ) as vehicle_rig,
        process(
            "-m",
            "ground",
            "fly",
            str(script),
            "--connect",
            f"serial:{radio.device['ground']}:{ground_baud}",
            "--log",
            str(log),
            "--json",
        ) as ground,
    ):
        finished = ground.finish(timeout_s=120.0)
        stderr = vehicle_rig.stop()
    wall_s = time.monotonic() - start_s
    return Flown(finished, stderr, Truth.read(vehicle_rig.truth), log, wall_s)


class Interrupted(NamedTuple):
    """Result of a dive with an interruption of the HIL line."""

    texts: list[str]
    armed: bool
    stderr: tuple[str, str]
    """Output of the autopilot and of the simulator."""
    depths_m: tuple[float, float]
    """Depths before the line was unplugged, and at the end."""
    truth: Truth


def interrupt(folder: Path) -> Interrupted:
    script, port = folder / "short.toml", free_port(socket.SOCK_STREAM)
    script.write_text(MISSION)
    with rig(folder, 57_600, f"tcpin:127.0.0.1:{port}", NOISE) as vehicle_rig:
        client = vehicle.VehicleClient(open_transport(f"tcp:127.0.0.1:{port}"))
        with closing(client):
            client.connect()
            flight.prepare(
                client, flight.Dive("short", plans.load_items(str(script)), folder / "unused.mcap")
            )
            client.arm()
            pump(client, lambda: depth_m(client) > 0.6)
            before_m = depth_m(client)
            vehicle_rig.hil.unplug("vehicle")
            until_s = time.monotonic() + OUTAGE_S
            pump(client, lambda: time.monotonic() > until_s)
            vehicle_rig.hil.plug("vehicle")
            pump(
                client,
                lambda: (
                    "Sensors recovered" in texts_of(client) and depth_m(client) > before_m + 0.2
                ),
            )
            texts, armed, after_m = texts_of(client), client.armed, depth_m(client)
        stderr = vehicle_rig.stop()
    return Interrupted(texts, armed, stderr, (before_m, after_m), Truth.read(vehicle_rig.truth))


def pump(client: vehicle.VehicleClient, done: Callable[[], bool], within_s: float = 60.0) -> None:
    deadline_s = time.monotonic() + within_s
    while not done():
        assert time.monotonic() < deadline_s, texts_of(client)
        client.pump(0.05)


def depth_m(client: vehicle.VehicleClient) -> float:
    position = client.latest("LOCAL_POSITION_NED")
    return 0.0 if position is None else float(position.z)


def texts_of(client: vehicle.VehicleClient) -> list[str]:
    return [text.text for text in client.texts]


class BenchResult(NamedTuple):
    """Result of the example of docs/hardware.md, connected to an autopilot."""

    texts: list[str]
    duct: float
    """Normalised rudder deflection that ground received."""
    released_s: float
    """Time from the autopilot's end until the duct was centred, in s."""


def try_example(folder: Path) -> BenchResult:
    port = free_port()
    with ExitStack() as stack:
        cable = stack.enter_context(line(folder, 115_200, NOISE))
        hil = f"serial:{cable.device['vehicle']}:115200"
        child = stack.enter_context(
            autopilot(hil, f"udpout:127.0.0.1:{port}", options=("--logs", "off"))
        )
        tailcone = stack.enter_context(process(EXAMPLE, cable.device["ground"], "115200"))
        ground = Endpoint(
            stack.enter_context(closing(open_transport(f"udpin:127.0.0.1:{port}"))), 250, 190
        )
        texts: list[str] = []
        receive_until(ground, texts, lambda frame: frame.name == "ATTITUDE")
        begin_test(ground, rudder=0.5, seconds=3.0)
        deflected = receive_until(
            ground,
            texts,
            lambda frame: frame.component == DUCT and frame.decode().actuator[0] > 0.1,
        )
        tailcone.read_until(r"rudder \+7\.5 deg, elevator \+0\.0 deg, thrust \+0 %")
        child.kill()
        killed_s = time.monotonic()
        tailcone.read_until(r"rudder \+0\.0 deg")
        return BenchResult(texts, deflected.decode().actuator[0], time.monotonic() - killed_s)


def begin_test(ground: Endpoint, rudder: float, seconds: float) -> None:
    """Send ACTUATOR_TEST for the rudder."""
    ground.send(
        "COMMAND_LONG",
        target_system=1,
        target_component=1,
        command=310,
        confirmation=0,
        param1=rudder,
        param2=seconds,
        param3=0,
        param4=0,
        param5=SERVO_1,
        param6=0,
        param7=0,
    )


def receive_until(ground: Endpoint, texts: list[str], condition: Callable[[Any], bool]) -> Any:
    """Return the first matching frame; store the texts that come before it."""
    deadline_s = time.monotonic() + 30.0
    while time.monotonic() < deadline_s:
        for frame in ground.receive():
            if frame.name == "STATUSTEXT":
                texts.append(frame.decode().text)
            if condition(frame):
                return frame
        time.sleep(0.01)
    raise AssertionError(texts)


class Scenes(NamedTuple):
    """Results of all dives, which run in parallel."""

    wide: Future[Flown]
    narrow: Future[Flown]
    interrupted: Future[Interrupted]
    bench: Future[BenchResult]


@pytest.fixture(scope="module")
def scenes(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Scenes]:
    wide, narrow, interrupted, bench = (tmp_path_factory.mktemp(name) for name in Scenes._fields)
    with ThreadPoolExecutor() as executor:
        yield Scenes(
            executor.submit(fly, wide, 115_200, 57_600),
            executor.submit(fly, narrow, 57_600, 9_600),
            executor.submit(interrupt, interrupted),
            executor.submit(try_example, bench),
        )


@pytest.mark.parametrize("width", ["wide", "narrow"])
def test_dive_over_noisy_lines_holds_depth_and_is_logged(scenes: Scenes, width: str) -> None:
    flown: Flown = getattr(scenes, width).result()
    assert flown.ground.status == 0, flown.ground
    outcome = json.loads(flown.ground.stdout)
    texts = {"Mode MISSION", "Armed: MISSION", "Mode SURFACE", "Surfaced: disarmed"}
    assert len(texts.intersection(outcome["texts"])) >= 2, (
        "noise can remove one or two texts, rarely three"
    )
    assert not any(text.startswith("Failsafe") for text in outcome["texts"])
    assert outcome["lost_frames"] > 0, "the line was not noisy"
    # Not the times of `ground fly`: its first message may be older than its last one by a queue.
    assert flown.truth.rows[-1]["time_us"] * 1e-6 <= flown.wall_s, (
        "vehicle time must not be ahead of the wall clock"
    )
    assert max(flown.truth.depths_m) == pytest.approx(DEPTH_M, abs=0.15)
    assert flown.truth.depths_m[-1] < 0.6
    with flown.log.open("rb") as file:
        logged = [channel.topic for _, channel, _ in make_reader(file).iter_messages()]
    attitudes = logged.count("/mavlink/1/1/ATTITUDE")
    assert attitudes > LEG_S * (5 if width == "wide" else 0.5)
    autopilot_stderr, simulator_stderr = flown.stderr
    assert autopilot_stderr == ""
    messages = [
        text for text in simulator_stderr.splitlines() if not text.startswith("sitl: too busy")
    ]
    assert re.fullmatch(r"sitl: actuators after \d+\.\d s", messages[0])
    assert len(messages) % 2 == 1, (
        "each actuator timeout on a busy machine must be followed by a recovery"
    )


def test_time_follows_wall_clock_at_line_rate(scenes: Scenes) -> None:
    for flown, step_us in ((scenes.wide.result(), 20_000), (scenes.narrow.result(), 40_000)):
        times_us = [row["time_us"] for row in flown.truth.rows]
        assert {after - before for before, after in pairwise(times_us)} == {step_us}


def test_unplugged_hil_line_is_reported_and_tolerated(scenes: Scenes) -> None:
    result = scenes.interrupted.result()
    assert "Sensors recovered" in result.texts[result.texts.index("Sensor timeout") :]
    assert not any(text.startswith(("Failsafe", "Restarted")) for text in result.texts)
    assert result.armed
    before_m, after_m = result.depths_m
    assert after_m > before_m + 0.2, "the vehicle must continue its dive"
    autopilot_stderr, simulator_stderr = result.stderr
    assert "lost (" in autopilot_stderr
    assert autopilot_stderr.rstrip().endswith(": back")
    assert "sitl: no actuators for 1 s: duct straight, propeller stopped\n" in simulator_stderr


def test_propeller_stops_without_actuator_commands(scenes: Scenes) -> None:
    rows = scenes.interrupted.result().truth.rows
    turning = [row["propeller_rps"] > 0.0 for row in rows]
    started = turning.index(True)
    stopped = turning.index(False, started)
    restarted = turning.index(True, stopped)
    assert (
        OUTAGE_S - 1.5
        < 1e-6 * (rows[restarted]["time_us"] - rows[stopped]["time_us"])
        < OUTAGE_S + 1.5
    )
    for axis in ("rudder_rad", "elevator_rad"):
        assert rows[restarted][axis] == pytest.approx(rows[0][axis], abs=0.03), (
            "straight, except for position errors of the motors"
        )


def test_example_centres_duct_when_autopilot_ends(scenes: Scenes) -> None:
    result = scenes.bench.result()
    assert result.duct == pytest.approx(0.5)
    assert 0.7 < result.released_s < 3.0
    assert result.texts == [], "the vehicle must report no fault on the bench"


@pytest.mark.parametrize(
    ("options", "error_line"),
    [
        (
            ("--speed", "2"),
            "sitl: --speed 2 cannot be combined with --no-lockstep:"
            " vehicle time follows the wall clock\n",
        ),
        (
            ("--wait-for-arm",),
            "sitl: --wait-for-arm cannot be combined with --no-lockstep:"
            " real time cannot be paused\n",
        ),
    ],
)
def test_options_incompatible_with_wall_clock_are_refused(
    options: tuple[str, ...], error_line: str
) -> None:
    with process("-m", "sitl", "--no-lockstep", *options) as simulator:
        assert simulator.finish() == (2, "", error_line)


def test_line_too_slow_for_sensors_is_refused(tmp_path: Path) -> None:
    slow = f"serial:{tmp_path}/tty-ground:9600"
    with line(tmp_path, 9600), process("-m", "sitl", "--no-lockstep", "--hil", slow) as simulator:
        finished = simulator.finish()
    assert finished.status == 2
    assert finished.stderr.endswith("too slow for the sensors: expected 38400 baud or more\n")
    assert finished.stderr.count("\n") == 1
