"""The tick: sensor checks, estimate, failsafes, mode, guidance, loops or test signal, actuators.

Pure: no clock, no I/O, no randomness.
"""

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
    rest,
)
from autopilot.control.excitation import ExcitationOutput
from autopilot.control.loops import ControlOutput
from autopilot.control.params import Config
from autopilot.control.sensor_health import monitor
from autopilot.control.setpoints import TrackLine
from autopilot.control.types import (
    US_PER_S,
    AutopilotState,
    Event,
    Events,
    Home,
    Inputs,
    LoopMemory,
    Severity,
    Stick,
    Trace,
    VehicleEstimate,
)
from mavlink_io.jit import numeric
from mavlink_io.records import (
    ARMED_FLAG,
    CUSTOM_MODE_FLAG,
    LOCKSTEP_FLAG,
    ActuatorFrame,
    GpsFix,
)

MAX_STEP_S = 0.2
"""Maximum time step of the tick: a longer gap between sensor frames is not integrated."""

_NEUTRAL = (0.0,) * 16
_UNUSED_CHANNELS = (0.0,) * 12
ARMED_MODE = CUSTOM_MODE_FLAG | ARMED_FLAG
"""HIL_ACTUATOR_CONTROLS.mode of an armed vehicle."""


def initial_state() -> AutopilotState:
    """Return the state before the first tick."""
    return AutopilotState()


def tick(
    state: AutopilotState, inputs: Inputs, config: Config
) -> tuple[AutopilotState, ActuatorFrame, Trace, Events]:
    """Advance the autopilot by one tick, to the vehicle time of the sensor frame.

    Parameters
    ----------
    state : AutopilotState
        State after the last tick.
    inputs : Inputs
        Sensors and link ages of this tick.
    config : Config
        Parameters.

    Returns
    -------
    tuple[AutopilotState, ActuatorFrame, Trace, Events]
        New state; actuator frame that answers the sensor frame; signals of the loops; events to
        send.
    """
    dt_s = step_s(state, inputs)
    state, inputs, sensor_events = update_sensors(state, inputs, config, dt_s)
    if any(state.targets):
        state = state._replace(targets=offboard.drop_stale_targets(state.targets, inputs, config))
    state, failsafe_events = failsafe.check_failsafes(state, inputs, config)
    state, mode_events = update_setpoints(state, inputs.stick, config, dt_s)
    state, trace = compute_actuators(state, inputs.stick, config, dt_s)
    events = (*sensor_events, *failsafe_events, *mode_events)
    return state, actuator_frame(state, trace, config), trace, events


def step_s(state: AutopilotState, inputs: Inputs) -> float:
    """Return the time (s) since the last tick; 0 at the first, at most ``MAX_STEP_S``."""
    return 0.0 if state.time_us < 0 else span_s(state.time_us, inputs.sensors.time_us)


@numeric
def span_s(before_us: int, now_us: int) -> float:
    """Return the time step (s) from the last tick to this one, at most ``MAX_STEP_S``."""
    return min(MAX_STEP_S, (now_us - before_us) / US_PER_S)


def update_sensors(
    state: AutopilotState, inputs: Inputs, config: Config, dt_s: float
) -> tuple[AutopilotState, Inputs, tuple[Event, ...]]:
    """Check the sensors and update home and the estimate.

    Returns the new state, the inputs without readings that must not be used, and events.
    """
    ahrs, health, inputs, events = monitor.check_sensors(state, inputs, config)
    home = update_home(state.home, inputs.gps)
    estimate = update_estimate(state, inputs, home, config, dt_s)
    time_us = inputs.sensors.time_us
    return (
        state._replace(time_us=time_us, ahrs=ahrs, health=health, home=home, estimate=estimate),
        inputs,
        events,
    )


def update_home(home: Home, fix: GpsFix | None) -> Home:
    """Return home; the first satellite fix sets it if it is unknown."""
    if home.known or fix is None or fix.fix_type < 3:
        return home
    return Home(fix.lat_deg, fix.lon_deg, known=True)


def update_estimate(
    state: AutopilotState, inputs: Inputs, home: Home, config: Config, dt_s: float
) -> VehicleEstimate:
    """Return the estimate of this tick; it starts when all required sensors are fresh."""
    if state.estimate.initialised:
        return estimator.update(state.estimate, inputs, state.thrust, home, config, dt_s)
    if inputs.sensors.fields_updated & estimator.REQUIRED_FIELDS == estimator.REQUIRED_FIELDS:
        return estimator.initial_estimate(inputs.sensors, config)
    return state.estimate


def update_setpoints(
    state: AutopilotState, stick: Stick | None, config: Config, dt_s: float
) -> tuple[AutopilotState, Events]:
    """Update the set-points by mode and path, and end a test that is due."""
    if not state.armed:
        return rest.step(state, config)
    state, test_events = end_test_if_due(state, config)
    state, events = _step_mode(state, stick, config, dt_s)
    return guidance.update_heading(state, config, dt_s), (*test_events, *events)


def _step_mode(
    state: AutopilotState, stick: Stick | None, config: Config, dt_s: float
) -> tuple[AutopilotState, Events]:
    """Update the set-points by the current mode."""
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
    """Change to SURFACE within RTL_RADIUS_M of home or after passing it."""
    path = state.path
    if isinstance(path, TrackLine) and not guidance.reached(
        path, state.estimate, config.rtl_radius_m
    ):
        return state, ()
    state, events = modes.enter(state, modes.SURFACE)
    return state, (
        Event(
            Severity.INFO,
            "RTL: return point reached" if state.rally.places else "RTL: home reached",
        ),
        *events,
    )


def step_offboard(
    state: AutopilotState, config: Config, dt_s: float
) -> tuple[AutopilotState, Events]:
    """Apply the set-point streams; change to HOLD when none is left."""
    if any(state.targets):
        return offboard.step(state, config, dt_s), ()
    state, events = modes.enter(state, modes.HOLD)
    timeout = Event(
        Severity.WARNING, f"OFFBOARD lost: no set-point for {config.offboard_timeout_s:g} s -> HOLD"
    )
    return guidance.hold_current(state, config), (timeout, *events)


def end_test_if_due(state: AutopilotState, config: Config) -> tuple[AutopilotState, Events]:
    """End a test after its duration or outside its safety envelope, and report the reason."""
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
    """Compute the commands from loops, test signal or stick, limited to the duct's travel.

    While disarmed the commands are those of actuator tests, or raise a vehicle that sinks; if not,
    the loops are reset.
    """
    if not state.armed:
        return _compute_disarmed(state, config, dt_s)
    mode, test, travel = modes.by_number(state.mode) or modes.HOLD, state.test, config.travel_rad
    axis = excitation.AXES[test.axis] if test else excitation.NO_AXIS
    output, memory = loops.step_loops(
        state.estimate,
        state.setpoint,
        state.loops,
        config,
        dt_s,
        heading=mode.closes_heading and not axis.opens_heading,
        depth=mode.closes_depth and not axis.opens_depth and not ascent.rests(state, config),
    )
    thrust, signal = state.setpoint.thrust, excitation.NO_SIGNAL
    if test is not None:
        signal = excitation.sample(test, (state.time_us - test.started_us) / US_PER_S)
    if mode is modes.MANUAL:
        manual = stick or Stick(0.0, 0.0, 0.0)
        rudder, elevator, thrust = manual.rudder * travel, manual.elevator * travel, manual.thrust
        output = output._replace(rudder_rad=rudder, elevator_rad=elevator)
    trace = commands(output, thrust, signal, test is not None, axis.rudder, config)
    duct_rad = monitor.predict_duct(state.duct_rad, trace.rudder_rad, trace.elevator_rad, dt_s)
    return state._replace(loops=memory, thrust=trace.thrust, duct_rad=duct_rad), trace


def _compute_disarmed(
    state: AutopilotState, config: Config, dt_s: float
) -> tuple[AutopilotState, Trace]:
    """Compute the commands of a disarmed vehicle."""
    trace, memory = Trace(), LoopMemory()
    rudder_rad, elevator_rad = (
        position * config.travel_rad for position in actuator_test.positions(state)[:2]
    )
    if rest.raises(state):
        output, memory = rest.command(state, config, dt_s)
        trace = commands(output, 0.0, excitation.NO_SIGNAL, False, False, config)
        rudder_rad, elevator_rad = trace.rudder_rad, trace.elevator_rad
    duct_rad = monitor.predict_duct(state.duct_rad, rudder_rad, elevator_rad, dt_s)
    return state._replace(thrust=0.0, loops=memory, duct_rad=duct_rad), trace


@numeric
def commands(
    output: ControlOutput,
    thrust: float,
    signal: ExcitationOutput,
    testing: bool,
    rudder_tested: bool,
    config: Config,
) -> Trace:
    """Return the commands of a tick: the loops' plus the test signal, limited, with their trace.

    Parameters
    ----------
    output : ControlOutput
        Commands of the loops.
    thrust : float
        Thrust set-point (fraction of full).
    signal : ExcitationOutput
        Test signal; used only if ``testing``.
    testing : bool
        Whether a test is in progress.
    rudder_tested : bool
        Whether the test excites the rudder, so that its signal is the one in the trace.
    config : Config
        Parameters.
    """
    rudder, elevator, test_rad, frequency_hz = output.rudder_rad, output.elevator_rad, 0.0, 0.0
    if testing:
        rudder, elevator = rudder + signal.rudder_rad, elevator + signal.elevator_rad
        thrust += signal.thrust
        test_rad = signal.rudder_rad if rudder_tested else signal.elevator_rad
        frequency_hz = signal.frequency_hz
    rudder, elevator, thrust = limit(rudder, elevator, thrust, config)
    return Trace(
        output.heading_error_rad,
        output.pitch_error_rad,
        output.depth_error_m,
        output.pitch_setpoint_rad,
        test_rad,
        frequency_hz,
        rudder,
        elevator,
        thrust,
    )


@numeric
def limit(
    rudder_rad: float, elevator_rad: float, thrust: float, config: Config
) -> tuple[float, float, float]:
    """Limit deflections (rad) to the duct's travel and thrust to [-1, 1]."""
    travel = config.travel_rad
    return (
        _clip(rudder_rad, travel),
        _clip(elevator_rad, travel),
        _clip(thrust, 1.0),
    )


@numeric
def _clip(value: float, limit: float) -> float:
    """Limit a value to +-limit; NaN becomes 0: neutral, not full deflection."""
    return min(limit, max(-limit, value)) if value == value else 0.0


def actuator_frame(state: AutopilotState, trace: Trace, config: Config) -> ActuatorFrame:
    """Return the actuator frame of this tick.

    While disarmed all is zero except for actuator tests, and for the fins of a vehicle that sinks.

    Parameters
    ----------
    state : AutopilotState
        State after the tick.
    trace : Trace
        Signals of the tick.
    config : Config
        Parameters.

    Returns
    -------
    ActuatorFrame
        The frame.
    """
    weight = 1.0 if state.weight_released else 0.0
    if state.armed:
        return armed_frame(state.time_us, trace, config, weight)
    if rest.raises(state):
        raising = armed_frame(state.time_us, trace, config, weight)
        return raising._replace(mode=CUSTOM_MODE_FLAG)
    resting: tuple[float, ...] = _NEUTRAL
    if state.actuator_tests or state.weight_released:
        resting = (*actuator_test.positions(state), weight, *_UNUSED_CHANNELS)
    return ActuatorFrame(state.time_us, LOCKSTEP_FLAG, resting, CUSTOM_MODE_FLAG)


@numeric
def armed_frame(time_us: int, trace: Trace, config: Config, weight: float = 0.0) -> ActuatorFrame:
    """Return the actuator frame of a tick of an armed vehicle.

    Parameters
    ----------
    time_us : int
        Vehicle time of the tick.
    trace : Trace
        Signals of the tick.
    config : Config
        Parameters.
    weight : float
        1 releases the drop weight.

    Returns
    -------
    ActuatorFrame
        The frame.
    """
    travel = config.travel_rad
    controls = (
        trace.rudder_rad / travel,
        trace.elevator_rad / travel,
        trace.thrust,
        weight,
        *_UNUSED_CHANNELS,
    )
    return ActuatorFrame(time_us, LOCKSTEP_FLAG, controls, ARMED_MODE)
