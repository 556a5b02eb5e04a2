"""A vehicle that SURFACE has disarmed: neutral, but its elevator raises it if it sinks. Pure.

Part of the tick. Without power a vehicle that floats up stays at the surface. One whose propeller
does not stop moves ahead and sinks with a neutral elevator; as long as it moves, the depth loop
holds it at the surface. The propeller is not commanded. Arming, or another request to disarm, ends
this.
"""

import math
from typing import NamedTuple

from autopilot.control import ascent, loops
from autopilot.control.loops import ControlOutput
from autopilot.control.params import Config
from autopilot.control.types import AutopilotState, Event, LoopMemory, Rest, Severity

RAISING = "Failsafe: sinks while disarmed -> elevator up"
"""Text of the first time that the elevator raises the vehicle."""


class RestOutput(NamedTuple):
    """Commands of a tick while the elevator raises the vehicle."""

    output: ControlOutput
    memory: LoopMemory


def step(state: AutopilotState, config: Config) -> tuple[AutopilotState, tuple[Event, ...]]:
    """Begin to raise a disarmed vehicle that sinks, and end it at the surface.

    Parameters
    ----------
    state : AutopilotState
        State of this tick, disarmed.
    config : Config
        Parameters.

    Returns
    -------
    tuple[AutopilotState, tuple[Event, ...]]
        New state, and the event of the first time.
    """
    rest = state.rest
    if rest is None:
        return state, ()
    margin_m = 0.0 if rest.raises else ascent.AFLOAT_MARGIN_M
    sunk = state.estimate.depth_m > config.surfaced_depth_m + margin_m
    raises = sunk and not ascent.is_blind(state, config)
    if raises == rest.raises:
        return state, ()
    changed = state._replace(rest=Rest(raises, rest.reported or raises))
    return changed, () if rest.reported or not raises else (Event(Severity.CRITICAL, RAISING),)


def raises(state: AutopilotState) -> bool:
    """Return whether the elevator raises a disarmed vehicle; actuator tests come before it."""
    return state.rest is not None and state.rest.raises and not state.actuator_tests


def command(state: AutopilotState, config: Config, dt_s: float) -> RestOutput:
    """Return the commands of the depth loop towards the surface; the heading loop is open.

    Parameters
    ----------
    state : AutopilotState
        State of this tick.
    config : Config
        Parameters.
    dt_s : float
        Time since the last tick.
    """
    setpoint = state.setpoint._replace(depth_m=0.0, thrust=0.0, pitch_rad=math.nan)
    return RestOutput(
        *loops.step_loops(
            state.estimate, setpoint, state.loops, config, dt_s, heading=False, depth=True
        )
    )
