"""Modes OFFBOARD (set-points streamed by a client) and STABILIZE (stick). Pure.

An attitude target and a motion target may stream at the same time. Then the motion target sets
depth, position, velocity or heading as far as it contains them, and the attitude target the rest.
A stream times out after OFB_TIMEOUT_S; without any stream OFFBOARD changes to HOLD.
"""

import cmath
import math

from autopilot.control import guidance
from autopilot.control.params import Config
from autopilot.control.setpoints import (
    AttitudeTarget,
    Circle,
    MotionTarget,
    Setpoint,
    Targets,
    TrackLine,
)
from autopilot.control.types import AutopilotState, Inputs, Stick
from mavlink_io.frames import wrap_pi

MIN_SPEED_MPS = 0.05
"""Speed below which a velocity target is zero."""
MAX_HEADING_LEAD_RAD = math.radians(30.0)
"""Maximum difference of an integrated heading set-point from the estimated heading."""


def drop_stale_targets(targets: Targets, inputs: Inputs, config: Config) -> Targets:
    """Return the targets whose streams have not timed out."""
    if targets.attitude and _is_stale(inputs.attitude_silent_s, config):
        targets = targets._replace(attitude=None)
    if targets.motion and _is_stale(inputs.motion_silent_s, config):
        targets = targets._replace(motion=None)
    return targets


def _is_stale(silent_s: float | None, config: Config) -> bool:
    """Return whether a stream has timed out."""
    return silent_s is not None and silent_s > config.offboard_timeout_s


def step(state: AutopilotState, config: Config, dt_s: float) -> AutopilotState:
    """Apply the targets to set-points and path."""
    attitude, motion = state.targets
    if motion is None:
        state = state._replace(path=None)
    if attitude is not None:
        state = state._replace(setpoint=_attitude(attitude, state, config, dt_s))
    if motion is not None:
        state = _motion(
            motion, state, config, dt_s, thrust=None if attitude is None else attitude.thrust
        )
    return state


def stabilize(
    state: AutopilotState, stick: Stick | None, config: Config, dt_s: float
) -> AutopilotState:
    """Set pitch, heading and thrust by the stick.

    The stick sets pitch (full: PTCH_LIM_DEG), yaw rate (full: STB_RATE_DEGPS) and thrust. Without
    a stick the vehicle holds heading and level pitch without thrust.
    """
    manual = stick or Stick(0.0, 0.0, 0.0)
    target = AttitudeTarget(
        pitch_rad=manual.elevator * config.pitch_limit_rad,
        heading_rate_radps=manual.rudder * math.radians(config.stick_rate_degps),
        thrust=manual.thrust,
    )
    return state._replace(setpoint=_attitude(target, state, config, dt_s))


def _attitude(
    target: AttitudeTarget, state: AutopilotState, config: Config, dt_s: float
) -> Setpoint:
    """Return the set-points of an attitude target; a missing angle is integrated from its rate."""
    old, limit = state.setpoint, config.pitch_limit_rad
    heading, pitch, thrust = target.heading_rad, target.pitch_rad, target.thrust
    if heading is None:
        heading = integrate_yaw_rate(state, target.heading_rate_radps, dt_s)
    if pitch is None:
        level = math.isnan(old.pitch_rad)
        pitch = (0.0 if level else old.pitch_rad) + target.pitch_rate_radps * dt_s
    return old._replace(
        heading_rad=heading,
        pitch_rad=max(-limit, min(limit, pitch)),
        thrust=old.thrust if thrust is None else thrust,
    )


def integrate_yaw_rate(state: AutopilotState, rate_radps: float, dt_s: float) -> float:
    """Return the heading set-point (rad) after a tick, at most 30 degrees ahead of the vehicle."""
    estimate_rad = state.estimate.heading_rad
    ahead = wrap_pi(state.setpoint.heading_rad + rate_radps * dt_s - estimate_rad)
    return wrap_pi(estimate_rad + max(-MAX_HEADING_LEAD_RAD, min(MAX_HEADING_LEAD_RAD, ahead)))


def _motion(
    target: MotionTarget, state: AutopilotState, config: Config, dt_s: float, thrust: float | None
) -> AutopilotState:
    """Apply a motion target: depth, then position, velocity, heading or yaw rate."""
    setpoint = state.setpoint._replace(
        thrust=config.cruise_thrust_pct / 100.0 if thrust is None else thrust
    )
    if target.depth_m is not None:
        setpoint = setpoint._replace(depth_m=target.depth_m, pitch_rad=math.nan)
    elif target.depth_rate_mps is not None:
        depth_m = max(0.0, setpoint.depth_m + target.depth_rate_mps * dt_s)
        setpoint = setpoint._replace(depth_m=depth_m, pitch_rad=math.nan)
    if target.speed_mps is not None:
        setpoint = setpoint._replace(thrust=thrust_for(target.speed_mps, config))
    if target.position_m is not None:
        return state._replace(setpoint=setpoint, path=_path(target.position_m, state, config))
    if target.velocity_mps is not None:
        setpoint = _track_velocity(target.velocity_mps, target.heading_rad, setpoint, state, config)
    elif target.heading_rad is not None:
        setpoint = setpoint._replace(heading_rad=target.heading_rad)
    elif target.heading_rate_radps is not None:
        setpoint = setpoint._replace(
            heading_rad=integrate_yaw_rate(state, target.heading_rate_radps, dt_s)
        )
    return state._replace(setpoint=setpoint, path=None)


def _path(position_m: complex, state: AutopilotState, config: Config) -> TrackLine | Circle:
    """Return the line to a position; once it is reached, a circle about it.

    The line starts where the vehicle was when the position was first requested.
    """
    path, estimate = state.path, state.estimate
    if isinstance(path, Circle) and path.centre_m == position_m:
        return path
    line = (
        path
        if isinstance(path, TrackLine) and path.to_m == position_m
        else TrackLine(guidance.position_of(estimate), position_m)
    )
    if guidance.reached(line, estimate, config.acceptance_m):
        return guidance.circle(position_m, config.station_radius_m, config)
    return line


def _track_velocity(
    velocity_mps: complex,
    heading_rad: float | None,
    setpoint: Setpoint,
    state: AutopilotState,
    config: Config,
) -> Setpoint:
    """Return heading and thrust for a velocity over ground, corrected for the current.

    At zero velocity the thrust is 0 and the heading is ``heading_rad`` if given.
    """
    navigation = state.estimate.navigation
    if abs(velocity_mps) < MIN_SPEED_MPS:
        heading = setpoint.heading_rad if heading_rad is None else heading_rad
        return setpoint._replace(heading_rad=heading, thrust=0.0)
    through_water = (velocity_mps - navigation.current_mps) / (1.0 + navigation.speed_error)
    speed, heading = cmath.polar(through_water)
    return setpoint._replace(heading_rad=wrap_pi(heading), thrust=thrust_for(speed, config))


def thrust_for(speed_mps: float, config: Config) -> float:
    """Return the thrust command in [-1, 1] for a speed through the water (m/s): proportional."""
    thrust = speed_mps / config.cruise_speed_mps * config.cruise_thrust_pct / 100.0
    return max(-1.0, min(1.0, thrust))


def full_thrust_speed_mps(config: Config) -> float:
    """Return the speed through the water (m/s) at full thrust; infinite without a cruise thrust."""
    fraction = config.cruise_thrust_pct / 100.0
    return config.cruise_speed_mps / fraction if fraction > 0.0 else math.inf
