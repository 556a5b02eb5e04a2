"""When telemetry is due on one link: by vehicle time, at rates that its line can carry.

Three profiles, chosen by the baud rate: all of the table, half of it without the widest messages,
and the few that a 9600 baud radio has room for. A ground station may still ask for any message at
any rate; what the line cannot carry of that is left out as it comes
(``autopilot.comms.bandwidth_limiter``)."""

from collections.abc import Mapping
from typing import NamedTuple

from autopilot.control.types import US_PER_S
from autopilot.telemetry.streams import BY_ID, STREAMS, TelemetryStream
from mavlink_io import dialect


class RateProfile(NamedTuple):
    """What a link is sent unasked."""

    name: str
    rates_hz: Mapping[int, float]
    """By message number; a stream that is missing comes only when asked for."""


def _number(name: str) -> int:
    return dialect.by_name(name).message_id


_OMITTED_ON_SLOW_LINKS = frozenset(
    map(_number, ("ODOMETRY", "HIGHRES_IMU", "ACTUATOR_OUTPUT_STATUS"))
)
_MINIMAL_HZ = {"ATTITUDE": 1.0, "GLOBAL_POSITION_INT": 1.0, "VFR_HUD": 1.0, "SYS_STATUS": 0.2}

FAST = RateProfile("fast", {stream.message.message_id: stream.rate_hz for stream in STREAMS})
HALF = RateProfile(
    "57600",
    {
        number: 0.5 * hz
        for number, hz in FAST.rates_hz.items()
        if number not in _OMITTED_ON_SLOW_LINKS
    },
)
MINIMAL = RateProfile("9600", {_number(name): hz for name, hz in _MINIMAL_HZ.items()})
FAST_BAUD, HALF_BAUD = 115_200, 38_400
"""The lowest baud rates of the first two."""


def profile_for(baud: int | None) -> RateProfile:
    """The profile of a line; None is a link without a baud rate."""
    if baud is None or baud >= FAST_BAUD:
        return FAST
    return HALF if baud >= HALF_BAUD else MINIMAL


class Schedule:
    """When each stream is due on one link. A stream is due in the tick in which time crosses a
    multiple of its interval; the first tick after a start only sets the phase."""

    def __init__(self, profile: RateProfile = FAST) -> None:
        self._defaults_us = {
            number: _interval_us(profile.rates_hz.get(number, 0.0)) for number in BY_ID
        }
        self._intervals_us = dict(self._defaults_us)
        self._due_us = dict.fromkeys(BY_ID, 0)
        self._running = False
        self._time_us = 0

    def set_interval(self, message_id: int, interval_us: int | None) -> None:
        """None is the default interval, 0 stops the stream. Raises KeyError for a message that is
        no stream."""
        default_us = self._defaults_us[message_id]
        self._intervals_us[message_id] = default_us if interval_us is None else interval_us
        self._align(message_id)

    def interval_us(self, message_id: int) -> int:
        """The interval in force, 0 where the stream is stopped. Raises KeyError."""
        return self._intervals_us[message_id]

    def due(self, time_us: int) -> list[TelemetryStream]:
        """The streams to send in the tick at ``time_us``, in the order of the table."""
        due: list[TelemetryStream] = []
        restarted = not self._running or time_us < self._time_us
        self._time_us = time_us
        if restarted:
            self._running = True
            for number in BY_ID:
                self._align(number)
            return due
        for number, due_us in self._due_us.items():
            if due_us <= time_us:
                if self._intervals_us[number]:
                    due.append(BY_ID[number])
                self._align(number)
        return due

    def _align(self, message_id: int) -> None:
        interval = self._intervals_us[message_id] or US_PER_S
        self._due_us[message_id] = (self._time_us // interval + 1) * interval


def _interval_us(rate_hz: float) -> int:
    return round(US_PER_S / rate_hz) if rate_hz else 0
