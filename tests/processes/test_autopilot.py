"""The autopilot as a process: lockstep contract, links, signals and error messages."""

import signal
import socket
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from mavlink_io import dialect
from mavlink_io.codec import Frame, encode
from mavlink_io.endpoint import Endpoint
from mavlink_io.mission_items import MissionItem
from mavlink_io.request import MavlinkId
from mavlink_io.services.missions import MissionClient
from mavlink_io.services.params import ParamClient
from mavlink_io.transport import Transport, open_transport, wait
from tests.helpers.exchange import run
from tests.helpers.fake_hil import TICK_US, sensors
from tests.helpers.subprocesses import (
    TIMEOUT_S,
    Process,
    autopilot,
    free_port,
    process,
)

pytestmark = pytest.mark.process

SENSOR = dialect.by_name("HIL_SENSOR")
GROUND, VEHICLE = MavlinkId(250, 190), MavlinkId(1, 1)
ARMED = 128


class Simulator:
    """The other end of the HIL link."""

    def __init__(self, port: int) -> None:
        self._transport = open_transport(f"udpout:127.0.0.1:{port}")
        self._endpoint = Endpoint(self._transport, 2, 1)

    def send(self, time_us: int, *more: bytes) -> None:
        frame = self._endpoint.encode_values(SENSOR, sensors(time_us, depth_m=2.0))
        self._transport.send(b"".join((frame, *more)))

    def answer(self) -> Any:
        while True:
            assert wait([self._transport], TIMEOUT_S)
            for frame in self._endpoint.receive():
                assert frame.name == "HIL_ACTUATOR_CONTROLS"
                return frame.decode()

    def ask(self, time_us: int) -> Any:
        self.send(time_us)
        return self.answer()

    def close(self) -> None:
        self._transport.close()


class Ground:
    """A ground station on a TCP link, which is lossless."""

    def __init__(self, port: int) -> None:
        self.transport: Transport = open_transport(f"tcp:127.0.0.1:{port}")
        self.endpoint = Endpoint(self.transport, *GROUND)

    def command(self, number: int, *parameters: float) -> int:
        filled = [*parameters, *[float("nan")] * (7 - len(parameters))]
        self.endpoint.send(
            "COMMAND_LONG",
            target_system=1,
            target_component=1,
            command=number,
            confirmation=0,
            **{f"param{n}": value for n, value in enumerate(filled, 1)},
        )
        return int(self.wait_for("COMMAND_ACK").result)

    def frames(self) -> list[Frame]:
        return self.endpoint.receive() if wait([self.transport], TIMEOUT_S) else []

    def wait_for(self, name: str) -> Any:
        while True:
            frames = self.frames()
            assert frames, f"no {name} was received"
            for frame in frames:
                if frame.name == name:
                    return frame.decode()

    def close(self) -> None:
        self.transport.close()


class Harness:
    """An autopilot process between a simulator and a ground station."""

    def __init__(self, child: Process, hil_port: int, ground_port: int) -> None:
        self.process = child
        self.simulator, self.ground = Simulator(hil_port), Ground(ground_port)


@pytest.fixture
def harness() -> Iterator[Harness]:
    hil, ground = free_port(), free_port(socket.SOCK_STREAM)
    with autopilot(f"udpin:127.0.0.1:{hil}", f"tcpin:127.0.0.1:{ground}") as child:
        built = Harness(child, hil, ground)
        with closing(built.simulator), closing(built.ground):
            yield built


def test_each_sensor_frame_is_answered_with_its_time(harness: Harness) -> None:
    for tick in range(100):
        answer = harness.simulator.ask(tick * TICK_US)
        assert (answer.time_usec, answer.flags, answer.mode) == (tick * TICK_US, 1, 1)
        assert answer.controls == (0.0,) * 16


def test_repeated_frame_answer_differs_in_armed_only(harness: Harness) -> None:
    first = harness.simulator.ask(0)
    assert harness.simulator.ask(0) == first
    assert harness.ground.command(400, 1) == 0
    again = harness.simulator.ask(0)
    assert again.mode == first.mode | ARMED
    assert (again.time_usec, again.controls) == (first.time_usec, first.controls)


def test_sensors_are_answered_before_truth_arrives(harness: Harness) -> None:
    harness.simulator.ask(0)
    truth = dialect.by_name("HIL_STATE_QUATERNION")
    lies = encode(truth, (0, (0.0, 0.0, 1.0, 0.0), 9.0, 9.0, 9.0, 1, 1, 1, *(32_000,) * 8), 0, 2, 1)
    plain = [harness.simulator.ask(n * TICK_US) for n in range(1, 20)]
    harness.ground.command(246, 1)
    harness.simulator.ask(0)
    for n, expected in enumerate(plain, 1):
        harness.simulator.send(n * TICK_US, lies)
        assert harness.simulator.answer() == expected


def test_late_sensor_frame_is_not_answered(harness: Harness) -> None:
    for n in range(3):
        harness.simulator.ask(n * TICK_US)
    harness.simulator.send(TICK_US)
    assert harness.simulator.ask(3 * TICK_US).time_usec == 3 * TICK_US


@pytest.mark.parametrize("ticks", [3, 100])
def test_restarted_simulator_is_served(harness: Harness, ticks: int) -> None:
    for n in range(ticks):
        harness.simulator.ask(n * TICK_US)
    for _ in range(5):
        harness.simulator.send(0)
    answer = harness.simulator.answer()
    assert (answer.time_usec, answer.mode) == (0, 1)
    while "Restarted" not in harness.ground.wait_for("STATUSTEXT").text:
        pass


def test_restarted_sensor_clock_keeps_vehicle_armed(harness: Harness) -> None:
    for n in range(100):
        harness.simulator.ask(n * TICK_US)
    assert harness.ground.command(400, 1) == 0
    for _ in range(5):
        harness.simulator.send(0)
    answer = harness.simulator.answer()
    assert (answer.time_usec, answer.mode) == (0, 1 | ARMED)
    assert harness.simulator.ask(TICK_US).time_usec == TICK_US
    while "Sensor clock jumped -2.0 s" not in harness.ground.wait_for("STATUSTEXT").text:
        pass


@pytest.mark.parametrize("bad_us", [0, 100_000_000, 2**63, 2**64 - 1])
def test_sample_with_bad_stamp_is_not_answered(harness: Harness, bad_us: int) -> None:
    for n in range(10):
        harness.simulator.ask(n * TICK_US)
    assert harness.ground.command(400, 1) == 0
    harness.simulator.send(bad_us)
    for n in range(10, 20):
        answer = harness.simulator.ask(n * TICK_US)
        assert (answer.time_usec, answer.mode) == (n * TICK_US, 1 | ARMED)


def test_ground_is_served_without_sensors(harness: Harness) -> None:
    listed = run(
        ParamClient(harness.ground.endpoint.send, GROUND, VEHICLE).list(), harness.ground.endpoint
    )
    assert listed["MAV_SYS_ID"] == 1.0
    items = (MissionItem(0, 2, 93, p1=5.0),)
    client = MissionClient(harness.ground.endpoint.send, GROUND, VEHICLE)
    run(client.upload(items), harness.ground.endpoint)
    assert run(client.download(), harness.ground.endpoint) == items
    assert harness.ground.command(400, 1) == 1


def test_ground_at_full_speed_loses_nothing(harness: Harness) -> None:
    harness.simulator.ask(0)
    for name in ("ATTITUDE", "ACTUATOR_OUTPUT_STATUS"):
        assert harness.ground.command(511, dialect.by_name(name).message_id, 20_000) == 0
    attitudes: list[int] = []
    for tick in range(1, 2001):
        harness.simulator.ask(tick * TICK_US)
        attitudes += attitude_times_ms(harness.ground.endpoint.receive())
    while len(attitudes) < 2000:
        attitudes += attitude_times_ms(harness.ground.frames())
    assert attitudes == [tick * TICK_US // 1000 for tick in range(1, 2001)]
    assert harness.ground.endpoint.lost_frames == 0


def attitude_times_ms(frames: list[Frame]) -> list[int]:
    return [frame.decode().time_boot_ms for frame in frames if frame.name == "ATTITUDE"]


def test_ground_station_disconnect_is_tolerated(harness: Harness) -> None:
    harness.simulator.ask(0)
    harness.ground.close()
    for tick in range(1, 200):
        assert harness.simulator.ask(tick * TICK_US).time_usec == tick * TICK_US
    assert harness.process.running


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_autopilot_on_signal_ends_cleanly(harness: Harness, number: signal.Signals) -> None:
    harness.simulator.ask(0)
    harness.process.signal(number)
    finished = harness.process.finish()
    assert (finished.status, finished.stdout, finished.stderr) == (0, "", "")


def test_parameters_are_read_from_the_file(tmp_path: Path) -> None:
    file = tmp_path / "boat.param"
    file.write_text("HDG_P,0.5  # from the sea trial\nMAV_SYS_ID 7\n")
    ground = free_port(socket.SOCK_STREAM)
    with (
        autopilot(
            f"udpin:127.0.0.1:{free_port()}",
            f"tcpin:127.0.0.1:{ground}",
            options=("--params", str(file)),
        ),
        closing(open_transport(f"tcp:127.0.0.1:{ground}")) as transport,
    ):
        endpoint = Endpoint(transport, *GROUND)
        assert (
            run(ParamClient(endpoint.send, GROUND, MavlinkId(7, 1)).get("HDG_P"), endpoint) == 0.5
        )


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (("--hil", "udpin:here"), "autopilot: address 'udpin:here': expected udpin:HOST:PORT"),
        (
            ("--gcs", "tcpin:127.0.0.1:x"),
            "autopilot: address 'tcpin:127.0.0.1:x': 'x' is no port number",
        ),
        (("--gcs", "serial:/dev/null:57600"), "autopilot: address 'serial:/dev/null:57600':"),
        (("--params", "nowhere.param"), "autopilot: nowhere.param: No such file"),
    ],
)
def test_bad_input_gives_one_error_line(arguments: tuple[str, ...], complaint: str) -> None:
    with process("-m", "autopilot", "--hil", f"udpin:127.0.0.1:{free_port()}", *arguments) as child:
        finished = child.finish()
    assert finished.status == 2
    assert finished.stderr.startswith(complaint)
    assert finished.stderr.count("\n") == 1


def test_bad_parameter_gives_file_line_and_range(tmp_path: Path) -> None:
    file = tmp_path / "boat.param"
    file.write_text("HDG_P,0.5\nHDG_D,99\n")
    with process("-m", "autopilot", "--params", str(file)) as child:
        finished = child.finish()
    assert finished == (2, "", f"autopilot: {file}:2: HDG_D = 99: must be 0 to 10 s\n")
