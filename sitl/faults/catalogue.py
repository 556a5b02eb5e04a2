"""The one table of faults: what can fail, in which ways, and what sizes each takes, with units and
limits."""

from __future__ import annotations

from collections.abc import Mapping
from math import inf, isfinite, nan, radians
from typing import NamedTuple


class Size(NamedTuple):
    """A number that a fault takes."""

    key: str
    """Its name in a scenario file, with the unit."""
    default: float | None
    """None where it must be given; NaN where leaving it out has a meaning of its own."""
    minimum: float = -inf
    maximum: float = inf
    si: float = 1.0
    """Turns the key's unit into SI."""


class Fault(NamedTuple):
    """One thing that goes wrong, from one vehicle time to another."""

    unit: str
    kind: str
    from_us: int
    until_us: int | None = None
    """None lasts until somebody clears it."""
    sizes: tuple[float, ...] = ()
    """In the order of the table, SI."""

    @property
    def name(self) -> str:
        """What people read."""
        return f"{self.unit} {self.kind}"


class FaultError(ValueError):
    """A fault that cannot be; the message says what would be right."""


Kinds = Mapping[str, tuple[Size, ...]]

_DEG = radians(1.0)
_MAX_S = 1e6

_AXIS: Kinds = {
    "off": (),
    "stuck": (Size("angle_deg", nan, -90.0, 90.0, _DEG),),
    "slipping": (Size("share", 0.3, 0.0, 1.0),),
    "slow": (Size("rate_degps", 2.0, 0.0, 1e3, _DEG),),
    "biased": (Size("angle_deg", 3.0, -90.0, 90.0, _DEG),),
    "noisy": (Size("rms_deg", 1.0, 0.0, 90.0, _DEG),),
}
"""Off: the flow turns the duct back to neutral. Stuck: where it stands, or having run to an angle.
Slipping: the motor loses that share of its steps. Biased: the duct stands off its count. Noisy:
white, renewed every tick."""
_PROPELLER: Kinds = {"off": (), "stuck": (), "loss": (Size("share", 0.5, 0.0, 1.0),)}
"""Stuck: the shaft keeps the speed it had. Loss: that share of the thrust is gone, as by a fouled
blade."""
_BALLAST: Kinds = dict.fromkeys(
    ("added", "shifted"),
    (
        Size("mass_kg", None, -1e3, 1e3),
        *(Size(key, 0.0, -10.0, 10.0) for key in ("x_m", "y_m", "z_m")),
    ),
)
"""Added: a point mass more (less, where negative) at a place, in the vehicle file's axes: x
forward, y port, z up from the hull axis at mid-length. Shifted: so much of her own mass carried
there from that origin."""


def _instrument(offset: Size, drift: Size) -> Kinds:
    """The ways in which an instrument fails; ``offset`` and ``drift`` are in its own unit."""
    return {
        "off": (),
        "stuck": (),
        "wrong": (offset,),
        "garbage": (),
        "slow": (Size("period_s", 2.0, 0.0, _MAX_S),),
        "delayed": (Size("delay_s", 1.0, 0.0, 60.0),),
        "intermittent": (Size("share", 0.5, 0.0, 0.99),),
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
"""Unit, kind, sizes. Slow: a sample each period. Intermittent: silent for that share of the time, a
second or so at once. Wrong and drifting: the error of every component; the encoder's is in percent
of the duct's travel."""


def read(row: Mapping[str, float | str]) -> Fault:
    """A fault as a scenario file's table ``[[fault]]`` tells it. Raises ``FaultError``."""
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
) -> Fault:
    """A fault of the table with the sizes ``given`` by key. Raises ``FaultError``."""
    sizes = _sizes(unit, kind)
    known = [size.key for size in sizes]
    for key in given:
        if key not in known:
            raise FaultError(
                f"{key} = {given[key]:g}: {unit} {kind} takes {', '.join(known) or 'no size'}"
            )
    if until_us is not None and until_us <= from_us:
        raise FaultError(
            f"until_s = {until_us * 1e-6:g}: expected more than at_s = {from_us * 1e-6:g}"
        )
    return Fault(
        unit,
        kind,
        from_us,
        until_us,
        tuple(_value(size, given, f"{unit} {kind}") for size in sizes),
    )


def _sizes(unit: str, kind: str) -> tuple[Size, ...]:
    if unit not in CATALOGUE:
        raise FaultError(f"unit = {unit!r}: expected {', '.join(CATALOGUE)}")
    kinds = CATALOGUE[unit]
    if kind not in kinds:
        raise FaultError(f"kind = {kind!r}: {unit} can be {', '.join(kinds)}")
    return kinds[kind]


def _value(size: Size, given: Mapping[str, float], name: str) -> float:
    value = given.get(size.key, size.default)
    if value is None:
        raise FaultError(f"missing key {size.key}: {name} needs it")
    if size.key in given and not (isfinite(value) and size.minimum <= value <= size.maximum):
        raise FaultError(f"{size.key} = {value:g}: expected {size.minimum:g} to {size.maximum:g}")
    return value * size.si


def _microseconds(key: str, time_s: float | None) -> int | None:
    if time_s is not None and not 0.0 <= time_s <= _MAX_S:
        raise FaultError(f"{key} = {time_s:g}: expected 0 to {_MAX_S:g}")
    return None if time_s is None else round(time_s * 1e6)
