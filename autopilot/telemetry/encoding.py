"""What the builders of messages share: times, and numbers that fit their field whatever they are.

The time since boot wraps after 2^32 ms (49.7 days), as MAVLink's ``time_boot_ms`` does everywhere.
"""

import math
import struct
from collections.abc import Callable

from autopilot.vehicle import Snapshot
from mavlink_io.device_messages import UNKNOWN_U16
from mavlink_io.dialect import MessageType, Values
from mavlink_io.endpoint import Endpoint

Builder = Callable[[Snapshot], Values]


def time_us(s: Snapshot) -> int:
    return max(0, s.state.time_us)


def boot_ms(s: Snapshot) -> int:
    return max(0, s.state.time_us) // 1000 & 0xFFFF_FFFF


def clamp(value: float, least: int, most: int) -> int:
    """The nearest whole number that the field holds; its least where there is no number at all."""
    if math.isnan(value):
        return least
    return round(max(least, min(most, value)))


def int16(value: float) -> int:
    return clamp(value, -32_768, 32_767)


def int32(value: float) -> int:
    return clamp(value, -(1 << 31), (1 << 31) - 1)


def uint16(value: float) -> int:
    """Below the field's mark of an unknown value."""
    return clamp(value, 0, UNKNOWN_U16 - 1)


def uint32(value: float) -> int:
    return clamp(value, 0, (1 << 32) - 1)


def encoded(endpoint: Endpoint, message: MessageType, values: Values) -> bytes:
    """Return the next frame of ``endpoint``: all that the autopilot sends to ground is packed here.

    A number that its field cannot hold is replaced by the nearest one that it can. A value that is
    missing or of another type raises struct.error or TypeError: that is a mistake of this program.
    """
    try:
        return endpoint.encode_values(message, values)
    except (struct.error, OverflowError):
        return endpoint.encode_values(message, message.clamped(values))


def packed(message: MessageType, values: Values) -> bytes:
    """Return the payload of a message for the log, with numbers treated as by ``encoded``."""
    try:
        return message.pack(values)
    except (struct.error, OverflowError):
        return message.pack(message.clamped(values))


def centidegrees(angle_rad: float) -> int:
    """Of a heading: 0 to 35999."""
    return clamp(math.degrees(angle_rad) % 360.0 * 100.0, 0, 36_000) % 36_000
