"""The compiled ticks of the simulator: the same datagrams as those of Python."""

import math
import multiprocessing
import socket
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from msgspec.structs import replace

from mavlink_io import dialect, jit
from mavlink_io.codec import encode
from mavlink_io.fixed_frame import FIELDS
from mavlink_io.transport import UdpClient
from sitl import scenario
from sitl.backends import lockstep
from sitl.backends.caribou import Caribou
from sitl.backends.messages import SENSOR_FRAME
from sitl.core import plant
from sitl.vehicle import config

CONTROLS = dialect.by_name("HIL_ACTUATOR_CONTROLS")
COMMAND = dialect.by_name("COMMAND_LONG")
TICKS = 300
TRUTH_HEAD = bytes((0xFD, 64))
"""First octets of a datagram with HIL_STATE_QUATERNION, whose last field is not zero."""
ARMED, DISARMED, INJECT_FAILURE = 129, 1, 420
END = b"end"
WITH_FAULTS = """
title = "faults"
[start]
depth_m = 0.2
[rig]
encoder = "as5048"
[[fault]]
unit = "magnetometer"
kind = "off"
at_s = 2.0
until_s = 2.5
[[fault]]
unit = "dvl"
kind = "off"
at_s = 2.94
until_s = 3.06
[[fault]]
unit = "gps"
kind = "wrong"
offset_m = 5.0
at_s = 3.2
until_s = 3.5
"""
"""A scenario with every sensor, in which faults begin and end in ticks with slow sensors or not."""


class Autopilot:
    """A process that answers HIL_SENSOR; what it answers depends on the stamp alone."""

    def __init__(self) -> None:
        fork = multiprocessing.get_context("fork")
        self._result, result = fork.Pipe(duplex=False)
        own = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        own.bind(("127.0.0.1", 0))
        own.settimeout(30.0)
        self._process = fork.Process(target=_answer_all, args=(own, result), daemon=True)
        self._process.start()
        self.link = UdpClient("udpout", *own.getsockname())
        own.close()

    def end(self) -> list[bytes]:
        """End the process; return the datagrams that it has received."""
        self.link.send(END)
        assert self._result.poll(30.0)
        sent: list[bytes] = self._result.recv()
        self._process.join()
        self.link.close()
        return sent


def _answer_all(own: socket.socket, result: Any) -> None:
    """Answer every HIL_SENSOR until `END` arrives; then return all datagrams."""
    sent: list[bytes] = []
    lost = {37 * 20_000}  # stamps whose first answer is lost
    while True:
        data, sea = own.recvfrom(65_535)
        if data == END:
            result.send(sent)
            return
        sent.append(data)
        decoded = SENSOR_FRAME.decode(data[-_frame_length(data) :])
        if decoded is None:  # the acknowledgement of the command
            continue
        time_us = decoded[FIELDS]
        if time_us in lost:
            lost.remove(time_us)
            continue
        seconds = 1e-6 * time_us
        controls = 0.3 * math.sin(seconds), 0.1, 0.58, 1.0 if seconds > 5.0 else 0.0
        mode = DISARMED if 1.0 < seconds < 1.1 else ARMED
        if time_us == 240 * 20_000:  # a stale answer, and a command, in datagrams of their own
            own.sendto(_answer(time_us - 20_000, controls, mode), sea)
            fields = (2.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, INJECT_FAILURE, 1, 0, 0)
            own.sendto(encode(COMMAND, fields, 0, 1, 1), sea)
        own.sendto(_answer(time_us, controls, mode), sea)


class Flown(NamedTuple):
    """A simulation and what it has sent."""

    sent: list[bytes]
    state: plant.PlantState
    python_ticks: int


def _frame_length(datagram: bytes) -> int:
    """Return the length of the last frame, HIL_SENSOR."""
    start = 0
    while start + datagram[start + 1] + 12 < len(datagram):
        start += datagram[start + 1] + 12
    return len(datagram) - start


def _answer(time_us: int, controls: tuple[float, ...], mode: int) -> bytes:
    return encode(CONTROLS, (time_us, 1, (*controls, *(0.0,) * 12), mode), 7, 1, 1)


def _vehicle(name: str) -> config.VehicleConfig:
    """Return a vehicle; remus100 with sensors that have latencies, dropouts and outliers."""
    vehicle = config.load(name)
    if name != "remus100":
        return vehicle
    instruments = replace(
        vehicle.instruments, pressure="ms5837-30ba", dvl="pathfinder-600", altimeter="va500"
    )
    return replace(vehicle, instruments=instruments)


def _simulate(vehicle: str, site: str, *, compiled: bool) -> Flown:
    """Simulate as ``sitl.app`` does; without ``compiled`` each tick is one of Python."""
    autopilot = Autopilot()
    backend = Caribou(autopilot.link, lambda: False)
    simulated = plant.build(_vehicle(vehicle), scenario.load(site))
    rng = plant.random_streams(1)
    state, sensors = plant.initial_state(simulated, rng)
    python_ticks = 0
    while state.time_us < TICKS * 20_000:
        python_ticks += 1
        if compiled:
            state, sensors = backend.advance(simulated, state, sensors, rng)
        actuators = backend.exchange(simulated, state, sensors)
        assert actuators is not None
        for injection in backend.take_injections():
            state = plant.inject_failure(state, injection)
        state, sensors = plant.step(simulated, state, actuators, rng)
    return Flown(autopilot.end(), state, python_ticks)


@pytest.fixture
def scene(request: pytest.FixtureRequest, tmp_path: Path) -> str:
    """Return a scenario by name, or the file with faults."""
    if request.param != "faults":
        return str(request.param)
    path = tmp_path / "faults.toml"
    path.write_text(WITH_FAULTS, encoding="utf-8")
    return str(path)


@pytest.mark.slow
@pytest.mark.skipif(not jit.COMPILED, reason="there is nothing to compare without numba")
@pytest.mark.parametrize("vehicle", ["caribou_truth", "remus100"])
@pytest.mark.parametrize("scene", ["disturbed", "swell", "faults"], indirect=True)
def test_datagrams_equal_those_of_python(
    vehicle: str, scene: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(lockstep, "RESEND_S", 0.01)
    plain = _simulate(vehicle, scene, compiled=False)
    quick = _simulate(vehicle, scene, compiled=True)
    assert quick.sent == plain.sent
    np.testing.assert_array_equal(quick.state.values, plain.state.values)
    assert plain.python_ticks == TICKS
    assert quick.python_ticks < 0.4 * TICKS


@pytest.mark.skipif(not jit.COMPILED, reason="there is no compiled path without numba")
def test_ticks_with_slow_sensors_stay_compiled() -> None:
    autopilot = Autopilot()
    simulated = plant.build(config.load("caribou_truth"), scenario.load("calm"))
    backend, rng = Caribou(autopilot.link, lambda: False), plant.random_streams(1)
    state, sensors = backend.advance(simulated, *plant.initial_state(simulated, rng), rng)
    assert state.time_us == 37 * 20_000, "the first tick whose answer is lost"
    assert sensors.frame.time_us == state.time_us
    assert any(sent.startswith(TRUTH_HEAD) for sent in autopilot.end()[1:])


def test_lost_answer_is_asked_for_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lockstep, "RESEND_S", 0.01)
    flown = _simulate("caribou_truth", "calm", compiled=jit.COMPILED)
    stamps = [
        decoded[FIELDS]
        for datagram in flown.sent
        if (decoded := SENSOR_FRAME.decode(datagram[-_frame_length(datagram) :]))
    ]
    assert [stamp for stamp in stamps if stamps.count(stamp) == 2] == [37 * 20_000] * 2
    assert sorted(set(stamps)) == list(range(0, TICKS * 20_000, 20_000))
