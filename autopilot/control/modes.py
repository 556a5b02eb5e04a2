"""The one table of modes: number (PX4's numbering), name, which loops each closes; and the change
of mode."""

from typing import NamedTuple

from autopilot.control.types import AutopilotState, Event, LoopMemory, Severity


class Mode(NamedTuple):
    number: int
    """``custom_mode``: main << 16 | sub << 24."""
    name: str
    standard_mode: int
    """MAV_STANDARD_MODE to advertise; 0 is non-standard."""
    closes_heading: bool
    closes_depth: bool


def _number(main: int, sub: int = 0) -> int:
    return main << 16 | sub << 24


MANUAL = Mode(_number(1), "MANUAL", 0, False, False)
DEPTH = Mode(_number(2), "DEPTH", 0, True, True)
STATION = Mode(_number(3), "STATION", 0, True, True)
"""Circles about a place: she cannot hover."""
HOLD = Mode(_number(4, 3), "HOLD", 0, True, True)
MISSION = Mode(_number(4, 4), "MISSION", 6, True, True)
RTL = Mode(_number(4, 5), "RTL", 5, True, True)
SURFACE = Mode(_number(4, 6), "SURFACE", 7, True, True)
SYSID = Mode(_number(4, 11), "SYSID", 0, True, True)
"""While a test runs its axis says which loops are open; the others stay closed."""

OFFBOARD = Mode(_number(6), "OFFBOARD", 0, True, True)
STABILIZE = Mode(_number(7), "STABILIZE", 0, True, True)
"""The stick sets pitch and rate of turn."""

MODES = (MANUAL, STABILIZE, DEPTH, STATION, HOLD, MISSION, RTL, SURFACE, OFFBOARD, SYSID)

_BY_NUMBER = {mode.number: mode for mode in MODES}
_BY_NAME = {mode.name: mode for mode in MODES}


def by_number(number: int) -> Mode | None:
    """The mode of a ``custom_mode``, or None."""
    return _BY_NUMBER.get(number)


def by_name(name: str) -> Mode | None:
    """The mode of a name, or None."""
    return _BY_NAME.get(name)


def enter(state: AutopilotState, mode: Mode) -> tuple[AutopilotState, tuple[Event, ...]]:
    """Take a mode: a test and a path end, and a mission that is left keeps its set-points for the
    way back."""
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
    """Everything at rest, in HOLD."""
    state = state._replace(armed=False, test=None, path=None, ascent=None)
    return state._replace(thrust=0.0, loops=LoopMemory(), mode=HOLD.number)
