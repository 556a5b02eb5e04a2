"""What the vehicle remembers of her instruments, and what she doubts of them."""

import math
from typing import Any, NamedTuple

from mavlink_io.records import SensorFrame

NO_READINGS = ((math.nan,) * 3, (math.nan,) * 3, (math.nan,) * 3, (math.nan,))
"""Of accelerometer, gyro, magnetometer and pressure sensor, in the order of SensorFrame."""
_NO_FRAME = SensorFrame(-1, *(0.0,) * 13, 0, 0)


class Piecemeal(NamedTuple):
    """What was heard of the AHRS's groups, in the order of ``NO_READINGS``, where not all spoke and
    made sense."""

    readings: tuple[tuple[float, ...], ...] = NO_READINGS
    """The last ones, whatever they say."""
    heard_us: tuple[int, ...] = (-1,) * 4
    """When a reading last made sense; -1 for never."""


class Ahrs(NamedTuple):
    """What was heard of the AHRS."""

    frame: SensorFrame = _NO_FRAME
    """The last readings that may be used."""
    changed_us: tuple[int, ...] = (-1,) * 4
    """When each group's reading last changed."""
    piecemeal: Piecemeal | None = Piecemeal()
    """None where ``frame`` is all there is to know: every group spoke in it and made sense."""


class Device(NamedTuple):
    """What was heard of a device that speaks for itself."""

    record: Any = None
    """The last one that makes sense."""
    sound_us: int = -1
    """When that was."""
    heard_us: int = -1
    """When anything was; -1 for never."""
    changed_us: int = -1
    """When it last said something new."""
    interval_us: int = 0
    """Between the last two words; zero before the second."""
    pace_us: int = 0
    """The usual interval."""


class Fault(NamedTuple):
    """Something that looks wrong in one tick."""

    subject: str
    what: str


class FaultTracker(NamedTuple):
    """A complaint that lasts, or lasted until lately."""

    complaint: Fault
    since_us: int
    last_us: int
    times: int = 1
    told: bool = False
    """Whether it has lasted long enough to be believed and told."""
    latest: str = ""
    """What was last complained of, once that differs."""


class Health(NamedTuple):
    """What the vehicle knows of her devices and her own soundness."""

    gps: Device = Device()
    altimeter: Device = Device()
    dvl: Device = Device()
    battery: Device = Device()
    leak: Device = Device()
    duct: Device = Device()
    gps_under_water: bool = False
    """The receiver was heard at depth: it speaks always, so its silence means something there
    too."""
    doubts: tuple[FaultTracker, ...] = ()
    check_us: int = 0
    """When to look again at what changes slowly."""
