"""Conversions shared by the message builders: times, and numbers limited to their field.

The time since boot wraps after 2^32 ms (49.7 days), as MAVLink's ``time_boot_ms`` does everywhere.
"""

import math
import struct
from collections.abc import Callable
from typing import Any

from autopilot.reports import Snapshot, SteadyReport, TickReport
from mavlink_io.device_messages import UNKNOWN_U16
from mavlink_io.dialect import MessageType, Values
from mavlink_io.jit import numeric

Builder = Callable[[Any], Values]
"""Build a message from a ``Snapshot``; from a ``TickReport`` if its stream is ``of_tick``."""
Report = Snapshot | TickReport | SteadyReport


@numeric
def time_us(s: Report) -> int:
    """Return vehicle time in us; 0 before the first sample."""
    return max(0, s.time_us)


@numeric
def boot_ms(s: Report) -> int:
    """Return vehicle time in ms, modulo 2^32."""
    return max(0, s.time_us) // 1000 & 0xFFFF_FFFF


@numeric
def clamp(value: float, minimum: int, maximum: int) -> int:
    """Return the nearest integer within the limits; the minimum for NaN."""
    if math.isnan(value):
        return minimum
    return round(max(minimum, min(maximum, value)))


@numeric
def int16(value: float) -> int:
    """Return the nearest int16."""
    return clamp(value, -32_768, 32_767)


@numeric
def int32(value: float) -> int:
    """Return the nearest int32."""
    return clamp(value, -(1 << 31), (1 << 31) - 1)


@numeric
def uint16(value: float) -> int:
    """Return the nearest uint16 below UNKNOWN_U16, which marks an unknown value."""
    return clamp(value, 0, UNKNOWN_U16 - 1)


def uint32(value: float) -> int:
    """Return the nearest uint32."""
    return clamp(value, 0, (1 << 32) - 1)


def pack_payload(message: MessageType, values: Values) -> bytes:
    """Return the payload of a message; all messages to ground and to the log are packed here.

    A number outside the range of its field is replaced by the nearest one inside. A value that is
    missing or has a wrong type raises struct.error or TypeError: that is a programming error.
    """
    try:
        return message.pack(values)
    except (struct.error, OverflowError):
        return message.pack(message.clamped(values))


@numeric
def centidegrees(angle_rad: float) -> int:
    """Return a heading in centidegrees, 0 to 35999."""
    return clamp(math.degrees(angle_rad) % 360.0 * 100.0, 0, 36_000) % 36_000
