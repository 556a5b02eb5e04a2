"""Telemetry schedule of one link, in vehicle time, at rates that its line can carry.

The baud rate selects one of three profiles: the whole table; half of its rates without the longest
messages; and the few messages that fit on a 9600 baud radio. A ground station may request any
message at any rate; ``autopilot.comms.bandwidth_limiter`` drops what the line cannot carry.
"""

import math
from collections.abc import Container, Mapping, Sequence
from itertools import groupby
from typing import NamedTuple

from autopilot.control.types import US_PER_S
from autopilot.telemetry.streams import STREAMS, StreamGroup, TelemetryStream, stream_group
from mavlink_io import dialect


class RateProfile(NamedTuple):
    """Default telemetry rates of a link."""

    name: str
    rates_hz: Mapping[int, float]
    """Rate by message id; a missing stream is sent only on request."""


def _message_id(name: str) -> int:
    """Return the id of a message."""
    return dialect.by_name(name).message_id


_OMITTED_ON_SLOW_LINKS = frozenset(
    map(
        _message_id,
        ("ODOMETRY", "HIGHRES_IMU", "ACTUATOR_OUTPUT_STATUS", "RAW_IMU", "SCALED_IMU2"),
    )
)
_MINIMAL_HZ = {"ATTITUDE": 1.0, "GLOBAL_POSITION_INT": 1.0, "VFR_HUD": 1.0, "SYS_STATUS": 0.2}


def fast_profile(streams: Sequence[TelemetryStream] = STREAMS) -> RateProfile:
    """Return the profile with the rates of a telemetry table."""
    return RateProfile("fast", {stream.message.message_id: stream.rate_hz for stream in streams})


def half_profile(streams: Sequence[TelemetryStream] = STREAMS) -> RateProfile:
    """Return the profile with half of the rates, without the longest messages."""
    rates_hz = {
        number: 0.5 * hz
        for number, hz in fast_profile(streams).rates_hz.items()
        if number not in _OMITTED_ON_SLOW_LINKS
    }
    return RateProfile("57600", rates_hz)


MINIMAL = RateProfile("9600", {_message_id(name): hz for name, hz in _MINIMAL_HZ.items()})
FAST_BAUD, HALF_BAUD = 115_200, 38_400
"""Lowest baud rates of the profiles FAST and HALF."""


def profile_for(baud: int | None, streams: Sequence[TelemetryStream] = STREAMS) -> RateProfile:
    """Return the profile of a telemetry table for a baud rate; None is a link without one."""
    if baud is None or baud >= FAST_BAUD:
        return fast_profile(streams)
    return half_profile(streams) if baud >= HALF_BAUD else MINIMAL


NEVER_US = 2**63
"""Due time of a link without streams."""
MIN_HIGH_LATENCY_S = 10.0
"""Shortest wall time between two HIGH_LATENCY2 messages on a link, and the default."""


class Schedule:
    """Schedule of the streams of one link.

    A stream is due in the tick in which vehicle time crosses a multiple of its interval. The first
    tick after a start only sets the phase.
    """

    def __init__(
        self,
        profile: RateProfile | None = None,
        streams: Sequence[TelemetryStream] = STREAMS,
        modem_s: float | None = None,
    ) -> None:
        """``modem_s`` is the time between two HIGH_LATENCY2 on a modem; None is no modem."""
        self._is_modem = self._sends_high_latency = modem_s is not None
        self._high_latency_s = max(MIN_HIGH_LATENCY_S, modem_s or 0.0)
        self._high_latency_due_s = self._progress_due_s = -math.inf
        rates_hz = (profile or fast_profile(streams)).rates_hz
        self._table = {stream.message.message_id: stream for stream in streams}
        self._defaults_us = {
            number: _interval_us(rates_hz.get(number, 0.0)) for number in self._table
        }
        self._intervals_us = dict(self._defaults_us)
        self._due_us: dict[int, int] = {}
        """Next due time of the streams of each interval (us)."""
        self._next_us = 0
        """The earliest of them."""
        self._snapshot_us = set[int]()
        """Intervals of the streams that need a ``Snapshot``."""
        self._streams: dict[tuple[int, ...], list[StreamGroup]] = {}
        """Streams that are due together, by their intervals."""
        self._running = False
        self._time_us = 0

    def set_interval(self, message_id: int, interval_us: int | None) -> None:
        """Set the interval of a stream: None is the default, 0 stops the stream.

        Raises KeyError for a message that is not a stream.
        """
        default_us = self._defaults_us[message_id]
        self._intervals_us[message_id] = default_us if interval_us is None else interval_us
        self._align()

    def interval_us(self, message_id: int) -> int:
        """Return the present interval, 0 for a stopped stream. Raises KeyError."""
        return self._intervals_us[message_id]

    def due(self, time_us: int) -> list[StreamGroup]:
        """Return the streams to send in the tick at ``time_us``, in the order of the table."""
        if self.answers_only:
            return []
        restarted = not self._running or time_us < self._time_us
        self._time_us = time_us
        if restarted:
            self._running = True
            self._align()
            return []
        if time_us < self._next_us:
            return []
        due_us, crossed = self._due_us, []
        for interval in due_us:
            if due_us[interval] <= time_us:
                crossed.append(interval)
                due_us[interval] = (time_us // interval + 1) * interval
        self._next_us = min(due_us.values())
        key = tuple(crossed)
        groups = self._streams.get(key)
        if groups is None:
            groups = self._streams[key] = self._streams_of(key)
        return groups

    @property
    def snapshot_due_us(self) -> int:
        """Vehicle time at which the first stream that needs a ``Snapshot`` is due."""
        if self.answers_only:
            return NEVER_US
        if not self._running:
            return self._time_us
        return min((self._due_us[interval] for interval in self._snapshot_us), default=NEVER_US)

    def set_group_rate(self, message_ids: Sequence[int], rate_hz: float) -> None:
        """Set the rate of several streams (REQUEST_DATA_STREAM); 0 stops them."""
        interval_us = _interval_us(rate_hz)
        for number in message_ids:
            self._intervals_us[number] = interval_us
        self._align()

    @property
    def answers_only(self) -> bool:
        """Whether the link carries answers and HIGH_LATENCY2 only."""
        return self._is_modem or self._sends_high_latency

    def control_high_latency(self, enabled: bool) -> None:
        """Start or stop HIGH_LATENCY2; a link that is no modem then has its telemetry again."""
        self._sends_high_latency, self._high_latency_due_s = enabled, -math.inf

    def high_latency_due(self, now_s: float) -> bool:
        """Return whether HIGH_LATENCY2 is due at a wall time, and count it as sent."""
        if not self._sends_high_latency or now_s < self._high_latency_due_s:
            return False
        self._high_latency_due_s = now_s + self._high_latency_s
        return True

    def allows_progress(self, now_s: float) -> bool:
        """Return whether the progress of a long command may be sent at a wall time."""
        if not self.answers_only:
            return True
        if now_s < self._progress_due_s:
            return False
        self._progress_due_s = now_s + MIN_HIGH_LATENCY_S
        return True

    def _streams_of(self, intervals_us: Container[int]) -> list[StreamGroup]:
        """Return the streams with one of the intervals, in the order of the table."""
        streams = [
            self._table[number]
            for number, own_us in self._intervals_us.items()
            if own_us in intervals_us
        ]
        groups = groupby(streams, key=lambda stream: (stream.of_tick, stream.is_numeric))
        return [stream_group(list(members)) for _, members in groups]

    def _align(self) -> None:
        """Set the due times of all streams to the next multiple of their interval."""
        self._due_us = {
            interval: _next_multiple(self._time_us, interval)
            for interval in self._intervals_us.values()
            if interval
        }
        self._next_us = min(self._due_us.values(), default=NEVER_US)
        self._snapshot_us = {
            interval
            for number, interval in self._intervals_us.items()
            if interval and not self._table[number].of_tick
        }
        self._streams = {}


def _next_multiple(time_us: int, interval_us: int) -> int:
    """Return the first multiple of an interval after a time."""
    return (time_us // interval_us + 1) * interval_us


def _interval_us(rate_hz: float) -> int:
    """Return the interval of a rate, 0 for no stream."""
    return round(US_PER_S / rate_hz) if rate_hz else 0
