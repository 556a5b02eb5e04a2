"""The simulator process with a simulated PX4."""

import math
import signal
import time
from collections.abc import Iterator
from contextlib import closing
from itertools import pairwise
from pathlib import Path
from socket import SOCK_STREAM

import pytest

from tests.helpers.subprocesses import free_port, process
from tests.peers.px4 import Instant, Px4, UdpPx4

pytestmark = pytest.mark.process

STEP_US = 4000
GROUPS = {"accel": 0x07, "gyro": 0x38, "mag": 0x1C0, "baro": 0x1A00}
"""Groups of HIL_SENSOR.fields_updated: PX4 uses each as a whole or not at all."""
NOTHING_S = 0.15
"""Wall time after which a frame is taken to be held back: below the simulator's answer timeout."""
ATTEMPTS = 3
"""Attempts of a measurement of wall time, of which one must succeed on a busy machine."""
DEEP = "[start]\ndepth_m = 5.0\nheading_deg = 90.0\nspeed_mps = 1.0\n"


@pytest.fixture(scope="module")
def port() -> Iterator[int]:
    """One simulator for this file: every connection starts a new run."""
    port = free_port(SOCK_STREAM)
    with process(
        "-m", "sitl", "--autopilot", "px4", "--hil", f"tcpin:127.0.0.1:{port}", "--speed", "max"
    ) as sitl:
        yield port
        assert sitl.running, "another program answered on the simulator's port"


@pytest.fixture
def px4(port: int) -> Iterator[Px4]:
    with closing(Px4(port)) as px4:
        yield px4


def steps_us(instants: list[Instant]) -> set[int]:
    return {after.time_us - before.time_us for before, after in pairwise(instants)}


def is_waited_for(px4: Px4, nth: int = 1) -> bool:
    """Tell whether the simulator sends no further frame while the n-th is unanswered.

    One success in three attempts is enough: without waiting, frames arrive every few milliseconds,
    but on a busy machine this peer may answer after the simulator's timeout.
    """
    for _ in range(ATTEMPTS):
        for _ in range(nth):
            px4.receive()
        try:
            px4.receive(timeout_s=NOTHING_S)
        except TimeoutError:
            return True
        finally:
            px4.answer()
    return False


def test_sensors_have_equal_steps_and_whole_groups(px4: Px4) -> None:
    instants = list(px4.fly(500))
    assert instants[0].time_us > 0, "PX4 treats a time of zero as not set"
    assert steps_us(instants) == {STEP_US}
    assert px4.sensor_ids == {0}
    updated = [instant.sensor.fields_updated for instant in instants]
    assert all(bits & group in (0, group) for bits in updated for group in GROUPS.values())
    assert all(bits & 0x3F == 0x3F for bits in updated), "PX4 integrates the IMU of every step"
    for slower in ("mag", "baro"):
        assert sum(bool(bits & GROUPS[slower]) for bits in updated) == 100, "50 Hz"


def test_message_units_match_px4(px4: Px4) -> None:
    instants = list(px4.fly(300))
    sensor = instants[-1].sensor
    assert sensor.zacc == pytest.approx(-9.81, abs=0.1)
    assert math.hypot(sensor.xmag, sensor.ymag, sensor.zmag) == pytest.approx(0.5, abs=0.1), "gauss"
    assert 1013.0 < sensor.abs_pressure < 1060.0, "hPa, afloat"
    assert 0.0 < sensor.temperature < 30.0
    fixes = [fix for instant in instants if (fix := instant.find("HIL_GPS"))]
    assert [after.time_usec - before.time_usec for before, after in pairwise(fixes)] == [
        200_000
    ] * (len(fixes) - 1)
    assert (fixes[-1].fix_type, fixes[-1].eph, fixes[-1].epv) == (3, 150, 300), (
        "1.5 m and 3 m in centimetres"
    )
    assert fixes[-1].lat * 1e-7 == pytest.approx(42.35, abs=1e-3)
    ranges = [echo for instant in instants if (echo := instant.find("DISTANCE_SENSOR"))]
    assert {echo.orientation for echo in ranges} == {25}
    assert ranges[-1].current_distance == pytest.approx(2000, abs=60), "centimetres"


def test_truth_rate_follows_px4_request(px4: Px4) -> None:
    def truth_count(count: int) -> int:
        return sum(instant.find("HIL_STATE_QUATERNION") is not None for instant in px4.fly(count))

    px4.receive()
    px4.answer()
    assert truth_count(500) == 400, "every 5 ms of 2 s"
    px4.ask_for_truth(1e6)
    truth_count(3)
    assert truth_count(500) == 2
    px4.ask_for_truth(-1)
    truth_count(3)
    assert truth_count(100) == 0
    acknowledged = [instant.find("COMMAND_ACK") for instant in px4.fly(3)]
    assert acknowledged == [None] * 3, "acknowledged long ago"


def test_hil_sensor_is_last_message_of_tick(px4: Px4) -> None:
    """PX4 stamps received messages with its clock: messages of a tick must not come in the next."""
    instants = list(px4.fly(250))
    fixes = [
        (instant.time_us, fix.time_usec) for instant in instants if (fix := instant.find("HIL_GPS"))
    ]
    assert fixes
    assert all(received_us == fix_us for received_us, fix_us in fixes)


def test_step_waits_for_answer(px4: Px4) -> None:
    *_, before = px4.fly(50)
    assert is_waited_for(px4)
    assert px4.receive().time_us > before.time_us


def test_before_first_answer_time_runs_in_real_time(px4: Px4) -> None:
    silent = [px4.receive() for _ in range(150)]
    took_s = silent[-1].wall_s - silent[0].wall_s
    assert steps_us(silent) == {STEP_US}
    assert took_s > 0.9 * 149 * STEP_US * 1e-6, "not faster than the clock, whatever the speed-up"
    assert took_s < 15.0
    px4.answer()
    late = list(px4.fly(50))
    assert steps_us([silent[-1], *late]) == {STEP_US}
    assert is_waited_for(px4)


@pytest.mark.parametrize("nth", [2, 5])
def test_answers_to_every_nth_frame_are_waited_for(px4: Px4, nth: int) -> None:
    """Waiting for answers that never come would take half a second per frame."""
    instants = list(px4.fly(20))
    for _ in range(40):
        instants += [px4.receive() for _ in range(nth)]
        px4.answer()
    settled = time.monotonic()
    for _ in range(40):
        instants += [px4.receive() for _ in range(nth)]
        px4.answer()
    assert steps_us(instants) == {STEP_US}
    assert time.monotonic() - settled < 10.0
    assert is_waited_for(px4, nth)


def test_lockstep_resumes_after_two_seconds_without_answers(px4: Px4) -> None:
    instants = list(px4.fly(50))
    while instants[-1].wall_s - instants[49].wall_s < 2.0:
        instants.append(px4.receive())
    waits_s = sorted(after.wall_s - before.wall_s for before, after in pairwise(instants[49:]))
    assert waits_s[-2] < 1.0, "PX4 complains when nothing comes for a second"
    flown_s = 1e-6 * (instants[-1].time_us - instants[49].time_us)
    assert 0.2 < flown_s < instants[-1].wall_s - instants[49].wall_s + 0.1
    px4.answer()
    instants += px4.fly(100)
    assert steps_us(instants) == {STEP_US}
    assert is_waited_for(px4)


def test_no_step_is_lost_while_px4_hangs(px4: Px4) -> None:
    instants = list(px4.fly(50))
    time.sleep(2.0)
    instants += px4.fly(700)
    assert steps_us(instants) == {STEP_US}
    assert instants[-1].time_us > instants[49].time_us + 2_000_000


def test_new_connection_starts_a_new_run(port: int) -> None:
    """Before the first answer time runs in real time: on a busy machine the first answers are late.

    Therefore PX4 arms after some ticks, as it does: late answers then change nothing.
    """

    def messages() -> list[list[str]]:
        with closing(Px4(port)) as px4:
            instants = [*px4.fly(20, armed=False), *px4.fly(200, (0.5, 0.2, 0.6))]
            return [[message.to_json() for message in instant.messages] for instant in instants]

    first, second = messages(), messages()
    assert [instant[-1] for instant in first] == [instant[-1] for instant in second]
    assert first[5:] == second[5:], "the request for truth may arrive a tick earlier or later"


def test_without_lockstep_wait_is_one_step(px4: Px4) -> None:
    """A flight controller in a hardware-in-the-loop setup answers by its own clock.

    The quickest of three series counts: on a busy machine one of them may wait for a core.
    """
    instants: list[Instant] = []

    def series_s() -> float:
        first = len(instants)
        for gap in range(1, 16):
            instants.extend(px4.receive() for _ in range(gap))
            px4.answer(lockstep=False)
        return instants[-1].wall_s - instants[first].wall_s

    quickest_s = min(series_s() for _ in range(ATTEMPTS))
    assert steps_us(instants) == {STEP_US}
    assert quickest_s < 4.0, "waiting without an answer would take half a second each time"


@pytest.mark.parametrize(("rate_hz", "step_us"), [(400, 2500), (1200, 833)])
def test_step_is_that_of_the_rate_option(rate_hz: int, step_us: int) -> None:
    """PX4 requests no rate: it sets its clock to each HIL_SENSOR, so that every step will do."""
    port = free_port(SOCK_STREAM)
    address, rate = f"tcpin:127.0.0.1:{port}", str(rate_hz)
    options = ("--autopilot", "px4", "--hil", address, "--speed", "max", "--rate", rate)
    with process("-m", "sitl", *options), closing(Px4(port)) as px4:
        instants = list(px4.fly(rate_hz))
    assert steps_us(instants) == {step_us}
    updated = [instant.sensor.fields_updated for instant in instants]
    assert all(bits & 0x3F == 0x3F for bits in updated)
    assert sum(bool(bits & GROUPS["baro"]) for bits in updated) == 50, "50 Hz"


@pytest.fixture(scope="module")
def deep_port(tmp_path_factory: pytest.TempPathFactory) -> Iterator[int]:
    """One simulator with options: at depth, 100 Hz, assigned outputs, true pose as vision."""
    scenario, port = tmp_path_factory.mktemp("px4") / "deep.toml", free_port(SOCK_STREAM)
    scenario.write_text(DEEP)
    options = (
        "--rate",
        "100",
        "--outputs",
        "4,-6,1",
        "--hil-position",
        "vision",
        "--scenario",
        str(scenario),
    )
    with process(
        "-m",
        "sitl",
        "--autopilot",
        "px4",
        "--hil",
        f"tcpin:127.0.0.1:{port}",
        "--speed",
        "max",
        *options,
    ) as sitl:
        yield port
        assert sitl.running, "another program answered on the simulator's port"


def steered(
    port: int, rudder: float = 0.0, elevator: float = 0.0, thrust: float = 0.0, armed: bool = True
) -> Instant:
    """Return the last tick with truth after eight seconds with these controls."""
    controls = [0.0] * 6
    controls[3], controls[5], controls[0] = rudder, -elevator, thrust
    with closing(Px4(port)) as px4:
        with_truth = [
            instant
            for instant in px4.fly(800, controls, armed=armed)
            if instant.find("HIL_STATE_QUATERNION")
        ]
    return with_truth[-1]


def test_assigned_outputs_control_the_vehicle(deep_port: int) -> None:
    straight = steered(deep_port, thrust=0.58)
    to_starboard = steered(deep_port, thrust=0.58, rudder=0.6)
    upwards = steered(deep_port, thrust=0.58, elevator=0.6)
    assert straight.sensor.time_usec == 8_000_000
    assert to_starboard.sensor.zgyro > straight.sensor.zgyro + math.radians(1.0)
    assert upwards.sensor.xacc > straight.sensor.xacc + 0.3, (
        "with the nose up gravity acts aft and thrust forward"
    )
    moving = straight.find("HIL_STATE_QUATERNION")
    adrift = steered(deep_port).find("HIL_STATE_QUATERNION")
    assert moving is not None
    assert adrift is not None
    assert moving.vy > 100, "cm/s, eastward"
    assert adrift.vy < moving.vy - 20
    disarmed = steered(deep_port, thrust=0.58, armed=False).find("HIL_STATE_QUATERNION")
    assert disarmed is not None
    assert disarmed.vy == adrift.vy


def test_default_pressure_gives_depth_in_px4(deep_port: int) -> None:
    """Reference: PX4's formula of the standard atmosphere."""
    with closing(Px4(deep_port)) as px4:
        instants = list(px4.fly(20))
    pressure_pa = (
        100.0
        * [tick.sensor for tick in instants if tick.sensor.fields_updated & 0x1A00][-1].abs_pressure
    )
    lapse = -0.0065
    air_constant = 287.1
    gravity = 9.80665
    sea_level_k = 288.15
    sea_level_pa = 101_325.0
    exponent = -lapse * air_constant / gravity
    altitude_m = ((pressure_pa / sea_level_pa) ** exponent * sea_level_k - sea_level_k) / lapse
    assert altitude_m == pytest.approx(-5.0, abs=0.1)


def test_vision_pose_is_the_true_one_under_water(deep_port: int) -> None:
    with closing(Px4(deep_port)) as px4:
        instants = list(px4.fly(60))
    poses = [pose for tick in instants if (pose := tick.find("ODOMETRY"))]
    located = [pose for pose in poses if math.isfinite(pose.x)]
    assert len(located) == 6, "10 Hz beside the velocity of the DVL"
    last = located[-1]
    assert (last.frame_id, last.child_frame_id, last.estimator_type) == (1, 12, 2)
    assert last.z == pytest.approx(5.0, abs=0.1)
    assert 2.0 * math.atan2(last.q[3], last.q[0]) == pytest.approx(math.pi / 2, abs=0.01)
    assert last.pose_covariance[0] == pytest.approx(0.09)
    assert math.isnan(last.vx)


def test_px4_on_udp_receives_first_datagram(tmp_path: Path) -> None:
    with (
        closing(UdpPx4()) as px4,
        process(
            "-m",
            "sitl",
            "--autopilot",
            "px4",
            "--hil",
            f"udpout:127.0.0.1:{px4.port}",
            "--speed",
            "max",
        ) as sitl,
    ):
        px4.wait_for_simulator()
        instants = list(px4.fly(200))
        assert steps_us(instants) == {STEP_US}
        sitl.signal(signal.SIGTERM)
        ended = sitl.finish()
    assert (ended.status, ended.stdout, ended.stderr) == (0, "", "")


def test_signal_without_connection_exits_cleanly() -> None:
    port = free_port(SOCK_STREAM)
    with process("-m", "sitl", "--autopilot", "px4", "--hil", f"tcpin:127.0.0.1:{port}") as sitl:
        Px4(port).close()
        sitl.signal(signal.SIGINT)
        ended = sitl.finish()
    assert (ended.status, ended.stdout, ended.stderr) == (0, "", "")
