"""Identity of the vehicle: HEARTBEAT, version and modes."""

from collections.abc import Mapping
from importlib import metadata
from typing import Any, NamedTuple

from autopilot.control import modes
from autopilot.control.sensor_health import monitor
from autopilot.control.sensor_health.sensor_checks import LEAK
from autopilot.control.types import AutopilotState
from mavlink_io.dialect import constant
from mavlink_io.records import ARMED_FLAG, CUSTOM_MODE_FLAG
from mavlink_io.vehicle_modes import ARDUSUB_NUMBERS, PX4_HIGH_LATENCY_SHIFT, VehicleMode

COMPONENT = constant("MAV_COMP_ID_AUTOPILOT1")
"""Component id of the autopilot; MAVSDK and MAVProxy recognise an autopilot by it."""

_SUBMARINE = constant("MAV_TYPE_SUBMARINE")
_BOOT, _STANDBY = constant("MAV_STATE_BOOT"), constant("MAV_STATE_STANDBY")
_ACTIVE, _CRITICAL = constant("MAV_STATE_ACTIVE"), constant("MAV_STATE_CRITICAL")
_EMERGENCY = constant("MAV_STATE_EMERGENCY")
_MAVLINK_VERSION = 3
_ADVANCED_MODE = constant("MAV_MODE_PROPERTY_ADVANCED")
BYTEWISE, C_CAST = (
    constant(f"MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_{name}") for name in ("BYTEWISE", "C_CAST")
)
"""Bits for the encoding of integer parameters: bytes, and a converted number.

Both are the same for REAL32, the type of all parameters here."""
_CAPABILITIES = sum(
    constant(f"MAV_PROTOCOL_CAPABILITY_{name}")
    for name in (
        "MISSION_INT",
        "MISSION_FENCE",
        "MISSION_RALLY",
        "COMMAND_INT",
        "FTP",
        "MAVLINK2",
        "SET_ATTITUDE_TARGET",
        "SET_POSITION_TARGET_LOCAL_NED",
        "SET_POSITION_TARGET_GLOBAL_INT",
    )
)
"""MAV_PROTOCOL_CAPABILITY bits of every identity. MAVSDK needs MISSION_INT."""


class ModeTable(NamedTuple):
    """Numbers and names of the modes in messages."""

    numbers: Mapping[int, int]
    """``custom_mode`` of every mode; of modes with one number the first of MODES is selected."""
    names: Mapping[int, str]
    """Names that differ from the vehicle's own."""
    has_sub_modes: bool
    """Whether DO_SET_MODE may give main and sub mode, as for PX4."""
    high_latency_shift: int
    """Lowest bit of ``custom_mode`` that HIGH_LATENCY2 contains."""

    def number(self, mode: int) -> int:
        """Return the ``custom_mode`` of a mode of the vehicle."""
        return self.numbers.get(mode, mode)

    @property
    def listed(self) -> tuple[modes.Mode, ...]:
        """Modes that can be selected, in the order of the vehicle's table."""
        first = {self.number(mode.number): mode for mode in reversed(modes.MODES)}
        return tuple(reversed(first.values()))

    def selected(self, number: int) -> modes.Mode | None:
        """Return the mode that a ``custom_mode`` selects; None if there is none."""
        return next((mode for mode in self.listed if self.number(mode.number) == number), None)

    def name(self, mode: modes.Mode) -> str:
        """Return the name of a mode."""
        return self.names.get(mode.number, mode.name)


PX4_MODES = ModeTable(
    numbers={mode.value: mode.value for mode in VehicleMode},
    names={},
    has_sub_modes=True,
    high_latency_shift=PX4_HIGH_LATENCY_SHIFT,
)
"""Modes with PX4's numbers and the vehicle's names."""
ARDUSUB_MODES = ModeTable(
    numbers={mode.value: number for mode, number in ARDUSUB_NUMBERS.items()},
    names={
        VehicleMode.DEPTH: "ALT_HOLD",
        VehicleMode.MISSION: "AUTO",
        VehicleMode.HOLD: "GUIDED",
        VehicleMode.STATION: "POSHOLD",
    },
    has_sub_modes=False,
    high_latency_shift=0,
)
"""Modes with ArduSub's numbers and names."""


def heartbeat(state: AutopilotState, autopilot: int, table: ModeTable) -> tuple[Any, ...]:
    """Return the fields of HEARTBEAT in wire order; ``autopilot`` is a MAV_AUTOPILOT."""
    base_mode = CUSTOM_MODE_FLAG | (ARMED_FLAG if state.armed else 0)
    number = table.number(state.mode)
    return number, _SUBMARINE, autopilot, base_mode, mav_state(state), _MAVLINK_VERSION


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


def current_mode(
    state: AutopilotState, intended_mode: int, table: ModeTable = PX4_MODES
) -> tuple[Any, ...]:
    """Return the fields of CURRENT_MODE in wire order."""
    mode = modes.by_number(state.mode)
    standard_mode = mode.standard_mode if mode else 0
    return table.number(state.mode), table.number(intended_mode), standard_mode


def available_mode(index: int, table: ModeTable) -> tuple[Any, ...]:
    """Return the fields of AVAILABLE_MODES in wire order for one mode; ``index`` starts at 1.

    The name of a standard mode is empty: clients use their own name for it. Raises IndexError for
    an index outside the table.
    """
    if index < 1:
        raise IndexError(index)
    listed = table.listed
    mode = listed[index - 1]
    properties = _ADVANCED_MODE if mode == modes.SYSID else 0
    name = "" if mode.standard_mode else table.name(mode)
    number = table.number(mode.number)
    return number, properties, len(listed), index, mode.standard_mode, name


def autopilot_version(system: int, encoding: int) -> tuple[Any, ...]:
    """Return the fields of AUTOPILOT_VERSION in wire order; ``encoding`` is BYTEWISE or C_CAST."""
    none8, none18 = (0,) * 8, (0,) * 18
    return (
        _CAPABILITIES | encoding,
        system,
        _software_version(),
        0,
        0,
        0,
        0,
        0,
        none8,
        none8,
        none8,
        none18,
    )


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
