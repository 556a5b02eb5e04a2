"""Identity of the vehicle: HEARTBEAT, version and modes."""

from enum import StrEnum
from importlib import metadata
from typing import Any

from autopilot.control import modes
from autopilot.control.sensor_health import monitor
from autopilot.control.sensor_health.sensor_checks import LEAK
from autopilot.control.types import AutopilotState
from mavlink_io.dialect import constant
from mavlink_io.records import ARMED_FLAG, CUSTOM_MODE_FLAG

COMPONENT = constant("MAV_COMP_ID_AUTOPILOT1")
"""Component id of the autopilot; MAVSDK and MAVProxy recognise an autopilot by it."""

_SUBMARINE = constant("MAV_TYPE_SUBMARINE")
_BOOT, _STANDBY = constant("MAV_STATE_BOOT"), constant("MAV_STATE_STANDBY")
_ACTIVE, _CRITICAL = constant("MAV_STATE_ACTIVE"), constant("MAV_STATE_CRITICAL")
_EMERGENCY = constant("MAV_STATE_EMERGENCY")
_MAVLINK_VERSION = 3
_ADVANCED_MODE = constant("MAV_MODE_PROPERTY_ADVANCED")
_CAPABILITIES = sum(
    constant(f"MAV_PROTOCOL_CAPABILITY_{name}")
    for name in (
        "MISSION_INT",
        "MISSION_FENCE",
        "MISSION_RALLY",
        "COMMAND_INT",
        "PARAM_ENCODE_BYTEWISE",
        "FTP",
        "MAVLINK2",
        "SET_ATTITUDE_TARGET",
        "SET_POSITION_TARGET_LOCAL_NED",
        "SET_POSITION_TARGET_GLOBAL_INT",
    )
)
"""MAV_PROTOCOL_CAPABILITY bits. MAVSDK needs MISSION_INT; BYTEWISE holds for REAL32 parameters."""


class AutopilotId(StrEnum):
    """Values of HEARTBEAT.autopilot: with ``px4`` the mode buttons of QGroundControl work."""

    GENERIC = "generic"
    PX4 = "px4"

    @property
    def number(self) -> int:
        """MAV_AUTOPILOT value."""
        return constant(f"MAV_AUTOPILOT_{self.name}")


def heartbeat(state: AutopilotState, autopilot: AutopilotId) -> tuple[Any, ...]:
    """Return the fields of HEARTBEAT in wire order."""
    base_mode = CUSTOM_MODE_FLAG | (ARMED_FLAG if state.armed else 0)
    return state.mode, _SUBMARINE, autopilot.number, base_mode, mav_state(state), _MAVLINK_VERSION


def mav_state(state: AutopilotState) -> int:
    """Return the MAV_STATE: leak, failsafe or fault, armed, in this order of priority."""
    if not state.estimate.initialised:
        return _BOOT
    faults = monitor.active_faults(state.health) if state.health.faults else {}
    if LEAK in faults:
        return _EMERGENCY
    if state.failsafe or faults:
        return _CRITICAL
    return _ACTIVE if state.armed else _STANDBY


def current_mode(state: AutopilotState, intended_mode: int) -> tuple[Any, ...]:
    """Return the fields of CURRENT_MODE in wire order."""
    mode = modes.by_number(state.mode)
    return state.mode, intended_mode, mode.standard_mode if mode else 0


def available_mode(index: int) -> tuple[Any, ...]:
    """Return the fields of AVAILABLE_MODES in wire order for one mode; ``index`` starts at 1.

    The name of a standard mode is empty: clients use their own name for it. Raises IndexError for
    an index outside the table.
    """
    if index < 1:
        raise IndexError(index)
    mode = modes.MODES[index - 1]
    properties = _ADVANCED_MODE if mode == modes.SYSID else 0
    name = "" if mode.standard_mode else mode.name
    return mode.number, properties, len(modes.MODES), index, mode.standard_mode, name


def autopilot_version(system: int) -> tuple[Any, ...]:
    """Return the fields of AUTOPILOT_VERSION in wire order."""
    none8, none18 = (0,) * 8, (0,) * 18
    return _CAPABILITIES, system, _software_version(), 0, 0, 0, 0, 0, none8, none8, none8, none18


def version() -> str:
    """Return the version of the package, for example ``0.1.0``; ``0`` when it is not installed."""
    try:
        return metadata.version("caribou-auv")
    except metadata.PackageNotFoundError:
        return "0"


def _software_version() -> int:
    """Return major, minor, patch and release type as the four bytes of an integer."""
    numbers = version().split(".")[:3]
    major, minor, patch = (int(n) if n.isdecimal() else 0 for n in (*numbers, "0", "0")[:3])
    return major << 24 | minor << 16 | patch << 8
