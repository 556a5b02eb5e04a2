"""Catalogue of faults: units, kinds of fault, and their parameters with units and limits."""

from __future__ import annotations

from collections.abc import Mapping
from math import inf, isfinite, nan, radians
from typing import NamedTuple

from mavlink_io.errors import ErrorCode, InputError
from mavlink_io.suggestions import did_you_mean


class Size(NamedTuple):
    """Numeric parameter of a fault."""

    key: str
    """Key in a scenario file, with the unit."""
    default: float | None
    """None if the key is required; NaN if its absence has a meaning of its own."""
    minimum: float = -inf
    maximum: float = inf
    si: float = 1.0
    """Factor from the key's unit to SI."""


class ScheduledFault(NamedTuple):
    """One fault with start and end."""

    unit: str
    kind: str
    from_us: int
    """Vehicle time of the start."""
    until_us: int | None = None
    """Vehicle time of the end; None until cleared."""
    sizes: tuple[float, ...] = ()
    """Parameters in the order of the catalogue, SI."""

    @property
    def name(self) -> str:
        """Unit and kind, as shown to operators."""
        return f"{self.unit} {self.kind}"


class FaultError(InputError):
    """The fault is not possible; the message describes a valid one."""

    code = ErrorCode.FAULT


Kinds = Mapping[str, tuple[Size, ...]]

_DEG = radians(1.0)
_MAX_S = 1e6

_AXIS: Kinds = {
    "off": (),
    "stuck": (Size(key="angle_deg", default=nan, minimum=-90.0, maximum=90.0, si=_DEG),),
    "slipping": (Size(key="share", default=0.3, minimum=0.0, maximum=1.0),),
    "slow": (Size(key="rate_degps", default=2.0, minimum=0.0, maximum=1e3, si=_DEG),),
    "biased": (Size(key="angle_deg", default=3.0, minimum=-90.0, maximum=90.0, si=_DEG),),
    "noisy": (Size(key="rms_deg", default=1.0, minimum=0.0, maximum=90.0, si=_DEG),),
}
"""Faults of a tailcone axis.

Off: no drive; the flow returns the duct to neutral. Stuck: at the present angle, or after running
to the given one. Slipping: the motor loses this fraction of its steps. Slow: reduced rate. Biased:
constant error of the duct angle. Noisy: white error of the duct angle, new every tick.
"""
_PROPELLER: Kinds = {
    "off": (),
    "stuck": (),
    "loss": (Size(key="share", default=0.5, minimum=0.0, maximum=1.0),),
}
"""Faults of the propeller.

Off: no thrust. Stuck: the shaft speed stays constant. Loss: this fraction of the thrust is lost, as
with a fouled blade.
"""
_BALLAST: Kinds = dict.fromkeys(
    ("added", "shifted"),
    (
        Size(key="mass_kg", default=None, minimum=-1e3, maximum=1e3),
        *(Size(key=key, default=0.0, minimum=-10.0, maximum=10.0) for key in ("x_m", "y_m", "z_m")),
    ),
)
"""Faults of the ballast.

Added: a point mass (negative to remove) in the vehicle file's axes, x forward, y port, z up from
the hull axis at mid-length. Shifted: this part of the vehicle's mass moves there from the origin.
"""


def _instrument(offset: Size, drift: Size) -> Kinds:
    """Return the faults of a sensor; ``offset`` and ``drift`` are in the sensor's own unit."""
    return {
        "off": (),
        "stuck": (),
        "wrong": (offset,),
        "garbage": (),
        "slow": (Size(key="period_s", default=2.0, minimum=0.0, maximum=_MAX_S),),
        "delayed": (Size(key="delay_s", default=1.0, minimum=0.0, maximum=60.0),),
        "intermittent": (Size(key="share", default=0.5, minimum=0.0, maximum=0.99),),
        "drifting": (drift,),
    }


CATALOGUE: Mapping[str, Kinds] = {
    "rudder": _AXIS,
    "elevator": _AXIS,
    "propeller": _PROPELLER,
    "gyro": _instrument(Size("offset_degps", 5.0, si=_DEG), Size("drift_degps2", 0.02, si=_DEG)),
    "accelerometer": _instrument(Size("offset_mps2", 1.0), Size("drift_mps3", 0.01)),
    "magnetometer": _instrument(Size("offset_gauss", 0.1), Size("drift_gaussps", 0.001)),
    "pressure": _instrument(Size("offset_hpa", 200.0), Size("drift_hpaps", 2.0)),
    "gps": _instrument(Size("offset_m", 100.0), Size("drift_mps", 1.0)),
    "dvl": _instrument(Size("offset_mps", 0.3), Size("drift_mps2", 0.005)),
    "altimeter": _instrument(Size("offset_m", 2.0), Size("drift_mps", 0.02)),
    "battery": _instrument(Size("offset_v", -3.0), Size("drift_vps", -0.02)),
    "encoder": _instrument(Size("offset_pct", 30.0, si=0.01), Size("drift_pctps", 0.5, si=0.01)),
    "leak": {"wet": ()},
    "ballast": _BALLAST,
    "link": {"off": ()},
}
"""Parameters by unit and kind.

Slow: one sample per period. Intermittent: silent for this fraction of the time, about a second at
once. Wrong and drifting: error of every component; for the encoder in percent of the duct's travel.
"""


def read(row: Mapping[str, float | str]) -> ScheduledFault:
    """Parse a table ``[[fault]]`` of a scenario file.

    Raises FaultError.
    """
    words = {key: value for key, value in row.items() if isinstance(value, str)}
    numbers = {key: value for key, value in row.items() if not isinstance(value, str)}
    for key in row:
        if (key in words) != (key in ("unit", "kind")):
            shown = (
                f"{words[key]!r}: expected a number"
                if key in words
                else f"{numbers[key]:g}: expected a name"
            )
            raise FaultError(f"{key} = {shown}")
    for key in ("at_s", "unit", "kind"):
        if key not in row:
            raise FaultError(f"missing key {key}")
    from_us, until_us = (_microseconds(key, numbers.pop(key, None)) for key in ("at_s", "until_s"))
    return make(words["unit"], words["kind"], from_us or 0, until_us, numbers)


def make(
    unit: str, kind: str, from_us: int, until_us: int | None, given: Mapping[str, float]
) -> ScheduledFault:
    """Build a fault with the parameters ``given`` by key, else defaults.

    Raises FaultError.
    """
    sizes = _sizes(unit, kind)
    known = [size.key for size in sizes]
    for key in given:
        if key not in known:
            raise FaultError(
                f"{key} = {given[key]:g}: {unit} {kind} takes {', '.join(known) or 'no parameter'}"
                f"{did_you_mean(key, known)}"
            )
    if until_us is not None and until_us <= from_us:
        raise FaultError(
            f"until_s = {until_us * 1e-6:g}: expected more than at_s = {from_us * 1e-6:g}"
        )
    return ScheduledFault(
        unit=unit,
        kind=kind,
        from_us=from_us,
        until_us=until_us,
        sizes=tuple(_value(size, given, f"{unit} {kind}") for size in sizes),
    )


def _sizes(unit: str, kind: str) -> tuple[Size, ...]:
    """Return the parameters of a fault.

    Raises FaultError: unknown unit or kind.
    """
    if unit not in CATALOGUE:
        raise FaultError(
            f"unit = {unit!r}: expected {', '.join(CATALOGUE)}{did_you_mean(unit, CATALOGUE)}"
        )
    kinds = CATALOGUE[unit]
    if kind not in kinds:
        raise FaultError(
            f"kind = {kind!r}: {unit} can be {', '.join(kinds)}{did_you_mean(kind, kinds)}"
        )
    return kinds[kind]


def _value(size: Size, given: Mapping[str, float], name: str) -> float:
    """Return a parameter in SI after a check of its range."""
    value = given.get(size.key, size.default)
    if value is None:
        raise FaultError(f"missing key {size.key}: {name} needs it")
    if size.key in given and not (isfinite(value) and size.minimum <= value <= size.maximum):
        raise FaultError(f"{size.key} = {value:g}: expected {size.minimum:g} to {size.maximum:g}")
    return value * size.si


def _microseconds(key: str, time_s: float | None) -> int | None:
    """Convert a time to whole microseconds after a check of its range."""
    if time_s is not None and not 0.0 <= time_s <= _MAX_S:
        raise FaultError(f"{key} = {time_s:g}: expected 0 to {_MAX_S:g}")
    return None if time_s is None else round(time_s * 1e6)
