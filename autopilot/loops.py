"""The nested loops: heading to rudder; depth to pitch, pitch to elevator. Radians in and out."""

from typing import NamedTuple

from autopilot.params import Config
from autopilot.pid import pid
from autopilot.targets import Setpoint
from autopilot.types import Estimate, LoopMemory
from link.frames import wrap_pi


class Surfaces(NamedTuple):
    """What the loops want of the duct, trim included, and the errors they saw."""

    rudder_rad: float
    elevator_rad: float
    heading_error_rad: float
    pitch_error_rad: float
    depth_error_m: float
    pitch_setpoint_rad: float


def close(
    estimate: Estimate,
    setpoint: Setpoint,
    memory: LoopMemory,
    config: Config,
    dt_s: float,
    *,
    heading: bool,
    depth: bool,
) -> tuple[Surfaces, LoopMemory]:
    """Close the loops that are asked for; an open plane rests at its trim and keeps its integrators."""
    rudder, elevator = config.rudder_trim_rad, config.elevator_trim_rad
    heading_error = wrap_pi(setpoint.heading_rad - estimate.heading_rad)
    depth_error = setpoint.depth_m - estimate.depth_m
    pitch_setpoint, pitch_error = estimate.pitch_rad, 0.0
    heading_i, pitch_i, depth_i = memory
    if heading:
        rudder, heading_i = heading_loop(estimate, heading_error, heading_i, config, dt_s)
    if depth:
        pitch_setpoint, depth_i = depth_loop(estimate, depth_error, depth_i, config, dt_s)
        if setpoint.pitch_rad is not None:
            pitch_setpoint = setpoint.pitch_rad
        pitch_error = pitch_setpoint - estimate.pitch_rad
        elevator, pitch_i = pitch_loop(estimate, pitch_error, pitch_i, config, dt_s)
    surfaces = Surfaces(rudder, elevator, heading_error, pitch_error, depth_error, pitch_setpoint)
    return surfaces, LoopMemory(heading_i, pitch_i, depth_i)


def heading_loop(
    estimate: Estimate, error_rad: float, integral: float, config: Config, dt_s: float
) -> tuple[float, float]:
    """Heading error to rudder, yaw rate from the gyro."""
    trim, travel = config.rudder_trim_rad, config.travel_rad
    rudder, integral = pid(
        error_rad, estimate.r_radps, config.heading_gains, integral, dt_s, -travel - trim, travel - trim
    )
    return rudder + trim, integral


def pitch_loop(
    estimate: Estimate, error_rad: float, integral: float, config: Config, dt_s: float
) -> tuple[float, float]:
    """Pitch error to elevator, pitch rate from the gyro."""
    trim, travel = config.elevator_trim_rad, config.travel_rad
    elevator, integral = pid(
        error_rad, estimate.q_radps, config.pitch_gains, integral, dt_s, -travel - trim, travel - trim
    )
    return elevator + trim, integral


def depth_loop(estimate: Estimate, error_m: float, integral: float, config: Config, dt_s: float) -> tuple[float, float]:
    """Depth error to pitch: too shallow asks for nose down, hence the minus."""
    limit = config.pitch_limit_rad
    nose_down, integral = pid(error_m, estimate.depth_rate_mps, config.depth_gains, integral, dt_s, -limit, limit)
    return -nose_down, integral
