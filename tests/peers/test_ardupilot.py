"""The real simulator with a peer that behaves like ArduPilot."""

import math
import signal
from collections.abc import Iterator
from contextlib import closing
from itertools import pairwise

import pytest

from tests.helpers.subprocesses import free_port, process
from tests.peers.ardupilot import ArduPilot, Motion, read

pytestmark = pytest.mark.process

DEEP = "[start]\ndepth_m = 5.0\nheading_deg = 90.0\nspeed_mps = 1.0\n"
LEFT_TO_STAND = 0.2
"""Wall time after which a missing answer is considered absent, in s."""


@pytest.fixture(scope="module")
def port(tmp_path_factory: pytest.TempPathFactory) -> Iterator[int]:
    """One simulator for this file; frame number 0 restarts the vehicle."""
    scenario, port = tmp_path_factory.mktemp("ardupilot") / "deep.toml", free_port()
    scenario.write_text(DEEP)
    address = f"udpin:127.0.0.1:{port}"
    with process(
        "-m", "sitl", "--autopilot", "ardupilot", "--hil", address, "--scenario", str(scenario)
    ) as sitl:
        yield port
        assert sitl.running, "only the simulator may answer here"


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


def test_mandatory_fields_give_the_state(ardupilot: ArduPilot) -> None:
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


def test_position_velocity_attitude_are_consistent(ardupilot: ArduPilot) -> None:
    """Each quantity is the integral of the next, by the trapezoidal rule over 2.5 ms."""
    motions = ardupilot.fly(800, (1600, 1450, 1732))
    for axis in range(3):
        distance = sum(
            0.5 * (a.velocity_ned_mps[axis] + b.velocity_ned_mps[axis]) / 400
            for a, b in pairwise(motions)
        )
        assert motions[-1].position_ned_m[axis] - motions[0].position_ned_m[axis] == pytest.approx(
            distance, abs=1e-4
        )
    yaw_change = sum(0.5 * (a.gyro_radps[2] + b.gyro_radps[2]) / 400 for a, b in pairwise(motions))
    assert heading_rad(motions[-1]) - heading_rad(motions[0]) == pytest.approx(yaw_change, abs=2e-3)


@pytest.mark.parametrize(
    ("frame_rate_hz", "step_s"), [(50, 0.02), (400, 0.0025), (1200, 0.000833), (10, 0.02)]
)
def test_each_frame_is_one_step_of_the_frame_rate(
    port: int, frame_rate_hz: int, step_s: float
) -> None:
    with closing(ArduPilot(port, frame_rate_hz)) as ardupilot:
        motions = ardupilot.fly(120)
    assert motions[0].timestamp_s == pytest.approx(step_s, abs=1e-9)
    assert steps_s(motions) == pytest.approx([step_s] * 119, abs=1e-9)


def test_motion_hardly_depends_on_frame_rate(port: int) -> None:
    ends = []
    for frame_rate_hz in (50, 400):
        with closing(ArduPilot(port, frame_rate_hz)) as ardupilot:
            ends.append(ardupilot.fly(4 * frame_rate_hz, (1600, 1500, 1732))[-1])
    assert ends[0].position_ned_m == pytest.approx(ends[1].position_ned_m, abs=0.02)
    assert heading_rad(ends[0]) == pytest.approx(heading_rad(ends[1]), abs=0.01)


def test_32_channels_are_accepted(port: int) -> None:
    with closing(ArduPilot(port, channels=32)) as ardupilot:
        assert len(ardupilot.fly(10)) == 10


def test_repeated_frame_is_answered_without_a_step(ardupilot: ArduPilot) -> None:
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


def test_lost_frames_leave_no_gap_in_time(ardupilot: ArduPilot) -> None:
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
        ardupilot.receive(LEFT_TO_STAND)
    assert steps_s([before, ardupilot.step()]) == pytest.approx([1 / 400])


def test_restarted_ardupilot_gets_restarted_vehicle(ardupilot: ArduPilot) -> None:
    first = ardupilot.fly(200, (1800, 1500, 1732))
    ardupilot.restart(400)
    assert ardupilot.fly(200, (1800, 1500, 1732)) == first
    ardupilot.restart(1200)
    assert steps_s(ardupilot.fly(20)) == pytest.approx([0.000833] * 19, abs=1e-9)


def test_pause_stops_vehicle_time_only(ardupilot: ArduPilot) -> None:
    before = ardupilot.fly(20)[-1]
    with pytest.raises(TimeoutError):
        ardupilot.receive(1.0)
    assert steps_s([before, ardupilot.step()]) == pytest.approx([1 / 400])


def steered(port: int, *pulses_us: int) -> Motion:
    """Return the state after eight seconds with these servos."""
    with closing(ArduPilot(port, 100)) as ardupilot:
        return ardupilot.fly(800, pulses_us)[-1]


def test_servos_steer_the_vehicle(port: int) -> None:
    straight = steered(port, 1500, 1500, 1732)
    to_starboard, to_port = steered(port, 1740, 1500, 1732), steered(port, 1260, 1500, 1732)
    assert heading_rad(to_starboard) > heading_rad(straight) + math.radians(3.0)
    assert heading_rad(to_port) < heading_rad(straight) - math.radians(3.0)
    assert pitch_rad(steered(port, 1500, 1740, 1732)) > pitch_rad(straight) + math.radians(2.0)
    assert speed_mps(straight) > speed_mps(steered(port, 1500, 1500, 1500)) + 0.2
    assert steered(port, 0, 0, 0) == steered(port, 1500, 1500, 1500), (
        "an output that is not in use asks for nothing"
    )
    assert steered(port, 1500, 1500, 2200) == steered(port, 1500, 1500, 1900), "no more than all"


def test_stop_without_requests_ends_run_cleanly() -> None:
    port = free_port()
    with process(
        "-m", "sitl", "--autopilot", "ardupilot", "--hil", f"udpin:127.0.0.1:{port}"
    ) as sitl:
        with closing(ArduPilot(port)) as ardupilot:
            ardupilot.step()
        sitl.signal(signal.SIGTERM)
        ended = sitl.finish()
    assert (ended.status, ended.stdout, ended.stderr) == (0, "", "")
