"""The nested loops: heading to rudder; depth to pitch, pitch to elevator. Radians in and out.

Where the parameters say so set-points are approached on ways that can be followed, gains follow the
speed, what is wanted is turned by the roll angle, the tailcone's lag is undone, and trims are
learned. Laws that were read at the start take the PIDs' place at about the speed that they were
designed for."""

import math
from typing import NamedTuple

from autopilot.control import lqg, reference_model
from autopilot.control.lqg import LqgControllers, LqgReference, ObserverState
from autopilot.control.params import Config
from autopilot.control.pid import Gains, pid
from autopilot.control.reference_model import ReferenceState
from autopilot.control.setpoints import Setpoint
from autopilot.control.types import LoopMemory, Trim, VehicleEstimate
from mavlink_io.frames import wrap_pi

MIN_SPEED_RATIO, MAX_SPEED_RATIO = 0.4, 2.5
"""Speeds over that of the gains between which they follow it."""
MIN_SPEED_MPS = 0.3
"""With at least this speed is reckoned what pitch a change of depth takes."""
INTEGRATOR_HOLD_RADPS, INTEGRATOR_HOLD_MPS = math.radians(0.3), 0.02
"""On a way that moves faster than this the error is none to carry for good."""
STEADY_RADPS, STEADY_RAD, STEADY_M = math.radians(2.0), math.radians(8.0), 0.5
"""Rates of turn, heading error and depth error below which trims are learned."""
STANDING_RADPS, STANDING_SPEED_RATIO = math.radians(0.3), 0.5
"""Maximum yaw rate, and minimum speed over the cruise speed, at which a larger heading error is a
standing one: the vehicle does not turn although it could, so the rudder that it lacks is trim."""


class ControlOutput(NamedTuple):
    """What the loops want of the duct, trim included, and how far off the set-points are."""

    rudder_rad: float
    elevator_rad: float
    heading_error_rad: float
    pitch_error_rad: float
    depth_error_m: float
    pitch_setpoint_rad: float


class HeadingLoopResult(NamedTuple):
    """Heading loop: what it wants, and its memory."""

    rudder_rad: float
    integral_rad: float
    course: ReferenceState | None
    belief: ObserverState | None = None


class YawReference(NamedTuple):
    """How she turns about the vertical, and should."""

    rate_radps: float
    wanted_radps: float
    error_rad: float


class DepthLoopResult(NamedTuple):
    """Depth and pitch loop: what they want, and their memory."""

    elevator_rad: float
    pitch_setpoint_rad: float
    pitch_integral_rad: float
    depth_integral_rad: float
    descent: ReferenceState | None
    belief: ObserverState | None = None


class DepthReference(NamedTuple):
    """Depth and its rate against what they should be at this moment."""

    error_m: float
    """Positive: too shallow."""
    rate_mps: float
    """Sinking faster than wanted."""
    ahead_rad: float
    """Nose-down pitch that the way itself takes."""
    descent: ReferenceState | None


def step_loops(
    estimate: VehicleEstimate,
    setpoint: Setpoint,
    memory: LoopMemory,
    config: Config,
    dt_s: float,
    *,
    heading: bool,
    depth: bool,
) -> tuple[ControlOutput, LoopMemory]:
    """Close the loops that are asked for; an open plane rests at its trim and keeps its
    integrators."""
    learned = memory.trim
    trims = (
        config.rudder_trim_rad + learned.rudder_rad,
        config.elevator_trim_rad + learned.elevator_rad,
    )
    steered = HeadingLoopResult(trims[0], memory.heading_integral_rad, None)
    dived = DepthLoopResult(
        trims[1], estimate.pitch_rad, memory.pitch_integral_rad, memory.depth_integral_rad, None
    )
    roll = estimate.roll_rad if config.roll_compensated and heading and depth else 0.0
    if heading:
        steered = heading_loop(estimate, setpoint, memory, trims[0], roll, config, dt_s)
    if depth:
        dived = depth_pitch_loop(estimate, setpoint, memory, trims[1], roll, config, dt_s)
    rudder, elevator = (
        rotate_by_roll(steered.rudder_rad, dived.elevator_rad, roll)
        if roll
        else (steered[0], dived[0])
    )
    rudder_way = elevator_way = None
    if config.actuator_lead_radps:
        if heading and steered.belief is None:
            rudder, rudder_way = reference_model.lead(
                rudder, memory.rudder_lead, config.servo, dt_s
            )
        if depth and dived.belief is None:
            elevator, elevator_way = reference_model.lead(
                elevator, memory.elevator_lead, config.servo, dt_s
            )
    surfaces = ControlOutput(
        rudder,
        elevator,
        wrap_pi(setpoint.heading_rad - estimate.heading_rad),
        dived.pitch_setpoint_rad - estimate.pitch_rad,
        setpoint.depth_m - estimate.depth_m,
        dived.pitch_setpoint_rad,
    )
    kept = LoopMemory(
        steered.integral_rad,
        dived.pitch_integral_rad,
        dived.depth_integral_rad,
        steered.course,
        dived.descent,
        rudder_way,
        elevator_way,
        learned,
        steered.belief,
        dived.belief,
    )
    if config.trim_time_s and heading and depth:
        kept = update_trim(kept, surfaces, trims, estimate, config, dt_s)
    return surfaces, kept


def heading_loop(
    estimate: VehicleEstimate,
    setpoint: Setpoint,
    memory: LoopMemory,
    trim_rad: float,
    roll_rad: float,
    config: Config,
    dt_s: float,
) -> HeadingLoopResult:
    """Heading error to rudder, yaw rate from the gyro; on the way to a new heading both are counted
    from the way."""
    turning = estimate.r_radps
    if roll_rad:
        turning = turning * math.cos(roll_rad) + estimate.q_radps * math.sin(roll_rad)
    rate = turning
    error, course = wrap_pi(setpoint.heading_rad - estimate.heading_rad), None
    gains, travel = config.heading_gains, config.travel_rad
    if config.schedule_mps:
        gains = schedule_gains(gains, estimate.speed_mps / config.schedule_mps)
    if bandwidth := config.heading_ref_radps:
        start = memory.heading_reference or ReferenceState(estimate.heading_rad, estimate.r_radps)
        to_go = wrap_pi(setpoint.heading_rad - start.value)
        course = reference_model.step_reference(
            to_go, start, bandwidth, config.heading_ref_rate_radps, dt_s
        )
        error, rate = wrap_pi(course.value - estimate.heading_rad), rate - course.rate
        if abs(course.rate) > INTEGRATOR_HOLD_RADPS:
            gains = gains._replace(i=0.0)
    elif config.heading_setpoint_weight < 1.0:
        start = memory.heading_reference or ReferenceState(estimate.heading_rad)
        to_go = wrap_pi(setpoint.heading_rad - start.value)
        error = wrap_pi(start.value - estimate.heading_rad) + config.heading_setpoint_weight * to_go
        course = reference_model.follow_reference(to_go, start, gains, dt_s)
    if laws := scheduled_controllers(config, estimate):
        turn = YawReference(turning, turning - rate, error)
        rudder, belief = heading_lqg(
            laws, turn, estimate.heading_rad, memory.rudder_observer, trim_rad, config
        )
        return HeadingLoopResult(rudder, memory.heading_integral_rad, course, belief)
    rudder, integral = pid(
        error, rate, gains, memory.heading_integral_rad, dt_s, -travel - trim_rad, travel - trim_rad
    )
    return HeadingLoopResult(rudder + trim_rad, integral, course)


def heading_lqg(
    laws: LqgControllers,
    turn: YawReference,
    heading_rad: float,
    belief: ObserverState | None,
    trim_rad: float,
    config: Config,
) -> tuple[float, ObserverState]:
    """The rudder. Headings are counted on past south, as a belief knows no turn of the circle."""
    if belief is not None:
        last = belief.measured[1]
        heading_rad = last + wrap_pi(heading_rad - last)
    wanted, travel = (turn.wanted_radps, heading_rad + turn.error_rad), config.travel_rad
    under_way = abs(turn.wanted_radps) > INTEGRATOR_HOLD_RADPS
    target = LqgReference(wanted, 0.0, -travel - trim_rad, travel - trim_rad, under_way)
    rudder, belief = lqg.step(laws.heading, belief, (turn.rate_radps, heading_rad), target)
    return rudder + trim_rad, belief


def scheduled_controllers(config: Config, estimate: VehicleEstimate) -> LqgControllers | None:
    """What flies in place of the PIDs; None where they fly."""
    if config.lqg_enabled and lqg.in_range(config.laws, estimate.speed_mps):
        return config.laws
    return None


def depth_pitch_loop(
    estimate: VehicleEstimate,
    setpoint: Setpoint,
    memory: LoopMemory,
    trim_rad: float,
    roll_rad: float,
    config: Config,
    dt_s: float,
) -> DepthLoopResult:
    """Depth error to pitch, or the pitch that is given; pitch error to elevator, pitch rate from
    the gyro."""
    rate = estimate.q_radps
    if roll_rad:
        rate = rate * math.cos(roll_rad) - estimate.r_radps * math.sin(roll_rad)
    path = depth_reference(estimate, setpoint, memory, config, dt_s)
    rest, travel = trim_rad, config.travel_rad
    if config.pitch_feedforward and path.descent and setpoint.pitch_rad is None:
        rest += pitch_feedforward(path.descent, estimate, config)
    if (laws := scheduled_controllers(config, estimate)) and setpoint.pitch_rad is None:
        return depth_lqg(laws, path, estimate, memory, rate, rest - trim_rad, trim_rad, config)
    pitch_setpoint, depth_i = depth_loop(path, memory, config, dt_s)
    if setpoint.pitch_rad is not None:
        pitch_setpoint = setpoint.pitch_rad
    gains = config.pitch_gains
    if config.schedule_mps:
        gains = schedule_gains(gains, estimate.speed_mps / config.schedule_mps)
    error = pitch_setpoint - estimate.pitch_rad
    elevator, pitch_i = pid(
        error, rate, gains, memory.pitch_integral_rad, dt_s, -travel - rest, travel - rest
    )
    return DepthLoopResult(elevator + rest, pitch_setpoint, pitch_i, depth_i, path.descent)


def depth_lqg(
    laws: LqgControllers,
    path: DepthReference,
    estimate: VehicleEstimate,
    memory: LoopMemory,
    rate_radps: float,
    ahead_rad: float,
    trim_rad: float,
    config: Config,
) -> DepthLoopResult:
    """Depth and pitch to elevator at once; the depth error counts as far as the pitch limit
    goes."""
    limit_m, travel = config.pitch_limit_rad / laws.pitch_per_metre, config.travel_rad
    error, sinking = min(limit_m, max(-limit_m, path.error_m)), estimate.depth_rate_mps
    measured = rate_radps, estimate.pitch_rad, estimate.depth_m, sinking
    wanted = 0.0, -path.ahead_rad, estimate.depth_m + error, sinking - path.rate_mps
    under_way = path.descent is not None and abs(path.descent.rate) > INTEGRATOR_HOLD_MPS
    target = LqgReference(wanted, ahead_rad, -travel - trim_rad, travel - trim_rad, under_way)
    elevator, belief = lqg.step(laws.depth, memory.elevator_observer, measured, target)
    pitch = -laws.pitch_per_metre * error - path.ahead_rad
    return DepthLoopResult(
        elevator + trim_rad,
        pitch,
        memory.pitch_integral_rad,
        memory.depth_integral_rad,
        path.descent,
        belief,
    )


def depth_reference(
    estimate: VehicleEstimate, setpoint: Setpoint, memory: LoopMemory, config: Config, dt_s: float
) -> DepthReference:
    """The depth error: from the reference model's way where there is one, or from the weighted
    set-point."""
    rate = estimate.depth_rate_mps
    if bandwidth := config.depth_ref_radps:
        start = memory.depth_reference or ReferenceState(estimate.depth_m, rate)
        descent = reference_model.step_reference(
            setpoint.depth_m - start.value, start, bandwidth, config.depth_ref_mps, dt_s
        )
        error = descent.value - estimate.depth_m
        return DepthReference(
            error, rate - descent.rate, required_pitch(descent, estimate), descent
        )
    if config.depth_setpoint_weight < 1.0:
        start = memory.depth_reference or ReferenceState(estimate.depth_m)
        to_go = setpoint.depth_m - start.value
        error = start.value - estimate.depth_m + config.depth_setpoint_weight * to_go
        return DepthReference(
            error,
            rate,
            0.0,
            reference_model.follow_reference(to_go, start, config.depth_gains, dt_s),
        )
    return DepthReference(setpoint.depth_m - estimate.depth_m, rate, 0.0, None)


def depth_loop(
    path: DepthReference, memory: LoopMemory, config: Config, dt_s: float
) -> tuple[float, float]:
    """Depth error to pitch: too shallow asks for nose down, hence the minus. (pitch, integral)."""
    limit, ahead, gains = config.pitch_limit_rad, path.ahead_rad, config.depth_gains
    if path.descent is not None and abs(path.descent.rate) > INTEGRATOR_HOLD_MPS:
        gains = gains._replace(i=0.0)
    nose_down, integral = pid(
        path.error_m,
        path.rate_mps,
        gains,
        memory.depth_integral_rad,
        dt_s,
        -limit - ahead,
        limit - ahead,
    )
    return -nose_down - ahead, integral


def required_pitch(descent: ReferenceState, estimate: VehicleEstimate) -> float:
    """The nose-down pitch that a way in depth itself takes: depth' = -U sin(theta)."""
    return descent.rate / max(estimate.speed_mps, MIN_SPEED_MPS)


def pitch_feedforward(descent: ReferenceState, estimate: VehicleEstimate, config: Config) -> float:
    """The elevator that holds the pitch of a way in depth against the weight under the hull's axis.

    That righting moment is the same at any speed; what an angle of the duct turns grows with U^2.
    """
    limit, x = (
        config.pitch_limit_rad,
        min(MAX_SPEED_RATIO, max(MIN_SPEED_RATIO, estimate.speed_mps / config.cruise_speed_mps)),
    )
    pitch = -min(limit, max(-limit, required_pitch(descent, estimate)))
    return config.pitch_feedforward * pitch / (x * x)


def schedule_gains(gains: Gains, speed: float) -> Gains:
    """Gains of rudder or elevator at ``speed`` times the speed that they were designed at.

    Slower, all of the vehicle's own motion slows with her, and a loop that slows likewise keeps its
    margins; faster, delay and lag do not shrink with her time, and the loop is held at its
    bandwidth. Hydrodynamic forces grow with U for a rate and with U^2 for an angle (Fossen 2021,
    section 6.7), and so does what an angle of the duct turns."""
    x = min(MAX_SPEED_RATIO, max(MIN_SPEED_RATIO, speed))
    if x <= 1.0:
        return gains._replace(d=gains.d / x, i=gains.i * x)
    return gains._replace(p=gains.p / (x * x), d=gains.d / (x * x), i=gains.i / (x * x))


def rotate_by_roll(rudder_rad: float, elevator_rad: float, roll_rad: float) -> tuple[float, float]:
    """What is wanted about the vertical and the horizontal, about the axes of a hull that has
    rolled."""
    c, s = math.cos(roll_rad), math.sin(roll_rad)
    return rudder_rad * c - elevator_rad * s, rudder_rad * s + elevator_rad * c


def update_trim(
    memory: LoopMemory,
    wanted: ControlOutput,
    trims: tuple[float, float],
    estimate: VehicleEstimate,
    config: Config,
    dt_s: float,
) -> LoopMemory:
    """In steady flight the trims go to the surfaces' mean and relieve the integrators."""
    if not steady(estimate, wanted, config):
        return memory
    share, old = dt_s / config.trim_time_s, memory.trim
    rudder, elevator = (
        share * (wanted.rudder_rad - trims[0]),
        share * (wanted.elevator_rad - trims[1]),
    )
    # Each integrator gives back its own part only. The part of a standing error is added to the
    # command: taken from the integrator too, it would drive that to its other limit.
    return memory._replace(
        heading_integral_rad=memory.heading_integral_rad
        * (1.0 - share if memory.rudder_observer is None else 1.0),
        pitch_integral_rad=memory.pitch_integral_rad * (1.0 - share),
        trim=Trim(old.rudder_rad + rudder, old.elevator_rad + elevator, old.learned_s + dt_s),
    )


def steady(estimate: VehicleEstimate, wanted: ControlOutput, config: Config) -> bool:
    """Whether the surfaces hold the vehicle in equilibrium, so that their mean is the trim.

    A missing rudder trim b leaves a heading error of about b / HDG_P where the integrator is
    limited. That error must not keep the trim from being learned.
    """
    slow = abs(estimate.r_radps) < STEADY_RADPS and abs(estimate.q_radps) < STEADY_RADPS
    if not slow or abs(wanted.depth_error_m) >= STEADY_M:
        return False
    standing = (
        abs(estimate.r_radps) < STANDING_RADPS
        and estimate.speed_mps >= STANDING_SPEED_RATIO * config.cruise_speed_mps
        and abs(wanted.rudder_rad) < config.travel_rad
    )
    return standing or abs(wanted.heading_error_rad) < STEADY_RAD
