"""ArduPilot's end of its JSON backend, in the test.

Written from libraries/SITL/examples/JSON/readme.md and the reader of SIM_JSON, without code of
Caribou. Imitated behaviour of ArduPilot: it sends servos from its own port, counts a frame when the
answer arrives, and repeats a frame without an answer; it uses the last complete line that it has
received, and searches that text for the numbers instead of parsing JSON.
"""

from __future__ import annotations

import re
import socket
import struct
import time
from collections.abc import Sequence
from typing import NamedTuple

START_S = 180.0
"""Wall time until the simulator answers, in s: it may have to compile its physics first."""
PATIENCE_S = 30.0
RESEND_S = 1.0
NEUTRAL = 1500


class Motion(NamedTuple):
    """Content of one line as ArduPilot parses it."""

    timestamp_s: float
    gyro_radps: list[float]
    accel_body_mps2: list[float]
    position_ned_m: list[float]
    quaternion: list[float]
    velocity_ned_mps: list[float]
    rng_1_m: float | None
    voltage_v: float | None
    current_a: float | None


class ArduPilot:
    """An ArduPilot that the test controls frame by frame."""

    def __init__(self, port: int, frame_rate_hz: int = 400, channels: int = 16) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._simulator = "127.0.0.1", port
        self._channels, self._frame_rate_hz = channels, frame_rate_hz
        self.count = 0
        """Rate in the next frame, in Hz."""

    def restart(self, frame_rate_hz: int) -> None:
        """Restart the program: it counts from the beginning and sends from another port."""
        self._socket.close()
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._frame_rate_hz, self.count = frame_rate_hz, 0

    def frame(self, pulses_us: Sequence[int] = (), count: int | None = None) -> bytes:
        """Send one datagram of servos."""
        magic = {16: 18458, 32: 29569}[self._channels]
        pulses = [*pulses_us, *(NEUTRAL,) * (self._channels - len(pulses_us))]
        number = self.count if count is None else count
        return struct.pack(f"<HHI{self._channels}H", magic, self._frame_rate_hz, number, *pulses)

    def send(self, datagram: bytes) -> None:
        self._socket.sendto(datagram, self._simulator)

    def receive(self, patience_s: float = PATIENCE_S) -> bytes:
        """Receive one datagram. Raises TimeoutError."""
        self._socket.settimeout(patience_s)
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

    def fly(self, count: int, pulses_us: Sequence[int] = ()) -> list[Motion]:
        return [self.step(pulses_us) for _ in range(count)]

    def close(self) -> None:
        self._socket.close()


def read(datagram: bytes) -> Motion:
    """Parse the last line between two line feeds as ArduPilot does.

    It searches the section, then the key, and reads what follows ``":``.
    """
    *_, before, line, after = datagram.decode().split("\n")
    assert (before, after) == ("", "")
    return Motion(
        _number(line, "", "timestamp", required=True),
        _vector(line, "imu", "gyro", 3),
        _vector(line, "imu", "accel_body", 3),
        _vector(line, "", "position", 3),
        _vector(line, "", "quaternion", 4),
        _vector(line, "", "velocity", 3),
        _number(line, "", "rng_1"),
        _number(line, "battery", "voltage"),
        _number(line, "battery", "current"),
    )


def _value(line: str, section: str, key: str) -> str | None:
    section_start = line.find(section)
    key_start = line.find(key, section_start + len(section)) if section_start >= 0 else -1
    return None if key_start < 0 else line[key_start + len(key) + 2 :]


def _number(line: str, section: str, key: str, *, required: bool = False) -> float | None:
    text = _value(line, section, key)
    assert text is not None or not required, key
    match = re.match(r"-?\d+(\.\d+)?(e-?\d+)?", text or "")
    return float(match.group()) if match else None


def _vector(line: str, section: str, key: str, size: int) -> list[float]:
    text = _value(line, section, key)
    assert text is not None, key
    assert text.startswith("["), "a blank after the colon, and ArduPilot reads nothing"
    numbers = [float(word) for word in text[1 : text.index("]")].split(",")]
    assert len(numbers) == size
    return numbers
