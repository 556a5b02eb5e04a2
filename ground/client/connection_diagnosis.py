"""Whether a vehicle was heard, and if not, what was heard in her place and where to look."""

from collections.abc import Collection
from typing import Any

from mavlink_io.dialect import constant
from mavlink_io.request import MavlinkId
from mavlink_io.transport import baud_rate

GROUND_STATION, NO_AUTOPILOT = constant("MAV_TYPE_GCS"), constant("MAV_AUTOPILOT_INVALID")


def is_vehicle(heartbeat: Any) -> bool:
    """Whether a HEARTBEAT is an autopilot's, and no ground station's, radio's or camera's."""
    return bool(heartbeat.type != GROUND_STATION and heartbeat.autopilot != NO_AUTOPILOT)


def explain(address: str, senders: Collection[MavlinkId], skipped_bytes: int) -> str:
    """Of ``senders`` MAVLink was heard, but none is a vehicle; ``skipped_bytes`` were no MAVLink at
    all."""
    baud = baud_rate(address)
    if senders:
        named = ", ".join(f"{system}/{component}" for system, component in sorted(senders))
        return f"MAVLink was heard of {named} (system/component), but no autopilot's HEARTBEAT"
    if skipped_bytes:
        question = f": is {baud} the vehicle's baud rate?" if baud else ""
        return f"{skipped_bytes} bytes were heard and no MAVLink in them{question}"
    advice = (
        ": is she switched on, TX wired to RX and RX to TX, and no other program on the line?"
        if baud
        else ""
    )
    return f"nothing was heard{advice}"
