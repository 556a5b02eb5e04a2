"""ArduPilot's side of its JSON backend, written from libraries/SITL/examples/JSON/readme.md.

It uses no part of Caribou. It behaves as ArduPilot (SIM_JSON) does: it sends servos from a port of
its own, counts a frame when it is answered, and repeats it otherwise; it takes the last complete
line received, and finds numbers by text search instead of a JSON parser.
"""

from __future__ import annotations

import re
import socket
import struct
import time
from collections.abc import Sequence
from typing import NamedTuple

START_S = 180.0
"""Time for the simulator's first answer; on a busy machine it may compile its physics first."""
TIMEOUT_S = 30.0
RESEND_S = 1.0
NEUTRAL = 1500


class Motion(NamedTuple):
    """Content of one answer, as ArduPilot reads it."""

    timestamp_s: float
    gyro_radps: list[float]
    accel_body_mps2: list[float]
    position_ned_m: list[float]
    attitude_rad: list[float]
    quaternion: list[float]
    velocity_ned_mps: list[float]
    rng_1_m: float | None
    voltage_v: float | None
    current_a: float | None


class ArduPilot:
    """A simulated ArduPilot that tests control frame by frame."""

    def __init__(self, port: int, frame_rate_hz: int = 400, channels: int = 16) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._simulator = "127.0.0.1", port
        self._channels, self._frame_rate_hz = channels, frame_rate_hz
        self.count = 0
        """Number of the next frame."""

    def restart(self, frame_rate_hz: int) -> None:
        """Restart the program: frame numbers start at zero, and the local port changes."""
        self._socket.close()
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._frame_rate_hz, self.count = frame_rate_hz, 0

    def frame(self, pulses_us: Sequence[int] = (), count: int | None = None) -> bytes:
        """Return one datagram of servo pulses."""
        magic = {16: 18458, 32: 29569}[self._channels]
        pulses = [*pulses_us, *(NEUTRAL,) * (self._channels - len(pulses_us))]
        number = self.count if count is None else count
        return struct.pack(f"<HHI{self._channels}H", magic, self._frame_rate_hz, number, *pulses)

    def send(self, datagram: bytes) -> None:
        self._socket.sendto(datagram, self._simulator)

    def receive(self, timeout_s: float = TIMEOUT_S) -> bytes:
        """Return one datagram.

        Raises TimeoutError: none has arrived.
        """
        self._socket.settimeout(timeout_s)
        return self._socket.recv(65536)

    def step(self, pulses_us: Sequence[int] = ()) -> Motion:
        """Send a frame until it is answered, and count it."""
        datagram, until_s = self.frame(pulses_us), time.monotonic() + START_S
        self.send(datagram)
        while True:
            try:
                line = self.receive(RESEND_S)
                break
            except TimeoutError:
                assert time.monotonic() < until_s, "no answer"
                self.send(datagram)
        self.count += 1
        return read(line)

    def ramp(self, count: int, goal_hz: int) -> list[Motion]:
        """Fly while the rate changes by 1 Hz a frame towards SIM_RATE_HZ, as SIM_JSON does."""
        motions = []
        for _ in range(count):
            motions.append(self.step())
            change = max(-1, min(1, goal_hz - self._frame_rate_hz))
            self._frame_rate_hz += change
        return motions

    def fly(self, count: int, pulses_us: Sequence[int] = ()) -> list[Motion]:
        return [self.step(pulses_us) for _ in range(count)]

    def close(self) -> None:
        self._socket.close()


def read(datagram: bytes) -> Motion:
    """Read the last line between two line feeds as ArduPilot does: section, key, text after it."""
    *_, before, line, after = datagram.decode().split("\n")
    assert (before, after) == ("", "")
    timestamp_s = _number(line, "", "timestamp")
    assert timestamp_s is not None, "timestamp"
    return Motion(
        timestamp_s,
        _vector(line, "imu", "gyro", 3),
        _vector(line, "imu", "accel_body", 3),
        _vector(line, "", "position", 3),
        _vector(line, "", "attitude", 3),
        _vector(line, "", "quaternion", 4),
        _vector(line, "", "velocity", 3),
        _number(line, "", "rng_1"),
        _number(line, "battery", "voltage"),
        _number(line, "battery", "current"),
    )


def _value(line: str, section: str, key: str) -> str | None:
    at = line.find(section)
    found = line.find(key, at + len(section)) if at >= 0 else -1
    return None if found < 0 else line[found + len(key) + 2 :]


def _number(line: str, section: str, key: str) -> float | None:
    text = _value(line, section, key)
    match = re.match(r"-?\d+(\.\d+)?(e-?\d+)?", text or "")
    return float(match.group()) if match else None


def _vector(line: str, section: str, key: str, size: int) -> list[float]:
    text = _value(line, section, key)
    assert text is not None, key
    assert text.startswith("["), "a blank after the colon, and ArduPilot reads nothing"
    numbers = [float(word) for word in text[1 : text.index("]")].split(",")]
    assert len(numbers) == size
    return numbers
