"""The nested loops: heading to rudder; depth to pitch, pitch to elevator. Radians in and out."""

import math
from typing import NamedTuple

from autopilot.params import Config
from autopilot.pid import Gains, pid
from autopilot.types import Estimate, LoopMemory, Setpoint
from link.frames import wrap_pi


class Surfaces(NamedTuple):
    """What the loops want of the duct, trim included, and the errors they saw."""

    rudder_rad: float
    elevator_rad: float
    heading_error_rad: float
    depth_error_m: float
    pitch_error_rad: float
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
    rudder, elevator = math.radians(config.rudder_trim_deg), math.radians(config.elevator_trim_deg)
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
    surfaces = Surfaces(rudder, elevator, heading_error, depth_error, pitch_error, pitch_setpoint)
    return surfaces, LoopMemory(heading_i, pitch_i, depth_i)


def heading_loop(
    estimate: Estimate, error_rad: float, integral: float, config: Config, dt_s: float
) -> tuple[float, float]:
    """Heading error to rudder, yaw rate from the gyro."""
    turning = math.radians(config.heading_i_rate_degps)
    gains = Gains(config.heading_p, config.heading_d, config.heading_i, config.heading_i_max, turning)
    return _surface(error_rad, estimate.r_radps, gains, integral, dt_s, config.rudder_trim_deg, config.travel_deg)


def pitch_loop(
    estimate: Estimate, error_rad: float, integral: float, config: Config, dt_s: float
) -> tuple[float, float]:
    """Pitch error to elevator, pitch rate from the gyro."""
    gains = Gains(config.pitch_p, config.pitch_d, config.pitch_i, config.pitch_i_max)
    return _surface(error_rad, estimate.q_radps, gains, integral, dt_s, config.elevator_trim_deg, config.travel_deg)


def depth_loop(estimate: Estimate, error_m: float, integral: float, config: Config, dt_s: float) -> tuple[float, float]:
    """Depth error to pitch: too shallow asks for nose down, hence the minus."""
    gains = Gains(config.depth_p, config.depth_d, config.depth_i, config.depth_i_max)
    limit = math.radians(config.pitch_limit_deg)
    nose_down, integral = pid(error_m, estimate.depth_rate_mps, gains, integral, dt_s, -limit, limit)
    return -nose_down, integral


def _surface(
    error_rad: float, rate_radps: float, gains: Gains, integral: float, dt_s: float, trim_deg: float, travel_deg: float
) -> tuple[float, float]:
    trim, travel = math.radians(trim_deg), math.radians(travel_deg)
    output, integral = pid(error_rad, rate_radps, gains, integral, dt_s, -travel - trim, travel - trim)
    return output + trim, integral
