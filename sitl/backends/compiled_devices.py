"""The frames of the slower sensors, encoded by compiled code as by ``HilClient``.

Importing this module loads the compiler.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from mavlink_io import device_messages, device_records, jit
from mavlink_io.device_messages import (
    BATTERY_COMPONENT,
    DUCT_COMPONENT,
    DVL_COMPONENT,
    LEAK_COMPONENT,
)
from mavlink_io.device_records import (
    ALTIMETER_NEW,
    BATTERY_NEW,
    DUCT_NEW,
    DVL_NEW,
    GPS_NEW,
    LEAK_NEW,
)
from mavlink_io.jit import numeric
from mavlink_io.lockstep_frames import HEAD, MessageLayout, message_layout, seal_at
from sitl.backends.messages import COMPONENT, SYSTEM, altimeter_values, gps_values
from sitl.core.sensors.devices import LATEST
from sitl.vehicle.vectors import Vector

_pack = jit.packer()
SENDERS = COMPONENT, DVL_COMPONENT, BATTERY_COMPONENT, LEAK_COMPONENT, DUCT_COMPONENT
"""Component ids of the frames, the simulator's own first; each has sequence numbers of its own."""
OWN, _DVL, _BATTERY, _LEAK, _DUCT = range(len(SENDERS))
_AT_GPS, _AT_ALTIMETER, _AT_DVL, _AT_BATTERY, _AT_LEAK, _AT_DUCT = LATEST
_GPS, _GPS_FORMAT = message_layout("HIL_GPS")
_RANGE, _RANGE_FORMAT = message_layout("DISTANCE_SENSOR")
_ODOMETRY, _ODOMETRY_FORMAT = message_layout("ODOMETRY")
_GAUGE, _GAUGE_FORMAT = message_layout("BATTERY_STATUS")
_STATUS, _STATUS_FORMAT = message_layout("SYS_STATUS")
_OUTPUTS, _OUTPUTS_FORMAT = message_layout("ACTUATOR_OUTPUT_STATUS")


@numeric
def encode(octets: Any, end: int, new: int, latest: Vector, sequences: NDArray[np.int64]) -> int:
    """Encode the frames of new readings.

    Parameters
    ----------
    octets : array of octets
        Receives the frames, one after the other.
    end : int
        First free octet.
    new : int
        Bits of the new readings, see ``device_records``.
    latest : ndarray
        Latest readings, see ``devices.LATEST``.
    sequences : ndarray
        Number of frames of each of `SENDERS`; it is counted up.

    Returns
    -------
    int
        First free octet after them.
    """
    if new & GPS_NEW != 0:
        fix = device_records.gps_fix(latest[_AT_GPS:])
        _pack(octets, end + HEAD, gps_values(fix), _GPS_FORMAT)
        end = seal(octets, end, _GPS, OWN, sequences)
    if new & ALTIMETER_NEW != 0:
        echo = device_records.altimeter(latest[_AT_ALTIMETER:])
        _pack(octets, end + HEAD, altimeter_values(echo), _RANGE_FORMAT)
        end = seal(octets, end, _RANGE, OWN, sequences)
    if new & DVL_NEW != 0:
        velocity = device_records.dvl(latest[_AT_DVL:])
        _pack(octets, end + HEAD, device_messages.dvl_values(velocity), _ODOMETRY_FORMAT)
        end = seal(octets, end, _ODOMETRY, _DVL, sequences)
    if new & BATTERY_NEW != 0:
        gauge = device_records.battery(latest[_AT_BATTERY:])
        _pack(octets, end + HEAD, device_messages.battery_values(gauge), _GAUGE_FORMAT)
        end = seal(octets, end, _GAUGE, _BATTERY, sequences)
    if new & LEAK_NEW != 0:
        bilge = device_records.leak(latest[_AT_LEAK:])
        _pack(octets, end + HEAD, device_messages.leak_values(bilge), _STATUS_FORMAT)
        end = seal(octets, end, _STATUS, _LEAK, sequences)
    if new & DUCT_NEW != 0:
        duct = device_records.duct(latest[_AT_DUCT:])
        _pack(octets, end + HEAD, device_messages.duct_values(duct), _OUTPUTS_FORMAT)
        end = seal(octets, end, _OUTPUTS, _DUCT, sequences)
    return end


@numeric
def seal(
    octets: Any, end: int, layout: MessageLayout, sender: int, sequences: NDArray[np.int64]
) -> int:
    """Write header and checksum of a frame whose payload is written.

    Parameters
    ----------
    octets : array of octets
        Memory of the frame.
    end : int
        First octet of the frame.
    layout : MessageLayout
        Message of the frame.
    sender : int
        Index in `SENDERS`.
    sequences : ndarray
        As of ``encode``.

    Returns
    -------
    int
        First free octet after the frame.
    """
    sequence = sequences[sender] & 0xFF
    sequences[sender] += 1
    return end + seal_at(octets, end, layout, sequence, SYSTEM << 8 | SENDERS[sender])
