"""The real simulator with a peer that behaves like PX4."""

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
"""HIL_SENSOR.fields_updated: PX4 uses each group completely or not at all."""
NOTHING_S = 0.15
"""Wall time after which a missing frame is considered held back, in s.

It is less than the wait for PX4 and many steps of the clock.
"""
DEEP = "[start]\ndepth_m = 5.0\nheading_deg = 90.0\nspeed_mps = 1.0\n"


@pytest.fixture(scope="module")
def port() -> Iterator[int]:
    """One simulator for this file; every connection restarts the vehicle."""
    port = free_port(SOCK_STREAM)
    with process(
        "-m", "sitl", "--autopilot", "px4", "--hil", f"tcpin:127.0.0.1:{port}", "--speed", "max"
    ) as sitl:
        yield port
        assert sitl.running, "only the simulator may answer here"


@pytest.fixture
def px4(port: int) -> Iterator[Px4]:
    with closing(Px4(port)) as px4:
        yield px4


def steps_us(instants: list[Instant]) -> set[int]:
    return {after.time_us - before.time_us for before, after in pairwise(instants)}


def is_waited_for(px4: Px4, nth: int = 1) -> bool:
    """Return whether no further frame comes while the n-th is unanswered.

    One of three attempts is enough: without a wait, frames come every few milliseconds, but on a
    busy machine the peer may be slower than the simulator's timeout.
    """
    for _ in range(3):
        for _ in range(nth):
            px4.hear()
        try:
            px4.hear(patience_s=NOTHING_S)
        except TimeoutError:
            return True
        finally:
            px4.answer()
    return False


def test_sensors_come_in_equal_steps_and_whole_groups(px4: Px4) -> None:
    instants = list(px4.fly(500))
    assert instants[0].time_us > 0, "PX4 takes a time of zero for never"
    assert steps_us(instants) == {STEP_US}
    assert px4.sensor_ids == {0}
    updated = [instant.sensor.fields_updated for instant in instants]
    assert all(bits & group in (0, group) for bits in updated for group in GROUPS.values())
    assert all(bits & 0x3F == 0x3F for bits in updated), "PX4 integrates the IMU of every step"
    for slower in ("mag", "baro"):
        assert sum(bool(bits & GROUPS[slower]) for bits in updated) == 100, "50 Hz"


def test_sensor_units_match_px4(px4: Px4) -> None:
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


def test_truth_is_sent_at_requested_interval(px4: Px4) -> None:
    def told(count: int) -> int:
        return sum(instant.find("HIL_STATE_QUATERNION") is not None for instant in px4.fly(count))

    px4.hear()
    px4.answer()
    assert told(500) == 400, "every 5 ms of 2 s"
    px4.ask_for_truth(1e6)
    told(3)
    assert told(500) == 2
    px4.ask_for_truth(-1)
    told(3)
    assert told(100) == 0
    acknowledged = [instant.find("COMMAND_ACK") for instant in px4.fly(3)]
    assert acknowledged == [None] * 3, "acknowledged long ago"


def test_hil_sensor_is_last_message_of_an_instant(px4: Px4) -> None:
    """PX4 stamps received messages with its present clock.

    The messages of an instant must not arrive in the next one.
    """
    instants = list(px4.fly(250))
    fixes = [
        (instant.time_us, fix.time_usec) for instant in instants if (fix := instant.find("HIL_GPS"))
    ]
    assert fixes
    assert all(heard_us == fix_us for heard_us, fix_us in fixes)


def test_step_waits_for_the_previous_answer(px4: Px4) -> None:
    *_, before = px4.fly(50)
    assert is_waited_for(px4)
    assert px4.hear().time_us > before.time_us


def test_before_first_answer_time_follows_wall_clock(px4: Px4) -> None:
    silent = [px4.hear() for _ in range(150)]
    took_s = silent[-1].wall_s - silent[0].wall_s
    assert steps_us(silent) == {STEP_US}
    assert took_s > 0.9 * 149 * STEP_US * 1e-6, "not faster than the clock, whatever the speed-up"
    assert took_s < 15.0
    px4.answer()
    late = list(px4.fly(50))
    assert steps_us([silent[-1], *late]) == {STEP_US}
    assert is_waited_for(px4)


@pytest.mark.parametrize("nth", [2, 5])
def test_every_nth_answer_is_awaited(px4: Px4, nth: int) -> None:
    """A wait for each missing answer would take half a second per frame."""
    instants = list(px4.fly(20))
    for _ in range(40):
        instants += [px4.hear() for _ in range(nth)]
        px4.answer()
    settled = time.monotonic()
    for _ in range(40):
        instants += [px4.hear() for _ in range(nth)]
        px4.answer()
    assert steps_us(instants) == {STEP_US}
    assert time.monotonic() - settled < 10.0
    assert is_waited_for(px4, nth)


def test_two_seconds_of_silence_keep_the_lockstep(px4: Px4) -> None:
    instants = list(px4.fly(50))
    while instants[-1].wall_s - instants[49].wall_s < 2.0:
        instants.append(px4.hear(patience_s=1.0))  # PX4 complains when nothing comes for a second
    flown_s = 1e-6 * (instants[-1].time_us - instants[49].time_us)
    assert 0.2 < flown_s < instants[-1].wall_s - instants[49].wall_s + 0.1
    px4.answer()
    instants += px4.fly(100)
    assert steps_us(instants) == {STEP_US}
    assert is_waited_for(px4)


def test_hanging_px4_finds_every_step_in_its_queue(px4: Px4) -> None:
    instants = list(px4.fly(50))
    time.sleep(2.0)
    instants += px4.fly(700)
    assert steps_us(instants) == {STEP_US}
    assert instants[-1].time_us > instants[49].time_us + 2_000_000


def test_new_connection_gets_restarted_vehicle(port: int) -> None:
    def told() -> list[list[str]]:
        with closing(Px4(port)) as px4:
            return [
                [message.to_json() for message in each.messages]
                for each in px4.fly(200, (0.5, 0.2, 0.6))
            ]

    first, second = told(), told()
    assert [each[-1] for each in first] == [each[-1] for each in second]
    assert first[5:] == second[5:], "the request for truth may arrive an instant sooner or later"


def test_without_lockstep_answers_are_not_awaited(px4: Px4) -> None:
    """A flight controller in a hardware loop answers by its own clock."""
    instants = []
    for gap in range(1, 16):
        instants += [px4.hear() for _ in range(gap)]
        px4.answer(lockstep=False)
    assert steps_us(instants) == {STEP_US}
    assert instants[-1].wall_s - instants[0].wall_s < 4.0, (
        "waiting in vain would take half a second each time"
    )


@pytest.fixture(scope="module")
def deep_port(tmp_path_factory: pytest.TempPathFactory) -> Iterator[int]:
    """A simulator with options: in motion, 100 Hz, own outputs, air-equivalent barometer."""
    scenario, port = tmp_path_factory.mktemp("px4") / "deep.toml", free_port(SOCK_STREAM)
    scenario.write_text(DEEP)
    options = (
        "--rate",
        "100",
        "--outputs",
        "4,-6,1",
        "--hil-baro",
        "air_equivalent",
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
        assert sitl.running, "only the simulator may answer here"


def steered(
    port: int, rudder: float = 0.0, elevator: float = 0.0, thrust: float = 0.0, armed: bool = True
) -> Instant:
    """Return the last instant with truth after eight seconds with these commands."""
    controls = [0.0] * 6
    controls[3], controls[5], controls[0] = rudder, -elevator, thrust
    with closing(Px4(port)) as px4:
        told = [
            instant
            for instant in px4.fly(800, controls, armed=armed)
            if instant.find("HIL_STATE_QUATERNION")
        ]
    return told[-1]


def test_outputs_steer_as_assigned(deep_port: int) -> None:
    straight = steered(deep_port, thrust=0.58)
    to_starboard = steered(deep_port, thrust=0.58, rudder=0.6)
    upwards = steered(deep_port, thrust=0.58, elevator=0.6)
    assert straight.sensor.time_usec == 8_000_000
    assert to_starboard.sensor.zgyro > straight.sensor.zgyro + math.radians(1.0)
    assert upwards.sensor.xacc > straight.sensor.xacc + 0.3, (
        "the nose is up: gravity pulls aft, the hull pushes forward"
    )
    moving, adrift = (
        straight.find("HIL_STATE_QUATERNION"),
        steered(deep_port).find("HIL_STATE_QUATERNION"),
    )
    assert moving.vy > 100, "cm/s, eastward"
    assert adrift.vy < moving.vy - 20
    disarmed = steered(deep_port, thrust=0.58, armed=False).find("HIL_STATE_QUATERNION")
    assert disarmed.vy == adrift.vy


def test_air_equivalent_barometer_gives_depth(deep_port: int) -> None:
    """Return the altitude by PX4's formula, that of the standard atmosphere."""
    with closing(Px4(deep_port)) as px4:
        instants = list(px4.fly(20))
    pressure_pa = (
        100.0
        * [each.sensor for each in instants if each.sensor.fields_updated & 0x1A00][-1].abs_pressure
    )
    lapse, air_constant, gravity, sea_level_k, sea_level_pa = (
        -0.0065,
        287.1,
        9.80665,
        288.15,
        101_325.0,
    )
    exponent = -lapse * air_constant / gravity
    altitude_m = ((pressure_pa / sea_level_pa) ** exponent * sea_level_k - sea_level_k) / lapse
    assert altitude_m == pytest.approx(-5.0, abs=0.1)


def test_px4_with_udp_server_is_contacted_first(tmp_path: Path) -> None:
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


def test_stop_without_connection_ends_run_cleanly() -> None:
    port = free_port(SOCK_STREAM)
    with process("-m", "sitl", "--autopilot", "px4", "--hil", f"tcpin:127.0.0.1:{port}") as sitl:
        Px4(port).close()
        sitl.signal(signal.SIGINT)
        ended = sitl.finish()
    assert (ended.status, ended.stdout, ended.stderr) == (0, "", "")
