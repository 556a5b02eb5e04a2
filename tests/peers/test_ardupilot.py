"""The simulator process with a simulated ArduPilot."""

import math
import signal
import time
from collections.abc import Iterator
from contextlib import closing
from itertools import pairwise

import pytest

from tests.helpers.subprocesses import free_port, process
from tests.peers.ardupilot import ArduPilot, Motion, read

pytestmark = pytest.mark.process

DEEP = "[start]\ndepth_m = 5.0\nheading_deg = 90.0\nspeed_mps = 1.0\n"
NO_ANSWER_S = 0.2
"""Wall time after which an answer is taken not to come."""


@pytest.fixture(scope="module")
def port(tmp_path_factory: pytest.TempPathFactory) -> Iterator[int]:
    """One simulator for this file: frame number 0 starts a new run."""
    scenario, port = tmp_path_factory.mktemp("ardupilot") / "deep.toml", free_port()
    scenario.write_text(DEEP)
    address = f"udpin:127.0.0.1:{port}"
    with process(
        "-m", "sitl", "--autopilot", "ardupilot", "--hil", address, "--scenario", str(scenario)
    ) as sitl:
        yield port
        assert sitl.running, "another program answered on the simulator's port"


@pytest.fixture
def ardupilot(port: int) -> Iterator[ArduPilot]:
    with closing(ArduPilot(port)) as ardupilot:
        yield ardupilot


def steps_s(motions: list[Motion]) -> list[float]:
    return [after.timestamp_s - before.timestamp_s for before, after in pairwise(motions)]


def speed_mps(motion: Motion) -> float:
    return math.hypot(*motion.velocity_ned_mps)


def pitch_rad(motion: Motion) -> float:
    w, x, y, z = motion.quaternion
    return math.asin(2.0 * (w * y - z * x))


def heading_rad(motion: Motion) -> float:
    w, x, y, z = motion.quaternion
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def test_mandatory_fields_have_correct_values(ardupilot: ArduPilot) -> None:
    first, *_, last = ardupilot.fly(400)
    assert first.timestamp_s == 1 / 400
    assert last.timestamp_s == pytest.approx(1.0)
    assert first.position_ned_m == pytest.approx([0.0, 0.0, 5.0], abs=0.01)
    assert first.velocity_ned_mps == pytest.approx([0.0, 1.0, 0.0], abs=0.01)
    assert first.accel_body_mps2[2] == pytest.approx(-9.81, abs=0.1)
    assert heading_rad(first) == pytest.approx(math.pi / 2, abs=1e-3)
    assert math.hypot(*last.quaternion) == pytest.approx(1.0, abs=1e-9)
    assert last.rng_1_m == pytest.approx(15.0, abs=0.3)
    assert last.voltage_v is not None
    assert last.current_a is not None
    assert 20.0 < last.voltage_v < 34.0
    assert last.current_a > 0.0


def test_position_velocity_and_attitude_are_consistent(ardupilot: ArduPilot) -> None:
    """Position is the integral of velocity, heading that of yaw rate (trapezoid rule, 2.5 ms)."""
    motions = ardupilot.fly(800, (1600, 1450, 1732))
    for axis in range(3):
        gone = sum(
            0.5 * (a.velocity_ned_mps[axis] + b.velocity_ned_mps[axis]) / 400
            for a, b in pairwise(motions)
        )
        assert motions[-1].position_ned_m[axis] - motions[0].position_ned_m[axis] == pytest.approx(
            gone, abs=1e-4
        )
    turned = sum(0.5 * (a.gyro_radps[2] + b.gyro_radps[2]) / 400 for a, b in pairwise(motions))
    assert heading_rad(motions[-1]) - heading_rad(motions[0]) == pytest.approx(turned, abs=2e-3)


@pytest.mark.parametrize(
    ("frame_rate_hz", "step_s"), [(50, 0.02), (400, 0.0025), (1200, 0.000833), (10, 0.02)]
)
def test_each_frame_is_one_step_of_frame_rate(port: int, frame_rate_hz: int, step_s: float) -> None:
    with closing(ArduPilot(port, frame_rate_hz)) as ardupilot:
        motions = ardupilot.fly(120)
    assert motions[0].timestamp_s == pytest.approx(step_s, abs=1e-9)
    assert steps_s(motions) == pytest.approx([step_s] * 119, abs=1e-9)


@pytest.mark.parametrize(("first_hz", "goal_hz"), [(500, 400), (400, 500)])
def test_step_follows_rate_that_ramps(port: int, first_hz: int, goal_hz: int) -> None:
    with closing(ArduPilot(port, first_hz)) as ardupilot:
        motions = [*ardupilot.ramp(100, goal_hz), *ardupilot.fly(50)]
    way = [first_hz + (n if goal_hz > first_hz else -n) for n in range(101)]
    rates_hz = [*way, *[goal_hz] * 49]
    wanted_s = [round(1e6 / rate_hz) * 1e-6 for rate_hz in rates_hz[1:150]]
    assert steps_s(motions) == pytest.approx(wanted_s, abs=1e-9)
    for before, after in pairwise(motions):
        step_s = after.timestamp_s - before.timestamp_s
        moved_m = math.dist(after.position_ned_m, before.position_ned_m)
        assert moved_m == pytest.approx(speed_mps(before) * step_s, rel=0.02, abs=1e-6)


def test_attitude_agrees_with_quaternion(ardupilot: ArduPilot) -> None:
    last = ardupilot.fly(200, (1700, 1400, 1732))[-1]
    assert last.attitude_rad[1:] == pytest.approx([pitch_rad(last), heading_rad(last)], abs=1e-6)


def test_restart_after_a_kill_and_a_pause_starts_a_new_run(port: int) -> None:
    with closing(ArduPilot(port)) as first:
        first.fly(50)
        first.send(first.frame())  # the answer meets a closed port
    time.sleep(0.5)
    with closing(ArduPilot(port, 250)) as second:
        motions = second.fly(20)
    assert motions[0].timestamp_s == pytest.approx(0.004)
    assert steps_s(motions) == pytest.approx([0.004] * 19, abs=1e-9)


def test_motion_is_nearly_independent_of_frame_rate(port: int) -> None:
    ends = []
    for frame_rate_hz in (50, 400):
        with closing(ArduPilot(port, frame_rate_hz)) as ardupilot:
            ends.append(ardupilot.fly(4 * frame_rate_hz, (1600, 1500, 1732))[-1])
    assert ends[0].position_ned_m == pytest.approx(ends[1].position_ned_m, abs=0.02)
    assert heading_rad(ends[0]) == pytest.approx(heading_rad(ends[1]), abs=0.01)


def test_32_channel_frames_are_accepted(port: int) -> None:
    with closing(ArduPilot(port, channels=32)) as ardupilot:
        assert len(ardupilot.fly(10)) == 10


def test_repeated_frame_gets_same_answer_without_step(ardupilot: ArduPilot) -> None:
    before = ardupilot.fly(20)[-1]
    asked = ardupilot.frame()
    ardupilot.send(asked)
    answers = [ardupilot.receive()]
    for _ in range(3):
        ardupilot.send(asked)
        answers.append(ardupilot.receive())
    assert len(set(answers)) == 1
    ardupilot.count += 1
    after = ardupilot.step()
    assert steps_s([before, read(answers[0]), after]) == pytest.approx([1 / 400, 1 / 400])


def test_lost_frames_cause_no_gap_in_time(ardupilot: ArduPilot) -> None:
    before = ardupilot.fly(20)[-1]
    ardupilot.count += 7
    assert steps_s([before, ardupilot.step()]) == pytest.approx([1 / 400])


def test_late_and_foreign_datagrams_are_ignored(ardupilot: ArduPilot) -> None:
    before = ardupilot.fly(30)[-1]
    junk = (
        b"",
        b"hello",
        ardupilot.frame()[:-1],
        b"\x00\x00" + ardupilot.frame()[2:],
        ardupilot.frame(count=25),
    )
    for datagram in junk:
        ardupilot.send(datagram)
    with pytest.raises(TimeoutError):
        ardupilot.receive(NO_ANSWER_S)
    assert steps_s([before, ardupilot.step()]) == pytest.approx([1 / 400])


def test_restart_starts_a_new_run(ardupilot: ArduPilot) -> None:
    first = ardupilot.fly(200, (1800, 1500, 1732))
    ardupilot.restart(400)
    assert ardupilot.fly(200, (1800, 1500, 1732)) == first
    ardupilot.restart(1200)
    assert steps_s(ardupilot.fly(20)) == pytest.approx([0.000833] * 19, abs=1e-9)


def test_pause_stops_vehicle_time(ardupilot: ArduPilot) -> None:
    before = ardupilot.fly(20)[-1]
    with pytest.raises(TimeoutError):
        ardupilot.receive(1.0)
    assert steps_s([before, ardupilot.step()]) == pytest.approx([1 / 400])


def steered(port: int, *pulses_us: int) -> Motion:
    """Return the motion after eight seconds with these servo pulses."""
    with closing(ArduPilot(port, 100)) as ardupilot:
        return ardupilot.fly(800, pulses_us)[-1]


def test_servos_control_the_vehicle(port: int) -> None:
    straight = steered(port, 1500, 1500, 1732)
    to_starboard, to_port = steered(port, 1740, 1500, 1732), steered(port, 1260, 1500, 1732)
    assert heading_rad(to_starboard) > heading_rad(straight) + math.radians(3.0)
    assert heading_rad(to_port) < heading_rad(straight) - math.radians(3.0)
    assert pitch_rad(steered(port, 1500, 1740, 1732)) > pitch_rad(straight) + math.radians(2.0)
    assert speed_mps(straight) > speed_mps(steered(port, 1500, 1500, 1500)) + 0.2
    assert steered(port, 0, 0, 0) == steered(port, 1500, 1500, 1500), (
        "an output that is not in use means no command"
    )
    assert steered(port, 1500, 1500, 2200) == steered(port, 1500, 1500, 1900), "pulses are limited"


def test_signal_while_waiting_exits_cleanly() -> None:
    port = free_port()
    with process(
        "-m", "sitl", "--autopilot", "ardupilot", "--hil", f"udpin:127.0.0.1:{port}"
    ) as sitl:
        with closing(ArduPilot(port)) as ardupilot:
            ardupilot.step()
        sitl.signal(signal.SIGTERM)
        ended = sitl.finish()
    assert (ended.status, ended.stdout, ended.stderr) == (0, "", "")
