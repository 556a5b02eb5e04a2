"""SI units of MAVLink fields: columns of messages with the unit in the name."""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mavlink_io import dialect
from mavlink_io.dialect import MessageField
from mavlink_io.frames import STANDARD_GRAVITY_MPS2

Column = NDArray[Any]

TIME = "time_s"
"""Column with the time of each message; a field of this name becomes ``field_time_s``."""

_DEG, _RPM = math.radians(1.0), 2 * math.pi / 60.0


class _SiUnit(NamedTuple):
    """Unit of a column, and what a value is multiplied with and then increased by."""

    suffix: str
    factor: float
    offset: float = 0.0


_SI_UNITS = {
    "s": _SiUnit("s", 1.0),
    "ds": _SiUnit("s", 0.1),
    "cs": _SiUnit("s", 0.01),
    "ms": _SiUnit("s", 1e-3),
    "us": _SiUnit("s", 1e-6),
    "ns": _SiUnit("s", 1e-9),
    "Hz": _SiUnit("hz", 1.0),
    "MHz": _SiUnit("hz", 1e6),
    "m": _SiUnit("m", 1.0),
    "dam": _SiUnit("m", 10.0),
    "dm": _SiUnit("m", 0.1),
    "cm": _SiUnit("m", 0.01),
    "mm": _SiUnit("m", 1e-3),
    "cm^2": _SiUnit("m2", 1e-4),
    "m/s": _SiUnit("mps", 1.0),
    "m/s*5": _SiUnit("mps", 0.2),
    "dm/s": _SiUnit("mps", 0.1),
    "cm/s": _SiUnit("mps", 0.01),
    "mm/s": _SiUnit("mps", 1e-3),
    "m/s/s": _SiUnit("mps2", 1.0),
    "mG": _SiUnit("mps2", 1e-3 * STANDARD_GRAVITY_MPS2),
    "rad": _SiUnit("rad", 1.0),
    "deg": _SiUnit("rad", _DEG),
    "deg/2": _SiUnit("rad", 2 * _DEG),
    "cdeg": _SiUnit("rad", 0.01 * _DEG),
    "degE5": _SiUnit("rad", 1e-5 * _DEG),
    "degE7": _SiUnit("deg", 1e-7),
    "rad/s": _SiUnit("radps", 1.0),
    "mrad/s": _SiUnit("radps", 1e-3),
    "deg/s": _SiUnit("radps", _DEG),
    "ddeg/s": _SiUnit("radps", 0.1 * _DEG),
    "rpm": _SiUnit("radps", _RPM),
    "V": _SiUnit("v", 1.0),
    "cV": _SiUnit("v", 0.01),
    "mV": _SiUnit("v", 1e-3),
    "A": _SiUnit("a", 1.0),
    "cA": _SiUnit("a", 0.01),
    "mA": _SiUnit("a", 1e-3),
    "mAh": _SiUnit("c", 3.6),
    "hJ": _SiUnit("j", 100.0),
    "W": _SiUnit("w", 1.0),
    "Pa": _SiUnit("pa", 1.0),
    "hPa": _SiUnit("pa", 100.0),
    "mbar": _SiUnit("pa", 100.0),
    "kPa": _SiUnit("pa", 1e3),
    "degC": _SiUnit("k", 1.0, 273.15),
    "cdegC": _SiUnit("k", 0.01, 273.15),
    "gauss": _SiUnit("t", 1e-4),
    "mgauss": _SiUnit("t", 1e-7),
    "kg": _SiUnit("kg", 1.0),
    "g": _SiUnit("kg", 1e-3),
    "%": _SiUnit("fraction", 0.01),
    "d%": _SiUnit("fraction", 1e-3),
    "c%": _SiUnit("fraction", 1e-4),
}
"""SI unit by MAVLink's unit; latitude and longitude (degE7) are in degrees.

A field with another unit, such as bytes or pixels, keeps its value and its name."""
_UNIT_SUFFIXES = ("_ms", "_usec", "_us", "_mm", "_cm", "_deg", "_mps")
"""Endings of MAVLink's field names that name a unit; the unit of the column replaces them."""

_UNKNOWN_IS_MINUS_ONE = frozenset(
    (
        "battery",
        "battery_remaining",
        "capacity_full",
        "capacity_full_specification",
        "current_battery",
        "current_consumed",
        "energy_consumed",
    )
)
"""Signed fields of battery messages in which MAVLink defines -1 as unknown."""


def si_columns(topic: str, columns: Mapping[str, Column]) -> dict[str, Column]:
    """Return the fields of a message in SI units, with the unit at the end of each name.

    Parameters
    ----------
    topic : str
        ``/mavlink/SYSTEM/COMPONENT/NAME``, or the name of a message that is not MAVLink's.
    columns : mapping
        Fields by name, shape (n,) or (n, elements).

    Returns
    -------
    dict
        Columns by name. An integer that MAVLink defines as unknown, the largest one of its type
        or -1 of a battery, is NaN. A text is an array of bytes. Messages that are not of the
        dialect, and fields without a unit, are unchanged.
    """
    name = topic.rsplit("/", 1)[-1]
    if not topic.startswith("/mavlink/") or name not in dialect.names():
        return dict(columns)
    fields = {field.name: field for field in dialect.by_name(name).fields}
    return dict(
        _si_column(fields[key], values) if key in fields else (key, values)
        for key, values in columns.items()
    )


def _si_column(field: MessageField, values: Column) -> tuple[str, Column]:
    """Return name and values of a field in SI units."""
    if field.type == "char" and values.ndim == 2:
        return field.name, np.ascontiguousarray(values).view(f"S{values.shape[1]}")[:, 0]
    unit = _SI_UNITS.get(field.unit)
    if unit is None:
        return field.name, values
    scaled = unit.factor * values.astype(np.float64) + unit.offset
    if values.dtype.kind in "iu" and values.dtype.itemsize > 1:
        scaled = np.where(values == np.iinfo(values.dtype).max, np.nan, scaled)
    if field.name in _UNKNOWN_IS_MINUS_ONE:
        scaled = np.where(values == -1, np.nan, scaled)
    return _with_unit(field.name, unit.suffix), scaled


def _with_unit(name: str, suffix: str) -> str:
    """Return the name of a column: the name of the field without its unit, and the SI unit."""
    ending = next((end for end in _UNIT_SUFFIXES if name.endswith(end)), "")
    base = name.removesuffix(ending)
    column = name if name.endswith(f"_{suffix}") else f"{base}_{suffix}"
    return f"field_{column}" if column == TIME else column
