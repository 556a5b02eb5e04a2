"""Who the vehicle is: HEARTBEAT, version, modes. One byte differs between its two personalities."""

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
"""MAVSDK and MAVProxy discover an autopilot by this component id only."""

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
        "COMMAND_INT",
        "PARAM_ENCODE_BYTEWISE",
        "FTP",
        "MAVLINK2",
        "SET_ATTITUDE_TARGET",
        "SET_POSITION_TARGET_LOCAL_NED",
        "SET_POSITION_TARGET_GLOBAL_INT",
    )
)
"""Without MISSION_INT MAVSDK refuses every mission; BYTEWISE is true of REAL32 parameters."""


class AutopilotId(StrEnum):
    """HEARTBEAT.autopilot: ``px4`` lets QGroundControl's mode buttons work."""

    GENERIC = "generic"
    PX4 = "px4"

    @property
    def number(self) -> int:
        return constant(f"MAV_AUTOPILOT_{self.name}")


def heartbeat(state: AutopilotState, autopilot: AutopilotId) -> tuple[Any, ...]:
    """HEARTBEAT's fields in wire order."""
    base_mode = CUSTOM_MODE_FLAG | (ARMED_FLAG if state.armed else 0)
    return state.mode, _SUBMARINE, autopilot.number, base_mode, mav_state(state), _MAVLINK_VERSION


def mav_state(state: AutopilotState) -> int:
    """MAV_STATE."""
    if not state.estimate.initialised:
        return _BOOT
    wrong = monitor.active_faults(state.health) if state.health.faults else {}
    if LEAK in wrong:
        return _EMERGENCY
    if state.failsafe or wrong:
        return _CRITICAL
    return _ACTIVE if state.armed else _STANDBY


def current_mode(state: AutopilotState, intended_mode: int) -> tuple[Any, ...]:
    """CURRENT_MODE's fields in wire order."""
    mode = modes.by_number(state.mode)
    return state.mode, intended_mode, mode.standard_mode if mode else 0


def available_mode(index: int) -> tuple[Any, ...]:
    """AVAILABLE_MODES's fields in wire order of one mode, counted from 1. Raises IndexError beyond
    the last.

    A standard mode has no name of its own: clients call it what they call it on every vehicle.
    """
    if index < 1:
        raise IndexError(index)
    mode = modes.MODES[index - 1]
    properties = _ADVANCED_MODE if mode == modes.SYSID else 0
    name = "" if mode.standard_mode else mode.name
    return mode.number, properties, len(modes.MODES), index, mode.standard_mode, name


def autopilot_version(system: int) -> tuple[Any, ...]:
    """AUTOPILOT_VERSION's fields in wire order."""
    none8, none18 = (0,) * 8, (0,) * 18
    return _CAPABILITIES, system, _software_version(), 0, 0, 0, 0, 0, none8, none8, none8, none18


def version() -> str:
    """The release, such as ``0.1.0``; ``0`` where the package is not installed."""
    try:
        return metadata.version("caribou-auv")
    except metadata.PackageNotFoundError:
        return "0"


def _software_version() -> int:
    """Major, minor, patch and type of the release, a byte each."""
    numbers = version().split(".")[:3]
    major, minor, patch = (int(n) if n.isdecimal() else 0 for n in (*numbers, "0", "0")[:3])
    return major << 24 | minor << 16 | patch << 8
