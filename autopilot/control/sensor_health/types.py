"""History of the sensors and their faults, as the tick keeps it."""

import math
from typing import Any, NamedTuple

from mavlink_io.records import SensorFrame

NO_READINGS = ((math.nan,) * 3, (math.nan,) * 3, (math.nan,) * 3, (math.nan,))
"""Accelerometer, gyro, magnetometer, pressure sensor (the order of SensorFrame) before any
reading."""
_NO_FRAME = SensorFrame(-1, *(0.0,) * 13, 0, 0)


ChangeTimes = tuple[int, int, int, int]
"""Time at which the reading of each group last changed."""


class GroupReadings(NamedTuple):
    """History of each group of the sensor frame, in the order of ``NO_READINGS``.

    Needed while a group is silent or implausible.
    """

    readings: tuple[tuple[float, ...], ...] = NO_READINGS
    """Last reading of each group, plausible or not."""
    received_us: tuple[int, ...] = (-1,) * 4
    """Time of the last plausible reading of each group; -1 before the first."""


class Ahrs(NamedTuple):
    """History of the sensor frame (accelerometer, gyro, magnetometer, pressure sensor)."""

    frame: SensorFrame = _NO_FRAME
    """Last readings that may be used."""
    changed_us: ChangeTimes = (-1, -1, -1, -1)
    """Time at which the reading of each group last changed."""
    per_group: GroupReadings | None = GroupReadings()
    """History by group; None if every group of ``frame`` is fresh and plausible."""


class Device(NamedTuple):
    """History of a sensor that sends messages of its own, for example the GPS receiver."""

    record: Any = None
    """Last plausible record; None before the first."""
    accepted_us: int = -1
    """Time of the last plausible record."""
    received_us: int = -1
    """Time of the last record, plausible or not; -1 before the first."""
    changed_us: int = -1
    """Time at which the reading last changed."""
    interval_us: int = 0
    """Interval between the last two records; 0 before the second."""
    usual_interval_us: int = 0
    """Smoothed interval between records; 0 before the second."""


class Fault(NamedTuple):
    """A fault that was detected in one tick."""

    subject: str
    """Name of the sensor or function, as in the STATUSTEXT."""
    what: str
    """Kind of the fault, as in the STATUSTEXT."""


class FaultTracker(NamedTuple):
    """A suspected or confirmed fault."""

    fault: Fault
    since_us: int
    """Time of the first detection."""
    last_us: int
    """Time of the last detection."""
    detections: int = 1
    """Number of ticks in which it was detected."""
    reported: bool = False
    """Whether the fault was confirmed and reported."""
    latest: str = ""
    """Kind of the last detection after the first; empty before the second detection."""


FieldReference = tuple[float, float]
"""Horizontal and downward magnetic field, gauss."""
NO_FIELD: FieldReference = (math.nan, math.nan)
"""Reference before the first arming: no field differs from it."""


class Devices(NamedTuple):
    """History of all sensors outside the sensor frame."""

    gps: Device = Device()
    altimeter: Device = Device()
    dvl: Device = Device()
    battery: Device = Device()
    leak: Device = Device()
    duct: Device = Device()
    gps_under_water: bool = False
    """Whether the receiver has reported while submerged; then its silence is a fault at any
    depth."""


class Health(NamedTuple):
    """History of the sensors outside the sensor frame, and all faults."""

    devices: Devices = Devices()
    faults: tuple[FaultTracker, ...] = ()
    """Suspected and confirmed faults, at most one per subject."""
    check_us: int = 0
    """Time of the next slow checks."""
    field_gauss: FieldReference = NO_FIELD
    """Magnetic field at the last arming."""
