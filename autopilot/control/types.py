"""Records of the tick: inputs, state, trace and events.

Body axes FRD, world NED, depth positive down, SI units and radians.
"""

import math
from enum import IntEnum
from typing import NamedTuple

from autopilot.control.fence import Fence, Rally
from autopilot.control.lqg import ObserverState
from autopilot.control.reference_model import NO_REFERENCE, ReferenceState
from autopilot.control.sensor_health.types import Ahrs, Health
from autopilot.control.setpoints import Path, Setpoint, Targets
from mavlink_io.frames import Quaternion
from mavlink_io.mission_items import MissionItem
from mavlink_io.records import (
    Altimeter,
    Battery,
    DuctFeedback,
    Dvl,
    GpsFix,
    Leak,
    SensorFrame,
)


class Severity(IntEnum):
    """MAV_SEVERITY."""

    EMERGENCY = 0
    ALERT = 1
    CRITICAL = 2
    ERROR = 3
    WARNING = 4
    NOTICE = 5
    INFO = 6
    DEBUG = 7


class Event(NamedTuple):
    """A message to the operator, sent as STATUSTEXT."""

    severity: Severity
    text: str


class ItemReached(NamedTuple):
    """A mission item was completed; sent as MISSION_ITEM_REACHED."""

    sequence: int


Events = tuple[Event | ItemReached, ...]
"""What a tick or a request reports, in order."""


class Inputs(NamedTuple):
    """Inputs of one tick.

    A sensor record is the newest one, None if none has come since the last tick.
    """

    sensors: SensorFrame
    gps: GpsFix | None
    altimeter: Altimeter | None
    ground_silent_s: float | None
    """Wall time since the last message of a ground station; None before the first."""
    stick: "Stick | None" = None
    """Manual control; None without a pilot."""
    dvl: Dvl | None = None
    battery: Battery | None = None
    leak: Leak | None = None
    duct: DuctFeedback | None = None
    attitude_silent_s: float | None = None
    """Wall time since the last attitude target; None before the first."""
    motion_silent_s: float | None = None
    """Wall time since the last motion target; None before the first."""


class Stick(NamedTuple):
    """Manual control, each axis in [-1, 1] with the signs of the actuator channels."""

    rudder: float
    elevator: float
    thrust: float


class NavCovariance(NamedTuple):
    """Covariance of the navigation states.

    The states are position (m), current (m/s), and the errors of the speed through the water and
    of the Doppler log (fractions). Each is a circular complex variable, north + i east: its
    variance is that along either axis, and the same holds for the covariances E[a conj(b)].
    """

    position: float = 0.0
    current: float = 0.0
    speed: float = 0.0
    dvl: float = 0.0
    position_current: complex = 0j
    position_speed: complex = 0j
    position_dvl: complex = 0j
    current_speed: complex = 0j
    current_dvl: complex = 0j
    speed_dvl: complex = 0j


class Navigation(NamedTuple):
    """State of dead reckoning. Horizontal vectors are complex numbers, north + i east."""

    current_mps: complex = 0j
    """Velocity of the water over ground."""
    speed_error: complex = 0j
    """Relative error of the speed through the water that follows from the thrust.

    The real part is a fraction of the speed, the imaginary part an angle (rad), to starboard
    positive.
    """
    dvl_error: complex = 0j
    """Relative error of the Doppler log (DVL) rotated by the heading; parts as in
    ``speed_error``."""
    slip: complex = 0j
    """Transient part of the relative speed error, from the Doppler log: sideslip and speed loss in
    a turn."""
    slip_sd_mps: float = 0.0
    """Standard deviation of the transient speed error; decays after a turn or a speed change."""
    covariance: NavCovariance = NavCovariance()
    span_s: float = 0.0
    """Time since the last update of the covariance."""
    distance_m: complex = 0j
    """Distance made through the water since the last update of the covariance."""
    fix_us: int = -1
    """Time of the last satellite fix that was used; -1 before the first."""
    ping_us: int = -1
    """Time of the last Doppler log velocity that was used; -1 before the first."""
    over_ground: bool = False
    """Whether the last Doppler log velocity was bottom track."""
    fixes_rejected: int = 0
    """Number of consecutive satellite fixes rejected."""
    pings_rejected: int = 0
    """Number of consecutive Doppler log velocities rejected."""


class VehicleEstimate(NamedTuple):
    """Estimated position, attitude and motion of the vehicle."""

    attitude: Quaternion = (1.0, 0.0, 0.0, 0.0)
    """Body to NED, scalar first."""
    roll_rad: float = 0.0
    pitch_rad: float = 0.0
    heading_rad: float = 0.0
    """Clockwise from true north, in [-pi, pi)."""
    p_radps: float = 0.0
    q_radps: float = 0.0
    r_radps: float = 0.0
    """Yaw rate. The body rates p, q, r are corrected for the estimated gyro bias."""
    gyro_bias_radps: tuple[float, float, float] = (0.0, 0.0, 0.0)
    depth_m: float = 0.0
    depth_rate_mps: float = 0.0
    accel_bias_mps2: float = 0.0
    """Bias of the downward acceleration."""
    speed_mps: float = 0.0
    """Forward speed through the water, from the thrust."""
    north_m: float = 0.0
    east_m: float = 0.0
    """Position from home; from the start point while home is unknown. By
    ``autopilot.control.navigation``."""
    north_rate_mps: float = 0.0
    east_rate_mps: float = 0.0
    """Velocity over ground."""
    position_sd_m: float = 0.0
    """Standard deviation of the horizontal position along each axis."""
    altitude_m: float = math.nan
    """Altitude above the sea floor; NaN without a valid range."""
    altitude_time_us: int = 0
    """Time of the last valid range."""
    initialised: bool = False
    depth_time_us: int = 0
    """Time of the last depth measurement."""
    navigation: Navigation = Navigation()
    attitude_error_rad: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Rotation (body axes) from the estimated attitude to that of accelerometer and magnetometer in
    the last tick; NaN if gyro, accelerometer or magnetometer are not used."""
    rates_measured: bool = True
    """Whether the body rates are those of the gyro, not of the observer that replaces it."""


class Motion(NamedTuple):
    """Numbers of ``VehicleEstimate`` that telemetry reports several times a second."""

    roll_rad: float
    pitch_rad: float
    heading_rad: float
    p_radps: float
    q_radps: float
    r_radps: float
    north_m: float
    east_m: float
    depth_m: float
    north_rate_mps: float
    east_rate_mps: float
    depth_rate_mps: float
    attitude_w: float
    attitude_x: float
    attitude_y: float
    attitude_z: float
    """Quaternion from body to NED."""
    speed_mps: float
    altitude_m: float
    position_sd_m: float
    velocity_sd_mps: float
    """Standard deviation of the velocity over ground along each axis."""


class Trim(NamedTuple):
    """Trims learned in flight, added to the trim parameters."""

    rudder_rad: float = 0.0
    elevator_rad: float = 0.0
    learned_s: float = 0.0
    """Duration of the steady flight from which the trims were learned."""


class LoopMemory(NamedTuple):
    """State of the control loops.

    Integrators have the unit of their loop's output, so that new gains cause no jump.
    """

    heading_integral_rad: float = 0.0
    """Integrator of the heading loop, as rudder angle."""
    pitch_integral_rad: float = 0.0
    """Integrator of the pitch loop, as elevator angle."""
    depth_integral_rad: float = 0.0
    """Integrator of the depth loop, as nose-down pitch."""
    heading_reference: ReferenceState = NO_REFERENCE
    depth_reference: ReferenceState = NO_REFERENCE
    """States of the reference models; NO_REFERENCE if the model is off or the loop was open."""
    rudder_lead: ReferenceState = NO_REFERENCE
    elevator_lead: ReferenceState = NO_REFERENCE
    """States of the actuator leads; NO_REFERENCE if the lead is off or the loop was open."""
    rudder_peak: ReferenceState = NO_REFERENCE
    elevator_peak: ReferenceState = NO_REFERENCE
    """States of the peak filters; NO_REFERENCE if the filter is off or the loop was open."""
    trim: Trim = Trim()
    rudder_observer: ObserverState | None = None
    """State of the heading LQG controller; None with PID or if the loop was open."""
    elevator_observer: ObserverState | None = None
    """State of the depth LQG controller; None with PID or if the loop was open."""
    rudder_full_s: float = 0.0
    elevator_full_s: float = 0.0
    """Time above the limit of a command that is not confirmed; see ``deflection_limit``."""
    reached_heading_rad: float = math.nan
    reached_depth_m: float = math.nan
    """Last set-points that the vehicle has reached; NaN for none, or if the loop was open."""


class Excitation(NamedTuple):
    """A test signal in progress, with the references of its safety envelope."""

    axis: int
    rudder_rad: float
    elevator_rad: float
    thrust: float
    """Amplitude as a fraction of full thrust. Amplitudes of axes not tested are zero."""
    start_hz: float
    stop_hz: float
    """Upper limit of the band of a chirp or a multisine; clock rate of a PRBS."""
    duration_s: float
    wave: int
    fade_s: float
    started_us: int
    heading_rad: float
    """Heading set-point at the start, from which the heading change is limited."""
    depth_m: float
    """Depth set-point at the start."""
    seed: int = 0
    """Seed of a PRBS."""
    switch_intervals: tuple[int, ...] = ()
    """Relative lengths of the intervals between sign changes of a square wave."""


class MissionState(NamedTuple):
    """Mission items and progress."""

    items: tuple[MissionItem, ...] = ()
    current: int = 0
    """Index of the item in progress; ``len(items)`` after the last."""
    entered_us: int | None = None
    """Time at which the current item was started; None before that."""
    jumps: tuple[tuple[int, int], ...] = ()
    """Pairs (sequence, number of times taken) of the DO_JUMP items, sorted."""
    reached: int = -1
    """Sequence of the last item that was completed; -1 before the first. Of a SURFACE or RTL from
    the change of the mode on."""
    paused_setpoint: Setpoint | None = None
    """Set-points to restore when the mission resumes; None if it was not interrupted."""
    previous_waypoint_m: complex | None = None
    """Last waypoint that was reached, north + i east from home."""


class Home(NamedTuple):
    """Point of the surface where north, east and depth are zero."""

    lat_deg: float = 0.0
    lon_deg: float = 0.0
    known: bool = False


class ActuatorTest(NamedTuple):
    """Test of one actuator of a disarmed vehicle."""

    channel: int
    """0 rudder, 1 elevator, 2 thrust."""
    value: float
    """Command in [-1, 1]."""
    until_us: int
    """Time at which the test ends."""


class AscentStage(IntEnum):
    """Stages of mode SURFACE, in the order in which they are tried."""

    POWERED = 0
    """Under power to depth 0."""
    ASTERN = 1
    """Propeller astern: the nose is down and the vehicle sinks."""
    STOPPED = 2
    """Propeller off: buoyancy raises the vehicle."""
    RELEASED = 3
    """Propeller off and drop weight released."""


class Ascent(NamedTuple):
    """Progress of mode SURFACE."""

    depth_m: float
    """Depth at the last rise; before the first: where SURFACE or its present stage began."""
    risen_us: int
    """Time of the last rise; before the first: when SURFACE or its present stage began."""
    fix_us: int | None = None
    """Time of the first of the satellite fixes that have come without a gap; None without a
    fix."""
    stage: AscentStage = AscentStage.POWERED
    began_us: int = 0
    """Time at which the stage began; 0 for the first stage."""
    afloat_us: int | None = None
    """Time since which the depth is that of the surface; None below it."""
    attempts: int = 0
    """Number of times that power was stopped."""
    braked_us: int | None = None
    """Time of the first braking since the vehicle came to the surface; None before it."""


class Rest(NamedTuple):
    """Vehicle that SURFACE has disarmed."""

    raises: bool = False
    """Whether the elevator raises the vehicle, which sinks."""
    reported: bool = False
    """Whether this was reported."""


class AutopilotState(NamedTuple):
    """Complete state of the autopilot between two ticks."""

    time_us: int = -1
    """Vehicle time of the last tick; -1 before the first."""
    mode: int = 50_593_792
    """``custom_mode`` of the table in modes.py; HOLD at the start."""
    armed: bool = False
    estimate: VehicleEstimate = VehicleEstimate()
    setpoint: Setpoint = Setpoint()
    loops: LoopMemory = LoopMemory()
    mission: MissionState = MissionState()
    path: Path | None = None
    """Path over ground that the heading follows; None without path following."""
    targets: Targets = Targets()
    test: Excitation | None = None
    failsafe: str = ""
    """Cause of the failsafe in force; empty without a failsafe."""
    failsafe_us: int = 0
    """Time at which a failsafe other than the geofence last began."""
    home: Home = Home()
    armed_us: int = 0
    """Time of the last arming."""
    thrust: float = 0.0
    """Last commanded thrust as a fraction of full."""
    duct_rad: tuple[float, float] = (0.0, 0.0)
    """Rudder and elevator angle that the commands predict."""
    ahrs: Ahrs = Ahrs()
    health: Health = Health()
    actuator_tests: tuple[ActuatorTest, ...] = ()
    """Actuator tests in progress; only while disarmed."""
    ascent: Ascent | None = None
    """Progress of mode SURFACE; None in other modes and before its first tick."""
    rest: Rest | None = None
    """Watch over a vehicle that SURFACE has disarmed; None if something else did."""
    weight_released: bool = False
    """Whether the drop weight was released; stays so until the autopilot restarts."""
    fence: Fence = Fence()
    """Geofence."""
    rally: Rally = Rally()
    """Rally points: where RTL ends."""
    fence_us: int = 0
    """Time of the next check of the geofence."""
    fence_breaches: int = 0
    """Number of reported breaches of the geofence since the start of the autopilot."""
    fence_breach_us: int = 0
    """Time of the last one."""
    charge: float = 1.0
    """Remaining fraction of the battery at the last request; 1 if it is not known."""


class Trace(NamedTuple):
    """Signals of the loops in one tick, for telemetry and tests."""

    heading_error_rad: float = 0.0
    pitch_error_rad: float = 0.0
    depth_error_m: float = 0.0
    """Set-point minus estimate, as the errors of heading and pitch."""
    pitch_setpoint_rad: float = 0.0
    excitation_rad: float = 0.0
    """Test signal on rudder or elevator; on the rudder if both are tested."""
    excitation_hz: float = 0.0
    """Momentary frequency of a chirp, else 0."""
    rudder_rad: float = 0.0
    elevator_rad: float = 0.0
    thrust: float = 0.0
    """Command as a fraction of full. Rudder, elevator and thrust are after limits."""


class Answer(NamedTuple):
    """Result of a request."""

    result: int
    """MAV_RESULT."""
    text: str = ""
    """Reason of a rejection."""
    parameter: int = 0
    """Number (1 to 7) of the mission item parameter that is wrong; 0 for none in particular."""


US_PER_S = 1_000_000
"""Microseconds per second; vehicle time is an integer number of microseconds."""
PRESSURE_HELD = 1 << 30
"""Bit of ``fields_updated`` in a checked sensor frame, beside PRESSURE_FRESH: the pressure is the
last reading, of an earlier tick."""

ACCEPTED, TEMPORARILY_REJECTED, DENIED, UNSUPPORTED, FAILED, IN_PROGRESS, CANCELLED = range(7)
"""MAV_RESULT."""
