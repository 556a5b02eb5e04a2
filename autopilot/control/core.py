"""The tick: health, estimate, failsafe, guidance, loops or excitation, actuators. Pure: no clock,
no I/O, no chance."""

from autopilot.control import (
    actuator_test,
    ascent,
    estimator,
    excitation,
    failsafe,
    guidance,
    loops,
    mission,
    modes,
    offboard,
)
from autopilot.control.params import Config
from autopilot.control.sensor_health import monitor
from autopilot.control.setpoints import TrackLine
from autopilot.control.types import (
    US_PER_S,
    AutopilotState,
    Event,
    Home,
    Inputs,
    ItemReached,
    LoopMemory,
    Severity,
    Stick,
    Trace,
    VehicleEstimate,
)
from mavlink_io.records import (
    ARMED_FLAG,
    CUSTOM_MODE_FLAG,
    LOCKSTEP_FLAG,
    ActuatorFrame,
    GpsFix,
)

MAX_STEP_S = 0.2
"""A longer gap between sensor frames is not bridged: the estimate would only guess."""

_NEUTRAL = (0.0,) * 16
_UNUSED_CHANNELS = (0.0,) * 13

Events = tuple[Event | ItemReached, ...]


def initial_state() -> AutopilotState:
    """The state before the first tick."""
    return AutopilotState()


def tick(
    state: AutopilotState, inputs: Inputs, config: Config
) -> tuple[AutopilotState, ActuatorFrame, Trace, Events]:
    """One step of the autopilot at the vehicle time of the sensors."""
    dt_s = step_s(state, inputs)
    state, inputs, noticed = update_sensors(state, inputs, config, dt_s)
    if any(state.targets):
        state = state._replace(targets=offboard.drop_stale_targets(state.targets, inputs, config))
    state, alarms = failsafe.check_failsafes(state, inputs, config)
    state, guided = update_setpoints(state, inputs.stick, config, dt_s)
    state, trace = compute_actuators(state, inputs.stick, config, dt_s)
    return state, actuator_frame(state, trace, config), trace, (*noticed, *alarms, *guided)


def step_s(state: AutopilotState, inputs: Inputs) -> float:
    """Seconds since the last tick, zero at the first and never more than ``MAX_STEP_S``."""
    if state.time_us < 0:
        return 0.0
    return min(MAX_STEP_S, (inputs.sensors.time_us - state.time_us) / US_PER_S)


def update_sensors(
    state: AutopilotState, inputs: Inputs, config: Config, dt_s: float
) -> tuple[AutopilotState, Inputs, tuple[Event, ...]]:
    """Take in the instruments as far as they can be believed, which is also what is given back of
    the inputs."""
    heard, sound, inputs, noticed = monitor.check_sensors(state, inputs, config)
    home = update_home(state.home, inputs.gps)
    estimate = update_estimate(state, inputs, home, config, dt_s)
    time_us = inputs.sensors.time_us
    return (
        state._replace(time_us=time_us, ahrs=heard, health=sound, home=home, estimate=estimate),
        inputs,
        noticed,
    )


def update_home(home: Home, fix: GpsFix | None) -> Home:
    """The first satellite fix at the surface becomes home."""
    if home.known or fix is None or fix.fix_type < 3:
        return home
    return Home(fix.lat_deg, fix.lon_deg, True)


def update_estimate(
    state: AutopilotState, inputs: Inputs, home: Home, config: Config, dt_s: float
) -> VehicleEstimate:
    """The estimate after this tick's sensors; it begins once all that it needs has spoken."""
    if state.estimate.initialised:
        return estimator.update(state.estimate, inputs, state.thrust, home, config, dt_s)
    if inputs.sensors.fields_updated & estimator.REQUIRED_FIELDS == estimator.REQUIRED_FIELDS:
        return estimator.initial_estimate(inputs.sensors, config)
    return state.estimate


def update_setpoints(
    state: AutopilotState, stick: Stick | None, config: Config, dt_s: float
) -> tuple[AutopilotState, Events]:
    """Let the mode move the set-points, and the path the heading."""
    if not state.armed:
        return state, ()
    state, ended = end_test_if_due(state, config)
    state, events = _step_mode(state, stick, config, dt_s)
    return guidance.update_heading(state, config, dt_s), (*ended, *events)


def _step_mode(
    state: AutopilotState, stick: Stick | None, config: Config, dt_s: float
) -> tuple[AutopilotState, Events]:
    mode = state.mode
    if mode == modes.MISSION.number:
        return mission.step(state, config)
    if mode == modes.SURFACE.number:
        return ascent.step_surface(state, config)
    if mode == modes.RTL.number:
        return step_rtl(state, config)
    if mode == modes.OFFBOARD.number:
        return step_offboard(state, config, dt_s)
    if mode == modes.STABILIZE.number:
        return offboard.stabilize(state, stick, config, dt_s), ()
    if mode == modes.SYSID.number and state.test is None:
        return modes.enter(state, modes.DEPTH)
    return state, ()


def step_rtl(state: AutopilotState, config: Config) -> tuple[AutopilotState, Events]:
    """Near home, or abeam of it, surface."""
    path = state.path
    if isinstance(path, TrackLine) and not guidance.reached(
        path, state.estimate, config.rtl_radius_m
    ):
        return state, ()
    state, events = modes.enter(state, modes.SURFACE)
    return state, (Event(Severity.INFO, "RTL: home reached"), *events)


def step_offboard(
    state: AutopilotState, config: Config, dt_s: float
) -> tuple[AutopilotState, Events]:
    """Follow the set-points from outside while they stream; then hold."""
    if any(state.targets):
        return offboard.step(state, config, dt_s), ()
    state, events = modes.enter(state, modes.HOLD)
    lost = Event(
        Severity.WARNING, f"OFFBOARD lost: no set-point for {config.offboard_timeout_s:g} s -> HOLD"
    )
    return guidance.hold_current(state, config), (lost, *events)


def end_test_if_due(state: AutopilotState, config: Config) -> tuple[AutopilotState, Events]:
    """End a test that has run its time or left its envelope, and say why."""
    test = state.test
    if test is None:
        return state, ()
    if reason := failsafe.envelope_violation(test, state, config):
        return state._replace(test=None), (Event(Severity.WARNING, f"SystemID Stopped: {reason}"),)
    if (state.time_us - test.started_us) / US_PER_S >= test.duration_s:
        return state._replace(test=None), (Event(Severity.INFO, "SystemID Finished"),)
    return state, ()


def compute_actuators(
    state: AutopilotState, stick: Stick | None, config: Config, dt_s: float
) -> tuple[AutopilotState, Trace]:
    """Loops, excitation or the pilot's hand to deflections within the duct's travel."""
    if not state.armed:
        rudder, elevator, _ = actuator_test.positions(state)
        at_rest = monitor.predict_duct(
            state.duct_rad, rudder * config.travel_rad, elevator * config.travel_rad, dt_s
        )
        return state._replace(thrust=0.0, loops=LoopMemory(), duct_rad=at_rest), Trace()
    mode, test, travel = modes.by_number(state.mode) or modes.HOLD, state.test, config.travel_rad
    axis = excitation.AXES[test.axis] if test else excitation.NO_AXIS
    wanted, memory = loops.step_loops(
        state.estimate,
        state.setpoint,
        state.loops,
        config,
        dt_s,
        heading=mode.closes_heading and not axis.opens_heading,
        depth=mode.closes_depth and not axis.opens_depth,
    )
    rudder, elevator, heading_error, pitch_error, depth_error, pitch_setpoint = wanted
    thrust, deflection, frequency = state.setpoint.thrust, 0.0, 0.0
    if test is not None:
        played = excitation.sample(test, (state.time_us - test.started_us) / US_PER_S)
        rudder, elevator, thrust = (
            rudder + played.rudder_rad,
            elevator + played.elevator_rad,
            thrust + played.thrust,
        )
        deflection, frequency = (
            played.rudder_rad if axis.rudder else played.elevator_rad,
            played.frequency_hz,
        )
    if mode is modes.MANUAL:
        hand = stick or Stick(0.0, 0.0, 0.0)
        rudder, elevator, thrust = hand.rudder * travel, hand.elevator * travel, hand.thrust
    rudder, elevator, thrust = limit(rudder, elevator, thrust, config)
    trace = Trace(
        heading_error,
        pitch_error,
        depth_error,
        pitch_setpoint,
        deflection,
        frequency,
        rudder,
        elevator,
        thrust,
    )
    follows = monitor.predict_duct(state.duct_rad, rudder, elevator, dt_s)
    return state._replace(loops=memory, thrust=thrust, duct_rad=follows), trace


def limit(
    rudder_rad: float, elevator_rad: float, thrust: float, config: Config
) -> tuple[float, float, float]:
    """Deflections within the duct's travel, thrust within full ahead and full astern."""
    travel = config.travel_rad
    return (
        min(travel, max(-travel, rudder_rad)),
        min(travel, max(-travel, elevator_rad)),
        min(1.0, max(-1.0, thrust)),
    )


def actuator_frame(state: AutopilotState, trace: Trace, config: Config) -> ActuatorFrame:
    """The frame that answers this tick's sensors; while disarmed all zero but for what is tested on
    the bench."""
    mode = CUSTOM_MODE_FLAG | (ARMED_FLAG if state.armed else 0)
    if not state.armed:
        resting = (
            (*actuator_test.positions(state), *_UNUSED_CHANNELS)
            if state.actuator_tests
            else _NEUTRAL
        )
        return ActuatorFrame(state.time_us, LOCKSTEP_FLAG, resting, mode)
    travel = config.travel_rad
    controls = (
        trace.rudder_rad / travel,
        trace.elevator_rad / travel,
        trace.thrust,
        *_UNUSED_CHANNELS,
    )
    return ActuatorFrame(state.time_us, LOCKSTEP_FLAG, controls, mode)
