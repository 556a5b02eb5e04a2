"""Receive what has arrived; whether a vehicle was heard, and if not, what was heard in her
place."""

from collections.abc import Collection
from typing import Any, NamedTuple

from mavlink_io.codec import Frame
from mavlink_io.dialect import constant
from mavlink_io.endpoint import Endpoint
from mavlink_io.request import MavlinkId
from mavlink_io.transport import LinkLostError, baud_rate, wait

GROUND_STATION, NO_AUTOPILOT = constant("MAV_TYPE_GCS"), constant("MAV_AUTOPILOT_INVALID")
MAX_READS = 64
"""Reads of a transport in one go, a datagram or 64 kB each: a fast link must not hold up its
reader."""


class Arrived(NamedTuple):
    """Frames that were read, and whether nothing is left unread: only then is silence silence."""

    frames: list[Frame]
    is_all: bool


def receive_all(endpoint: Endpoint) -> Arrived:
    """Read what has arrived on an endpoint, without waiting.

    Returns
    -------
    Arrived
        The frames of at most `MAX_READS` reads, in order.

    Raises
    ------
    LinkLostError
        The other end is gone for good, and nothing that it sent is left unread.
    """
    frames: list[Frame] = []
    for _ in range(MAX_READS):
        if not wait([endpoint.transport], 0.0):
            return Arrived(frames, True)
        try:
            frames += endpoint.receive()
        except LinkLostError:
            if not frames:
                raise
            return Arrived(frames, False)
    return Arrived(frames, False)


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
