"""The nested loops: heading to rudder; depth to pitch, pitch to elevator. Radians in and out.

Where the parameters say so set-points are approached on ways that can be followed, gains follow the speed, what is
wanted is turned by the roll angle, the tailcone's lag is undone, and trims are learned.
"""

import math
from typing import NamedTuple

from autopilot import shaping
from autopilot.params import Config
from autopilot.pid import Gains, pid
from autopilot.shaping import Way
from autopilot.targets import Setpoint
from autopilot.types import Estimate, LoopMemory, Trim
from link.frames import wrap_pi

SLOWEST, FASTEST = 0.4, 2.5
"""Speeds over that of the gains between which they follow it."""
LEAST_SPEED_MPS = 0.3
"""With at least this speed is reckoned what pitch a change of depth takes."""
UNDER_WAY_RADPS, UNDER_WAY_MPS = math.radians(0.3), 0.02
"""On a way that moves faster than this the error is none to carry for good."""
STEADY_RADPS, STEADY_RAD, STEADY_M = math.radians(2.0), math.radians(8.0), 0.5
"""Rates of turn, heading error and depth error below which trims are learned."""


class Surfaces(NamedTuple):
    """What the loops want of the duct, trim included, and how far off the set-points are."""

    rudder_rad: float
    elevator_rad: float
    heading_error_rad: float
    pitch_error_rad: float
    depth_error_m: float
    pitch_setpoint_rad: float


class Steered(NamedTuple):
    """Heading loop: what it wants, and its memory."""

    rudder_rad: float
    integral_rad: float
    course: Way | None


class Dived(NamedTuple):
    """Depth and pitch loop: what they want, and their memory."""

    elevator_rad: float
    pitch_setpoint_rad: float
    pitch_integral_rad: float
    depth_integral_rad: float
    descent: Way | None


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
    learned = memory.trim
    trims = config.rudder_trim_rad + learned.rudder_rad, config.elevator_trim_rad + learned.elevator_rad
    steered = Steered(trims[0], memory.heading_rad, None)
    dived = Dived(trims[1], estimate.pitch_rad, memory.pitch_rad, memory.depth_rad, None)
    roll = estimate.roll_rad if config.roll_compensated and heading and depth else 0.0
    if heading:
        steered = steer(estimate, setpoint, memory, trims[0], roll, config, dt_s)
    if depth:
        dived = dive(estimate, setpoint, memory, trims[1], roll, config, dt_s)
    rudder, elevator = turned(steered.rudder_rad, dived.elevator_rad, roll) if roll else (steered[0], dived[0])
    rudder_way = elevator_way = None
    if config.lead_radps:
        if heading:
            rudder, rudder_way = shaping.lead(rudder, memory.rudder, config.servo, dt_s)
        if depth:
            elevator, elevator_way = shaping.lead(elevator, memory.elevator, config.servo, dt_s)
    surfaces = Surfaces(
        rudder, elevator,
        wrap_pi(setpoint.heading_rad - estimate.heading_rad), dived.pitch_setpoint_rad - estimate.pitch_rad,
        setpoint.depth_m - estimate.depth_m, dived.pitch_setpoint_rad,
    )  # fmt: skip
    kept = LoopMemory(
        steered.integral_rad, dived.pitch_integral_rad, dived.depth_integral_rad,
        steered.course, dived.descent, rudder_way, elevator_way, learned,
    )  # fmt: skip
    if config.trim_time_s and heading and depth:
        kept = learn_trim(kept, surfaces, trims, estimate, config.trim_time_s, dt_s)
    return surfaces, kept


def steer(
    estimate: Estimate, setpoint: Setpoint, memory: LoopMemory, trim_rad: float, roll_rad: float, config: Config,
    dt_s: float,
) -> Steered:  # fmt: skip
    """Heading error to rudder, yaw rate from the gyro; on the way to a new heading both are counted from the way."""
    rate = estimate.r_radps
    if roll_rad:
        rate = rate * math.cos(roll_rad) + estimate.q_radps * math.sin(roll_rad)
    error, course = wrap_pi(setpoint.heading_rad - estimate.heading_rad), None
    gains, travel = config.heading_gains, config.travel_rad
    if config.schedule_mps:
        gains = scheduled(gains, estimate.speed_mps / config.schedule_mps)
    if bandwidth := config.heading_way_radps:
        start = memory.course or Way(estimate.heading_rad, estimate.r_radps)
        to_go = wrap_pi(setpoint.heading_rad - start.at)
        course = shaping.approach(to_go, start, bandwidth, config.turn_most_radps, dt_s)
        error, rate = wrap_pi(course.at - estimate.heading_rad), rate - course.rate
        if abs(course.rate) > UNDER_WAY_RADPS:
            gains = gains._replace(i=0.0)
    elif config.heading_weight < 1.0:
        start = memory.course or Way(estimate.heading_rad)
        to_go = wrap_pi(setpoint.heading_rad - start.at)
        error = wrap_pi(start.at - estimate.heading_rad) + config.heading_weight * to_go
        course = shaping.follow(to_go, start, gains, dt_s)
    rudder, integral = pid(error, rate, gains, memory.heading_rad, dt_s, -travel - trim_rad, travel - trim_rad)
    return Steered(rudder + trim_rad, integral, course)


def dive(
    estimate: Estimate, setpoint: Setpoint, memory: LoopMemory, trim_rad: float, roll_rad: float, config: Config,
    dt_s: float,
) -> Dived:  # fmt: skip
    """Depth error to pitch, or the pitch that is given; pitch error to elevator, pitch rate from the gyro."""
    rate = estimate.q_radps
    if roll_rad:
        rate = rate * math.cos(roll_rad) - estimate.r_radps * math.sin(roll_rad)
    pitch_setpoint, depth_i, descent = depth_loop(estimate, setpoint, memory, config, dt_s)
    if setpoint.pitch_rad is not None:
        pitch_setpoint = setpoint.pitch_rad
    gains, travel = config.pitch_gains, config.travel_rad
    if config.schedule_mps:
        gains = scheduled(gains, estimate.speed_mps / config.schedule_mps)
    rest = trim_rad
    if config.pitch_stiffness and descent and setpoint.pitch_rad is None:
        rest += hold_pitch(descent, estimate, config)
    error = pitch_setpoint - estimate.pitch_rad
    elevator, pitch_i = pid(error, rate, gains, memory.pitch_rad, dt_s, -travel - rest, travel - rest)
    return Dived(elevator + rest, pitch_setpoint, pitch_i, depth_i, descent)


def depth_loop(
    estimate: Estimate, setpoint: Setpoint, memory: LoopMemory, config: Config, dt_s: float
) -> tuple[float, float, Way | None]:
    """Depth error to pitch: too shallow asks for nose down, hence the minus. (pitch, integral, way)."""
    limit, rate, descent = config.pitch_limit_rad, estimate.depth_rate_mps, None
    error, ahead, gains = setpoint.depth_m - estimate.depth_m, 0.0, config.depth_gains
    if bandwidth := config.depth_way_radps:
        start = memory.descent or Way(estimate.depth_m, rate)
        descent = shaping.approach(setpoint.depth_m - start.at, start, bandwidth, config.depth_way_mps, dt_s)
        error, rate = descent.at - estimate.depth_m, rate - descent.rate
        ahead = steepness(descent, estimate)
        if abs(descent.rate) > UNDER_WAY_MPS:
            gains = gains._replace(i=0.0)
    elif config.depth_weight < 1.0:
        start = memory.descent or Way(estimate.depth_m)
        to_go = setpoint.depth_m - start.at
        error = start.at - estimate.depth_m + config.depth_weight * to_go
        descent = shaping.follow(to_go, start, gains, dt_s)
    nose_down, integral = pid(error, rate, gains, memory.depth_rad, dt_s, -limit - ahead, limit - ahead)
    return -nose_down - ahead, integral, descent


def steepness(descent: Way, estimate: Estimate) -> float:
    """The nose-down pitch that a way in depth itself takes: depth' = -U sin(theta)."""
    return descent.rate / max(estimate.speed_mps, LEAST_SPEED_MPS)


def hold_pitch(descent: Way, estimate: Estimate, config: Config) -> float:
    """The elevator that holds the pitch of a way in depth against the weight under the hull's axis.

    That righting moment is the same at any speed; what an angle of the duct turns grows with U^2.
    """
    limit, x = config.pitch_limit_rad, min(FASTEST, max(SLOWEST, estimate.speed_mps / config.cruise_speed_mps))
    pitch = -min(limit, max(-limit, steepness(descent, estimate)))
    return config.pitch_stiffness * pitch / (x * x)


def scheduled(gains: Gains, speed: float) -> Gains:
    """Gains of rudder or elevator at ``speed`` times the speed that they were designed at.

    Slower, all of the vehicle's own motion slows with her, and a loop that slows likewise keeps its margins; faster,
    delay and lag do not shrink with her time, and the loop is held at its bandwidth. Hydrodynamic forces grow with U
    for a rate and with U^2 for an angle (Fossen 2021, section 6.7), and so does what an angle of the duct turns.
    """
    x = min(FASTEST, max(SLOWEST, speed))
    if x <= 1.0:
        return gains._replace(d=gains.d / x, i=gains.i * x)
    return gains._replace(p=gains.p / (x * x), d=gains.d / (x * x), i=gains.i / (x * x))


def turned(rudder_rad: float, elevator_rad: float, roll_rad: float) -> tuple[float, float]:
    """What is wanted about the vertical and the horizontal, about the axes of a hull that has rolled."""
    c, s = math.cos(roll_rad), math.sin(roll_rad)
    return rudder_rad * c - elevator_rad * s, rudder_rad * s + elevator_rad * c


def learn_trim(
    memory: LoopMemory, wanted: Surfaces, trims: tuple[float, float], estimate: Estimate, time_s: float, dt_s: float
) -> LoopMemory:
    """In steady flight the trims go where the surfaces are on average; the integrators give back what they take."""
    if not (
        abs(estimate.r_radps) < STEADY_RADPS and abs(estimate.q_radps) < STEADY_RADPS
        and abs(wanted.heading_error_rad) < STEADY_RAD and abs(wanted.depth_error_m) < STEADY_M
    ):  # fmt: skip
        return memory
    share, old = dt_s / time_s, memory.trim
    rudder, elevator = share * (wanted.rudder_rad - trims[0]), share * (wanted.elevator_rad - trims[1])
    return memory._replace(
        heading_rad=memory.heading_rad - rudder,
        pitch_rad=memory.pitch_rad - (elevator if memory.pitch_rad else 0.0),
        trim=Trim(old.rudder_rad + rudder, old.elevator_rad + elevator, old.learned_s + dt_s),
    )
