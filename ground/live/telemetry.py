"""Store telemetry as it arrives, in the form of the log that identification reads.

Test segments are cut out of it as out of a log file. Frames are stored undecoded and decoded
together on request, so that receiving them takes little time.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from mavlink_io import dialect
from mavlink_io.codec import Frame
from mavlink_io.logging import ros1 as schemas
from mavlink_io.vehicle_clock import VehicleClock
from sysid.data import ros1
from sysid.data.dataset import Log, LogEvent
from sysid.data.events import VehicleEvent
from sysid.data.readers import messages
from sysid.data.readers.messages import Messages
from sysid.data.readers.parameter_history import ParameterHistory
from sysid.data.readers.servo_channels import FROM_LOG

MAX_GAP_S = {
    "ATTITUDE": 0.25,
    "ACTUATOR_OUTPUT_STATUS": 0.12,
    "SERVO_OUTPUT_RAW": 0.12,
    "LOCAL_POSITION_NED": 0.5,
}
"""Messages that identification needs, and the maximum time between two of them (s).

One of ACTUATOR_OUTPUT_STATUS and SERVO_OUTPUT_RAW is enough. Their limit is the shortest: a control
surface moves faster than the attitude changes.
"""
SETPOINTS = ("ATTITUDE_TARGET", "POSITION_TARGET_LOCAL_NED")
"""Setpoint messages; optional for identification."""
_STORED_MESSAGES = {dialect.by_name(name).message_id: name for name in (*MAX_GAP_S, *SETPOINTS)}
_NAME = Path("live")


class Gap(NamedTuple):
    """Time range without data of one message (vehicle time, s)."""

    message_name: str
    start_s: float
    end_s: float


class Telemetry:
    """Recent telemetry of one vehicle: motion, commands and events."""

    def __init__(self, parameters: Mapping[str, float]) -> None:
        self._parameters = ParameterHistory(dict(parameters))
        self._stored: dict[str, list[tuple[float, bytes]]] = {}
        self._clock = VehicleClock()
        self.events: list[LogEvent] = []
        self.now_s = 0.0
        """Vehicle time of the newest message."""

    def on_frame(self, frame: Frame, on_restart: Callable[[], None]) -> None:
        """Store a frame; leave out one with an impossible time.

        A frame without a time stamp gets the time of the newest frame. When the vehicle's clock has
        restarted, `on_restart` is called, and everything that was stored before is deleted.
        """
        name = _STORED_MESSAGES.get(frame.message_id)
        if name is None:
            return
        record, read_time_us = _decoder(name)
        payload = frame.payload.ljust(record.itemsize, b"\0")
        time_us, time_s = read_time_us(payload) if read_time_us else None, self.now_s
        if time_us is not None:
            reading = self._clock.read(time_us)
            if not reading.valid:
                return
            if reading.restarted:
                on_restart()
                self._stored, self.events, self.now_s = {}, [], 0.0
            time_s = reading.time_us * 1e-6
        self._stored.setdefault(name, []).append((time_s, payload))
        self.now_s = max(self.now_s, time_s)

    def on_event(self, event: VehicleEvent) -> None:
        """Store an event with the vehicle time of the newest message."""
        self.events.append(LogEvent(self.now_s, event))

    @property
    def complete_s(self) -> float:
        """Vehicle time up to which every required message has been received (s)."""
        return min(
            (stored[-1][0] for name, stored in self._used().items() if name not in SETPOINTS),
            default=0.0,
        )

    def log(self, until_s: float) -> Log:
        """Return the stored telemetry up to a vehicle time (s).

        Raises
        ------
        LogError
            A message that identification needs is missing.
        """
        messages_by_name: Messages = {}
        for name, stored in self._used().items():
            samples = [(time_s, raw) for time_s, raw in stored if time_s <= until_s]
            if samples:
                record = ros1.decode([raw for _, raw in samples], _decoder(name)[0])
                messages_by_name[name] = np.array([time_s for time_s, _ in samples]), record
        log = messages.assemble(
            _NAME,
            messages_by_name,
            self._parameters,
            FROM_LOG,
            (np.empty(0), np.empty(0)),
        )
        return replace(log, events=tuple(event for event in self.events if event.time_s <= until_s))

    def forget(self, before_s: float) -> None:
        """Delete the messages before a vehicle time (s)."""
        for name, stored in self._stored.items():
            self._stored[name] = [sample for sample in stored if sample[0] >= before_s]

    def gap(self) -> Gap | None:
        """Return the first gap in a required message, or None."""
        needed = {name: stored for name, stored in self._used().items() if name not in SETPOINTS}
        gaps = [
            gap for name, stored in needed.items() if (gap := _first_gap(name, stored)) is not None
        ]
        return min(gaps, key=lambda gap: gap.end_s, default=None)

    def _used(self) -> dict[str, list[tuple[float, bytes]]]:
        """Return the stored samples by message name, with one source of actuator commands."""
        unused = "SERVO_OUTPUT_RAW" if self._stored.get("ACTUATOR_OUTPUT_STATUS") else ""
        return {name: stored for name, stored in self._stored.items() if stored and name != unused}


def _first_gap(name: str, samples: list[tuple[float, bytes]]) -> Gap | None:
    """Return the first gap longer than MAX_GAP_S in the samples of a message, if there is one."""
    latest_s = samples[0][0]
    for time_s, _ in samples:
        if time_s - latest_s > MAX_GAP_S[name]:
            return Gap(name, latest_s, time_s)
        latest_s = max(latest_s, time_s)
    return None


@cache
def _decoder(name: str) -> tuple[np.dtype[Any], Callable[[bytes], int | None] | None]:
    """Return the record type of a payload and the function that reads its time (us)."""
    message = dialect.by_name(name)
    return ros1.record_type(schemas.schema_text(message)), schemas.time_reader(message.message_id)
