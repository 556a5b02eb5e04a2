"""Telemetry as it arrives, kept as the log that identification would read: tests are cut out of it
as everywhere.

Frames are kept as they came, and decoded together when somebody asks: listening costs next to
nothing."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from mavlink_io import dialect
from mavlink_io.codec import Frame
from mavlink_io.logging import ros1 as schemas
from sysid.data import ros1
from sysid.data.dataset import Log, TextEvent
from sysid.data.readers import messages
from sysid.data.readers.messages import Messages
from sysid.data.readers.servo_channels import FIRST_THREE

MAX_GAP_S = {
    "ATTITUDE": 0.25,
    "ACTUATOR_OUTPUT_STATUS": 0.12,
    "SERVO_OUTPUT_RAW": 0.12,
    "LOCAL_POSITION_NED": 0.5,
}
"""What identification needs (of the two in the middle one is enough), and how far apart two of them
may be: a surface moves in a moment, attitude does not."""
SETPOINTS = ("ATTITUDE_TARGET", "POSITION_TARGET_LOCAL_NED")
"""What she was asked for; identification goes without."""
_STORED_MESSAGES = {dialect.by_name(name).message_id: name for name in (*MAX_GAP_S, *SETPOINTS)}
_NAME = Path("live")


class Gap(NamedTuple):
    """A stretch of which nothing is known."""

    what: str
    start_s: float
    end_s: float


class Telemetry:
    """What one vehicle has told of late: motion, commands, and what it said of its tests."""

    def __init__(self, parameters: Mapping[str, float]) -> None:
        self._parameters = dict(parameters)
        self._kept: dict[str, list[tuple[float, bytes]]] = {}
        self.events: list[TextEvent] = []
        self.now_s = 0.0
        """Vehicle time of the newest message."""

    def on_frame(self, frame: Frame) -> float:
        """Take a frame. Returns its vehicle time; that of the newest one where it carries none."""
        name = _STORED_MESSAGES.get(frame.message_id)
        if name is None:
            return self.now_s
        record, read_time_us = _decoder(name)
        payload = frame.payload.ljust(record.itemsize, b"\0")
        time_us = read_time_us(payload) if read_time_us else None
        time_s = self.now_s if time_us is None else time_us * 1e-6
        self._kept.setdefault(name, []).append((time_s, payload))
        self.now_s = max(self.now_s, time_s)
        return time_s

    def on_text(self, severity: int, text: str) -> None:
        """Take a text."""
        self.events.append(TextEvent(self.now_s, severity, text))

    @property
    def complete_s(self) -> float:
        """The vehicle time up to which every one of the messages has told its part."""
        return min(
            (kept[-1][0] for name, kept in self._used().items() if name not in SETPOINTS),
            default=0.0,
        )

    def log(self, until_s: float) -> Log:
        """What is kept up to a time. Raises LogError where a message is missing that identification
        needs."""
        messages_then: Messages = {}
        for name, kept in self._used().items():
            told = [(time_s, raw) for time_s, raw in kept if time_s <= until_s]
            if told:
                record = ros1.decode([raw for _, raw in told], _decoder(name)[0])
                messages_then[name] = np.array([time_s for time_s, _ in told]), record
        log = messages.assemble(
            _NAME, messages_then, self._parameters, FIRST_THREE, (np.empty(0), np.empty(0))
        )
        return replace(log, events=tuple(event for event in self.events if event.time_s <= until_s))

    def forget(self, before_s: float) -> None:
        """Let go of the messages that were told before."""
        for name, kept in self._kept.items():
            self._kept[name] = [told for told in kept if told[0] >= before_s]

    def restart(self) -> None:
        """Forget everything: the vehicle has begun anew."""
        self._kept, self.events, self.now_s = {}, [], 0.0

    def gap(self) -> Gap | None:
        """The first stretch in which one of the messages failed to come."""
        needed = {name: kept for name, kept in self._used().items() if name not in SETPOINTS}
        gaps = [gap for name, kept in needed.items() if (gap := _first_gap(name, kept)) is not None]
        return min(gaps, key=lambda gap: gap.end_s, default=None)

    def _used(self) -> dict[str, list[tuple[float, bytes]]]:
        """By name; of the two that tell commands the better one."""
        unused = "SERVO_OUTPUT_RAW" if self._kept.get("ACTUATOR_OUTPUT_STATUS") else ""
        return {name: kept for name, kept in self._kept.items() if kept and name != unused}


def _first_gap(name: str, kept: list[tuple[float, bytes]]) -> Gap | None:
    latest_s = kept[0][0]
    for time_s, _ in kept:
        if time_s - latest_s > MAX_GAP_S[name]:
            return Gap(name, latest_s, time_s)
        latest_s = max(latest_s, time_s)
    return None


@cache
def _decoder(name: str) -> tuple[np.dtype[Any], Callable[[bytes], int | None] | None]:
    """How a payload is laid out, and how its time is read."""
    message = dialect.by_name(name)
    return ros1.record_type(schemas.schema_text(message)), schemas.vehicle_time_reader(message)
