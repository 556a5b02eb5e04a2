"""MAV_CMD_INJECT_FAILURE: failures commanded by a ground station, and silence of the ground links.

Units and kinds are those of MAVLink where they exist. The reserved ``param4`` may hold the first
parameter of a fault in the unit of the catalogue's key. For the link it is the duration of the
silence, because the ground cannot end it. Zero and NaN both select the default, because clients
fill unused parameters with either value.
"""

from __future__ import annotations

from math import isfinite, isnan, nan
from typing import NamedTuple

from mavlink_io import dialect
from mavlink_io.dialect import constant
from mavlink_io.mission_items import MavCmd
from sitl.faults import timeline
from sitl.faults.catalogue import CATALOGUE, FaultError, ScheduledFault, make
from sitl.faults.timeline import Timeline

_COMMAND, _AUTOPILOT = dialect.by_name("COMMAND_LONG"), constant("MAV_COMP_ID_AUTOPILOT1")
ACCEPTED, DENIED, UNSUPPORTED = (
    constant(f"MAV_RESULT_{name}") for name in ("ACCEPTED", "DENIED", "UNSUPPORTED")
)
LINK_UNIT = constant("FAILURE_UNIT_SYSTEM_MAVLINK_SIGNAL")
OK, OFF = constant("FAILURE_TYPE_OK"), constant("FAILURE_TYPE_OFF")
LINK_SILENT_S = 10.0
"""Default duration of the silence of a link."""

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
"""Simulated units by FAILURE_UNIT, one per instance from 1; instance 0 means all of them."""
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
"""Kinds of fault by FAILURE_TYPE; the first one that the unit supports applies."""


class InjectionResult(NamedTuple):
    """Result of a failure command."""

    result: int
    """MAV_RESULT of the acknowledgement."""
    text: str = ""
    """Reason of a rejection."""
    units: tuple[str, ...] = ()
    kind: str = ""
    """Kind of fault; empty to clear the faults of the units."""
    size: float = nan
    """First parameter of the fault, in the unit of its key; NaN for the default."""


def parse_command(unit: float, kind: float, instance: float, size: float) -> InjectionResult:
    """Evaluate param1 to param4 of the command; an absent parameter is NaN."""
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
        name for name in _names(_KINDS, kind) if all(name in CATALOGUE[item] for item in units)
    ]
    if not known:
        return InjectionResult(
            UNSUPPORTED,
            f"Failure type {kind:g}: {units[0]} can be {', '.join(CATALOGUE[units[0]])}",
        )
    injection = InjectionResult(
        result=ACCEPTED, text="", units=units, kind=known[0], size=size or nan
    )
    try:
        for name in units:
            _fault(injection, name, 0)
    except FaultError as error:
        return InjectionResult(DENIED, str(error))
    return injection


def apply_injection(running: Timeline, injection: InjectionResult, time_us: int) -> Timeline:
    """Return the timeline after an accepted command at vehicle time ``time_us`` (us)."""
    if not injection.kind:
        return timeline.end_faults(running, injection.units, time_us)
    for unit in injection.units:
        running = timeline.add_fault(running, _fault(injection, unit, time_us))
    return running


def link_silence_values(silent: bool) -> tuple[object, ...]:
    """Return COMMAND_LONG's fields in wire order that silence or restore the ground links."""
    kind = OFF if silent else OK
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
    """Return the entry of a MAVLink enum value; empty if there is none."""
    return table.get(int(number), ()) if isfinite(number) else ()


def _fault(injection: InjectionResult, unit: str, time_us: int) -> ScheduledFault:
    """Build the fault of one unit, starting at ``time_us``.

    Raises FaultError.
    """
    sizes = CATALOGUE[unit][injection.kind]
    if unit == "link":
        silent_s = LINK_SILENT_S if isnan(injection.size) else injection.size
        return make(unit, injection.kind, time_us, time_us + round(silent_s * 1e6), {})
    given = {} if isnan(injection.size) or not sizes else {sizes[0].key: injection.size}
    return make(unit, injection.kind, time_us, None, given)
