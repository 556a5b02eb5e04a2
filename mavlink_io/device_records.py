"""Records of the slower sensors as numbers in arrays, which compiled code keeps them in.

Each function takes the numbers from the first one of a record on, in the order of its fields.
"""

from typing import Any

from mavlink_io.jit import numeric
from mavlink_io.records import Altimeter, Battery, DuctFeedback, Dvl, GpsFix, Leak

KINDS = GpsFix, Altimeter, Dvl, Battery, Leak, DuctFeedback
"""Records, in the order of their bits."""
GPS_NEW, ALTIMETER_NEW, DVL_NEW, BATTERY_NEW, LEAK_NEW, DUCT_NEW = (
    1 << index for index in range(len(KINDS))
)
"""Bits of the records that are new in a tick."""
LENGTHS = tuple(len(kind._fields) for kind in KINDS)
"""Length of each record."""


@numeric
def gps_fix(v: Any) -> GpsFix:
    """Return a satellite fix.

    Parameters
    ----------
    v : sequence of float
        Its numbers.

    Returns
    -------
    GpsFix
        The record.
    """
    return GpsFix(int(v[0]), int(v[1]), v[2], v[3], v[4], v[5], v[6], v[7], int(v[8]), v[9], v[10])


@numeric
def altimeter(v: Any) -> Altimeter:
    """Return an altimeter record.

    Parameters
    ----------
    v : sequence of float
        Its numbers.

    Returns
    -------
    Altimeter
        The record.
    """
    return Altimeter(int(v[0]), v[1], v[2], v[3])


@numeric
def dvl(v: Any) -> Dvl:
    """Return a DVL record.

    Parameters
    ----------
    v : sequence of float
        Its numbers.

    Returns
    -------
    Dvl
        The record.
    """
    return Dvl(int(v[0]), v[1], v[2], v[3], v[4] != 0.0, v[5], int(v[6]))


@numeric
def battery(v: Any) -> Battery:
    """Return a battery record.

    Parameters
    ----------
    v : sequence of float
        Its numbers.

    Returns
    -------
    Battery
        The record.
    """
    return Battery(v[0], v[1], v[2], v[3])


@numeric
def leak(v: Any) -> Leak:
    """Return a record of the leak detector.

    Parameters
    ----------
    v : sequence of float
        Its number.

    Returns
    -------
    Leak
        The record.
    """
    return Leak(v[0] != 0.0)


@numeric
def duct(v: Any) -> DuctFeedback:
    """Return a measured duct deflection.

    Parameters
    ----------
    v : sequence of float
        Its numbers.

    Returns
    -------
    DuctFeedback
        The record.
    """
    return DuctFeedback(int(v[0]), v[1], v[2])


READERS = gps_fix, altimeter, dvl, battery, leak, duct
"""Functions that return the records of `KINDS`."""
