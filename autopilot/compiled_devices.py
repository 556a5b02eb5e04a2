"""The messages of the vehicle's devices before a sensor sample, decoded by compiled code.

The conversions are those of ``device_messages``. Importing this module loads the compiler.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from autopilot.control import steady_kernel
from mavlink_io import device_messages, jit, lockstep_frames
from mavlink_io.device_records import (
    ALTIMETER_NEW,
    BATTERY_NEW,
    DUCT_NEW,
    DVL_NEW,
    GPS_NEW,
    LEAK_NEW,
)
from mavlink_io.jit import Numbers, numeric
from mavlink_io.lockstep_frames import PAYLOAD, TRUTH, FrameMemory, MessageLayout, message_layout

_pack, _unpack = jit.packer(), jit.unpacker()

_GPS, _GPS_FORMAT = message_layout("HIL_GPS")
_RANGE, _RANGE_FORMAT = message_layout("DISTANCE_SENSOR")
_ODOMETRY, _ODOMETRY_FORMAT = message_layout("ODOMETRY")
_BATTERY, _BATTERY_FORMAT = message_layout("BATTERY_STATUS")
_STATUS, _STATUS_FORMAT = message_layout("SYS_STATUS")
_OUTPUTS, _OUTPUTS_FORMAT = message_layout("ACTUATOR_OUTPUT_STATUS")
_UNKNOWN = MessageLayout(number=-1, length=0, seed=0)
RELAYED = DUCT_NEW << 1
"""Bit beside those of the new records: the message is relayed to ground."""
REFUSED = -1
_FLOAT64 = 8


class _Gps(NamedTuple):
    """Fields of HIL_GPS that are used."""

    time_usec: int
    lat: int
    lon: int
    alt: int
    eph: int
    epv: int
    vn: int
    ve: int
    vd: int
    fix_type: int
    satellites_visible: int


class _Range(NamedTuple):
    """Fields of DISTANCE_SENSOR that are used."""

    time_boot_ms: int
    min_distance: int
    max_distance: int
    current_distance: int
    orientation: int


class _Odometry(NamedTuple):
    """Fields of ODOMETRY that are used."""

    time_usec: int
    vx: float
    vy: float
    vz: float
    velocity_covariance: tuple[float, ...]
    frame_id: int
    child_frame_id: int
    quality: int


class _Battery(NamedTuple):
    """Fields of BATTERY_STATUS that are used."""

    current_consumed: int
    voltages: tuple[int, ...]
    current_battery: int
    battery_remaining: int


class _Status(NamedTuple):
    """Fields of SYS_STATUS that are used."""

    onboard_control_sensors_present_extended: int
    onboard_control_sensors_health_extended: int


class _Outputs(NamedTuple):
    """Fields of ACTUATOR_OUTPUT_STATUS."""

    time_usec: int
    active: int
    actuator: tuple[float, ...]


@numeric
def read(
    octets: Any, received: int, frame: FrameMemory, values: Numbers, relay: Any, relay_end: int
) -> tuple[int, int, int]:
    """Read the frames of a datagram before its last one.

    Parameters
    ----------
    octets : array of octets
        Begins with the datagram.
    received : int
        Number of octets of the datagram.
    frame : FrameMemory
        Memory for one frame.
    values : Numbers
        Array of ``steady_kernel``; receives the records.
    relay : array of octets
        Receives the frames to relay to ground, from ``relay_end`` on.
    relay_end : int
        First free octet of ``relay``.

    Returns
    -------
    tuple of int
        First octet of the last frame; bits of the new records, or `REFUSED` for a datagram that
        Python has to read; first free octet of ``relay``.
    """
    start = new = 0
    size = lockstep_frames.frame_size(octets, 0, received)
    while size > 0 and start + size < received:
        layout = _layout(lockstep_frames.message_number(octets, start))
        if not lockstep_frames.open_frame(octets, start, size, layout, frame):
            return start, REFUSED, relay_end
        added = _store(layout.number, frame.octets, values)
        if added < 0 or relay_end + size > len(relay):
            return start, REFUSED, relay_end
        if added & RELAYED != 0:
            for i in range(size):
                relay[relay_end + i] = octets[start + i]
            relay_end += size
        new |= added
        start += size
        size = lockstep_frames.frame_size(octets, start, received)
    return start, new & (RELAYED - 1), relay_end


@numeric
def _layout(number: int) -> MessageLayout:
    """Return the layout of a message that may come before a sample."""
    layout = _UNKNOWN
    if number == TRUTH.number:
        layout = TRUTH
    elif number == _GPS.number:
        layout = _GPS
    elif number == _RANGE.number:
        layout = _RANGE
    elif number == _ODOMETRY.number:
        layout = _ODOMETRY
    elif number == _BATTERY.number:
        layout = _BATTERY
    elif number == _STATUS.number:
        layout = _STATUS
    elif number == _OUTPUTS.number:
        layout = _OUTPUTS
    return layout


@numeric
def _store(number: int, octets: Any, values: Numbers) -> int:
    """Store the record of a message; return its bits, `REFUSED` for an impossible time."""
    if number == _GPS.number:
        return _store_fix(octets, values)
    if number == _RANGE.number:
        return _store_range(octets, values)
    if number == _ODOMETRY.number:
        return _store_velocity(octets, values)
    if number == _BATTERY.number:
        return _store_battery(octets, values)
    if number == _STATUS.number:
        return _store_leak(octets, values)
    if number == _OUTPUTS.number:
        return _store_deflections(octets, values)
    return 0


@numeric
def _store_fix(octets: Any, values: Numbers) -> int:
    """Store a HIL_GPS."""
    time_us, lat, lon, alt, eph, epv, _, vn, ve, vd, _, fix_type, satellites, _, _ = _unpack(
        octets, PAYLOAD, _GPS_FORMAT
    )
    fields = _Gps(time_us, lat, lon, alt, eph, epv, vn, ve, vd, fix_type, satellites)
    record = device_messages.gps_record(fields)
    _pack(values, _FLOAT64 * steady_kernel.GPS, record, "<11d")
    return GPS_NEW if time_us >= 0 else REFUSED


@numeric
def _store_range(octets: Any, values: Numbers) -> int:
    """Store a DISTANCE_SENSOR of an altimeter."""
    time_ms, nearest, farthest, distance, _, _, orientation, _, _, _, _, _ = _unpack(
        octets, PAYLOAD, _RANGE_FORMAT
    )
    fields = _Range(time_ms, nearest, farthest, distance, orientation)
    if not device_messages.looks_down(fields):
        return 0
    record = device_messages.altimeter_record(fields)
    _pack(values, _FLOAT64 * steady_kernel.ALTIMETER, record, "<4d")
    return ALTIMETER_NEW


@numeric
def _store_velocity(octets: Any, values: Numbers) -> int:
    """Store an ODOMETRY of a DVL."""
    time_us, _, _, _, _, vx, vy, vz, _, _, _, _, covariance, frame, child_frame, _, _, quality = (
        _unpack(octets, PAYLOAD, _ODOMETRY_FORMAT)
    )
    fields = _Odometry(time_us, vx, vy, vz, covariance, frame, child_frame, quality)
    if not device_messages.has_velocity(fields):
        return RELAYED
    record = device_messages.dvl_record(fields)
    _pack(values, _FLOAT64 * steady_kernel.DVL, record, "<7d")
    return RELAYED | DVL_NEW if time_us >= 0 else REFUSED


@numeric
def _store_battery(octets: Any, values: Numbers) -> int:
    """Store a BATTERY_STATUS."""
    consumed, _, _, cells, current, _, _, _, remaining, _, _, _, _, _ = _unpack(
        octets, PAYLOAD, _BATTERY_FORMAT
    )
    fields = _Battery(consumed, cells, current, remaining)
    if not device_messages.has_voltage(fields):
        return 0
    record = device_messages.battery_record(fields)
    _pack(values, _FLOAT64 * steady_kernel.BATTERY, record, "<4d")
    return BATTERY_NEW


@numeric
def _store_leak(octets: Any, values: Numbers) -> int:
    """Store a SYS_STATUS of a leak detector."""
    _, _, _, _, _, _, _, _, _, _, _, _, _, present, _, health = _unpack(
        octets, PAYLOAD, _STATUS_FORMAT
    )
    fields = _Status(present, health)
    if not device_messages.has_leak_detector(fields):
        return 0
    values[steady_kernel.LEAK] = 1.0 if device_messages.leak_record(fields).wet else 0.0
    return LEAK_NEW


@numeric
def _store_deflections(octets: Any, values: Numbers) -> int:
    """Store an ACTUATOR_OUTPUT_STATUS of the duct."""
    time_us, active, actuator = _unpack(octets, PAYLOAD, _OUTPUTS_FORMAT)
    fields = _Outputs(time_us, active, actuator)
    if not device_messages.has_deflections(fields):
        return RELAYED
    record = device_messages.duct_record(fields)
    _pack(values, _FLOAT64 * steady_kernel.DUCT, record, "<3d")
    return RELAYED | DUCT_NEW if time_us >= 0 else REFUSED
