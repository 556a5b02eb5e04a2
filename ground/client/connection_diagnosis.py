"""Receive frames, recognise a vehicle, and explain why none was found."""

from collections.abc import Collection
from typing import Any, NamedTuple

from mavlink_io.codec import Frame
from mavlink_io.dialect import constant
from mavlink_io.endpoint import Endpoint
from mavlink_io.request import MavlinkId
from mavlink_io.transport import LinkLostError, baud_rate, wait

GROUND_STATION, NO_AUTOPILOT = constant("MAV_TYPE_GCS"), constant("MAV_AUTOPILOT_INVALID")
MAX_READS = 64
"""Maximum number of reads (a datagram or 64 kB each) in one call, so that a fast link cannot block
the caller."""
MAX_FRAMES = 5000
"""Number of frames after which one call reads no more. The system keeps megabytes of a stream; to
record them takes seconds in a program that records several vehicles."""


class Arrived(NamedTuple):
    """Result of `receive_all`."""

    frames: list[Frame]
    is_all: bool
    """True if nothing is left unread; only then may a timeout be checked."""


def receive_all(endpoint: Endpoint) -> Arrived:
    """Read what has arrived on an endpoint, without waiting.

    Returns
    -------
    Arrived
        The frames of at most `MAX_READS` reads, in order; about `MAX_FRAMES` at most.

    Raises
    ------
    LinkLostError
        The other end is gone for good, and nothing that it sent is left unread.
    """
    frames: list[Frame] = []
    for _ in range(MAX_READS):
        if len(frames) >= MAX_FRAMES:
            break
        if not wait([endpoint.transport], 0.0):
            return Arrived(frames, True)
        try:
            frames += endpoint.receive()
        except LinkLostError:
            if not frames:
                raise
            break
    return Arrived(frames, False)


def is_vehicle(heartbeat: Any) -> bool:
    """Return whether a HEARTBEAT is that of an autopilot, not of a ground station or device."""
    return bool(heartbeat.type != GROUND_STATION and heartbeat.autopilot != NO_AUTOPILOT)


def explain(endpoint: Endpoint, senders: Collection[MavlinkId]) -> str:
    """Return why no vehicle was found on a link.

    Parameters
    ----------
    endpoint : Endpoint
        This end of the link; the text names the baud rate of a serial one.
    senders : Collection
        Systems and components from which MAVLink frames were received.
    """
    baud = baud_rate(endpoint.transport.address)
    if senders:
        named = ", ".join(f"{system}/{component}" for system, component in sorted(senders))
        return (
            f"MAVLink was received from {named} (system/component), "
            "but no HEARTBEAT of an autopilot"
        )
    if endpoint.signing is not None and endpoint.signing.refused_signatures:
        return "messages with another signature were received: is the key of --sign the vehicle's?"
    if endpoint.signing is not None and endpoint.signing.unsigned_frames:
        return "messages without a signature were received: leave --sign out for an unsigned link"
    if endpoint.skipped_bytes:
        question = f": is {baud} the vehicle's baud rate?" if baud else ""
        return f"{endpoint.skipped_bytes} bytes were received and no MAVLink in them{question}"
    advice = (
        ": is the vehicle switched on, TX wired to RX and RX to TX, and no other program on the"
        " line?"
        if baud
        else ""
    )
    return f"nothing was received{advice}"
