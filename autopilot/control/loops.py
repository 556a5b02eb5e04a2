"""Control loops: heading to rudder; depth to pitch and pitch to elevator. Pure.

Angles in rad, rates in rad/s, depth in m, speeds in m/s. Signs: positive rudder turns the nose to
starboard, positive elevator raises it; depth is positive down. With e = set-point - estimate and
the rates r, q from the gyro, and theta the pitch set-point of the depth loop::

    heading   rudder   = P e - D r + I          I' = K_i e
    depth     theta    = -(P e - D depth' + I)  I' = K_i e    |theta| <= PTCH_LIM_DEG
    pitch     elevator = P e - D q + I          I' = K_i e

Both outputs are added to the trims. Parameters switch on: reference models or set-point weighting
(``reference_model``), pitch feedforward, gain scheduling with speed, roll compensation, peak
filters of the commands, the lead that compensates the lag of the tailcone, and trims that are
learned in flight. Full deflection that one sensor alone asks for is limited
(``deflection_limit``). LQG controllers (``lqg``), if given, replace the PIDs near the speed that
they were designed for.
"""

import math
from typing import NamedTuple

from autopilot.control import deflection_limit, lqg, reference_model
from autopilot.control.lqg import LqgControllers, LqgReference, ObserverState
from autopilot.control.params import Config
from autopilot.control.pid import Gains, pid
from autopilot.control.reference_model import NO_REFERENCE, ReferenceState, begun
from autopilot.control.setpoints import Setpoint
from autopilot.control.types import LoopMemory, Trim, VehicleEstimate
from mavlink_io.frames import wrap_pi
from mavlink_io.jit import numeric

MIN_SPEED_RATIO, MAX_SPEED_RATIO = 0.4, 2.5
"""Limits of the speed ratio (speed over that of the gains) in gain scheduling."""
MIN_SPEED_MPS = 0.3
"""Minimum speed assumed when a depth rate is converted to pitch."""
INTEGRATOR_HOLD_RADPS, INTEGRATOR_HOLD_MPS = math.radians(0.3), 0.02
"""Reference rates above which the integrators of heading and depth are frozen: tracking error
during a manoeuvre is transient."""
STEADY_RADPS, STEADY_RAD, STEADY_M = math.radians(2.0), math.radians(8.0), 0.5
"""Body rate, heading error and depth error below which trims are learned and a set-point counts as
reached."""
SAME_SETPOINT_RAD, SAME_SETPOINT_M = math.radians(2.0), 0.25
"""Change of a set-point that has been reached, up to which no manoeuvre has been commanded."""
OBSERVED_RATES = 0.6
"""Factor on P and D of loops with actuator lead while an observer replaces the gyro: its rates are
late, and such a fast loop would swing."""
STANDING_RADPS, STANDING_SPEED_RATIO = math.radians(0.3), 0.5
"""Maximum yaw rate, and minimum speed over the cruise speed, at which a larger heading error is a
standing one: the vehicle does not turn although it could, so the rudder that it lacks is trim."""


class ControlOutput(NamedTuple):
    """Commanded deflections, trim included, and control errors (set-point minus estimate)."""

    rudder_rad: float
    elevator_rad: float
    heading_error_rad: float
    pitch_error_rad: float
    depth_error_m: float
    pitch_setpoint_rad: float


class HeadingLoopResult(NamedTuple):
    """Rudder command and new state of the heading loop."""

    rudder_rad: float
    integral_rad: float
    reference: ReferenceState
    observer: ObserverState | None
    confirming_rad: float
    """Rudder that accelerometer and magnetometer ask for (``deflection_limit``)."""


class YawReference(NamedTuple):
    """Heading error and yaw rate relative to their reference."""

    error_rad: float
    """Reference minus estimate, or the weighted error."""
    rate_radps: float
    """Estimated minus reference yaw rate."""
    reference: ReferenceState
    yaw_rate_radps: float
    """Estimated yaw rate about the vertical."""


class DepthLoopResult(NamedTuple):
    """Elevator command and new state of the depth and pitch loops."""

    elevator_rad: float
    pitch_setpoint_rad: float
    pitch_integral_rad: float
    depth_integral_rad: float
    reference: ReferenceState
    observer: ObserverState | None
    confirming_rad: float
    """Elevator that the accelerometer asks for (``deflection_limit``)."""


class DepthReference(NamedTuple):
    """Depth and depth rate relative to their reference."""

    error_m: float
    """Reference minus estimate; positive: too shallow."""
    rate_mps: float
    """Estimated minus reference depth rate; positive: sinks faster than the reference."""
    pitch_down_rad: float
    """Nose-down pitch that the depth rate of the reference needs."""
    reference: ReferenceState


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
    """Run the closed loops for one tick.

    The surface of an open loop rests at its trim, and its integrators keep their values.

    Parameters
    ----------
    estimate : VehicleEstimate
        Estimated attitude, rates, depth and speed.
    setpoint : Setpoint
        Heading (rad), depth (m), or pitch (rad) in place of the depth.
    memory : LoopMemory
        State of the loops after the last tick.
    config : Config
        Parameters.
    dt_s : float
        Time since the last tick.
    heading : bool
        Whether the heading loop is closed.
    depth : bool
        Whether the depth and pitch loops are closed.

    Returns
    -------
    tuple[ControlOutput, LoopMemory]
        Commands and errors of this tick, and the new state of the loops. Commands may exceed the
        travel of the duct after rotation by the roll angle.
    """
    controllers = scheduled_controllers(config, estimate)
    if controllers is None:
        return step_pids(estimate, setpoint, memory, config, dt_s, heading, depth)
    trims, roll = _trims(memory, config), _roll(estimate, config, heading, depth)
    rudder = _open_heading(memory, trims)
    elevator = _open_depth(estimate, memory, trims)
    if heading:
        rudder = heading_lqg(controllers, estimate, setpoint, memory, trims[0], roll, config, dt_s)
    if depth and math.isnan(setpoint.pitch_rad):
        elevator = depth_lqg(controllers, estimate, setpoint, memory, trims[1], roll, config, dt_s)
    elif depth:
        elevator = depth_pids(estimate, setpoint, memory, trims[1], roll, config, dt_s)
    return _combine(
        rudder, elevator, estimate, setpoint, memory, trims, roll, config, dt_s, heading, depth
    )


@numeric
def step_pids(
    estimate: VehicleEstimate,
    setpoint: Setpoint,
    memory: LoopMemory,
    config: Config,
    dt_s: float,
    heading: bool,
    depth: bool,
) -> tuple[ControlOutput, LoopMemory]:
    """Run the closed loops for one tick, as ``step_loops`` does, with PIDs only.

    Parameters
    ----------
    estimate : VehicleEstimate
        Estimated attitude, rates, depth and speed.
    setpoint : Setpoint
        Heading (rad), depth (m), or pitch (rad) in place of the depth.
    memory : LoopMemory
        State of the loops after the last tick.
    config : Config
        Parameters.
    dt_s : float
        Time since the last tick.
    heading, depth : bool
        Whether the heading loop, and the depth and pitch loops are closed.

    Returns
    -------
    tuple[ControlOutput, LoopMemory]
        As of ``step_loops``.
    """
    trims, roll = _trims(memory, config), _roll(estimate, config, heading, depth)
    rudder = _open_heading(memory, trims)
    elevator = _open_depth(estimate, memory, trims)
    if heading:
        rudder = heading_pid(estimate, setpoint, memory, trims[0], roll, config, dt_s)
    if depth:
        elevator = depth_pids(estimate, setpoint, memory, trims[1], roll, config, dt_s)
    return _combine(
        rudder, elevator, estimate, setpoint, memory, trims, roll, config, dt_s, heading, depth
    )


@numeric
def _trims(memory: LoopMemory, config: Config) -> tuple[float, float]:
    """Return the trims of rudder and elevator (rad), learned parts included."""
    return (
        config.rudder_trim_rad + memory.trim.rudder_rad,
        config.elevator_trim_rad + memory.trim.elevator_rad,
    )


@numeric
def _roll(estimate: VehicleEstimate, config: Config, heading: bool, depth: bool) -> float:
    """Return the roll angle (rad) to compensate; 0 without roll compensation."""
    return estimate.roll_rad if config.roll_compensated and heading and depth else 0.0


@numeric
def _open_heading(memory: LoopMemory, trims: tuple[float, float]) -> HeadingLoopResult:
    """Return the result of an open heading loop."""
    return HeadingLoopResult(trims[0], memory.heading_integral_rad, NO_REFERENCE, None, trims[0])


@numeric
def _open_depth(
    estimate: VehicleEstimate, memory: LoopMemory, trims: tuple[float, float]
) -> DepthLoopResult:
    """Return the result of open depth and pitch loops."""
    return DepthLoopResult(
        trims[1],
        estimate.pitch_rad,
        memory.pitch_integral_rad,
        memory.depth_integral_rad,
        NO_REFERENCE,
        None,
        trims[1],
    )


@numeric
def _combine(
    heading_result: HeadingLoopResult,
    depth_result: DepthLoopResult,
    estimate: VehicleEstimate,
    setpoint: Setpoint,
    memory: LoopMemory,
    trims: tuple[float, float],
    roll_rad: float,
    config: Config,
    dt_s: float,
    heading: bool,
    depth: bool,
) -> tuple[ControlOutput, LoopMemory]:
    """Return commands, errors and new memory: roll compensation, filters, learned trims."""
    rudder, elevator = heading_result.rudder_rad, depth_result.elevator_rad
    if roll_rad != 0.0:
        rudder, elevator = rotate_by_roll(rudder, elevator, roll_rad)
    rudder_peak = elevator_peak = rudder_lead = elevator_lead = NO_REFERENCE
    if heading and heading_result.observer is None and config.heading_peak_radps:
        rudder, rudder_peak = reference_model.peak(
            rudder, memory.rudder_peak, config.rudder_peak, dt_s
        )
    if depth and depth_result.observer is None and config.pitch_peak_radps:
        elevator, elevator_peak = reference_model.peak(
            elevator, memory.elevator_peak, config.elevator_peak, dt_s
        )
    if config.actuator_lead_radps:
        if heading and heading_result.observer is None:
            rudder, rudder_lead = reference_model.lead(
                rudder, memory.rudder_lead, config.servo, dt_s
            )
        if depth and depth_result.observer is None:
            elevator, elevator_lead = reference_model.lead(
                elevator, memory.elevator_lead, config.servo, dt_s
            )
    heading_error = wrap_pi(setpoint.heading_rad - estimate.heading_rad)
    depth_error = setpoint.depth_m - estimate.depth_m
    reached_heading = reached_depth = math.nan
    if heading:
        reached_heading = (
            setpoint.heading_rad
            if abs(heading_error) < STEADY_RAD and abs(estimate.r_radps) < STEADY_RADPS
            else memory.reached_heading_rad
        )
    if depth and math.isnan(setpoint.pitch_rad):
        reached_depth = (
            setpoint.depth_m
            if abs(depth_error) < STEADY_M and abs(estimate.q_radps) < STEADY_RADPS
            else memory.reached_depth_m
        )
    turned = abs(wrap_pi(setpoint.heading_rad - reached_heading)) < SAME_SETPOINT_RAD
    dived = abs(setpoint.depth_m - reached_depth) < SAME_SETPOINT_M
    rudder, rudder_full_s = deflection_limit.limit_deflection(
        rudder,
        math.nan if turned else heading_result.confirming_rad,
        memory.rudder_full_s,
        config.travel_rad,
        dt_s,
    )
    elevator, elevator_full_s = deflection_limit.limit_deflection(
        elevator,
        math.nan if dived else depth_result.confirming_rad,
        memory.elevator_full_s,
        config.travel_rad,
        dt_s,
    )
    output = ControlOutput(
        rudder,
        elevator,
        heading_error,
        depth_result.pitch_setpoint_rad - estimate.pitch_rad,
        depth_error,
        depth_result.pitch_setpoint_rad,
    )
    new_memory = LoopMemory(
        heading_result.integral_rad,
        depth_result.pitch_integral_rad,
        depth_result.depth_integral_rad,
        heading_result.reference,
        depth_result.reference,
        rudder_lead,
        elevator_lead,
        rudder_peak,
        elevator_peak,
        memory.trim,
        heading_result.observer,
        depth_result.observer,
        rudder_full_s,
        elevator_full_s,
        reached_heading,
        reached_depth,
    )
    if config.trim_time_s and heading and depth:
        new_memory = update_trim(new_memory, output, trims, estimate, config, dt_s)
    return output, new_memory


@numeric
def heading_reference(
    estimate: VehicleEstimate,
    setpoint: Setpoint,
    memory: LoopMemory,
    roll_rad: float,
    config: Config,
    dt_s: float,
) -> YawReference:
    """Compute heading error and yaw rate relative to the reference model or weighted set-point.

    With r_v the yaw rate about the vertical, r cos(roll) + q sin(roll) with roll compensation, else
    r; psi the heading, psi_s its set-point, x and x' the reference and its rate, and b the weight::

        plain             e = psi_s - psi                        rate = r_v
        reference model   e = x - psi                            rate = r_v - x'
        weighting         e = x - psi + b (psi_s - x)            rate = r_v

    Differences of headings are wrapped to (-pi, pi].
    """
    yaw_rate, heading_rad = estimate.r_radps, estimate.heading_rad
    if roll_rad != 0.0:
        yaw_rate = yaw_rate * math.cos(roll_rad) + estimate.q_radps * math.sin(roll_rad)
    start, bandwidth = memory.heading_reference, config.heading_ref_radps
    if bandwidth:
        if not begun(start):
            start = ReferenceState(heading_rad, estimate.r_radps)
        to_go = wrap_pi(setpoint.heading_rad - start.value)
        reference = reference_model.step_reference(
            to_go, start, bandwidth, config.heading_ref_rate_radps, dt_s
        )
        error = wrap_pi(reference.value - heading_rad)
        return YawReference(error, yaw_rate - reference.rate, reference, yaw_rate)
    if config.heading_setpoint_weight < 1.0:
        if not begun(start):
            start = ReferenceState(heading_rad, 0.0)
        to_go = wrap_pi(setpoint.heading_rad - start.value)
        error = wrap_pi(start.value - heading_rad) + config.heading_setpoint_weight * to_go
        gains = scheduled_gains(config.heading_gains, estimate, config)
        followed = reference_model.follow_reference(to_go, start, gains, dt_s)
        return YawReference(error, yaw_rate, followed, yaw_rate)
    error = wrap_pi(setpoint.heading_rad - heading_rad)
    return YawReference(error, yaw_rate, NO_REFERENCE, yaw_rate)


@numeric
def hold_reference(
    yaw: YawReference,
    gains: Gains,
    integral_rad: float,
    low_rad: float,
    high_rad: float,
    dt_s: float,
) -> YawReference:
    """Slow the reference down to what the rudder can do, while its command is beyond a limit.

    With c the excess of the command P e - D (r - x') + I over the limit, and x = x0 + x' dt::

        x' <- x' - c / (D + P dt)        x <- x0 + x' dt

    so that the command is at the limit. Otherwise the reference would turn ahead of a vehicle that
    cannot follow it, and an unstable hull would swing to and fro at full rudder (reference hedging,
    Johnson and Calise 2001).
    """
    wanted = gains.p * yaw.error_rad - gains.d * yaw.rate_radps + integral_rad
    excess = wanted - min(high_rad, max(low_rad, wanted))
    if excess == 0.0:
        return yaw
    change_radps = -excess / (gains.d + gains.p * dt_s)
    value, rate = yaw.reference
    return YawReference(
        yaw.error_rad + change_radps * dt_s,
        yaw.rate_radps - change_radps,
        ReferenceState(value + change_radps * dt_s, rate + change_radps),
        yaw.yaw_rate_radps,
    )


@numeric
def heading_pid(
    estimate: VehicleEstimate,
    setpoint: Setpoint,
    memory: LoopMemory,
    trim_rad: float,
    roll_rad: float,
    config: Config,
    dt_s: float,
) -> HeadingLoopResult:
    """Compute the rudder: P e - D rate + I + trim, with e and rate of ``heading_reference``."""
    yaw = heading_reference(estimate, setpoint, memory, roll_rad, config, dt_s)
    gains, travel = scheduled_gains(config.heading_gains, estimate, config), config.travel_rad
    low_rad, high_rad = -travel - trim_rad, travel - trim_rad
    if config.heading_ref_radps and gains.d > 0.0:
        yaw = hold_reference(yaw, gains, memory.heading_integral_rad, low_rad, high_rad, dt_s)
    if abs(yaw.reference.rate) > INTEGRATOR_HOLD_RADPS:
        gains = gains._replace(i=0.0)
    rudder, integral = pid(
        yaw.error_rad,
        yaw.rate_radps,
        gains,
        memory.heading_integral_rad,
        dt_s,
        low_rad,
        high_rad,
    )
    static_rad = trim_rad + gains.p * yaw.error_rad + integral
    confirming_rad = static_rad - gains.p * estimate.attitude_error_rad[2]
    return HeadingLoopResult(rudder + trim_rad, integral, yaw.reference, None, confirming_rad)


def heading_lqg(
    controllers: LqgControllers,
    estimate: VehicleEstimate,
    setpoint: Setpoint,
    memory: LoopMemory,
    trim_rad: float,
    roll_rad: float,
    config: Config,
    dt_s: float,
) -> HeadingLoopResult:
    """Compute the rudder (rad, trim included) by the heading LQG controller."""
    yaw = heading_reference(estimate, setpoint, memory, roll_rad, config, dt_s)
    heading_rad, observer = estimate.heading_rad, memory.rudder_observer
    if observer is not None:
        # Unwrapped: the observer state is linear in heading, so it has no jump at +-180 degrees.
        last = observer.measured[1]
        heading_rad = last + wrap_pi(heading_rad - last)
    reference_radps, travel = yaw.yaw_rate_radps - yaw.rate_radps, config.travel_rad
    target = LqgReference(
        (reference_radps, heading_rad + yaw.error_rad),
        0.0,
        -travel - trim_rad,
        travel - trim_rad,
        abs(reference_radps) > INTEGRATOR_HOLD_RADPS,
    )
    rudder, observer = lqg.step(
        controllers.heading, observer, (yaw.yaw_rate_radps, heading_rad), target
    )
    rudder += trim_rad
    confirming_rad = rudder - controllers.heading.forward[1] * estimate.attitude_error_rad[2]
    return HeadingLoopResult(
        rudder, memory.heading_integral_rad, yaw.reference, observer, confirming_rad
    )


def scheduled_controllers(config: Config, estimate: VehicleEstimate) -> LqgControllers | None:
    """Return the LQG controllers if they are enabled and valid, else None.

    They are valid in their speed range, with the gyro that their filter assumes.
    """
    if not (config.lqg_enabled and estimate.rates_measured):
        return None
    in_range = lqg.in_range(config.lqg_controllers, estimate.speed_mps)
    return config.lqg_controllers if in_range else None


@numeric
def depth_pids(
    estimate: VehicleEstimate,
    setpoint: Setpoint,
    memory: LoopMemory,
    trim_rad: float,
    roll_rad: float,
    config: Config,
    dt_s: float,
) -> DepthLoopResult:
    """Compute the elevator from depth, or from the pitch set-point if one is given.

    With q_v the pitch rate of ``_vertical_pitch_rate``, theta the pitch and theta_s its set-point::

        elevator = P (theta_s - theta) - D q_v + I + trim + feedforward
    """
    depth = depth_reference(estimate, setpoint, memory, config, dt_s)
    rest, travel = trim_rad, config.travel_rad
    level_rad = level_pitch(estimate, config)
    pitch_setpoint, depth_integral = depth_loop(depth, level_rad, memory, config, dt_s)
    if math.isnan(setpoint.pitch_rad):
        rest += pitch_feedforward(depth.reference, estimate, config)
    else:
        pitch_setpoint = setpoint.pitch_rad
    error_rad = pitch_setpoint - estimate.pitch_rad
    gains = scheduled_gains(config.pitch_gains, estimate, config)
    elevator, pitch_integral = pid(
        error_rad,
        _vertical_pitch_rate(estimate, roll_rad),
        gains,
        memory.pitch_integral_rad,
        dt_s,
        -travel - rest,
        travel - rest,
    )
    static_rad = rest + gains.p * error_rad + pitch_integral
    return DepthLoopResult(
        elevator + rest,
        pitch_setpoint,
        pitch_integral,
        depth_integral,
        depth.reference,
        None,
        static_rad - gains.p * estimate.attitude_error_rad[1],
    )


@numeric
def _vertical_pitch_rate(estimate: VehicleEstimate, roll_rad: float) -> float:
    """Return the pitch rate in the vertical plane, q cos(roll) - r sin(roll); q without roll."""
    if roll_rad == 0.0:
        return estimate.q_radps
    return estimate.q_radps * math.cos(roll_rad) - estimate.r_radps * math.sin(roll_rad)


def depth_lqg(
    controllers: LqgControllers,
    estimate: VehicleEstimate,
    setpoint: Setpoint,
    memory: LoopMemory,
    trim_rad: float,
    roll_rad: float,
    config: Config,
    dt_s: float,
) -> DepthLoopResult:
    """Compute the elevator (rad, trim included) by the depth LQG controller.

    One controller closes depth and pitch. The depth error is limited to the one at which the
    controller would ask for the pitch limit: PTCH_LIM_DEG over ``pitch_per_metre``. Pitch is
    relative to that of a level run (TRIM_PIT_DEG), so that the observer estimates only the rest of
    the net buoyancy.
    """
    level_rad = level_pitch(estimate, config)
    depth = depth_reference(estimate, setpoint, memory, config, dt_s)
    # As the sum in ``depth_pids``, so that both controllers round it in the same way.
    feedforward_rad = trim_rad + pitch_feedforward(depth.reference, estimate, config) - trim_rad
    limit_m, travel = config.pitch_limit_rad / controllers.pitch_per_metre, config.travel_rad
    error, sinking = min(limit_m, max(-limit_m, depth.error_m)), estimate.depth_rate_mps
    pitch_rate = _vertical_pitch_rate(estimate, roll_rad)
    measured = pitch_rate, estimate.pitch_rad - level_rad, estimate.depth_m, sinking
    wanted = 0.0, -depth.pitch_down_rad, estimate.depth_m + error, sinking - depth.rate_mps
    moving = abs(depth.reference.rate) > INTEGRATOR_HOLD_MPS
    target = LqgReference(wanted, feedforward_rad, -travel - trim_rad, travel - trim_rad, moving)
    elevator, observer = lqg.step(controllers.depth, memory.elevator_observer, measured, target)
    pitch = level_rad - controllers.pitch_per_metre * error - depth.pitch_down_rad
    elevator += trim_rad
    return DepthLoopResult(
        elevator,
        pitch,
        memory.pitch_integral_rad,
        memory.depth_integral_rad,
        depth.reference,
        observer,
        elevator - controllers.depth.forward[1] * estimate.attitude_error_rad[1],
    )


@numeric
def depth_reference(
    estimate: VehicleEstimate, setpoint: Setpoint, memory: LoopMemory, config: Config, dt_s: float
) -> DepthReference:
    """Compute the depth error to the reference model or to the weighted set-point.

    With z the depth, z_s its set-point, x and x' the reference and its rate, b the weight and U the
    speed::

        plain             e = z_s - z                  rate = z'
        reference model   e = x - z                    rate = z' - x'     nose-down pitch x' / U
        weighting         e = x - z + b (z_s - x)      rate = z'
    """
    rate, start = estimate.depth_rate_mps, memory.depth_reference
    bandwidth = config.depth_ref_radps
    if bandwidth:
        if not begun(start):
            start = ReferenceState(estimate.depth_m, rate)
        # A slow vehicle cannot follow: at the surface the reference waits for the speed.
        max_rate_mps = config.depth_ref_mps * min(
            1.0, max(0.0, estimate.speed_mps / config.cruise_speed_mps)
        )
        reference = reference_model.step_reference(
            setpoint.depth_m - start.value, start, bandwidth, max_rate_mps, dt_s
        )
        error = reference.value - estimate.depth_m
        acceleration_mps2 = (reference.rate - start.rate) / dt_s if dt_s > 0.0 else 0.0
        ahead = ReferenceState(
            reference.value, reference.rate + config.depth_ref_lead_s * acceleration_mps2
        )
        return DepthReference(
            error, rate - reference.rate, required_pitch(ahead, estimate), reference
        )
    if config.depth_setpoint_weight < 1.0:
        if not begun(start):
            start = ReferenceState(estimate.depth_m, 0.0)
        to_go = setpoint.depth_m - start.value
        error = start.value - estimate.depth_m + config.depth_setpoint_weight * to_go
        return DepthReference(
            error,
            rate,
            0.0,
            reference_model.follow_reference(to_go, start, config.depth_gains, dt_s),
        )
    return DepthReference(setpoint.depth_m - estimate.depth_m, rate, 0.0, NO_REFERENCE)


@numeric
def depth_loop(
    depth: DepthReference, level_rad: float, memory: LoopMemory, config: Config, dt_s: float
) -> tuple[float, float]:
    """Compute the pitch set-point (rad, nose up) and the new integral (rad, nose down).

    With e and rate of ``depth_reference``, a the nose-down pitch of the reference and theta_0 the
    pitch of a level run, ``level_rad``::

        theta_s = theta_0 - (P e - D rate + I) - a

    The sign changes because a vehicle that is too shallow must pitch down.
    """
    limit, gains = config.pitch_limit_rad, config.depth_gains
    ahead = depth.pitch_down_rad - level_rad
    if abs(depth.reference.rate) > INTEGRATOR_HOLD_MPS:
        gains = gains._replace(i=0.0)
    nose_down, integral = pid(
        depth.error_m,
        depth.rate_mps,
        gains,
        memory.depth_integral_rad,
        dt_s,
        -limit - ahead,
        limit - ahead,
    )
    return -nose_down - ahead, integral


@numeric
def level_pitch(estimate: VehicleEstimate, config: Config) -> float:
    """Return the pitch (rad) at which the lift of the hull balances the net buoyancy.

    With theta_c = TRIM_PIT_DEG and x = U / U_cruise, limited: theta_c / x^2, because the lift per
    angle grows with U^2.
    """
    x, limit = _cruise_ratio(estimate, config), config.pitch_limit_rad
    return min(limit, max(-limit, config.level_pitch_rad / (x * x)))


@numeric
def _cruise_ratio(estimate: VehicleEstimate, config: Config) -> float:
    """Return speed over cruise speed, limited as in gain scheduling."""
    ratio = estimate.speed_mps / config.cruise_speed_mps
    return min(MAX_SPEED_RATIO, max(MIN_SPEED_RATIO, ratio))


@numeric
def required_pitch(reference: ReferenceState, estimate: VehicleEstimate) -> float:
    """Return the nose-down pitch (rad) for a depth rate: depth' = -U sin(theta), theta small."""
    return reference.rate / max(estimate.speed_mps, MIN_SPEED_MPS)


@numeric
def pitch_feedforward(
    reference: ReferenceState, estimate: VehicleEstimate, config: Config
) -> float:
    """Return the elevator (rad) that holds the pitch of a depth reference.

    The elevator balances the righting moment of a centre of gravity below the centre of buoyancy.
    With theta the pitch of the reference, K = PTCH_FF and x = U / U_cruise, limited::

        elevator = K theta / x^2

    The righting moment does not depend on the speed U; the moment of the duct grows with U^2. The
    result is 0 without feedforward or without a reference.
    """
    if not config.pitch_feedforward or not begun(reference):
        return 0.0
    limit, x = config.pitch_limit_rad, _cruise_ratio(estimate, config)
    pitch = -min(limit, max(-limit, required_pitch(reference, estimate)))
    return config.pitch_feedforward * pitch / (x * x)


@numeric
def scheduled_gains(gains: Gains, estimate: VehicleEstimate, config: Config) -> Gains:
    """Return heading or pitch gains: scheduled with speed if that is on, smaller without gyro.

    A loop without actuator lead is slow enough for the rates of the observer.
    """
    if config.actuator_lead_radps and not estimate.rates_measured:
        gains = gains._replace(p=OBSERVED_RATES * gains.p, d=OBSERVED_RATES * gains.d)
    if not config.schedule_mps:
        return gains
    return schedule_gains(gains, estimate.speed_mps / config.schedule_mps)


@numeric
def schedule_gains(gains: Gains, speed_ratio: float) -> Gains:
    """Scale heading or pitch gains with speed.

    Parameters
    ----------
    gains : Gains
        Gains at the design speed.
    speed_ratio : float
        Speed over the design speed; limited to MIN_SPEED_RATIO .. MAX_SPEED_RATIO.

    Returns
    -------
    Gains
        Gains at that speed. With x the speed ratio::

            x <= 1    P         D / x      I x
            x >  1    P / x^2   D / x^2    I / x^2

    Notes
    -----
    Hydrodynamic forces grow with U for a rate and with U^2 for an angle, also for an angle of
    the duct (Fossen 2021, section 6.7). Below the design speed all motion of the vehicle slows
    in proportion; a loop that slows equally keeps its margins. Above it delay and lag of the
    tailcone do not shrink with the vehicle's time constants; the loop keeps its bandwidth.
    """
    x = min(MAX_SPEED_RATIO, max(MIN_SPEED_RATIO, speed_ratio))
    if x <= 1.0:
        return gains._replace(d=gains.d / x, i=gains.i * x)
    return gains._replace(p=gains.p / (x * x), d=gains.d / (x * x), i=gains.i / (x * x))


@numeric
def rotate_by_roll(rudder_rad: float, elevator_rad: float, roll_rad: float) -> tuple[float, float]:
    """Rotate commands about the vertical and the horizontal to the axes of a rolled hull (rad).

    With phi the roll angle, positive starboard down::

        rudder   <- rudder cos(phi) - elevator sin(phi)
        elevator <- rudder sin(phi) + elevator cos(phi)
    """
    c, s = math.cos(roll_rad), math.sin(roll_rad)
    return rudder_rad * c - elevator_rad * s, rudder_rad * s + elevator_rad * c


@numeric
def update_trim(
    memory: LoopMemory,
    output: ControlOutput,
    trims: tuple[float, float],
    estimate: VehicleEstimate,
    config: Config,
    dt_s: float,
) -> LoopMemory:
    """Move the trims towards the mean deflections in steady flight, and unload the integrators.

    With T = TRIM_AUTO_S: trim' = (command - trim) / T, and the integrators decay with T.
    """
    if not steady(estimate, output, config):
        return memory
    alpha, old = dt_s / config.trim_time_s, memory.trim
    rudder, elevator = (
        alpha * (output.rudder_rad - trims[0]),
        alpha * (output.elevator_rad - trims[1]),
    )
    # Each integrator gives back its own part only. The part of a standing error is added to the
    # command: taken from the integrator too, it would drive that to its other limit.
    return memory._replace(
        heading_integral_rad=memory.heading_integral_rad
        * (1.0 - alpha if memory.rudder_observer is None else 1.0),
        pitch_integral_rad=memory.pitch_integral_rad * (1.0 - alpha),
        trim=Trim(old.rudder_rad + rudder, old.elevator_rad + elevator, old.learned_s + dt_s),
    )


@numeric
def steady(estimate: VehicleEstimate, output: ControlOutput, config: Config) -> bool:
    """Return whether the surfaces hold the vehicle in equilibrium, so that their mean is the trim.

    A missing rudder trim b leaves a heading error of about b / HDG_P where the integrator is
    limited. That error must not keep the trim from being learned.
    """
    slow = abs(estimate.r_radps) < STEADY_RADPS and abs(estimate.q_radps) < STEADY_RADPS
    if not slow or abs(output.depth_error_m) >= STEADY_M:
        return False
    standing = (
        abs(estimate.r_radps) < STANDING_RADPS
        and estimate.speed_mps >= STANDING_SPEED_RATIO * config.cruise_speed_mps
        and abs(output.rudder_rad) < config.travel_rad
    )
    return standing or abs(output.heading_error_rad) < STEADY_RAD
