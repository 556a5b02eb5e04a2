"""Frames of a vehicle for tests of the live page."""

import math
from typing import Any

from mavlink_io.codec import Frame
from mavlink_io.dialect import by_name

SUBMARINE, GENERIC, ARDUPILOT, ARMED = 12, 0, 3, 129
LEVEL_Q = (1.0, 0.0, 0.0, 0.0)


def frame(name: str, **fields: Any) -> Frame:
    """A frame of system 1 with zeros in all other fields."""
    kind = by_name(name)
    payload = kind.pack(kind.values(**{**kind.unpack(b"")._asdict(), **fields}))
    return Frame(1, 1, kind.message_id, 0, payload, payload)


def heartbeat(autopilot: int = GENERIC) -> Frame:
    return frame("HEARTBEAT", type=SUBMARINE, autopilot=autopilot, base_mode=ARMED)


def motion(time_s: float) -> list[Frame]:
    """A dive in a circle of 20 m, one sample of each message."""
    time_ms, angle = int(time_s * 1e3), time_s / 10.0
    depth_m = 4.0 + math.sin(time_s / 3.0)
    return [
        frame(
            "LOCAL_POSITION_NED",
            time_boot_ms=time_ms,
            x=20.0 * math.sin(angle),
            y=20.0 - 20.0 * math.cos(angle),
            z=depth_m,
        ),
        frame("ACTUATOR_OUTPUT_STATUS", actuator=(0.5 * math.sin(time_s), 0.2, 0.58, *[0.0] * 29)),
        frame("ATTITUDE_TARGET", time_boot_ms=time_ms, q=LEVEL_Q, type_mask=7),
        frame("POSITION_TARGET_LOCAL_NED", time_boot_ms=time_ms, z=4.0, type_mask=0b11111111000),
        frame(
            "ATTITUDE", time_boot_ms=time_ms, yaw=angle, pitch=0.1 * math.sin(time_s), roll=-0.0005
        ),
    ]
