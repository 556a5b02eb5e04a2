"""Table of the modes (numbers as in PX4, names, closed loops), and changes of mode. Pure."""

from typing import NamedTuple

from autopilot.control.types import AutopilotState, Event, LoopMemory, Severity
from mavlink_io.vehicle_modes import VehicleMode


class Mode(NamedTuple):
    """One row of the table of modes."""

    number: int
    """``custom_mode``."""
    name: str
    standard_mode: int
    """MAV_STANDARD_MODE to advertise; 0 is non-standard."""
    closes_heading: bool
    """Whether the heading loop is closed."""
    closes_depth: bool
    """Whether the depth and pitch loops are closed."""


MANUAL = Mode(
    number=VehicleMode.MANUAL.value,
    name="MANUAL",
    standard_mode=0,
    closes_heading=False,
    closes_depth=False,
)
DEPTH = Mode(
    number=VehicleMode.DEPTH.value,
    name="DEPTH",
    standard_mode=0,
    closes_heading=True,
    closes_depth=True,
)
STATION = Mode(
    number=VehicleMode.STATION.value,
    name="STATION",
    standard_mode=0,
    closes_heading=True,
    closes_depth=True,
)
"""Circles about a position: the vehicle cannot hover."""
HOLD = Mode(
    number=VehicleMode.HOLD.value,
    name="HOLD",
    standard_mode=0,
    closes_heading=True,
    closes_depth=True,
)
MISSION = Mode(
    number=VehicleMode.MISSION.value,
    name="MISSION",
    standard_mode=6,
    closes_heading=True,
    closes_depth=True,
)
RTL = Mode(
    number=VehicleMode.RTL.value,
    name="RTL",
    standard_mode=5,
    closes_heading=True,
    closes_depth=True,
)
SURFACE = Mode(
    number=VehicleMode.SURFACE.value,
    name="SURFACE",
    standard_mode=7,
    closes_heading=True,
    closes_depth=True,
)
SYSID = Mode(
    number=VehicleMode.SYSID.value,
    name="SYSID",
    standard_mode=0,
    closes_heading=True,
    closes_depth=True,
)
"""Runs a test: the loops of the tested axis are open, the others stay closed."""

OFFBOARD = Mode(
    number=VehicleMode.OFFBOARD.value,
    name="OFFBOARD",
    standard_mode=0,
    closes_heading=True,
    closes_depth=True,
)
STABILIZE = Mode(
    number=VehicleMode.STABILIZE.value,
    name="STABILIZE",
    standard_mode=0,
    closes_heading=True,
    closes_depth=True,
)
"""The stick sets pitch, yaw rate and thrust."""

MODES = (MANUAL, STABILIZE, DEPTH, STATION, HOLD, MISSION, RTL, SURFACE, OFFBOARD, SYSID)

_BY_NUMBER = {mode.number: mode for mode in MODES}


def by_number(number: int) -> Mode | None:
    """Return the mode of a ``custom_mode``, None if unknown."""
    return _BY_NUMBER.get(number)


def enter(state: AutopilotState, mode: Mode) -> tuple[AutopilotState, tuple[Event, ...]]:
    """Change the mode.

    A test and a path end. The set-points of an interrupted mission are kept for its resumption.

    Parameters
    ----------
    state : AutopilotState
        Present state.
    mode : Mode
        New mode.

    Returns
    -------
    tuple[AutopilotState, tuple[Event, ...]]
        New state and events; the same state without events if the mode does not change.
    """
    if mode.number == state.mode:
        return state, ()
    events = [Event(Severity.INFO, f"Mode {mode.name}")]
    if state.test is not None:
        events.insert(0, Event(Severity.NOTICE, f"SystemID Stopped: mode {mode.name}"))
    mission = state.mission
    if state.mode == MISSION.number and state.armed:
        mission = mission._replace(paused_setpoint=state.setpoint)
    state = state._replace(mode=mode.number, test=None, path=None, ascent=None, mission=mission)
    return state, tuple(events)


def disarm(state: AutopilotState) -> AutopilotState:
    """Return the disarmed state: thrust 0, loops reset, mode HOLD."""
    state = state._replace(armed=False, test=None, path=None, ascent=None, rest=None)
    return state._replace(thrust=0.0, loops=LoopMemory(), mode=HOLD.number)
