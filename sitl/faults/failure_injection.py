"""MAV_CMD_INJECT_FAILURE: a ground station's faults, and the simulator's wish that the links to the
ground fall silent.

Units and kinds are MAVLink's where it has them. Its ``param4``, which is reserved, may carry a
fault's first size, in the unit of the catalogue's key; for the link it is how long it stays silent,
since nobody can end that from the ground. Zero and NaN leave it at its default: clients fill what
they do not mean with either."""

from __future__ import annotations

from math import isfinite, isnan, nan
from typing import NamedTuple

from mavlink_io import dialect
from mavlink_io.dialect import constant
from mavlink_io.mission_items import MavCmd
from sitl.faults import timeline
from sitl.faults.catalogue import CATALOGUE, Fault, FaultError, make
from sitl.faults.timeline import Timeline

_COMMAND, _AUTOPILOT = dialect.by_name("COMMAND_LONG"), constant("MAV_COMP_ID_AUTOPILOT1")
ACCEPTED, DENIED, UNSUPPORTED = (
    constant(f"MAV_RESULT_{name}") for name in ("ACCEPTED", "DENIED", "UNSUPPORTED")
)
LINK_UNIT = constant("FAILURE_UNIT_SYSTEM_MAVLINK_SIGNAL")
OK, OFF = constant("FAILURE_TYPE_OK"), constant("FAILURE_TYPE_OFF")
LINK_SILENT_S = 10.0
"""Where the order says nothing."""

_UNITS: dict[int, tuple[str, ...]] = {
    constant(f"FAILURE_UNIT_{name}"): units
    for name, units in {
        "SENSOR_GYRO": ("gyro",),
        "SENSOR_ACCEL": ("accelerometer",),
        "SENSOR_MAG": ("magnetometer",),
        "SENSOR_BARO": ("pressure",),
        "SENSOR_GPS": ("gps",),
        "SENSOR_VIO": ("dvl",),
        "SENSOR_DISTANCE_SENSOR": ("altimeter",),
        "SYSTEM_BATTERY": ("battery",),
        "SYSTEM_MOTOR": ("propeller",),
        "SYSTEM_SERVO": ("rudder", "elevator"),
        "SYSTEM_MAVLINK_SIGNAL": ("link",),
    }.items()
}
"""FAILURE_UNIT to units by instance, counted from 1; instance 0 is all of them."""
_KINDS: dict[int, tuple[str, ...]] = {
    constant(f"FAILURE_TYPE_{name}"): kinds
    for name, kinds in {
        "OFF": ("off",),
        "STUCK": ("stuck",),
        "GARBAGE": ("garbage", "noisy"),
        "WRONG": ("wrong", "biased"),
        "SLOW": ("slow", "loss"),
        "DELAYED": ("delayed",),
        "INTERMITTENT": ("intermittent", "slipping"),
    }.items()
}
"""FAILURE_TYPE to the kind that the unit knows."""


class InjectionResult(NamedTuple):
    """What becomes of an order."""

    result: int
    """MAV_RESULT."""
    text: str = ""
    """Why not."""
    units: tuple[str, ...] = ()
    kind: str = ""
    """Empty to clear what is on the units."""
    size: float = nan
    """Of the first key, NaN for its default."""


def parse_order(unit: float, kind: float, instance: float, size: float) -> InjectionResult:
    """Read param1 to param4; what was not given is NaN."""
    units = _names(_UNITS, unit)
    if not units:
        return InjectionResult(UNSUPPORTED, f"Failure unit {unit:g} is not simulated")
    if instance == instance and instance != 0:
        if instance not in range(1, len(units) + 1):
            return InjectionResult(
                DENIED, f"Failure of instance {instance:g}: {', '.join(units)} is 1 to {len(units)}"
            )
        units = (units[int(instance) - 1],)
    if kind == OK:
        return InjectionResult(ACCEPTED, units=units)
    known = [
        name for name in _names(_KINDS, kind) if all(name in CATALOGUE[each] for each in units)
    ]
    if not known:
        return InjectionResult(
            UNSUPPORTED,
            f"Failure type {kind:g}: {units[0]} can be {', '.join(CATALOGUE[units[0]])}",
        )
    verdict = InjectionResult(ACCEPTED, "", units, known[0], size or nan)
    try:
        for name in units:
            _fault(verdict, name, 0)
    except FaultError as error:
        return InjectionResult(DENIED, str(error))
    return verdict


def apply_order(running: Timeline, verdict: InjectionResult, time_us: int) -> Timeline:
    """The timeline after an accepted order of vehicle time ``time_us``."""
    if not verdict.kind:
        return timeline.end_faults(running, verdict.units, time_us)
    for unit in verdict.units:
        running = timeline.add_fault(running, _fault(verdict, unit, time_us))
    return running


def link_silence_values(wanted: bool) -> tuple[object, ...]:
    """COMMAND_LONG's fields in wire order that have the autopilot's links to the ground fall
    silent, or speak again."""
    kind = OFF if wanted else OK
    return _COMMAND.values(
        param1=LINK_UNIT,
        param2=kind,
        param3=0,
        param4=nan,
        param5=nan,
        param6=nan,
        param7=nan,
        command=MavCmd.INJECT_FAILURE,
        target_system=0,
        target_component=_AUTOPILOT,
        confirmation=0,
    )


def _names(table: dict[int, tuple[str, ...]], number: float) -> tuple[str, ...]:
    return table.get(int(number), ()) if isfinite(number) else ()


def _fault(verdict: InjectionResult, unit: str, time_us: int) -> Fault:
    sizes = CATALOGUE[unit][verdict.kind]
    if unit == "link":
        silent_s = LINK_SILENT_S if isnan(verdict.size) else verdict.size
        return make(unit, verdict.kind, time_us, time_us + round(silent_s * 1e6), {})
    given = {} if isnan(verdict.size) or not sizes else {sizes[0].key: verdict.size}
    return make(unit, verdict.kind, time_us, None, given)
