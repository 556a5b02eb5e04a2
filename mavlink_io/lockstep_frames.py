"""The frames of a lockstep tick, encoded and decoded by compiled code in memory of their own.

A simulator sends HIL_SENSOR and receives HIL_ACTUATOR_CONTROLS in every tick, and often sends
HIL_STATE_QUATERNION. Records and bytes of Python take longer than the tick itself, so these
functions read and write the memory that the socket reads and writes. Whatever is no unsigned
MAVLink 2 frame of an expected message is refused, and left to ``codec.Framer``.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from mavlink_io import dialect, jit
from mavlink_io.jit import numeric

START, HEAD, PAYLOAD = 6, 10, 16
"""Octets of the memory at which a frame starts, of its header, and at which its payload starts.

Every field of the payload is then aligned to its size.
"""
OVERHEAD = 12
"""Octets of a frame beside its payload."""
_MAGIC, _CRC_START, _CONTROLS = 0xFD, 0xFFFF, 16
_TIME, _FLOATS, _FLAGS = PAYLOAD // 8, PAYLOAD // 4, PAYLOAD // 8 + 1
"""Indices of the time stamp in ``words``, of the payload in ``floats``, of the flags in ``words``.

All messages begin with the time stamp.
"""


class MessageLayout(NamedTuple):
    """What the header and the checksum of a message depend on."""

    number: int
    """Message id."""
    length: int
    """Octets of the payload with its extension fields."""
    seed: int
    """CRC_EXTRA of the message definition."""


def message_layout(name: str) -> tuple[MessageLayout, str]:
    """Return the layout of a message of the dialect.

    Parameters
    ----------
    name : str
        Name of the message.

    Returns
    -------
    tuple of MessageLayout and str
        What its frame depends on, and the format of its payload.
    """
    message = dialect.by_name(name)
    layout = MessageLayout(message.message_id, message.struct.size, message.crc_extra)
    return layout, message.struct.format


SENSOR = MessageLayout(number=107, length=65, seed=108)
"""HIL_SENSOR."""
CONTROLS = MessageLayout(number=93, length=81, seed=47)
"""HIL_ACTUATOR_CONTROLS."""
TRUTH = MessageLayout(number=115, length=64, seed=4)
"""HIL_STATE_QUATERNION."""
READINGS = 13
"""Real-valued fields of HIL_SENSOR, after the time stamp."""
_UPDATED, _SENSOR_ID = PAYLOAD // 4 + 15, PAYLOAD + 64
"""Index of ``fields_updated`` in ``integers``, and of ``id`` in ``octets``."""
_FIRST_READING, _FIRST_CONTROL, _MODE = _FLOATS + 2, _FLOATS + 4, PAYLOAD + 80
"""Indices of the first reading and control in ``floats``, and of the mode in ``octets``."""
_ATTITUDE, _RATES, _POSITION, _VELOCITY = _FLOATS + 2, _FLOATS + 6, _FLOATS + 9, PAYLOAD + 48
"""Indices of attitude and rates in ``floats``, of the position in ``integers``, and of the velocity
in ``octets``."""


class FrameMemory(NamedTuple):
    """Memory of one frame, as numbers of four types; all share the same memory."""

    octets: Any
    """Unsigned numbers of 8 bits."""
    floats: Any
    """Numbers of 32 bits."""
    integers: Any
    """Unsigned numbers of 32 bits."""
    words: Any
    """Signed numbers of 64 bits."""


def frame_memory(frame_length: int) -> FrameMemory:
    """Return memory of zeros.

    Parameters
    ----------
    frame_length : int
        Largest number of octets of the frame.

    Returns
    -------
    FrameMemory
        Arrays for compiled code; memory views without numba.
    """
    octets = jit.octets(8 * (1 + (START + frame_length) // 8))
    return FrameMemory(octets, *(jit.view(octets, code) for code in ("f", "I", "q")))


@numeric
def checksum(octets: Any, start: int, end: int, seed: int) -> int:
    """Return the checksum of a frame: CRC-16/MCRF4XX of its octets and the seed.

    Parameters
    ----------
    octets : sequence of int
        The frame.
    start, end : int
        First octet after the magic number, and first octet of the checksum.
    seed : int
        CRC_EXTRA of the message.

    Returns
    -------
    int
        16 bits.

    Notes
    -----
    The update by one octet is that of MAVLink's ``crc_accumulate``, without a table.
    """
    crc = _CRC_START
    for i in range(start, end + 1):
        low = ((seed if i == end else int(octets[i])) ^ crc) & 0xFF
        low = (low ^ (low << 4)) & 0xFF
        crc = (crc >> 8) ^ (low << 8) ^ (low << 3) ^ (low >> 4)
    return crc & 0xFFFF


@numeric
def seal(memory: FrameMemory, layout: MessageLayout, sequence: int, sender: int) -> int:
    """Write the header and the checksum of a frame whose payload is written.

    Parameters
    ----------
    memory : FrameMemory
        Memory with the payload at full length; the checksum may overwrite zeros at its end.
    layout : MessageLayout
        Message of the frame.
    sequence : int
        Sequence number, 0 to 255.
    sender : int
        256 times the system id plus the component id.

    Returns
    -------
    int
        Length of the frame. Trailing zeros of its payload are cut off.
    """
    return seal_at(memory.octets, START, layout, sequence, sender)


@numeric
def seal_at(octets: Any, start: int, layout: MessageLayout, sequence: int, sender: int) -> int:
    """Write the header and the checksum of a frame, as ``seal`` does.

    Parameters
    ----------
    octets : sequence of int
        Memory with the payload at full length, `HEAD` octets after ``start``.
    start : int
        First octet of the frame.
    layout : MessageLayout
        Message of the frame.
    sequence, sender : int
        As of ``seal``.

    Returns
    -------
    int
        Length of the frame.
    """
    payload, length = start + HEAD, layout.length
    while length > 1 and octets[payload + length - 1] == 0:
        length -= 1
    octets[start] = _MAGIC
    octets[start + 1] = length
    octets[start + 2] = 0
    octets[start + 3] = 0
    octets[start + 4] = sequence
    octets[start + 5] = sender >> 8
    octets[start + 6] = sender & 0xFF
    octets[start + 7] = layout.number & 0xFF
    octets[start + 8] = layout.number >> 8
    octets[start + 9] = 0
    end = payload + length
    crc = checksum(octets, start + 1, end, layout.seed)
    octets[end] = crc & 0xFF
    octets[end + 1] = crc >> 8
    return length + OVERHEAD


@numeric
def frame_size(octets: Any, start: int, end: int) -> int:
    """Return the length of the MAVLink 2 frame at an index of a datagram.

    Parameters
    ----------
    octets : sequence of int
        The datagram.
    start, end : int
        First octet of the frame; number of octets of the datagram.

    Returns
    -------
    int
        Number of octets; 0 if no complete frame begins there.
    """
    if end - start <= OVERHEAD or octets[start] != _MAGIC:
        return 0
    size = int(octets[start + 1]) + OVERHEAD
    return size if start + size <= end else 0


@numeric
def message_number(octets: Any, start: int) -> int:
    """Return the message id of a frame.

    Parameters
    ----------
    octets : sequence of int
        Datagram with the frame.
    start : int
        First octet of the frame, for which ``frame_size`` is not 0.

    Returns
    -------
    int
        Message id.
    """
    return int(octets[start + 7]) | int(octets[start + 8]) << 8 | int(octets[start + 9]) << 16


@numeric
def open_frame(
    octets: Any, start: int, size: int, layout: MessageLayout, memory: FrameMemory
) -> bool:
    """Check a frame of a datagram, and copy its payload.

    Parameters
    ----------
    octets : sequence of int
        Datagram with the frame.
    start, size : int
        First octet of the frame, and its ``frame_size``.
    layout : MessageLayout
        Expected message.
    memory : FrameMemory
        Receives the payload, with the zeros that its sender has cut off.

    Returns
    -------
    bool
        Whether it is an unsigned frame of the message. Otherwise the memory has not changed.
    """
    length = size - OVERHEAD
    payload = start + HEAD
    if not (
        1 <= length <= layout.length
        and octets[start + 2] == 0
        and message_number(octets, start) == layout.number
        and checksum(octets, start + 1, payload + length, layout.seed)
        == int(octets[payload + length]) | int(octets[payload + length + 1]) << 8
    ):
        return False
    for i in range(length):
        memory.octets[PAYLOAD + i] = octets[payload + i]
    for i in range(length, layout.length):
        memory.octets[PAYLOAD + i] = 0
    return True


@numeric
def time_us(memory: FrameMemory) -> int:
    """Return the time stamp of a frame.

    Parameters
    ----------
    memory : FrameMemory
        Memory with the payload of a frame.

    Returns
    -------
    int
        Time, us; negative above 2^63.
    """
    return int(memory.words[_TIME])


@numeric
def control(memory: FrameMemory, index: int) -> float:
    """Return a control of HIL_ACTUATOR_CONTROLS.

    Parameters
    ----------
    memory : FrameMemory
        Memory with the payload of a frame.
    index : int
        Number of the control, 0 to 15.

    Returns
    -------
    float
        Its value.
    """
    return float(memory.floats[_FIRST_CONTROL + index])


@numeric
def mode(memory: FrameMemory) -> int:
    """Return the mode of HIL_ACTUATOR_CONTROLS.

    Parameters
    ----------
    memory : FrameMemory
        Memory with the payload of a frame.

    Returns
    -------
    int
        MAV_MODE_FLAG.
    """
    return int(memory.octets[_MODE])


@numeric
def write_sensors(memory: FrameMemory, stamp_us: int, readings: Any, updated: int) -> None:
    """Write the payload of HIL_SENSOR; the sensor id is 0.

    Parameters
    ----------
    memory : FrameMemory
        Memory to write.
    stamp_us : int
        Time stamp, us.
    readings : sequence of float
        The `READINGS` real-valued fields in wire order.
    updated : int
        Field ``fields_updated``.
    """
    memory.words[_TIME] = stamp_us
    for i in range(READINGS):
        memory.floats[_FIRST_READING + i] = readings[i]
    memory.integers[_UPDATED] = updated
    memory.octets[_SENSOR_ID] = 0


@numeric
def write_truth(
    memory: FrameMemory,
    stamp_us: int,
    attitude_q: tuple[float, float, float, float],
    rates_radps: tuple[float, float, float],
    position: tuple[int, int, int],
    motion: tuple[int, int, int, int, int, int, int, int],
) -> None:
    """Write the payload of HIL_STATE_QUATERNION.

    Parameters
    ----------
    memory : FrameMemory
        Memory to write.
    stamp_us : int
        Time stamp, us.
    attitude_q : tuple of float
        Quaternion from FRD to NED, scalar first.
    rates_radps : tuple of float
        Angular rates in FRD.
    position : tuple of int
        Latitude, longitude (1e-7 deg) and altitude (mm).
    motion : tuple of int
        Velocity in NED (cm/s), indicated and true airspeed (cm/s), and specific force in FRD (mG).
    """
    memory.words[_TIME] = stamp_us
    for i in range(len(attitude_q)):
        memory.floats[_ATTITUDE + i] = attitude_q[i]
    for i in range(len(rates_radps)):
        memory.floats[_RATES + i] = rates_radps[i]
    for i in range(len(position)):
        memory.integers[_POSITION + i] = position[i] & 0xFFFFFFFF
    for i in range(len(motion)):
        memory.octets[_VELOCITY + 2 * i] = motion[i] & 0xFF
        memory.octets[_VELOCITY + 2 * i + 1] = motion[i] >> 8 & 0xFF


@numeric
def read_sensors(memory: FrameMemory, values: Any) -> None:
    """Read the fields of HIL_SENSOR as numbers in wire order.

    Parameters
    ----------
    memory : FrameMemory
        Memory with the payload of a frame.
    values : array of float
        Receives time stamp, readings, ``fields_updated`` and sensor id.
    """
    values[0] = float(memory.words[_TIME])
    for i in range(READINGS):
        values[1 + i] = float(memory.floats[_FIRST_READING + i])
    values[1 + READINGS] = float(memory.integers[_UPDATED])
    values[2 + READINGS] = float(memory.octets[_SENSOR_ID])


@numeric
def write_controls(
    memory: FrameMemory,
    stamp_us: int,
    flags: int,
    controls: tuple[float, float, float, float],
    new_mode: int,
) -> None:
    """Write the payload of HIL_ACTUATOR_CONTROLS.

    Parameters
    ----------
    memory : FrameMemory
        Memory to write.
    stamp_us : int
        Time stamp of the answered sensors, us.
    flags : int
        HIL_ACTUATOR_CONTROLS_FLAGS.
    controls : tuple of float
        The first controls; the others are zero.
    new_mode : int
        MAV_MODE_FLAG.
    """
    memory.words[_TIME] = stamp_us
    memory.words[_FLAGS] = flags
    for i in range(_CONTROLS):
        memory.floats[_FIRST_CONTROL + i] = 0.0
    for i in range(len(controls)):
        memory.floats[_FIRST_CONTROL + i] = controls[i]
    memory.octets[_MODE] = new_mode
