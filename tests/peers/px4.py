"""PX4's side of its simulator API, written from PX4's documentation and module simulator_mavlink.

It uses no part of Caribou; pymavlink encodes and decodes. It behaves as PX4 does: it connects by
TCP with retries, sends HEARTBEAT and requests HIL_STATE_QUATERNION every 5 ms. HIL_SENSOR drives
its clock, which counts from the first of them. Its controls are zero while it is disarmed.
"""

from __future__ import annotations

import socket
import time
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import all as mavlink

TIMEOUT_S = 30.0
START_S = 180.0
"""Time to connect; on a busy machine the simulator may compile its physics first."""
TRUTH_INTERVAL_US = 5000
LOCKSTEP, CUSTOM, ARMED = 1, 1, 128


class Instant(NamedTuple):
    """Messages of one tick, up to and including HIL_SENSOR."""

    time_us: int
    messages: tuple[Any, ...]
    wall_s: float
    """Wall time of arrival."""

    @property
    def sensor(self) -> Any:
        return self.messages[-1]

    def find(self, name: str) -> Any | None:
        return next((message for message in self.messages if message.get_type() == name), None)


class Px4:
    """A simulated PX4 that tests control from one HIL_SENSOR to the next."""

    def __init__(self, port: int) -> None:
        self._socket = _connected(port)
        self._begin(("127.0.0.1", port))

    def _begin(self, simulator: tuple[str, int]) -> None:
        self._socket.settimeout(TIMEOUT_S)
        self._simulator = simulator
        self._mavlink = mavlink.MAVLink(None, srcSystem=1, srcComponent=1)
        self._waiting: list[Any] = []
        self._start_us: int | None = None
        self._clock_us = 0
        self.sensor_ids: set[int] = set()
        self._send(
            self._mavlink.heartbeat_encode(
                mavlink.MAV_TYPE_GENERIC, mavlink.MAV_AUTOPILOT_PX4, 0, 0, 0
            )
        )
        self.ask_for_truth(TRUTH_INTERVAL_US)

    def ask_for_truth(self, interval_us: float) -> None:
        wanted = mavlink.MAVLINK_MSG_ID_HIL_STATE_QUATERNION
        command = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
        self._send(
            self._mavlink.command_long_encode(0, 0, command, 0, wanted, interval_us, 0, 0, 0, 0, 0)
        )

    def receive(self, timeout_s: float = TIMEOUT_S) -> Instant:
        """Wait for HIL_SENSOR, as PX4 does.

        Raises TimeoutError: none has arrived.
        """
        messages: list[Any] = []
        until_s = time.monotonic() + timeout_s
        while True:
            while self._waiting:
                message = self._waiting.pop(0)
                messages.append(message)
                if message.get_type() == "HIL_SENSOR":
                    return self._take(message, messages)
            left_s = until_s - time.monotonic()
            if left_s <= 0.0:
                self._waiting = messages
                raise TimeoutError
            self._socket.settimeout(left_s)
            try:
                data = self._socket.recv(65536)
            except TimeoutError:
                continue
            assert data, "the simulator hung up"
            self._waiting = self._mavlink.parse_buffer(data) or []

    def _take(self, sensor: Any, messages: list[Any]) -> Instant:
        self.sensor_ids.add(sensor.id)
        if self._start_us is None:
            self._start_us = sensor.time_usec
        self._clock_us = sensor.time_usec - self._start_us
        return Instant(sensor.time_usec, tuple(messages), time.monotonic())

    def answer(
        self, controls: Sequence[float] = (), *, armed: bool = True, lockstep: bool = True
    ) -> None:
        """Send HIL_ACTUATOR_CONTROLS with the present clock."""
        outputs = [*controls, *(0.0,) * (16 - len(controls))] if armed else [0.0] * 16
        mode, flags = CUSTOM | (ARMED if armed else 0), LOCKSTEP if lockstep else 0
        self._send(self._mavlink.hil_actuator_controls_encode(self._clock_us, outputs, mode, flags))

    def fly(
        self, count: int, controls: Sequence[float] = (), *, armed: bool = True
    ) -> Iterator[Instant]:
        """Answer a number of ticks, each before the next."""
        for _ in range(count):
            instant = self.receive()
            self.answer(controls, armed=armed)
            yield instant

    def close(self) -> None:
        self._socket.close()

    def _send(self, message: Any) -> None:
        self._socket.sendall(message.pack(self._mavlink))


class UdpPx4(Px4):
    """PX4 started with -u: it binds a port and waits for the simulator's first datagram."""

    def __init__(self) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", 0))
        self.port = int(self._socket.getsockname()[1])

    def wait_for_simulator(self) -> None:
        self._socket.settimeout(START_S)
        _, simulator = self._socket.recvfrom(65536)
        self._socket.connect(simulator)
        self._begin(simulator)


def _connected(port: int) -> socket.socket:
    """Connect to the port, with a retry every half a millisecond."""
    until_s = time.monotonic() + START_S
    while time.monotonic() < until_s:
        try:
            connection = socket.create_connection(("127.0.0.1", port))
        except ConnectionRefusedError:
            time.sleep(5e-4)
            continue
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        return connection
    raise AssertionError(f"no program listens on port {port}")
