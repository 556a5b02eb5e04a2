"""What goes into a tick and what comes out. Body axes FRD, world NED, depth positive down, SI and
radians."""

from enum import IntEnum
from typing import NamedTuple

from autopilot.control.lqg import ObserverState
from autopilot.control.reference_model import ReferenceState
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
    """Something a person should read: goes out as STATUSTEXT."""

    severity: Severity
    text: str


class ItemReached(NamedTuple):
    """A mission item was completed: goes out as MISSION_ITEM_REACHED."""

    sequence: int


class Inputs(NamedTuple):
    """What one tick may know of the world."""

    sensors: SensorFrame
    gps: GpsFix | None
    """The newest fix, None when none came since the last tick."""
    altimeter: Altimeter | None
    """The newest range, None when none came since the last tick."""
    ground_silent_s: float | None
    """Wall seconds since a ground station was last heard; None before the first."""
    stick: "Stick | None" = None
    """MANUAL_CONTROL, when a pilot steers."""
    dvl: Dvl | None = None
    battery: Battery | None = None
    leak: Leak | None = None
    duct: DuctFeedback | None = None
    """Each the newest, None when none came since the last tick."""
    attitude_silent_s: float | None = None
    motion_silent_s: float | None = None
    """Wall seconds since an attitude target and a motion target were last heard; None before the
    first."""


class Stick(NamedTuple):
    """A pilot's hand: each in [-1, 1], as the actuator channels."""

    rudder: float
    elevator: float
    thrust: float


class NavCovariance(NamedTuple):
    """Of position (m), current (m/s), and the errors of the speed through the water and of the
    Doppler log (fractions).

    Each is a circular complex variable, north + i east: its variance is that along either axis, and
    so are covariances."""

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
    """What dead reckoning has learned, all horizontal vectors as north + i east."""

    current_mps: complex = 0j
    """Of the water, towards."""
    speed_error: complex = 0j
    """Of the speed through the water by the thrust, as a fraction; the imaginary part is an angle
    to starboard."""
    dvl_error: complex = 0j
    """Of the Doppler log turned by the heading, likewise."""
    slip: complex = 0j
    """What the Doppler log adds to the water's error for the moment: a turn's sideslip and lost
    speed."""
    slip_sd_mps: float = 0.0
    """What may be added so; it fades after a turn or a change of speed."""
    covariance: NavCovariance = NavCovariance()
    span_s: float = 0.0
    distance_m: complex = 0j
    """Time and way through the water since the covariance was brought up to date."""
    fix_us: int = -1
    """When a satellite fix was last used; -1 for never."""
    ping_us: int = -1
    over_ground: bool = False
    """Of the last ping: whether it tracked the bottom."""
    fixes_rejected: int = 0
    pings_rejected: int = 0
    """In a row."""


class VehicleEstimate(NamedTuple):
    """Where the vehicle is and how it moves, as far as its sensors tell."""

    attitude: Quaternion = (1.0, 0.0, 0.0, 0.0)
    """Body to NED, scalar first."""
    roll_rad: float = 0.0
    pitch_rad: float = 0.0
    heading_rad: float = 0.0
    """Clockwise from true north, in [-pi, pi)."""
    p_radps: float = 0.0
    q_radps: float = 0.0
    r_radps: float = 0.0
    """Body rates with the estimated gyro bias taken off."""
    gyro_bias_radps: tuple[float, float, float] = (0.0, 0.0, 0.0)
    depth_m: float = 0.0
    depth_rate_mps: float = 0.0
    accel_bias_mps2: float = 0.0
    """Of the vertical channel."""
    speed_mps: float = 0.0
    """Forward, through the water, by the thrust."""
    north_m: float = 0.0
    east_m: float = 0.0
    """From home, by ``autopilot.control.navigation``; from where she was switched on before home is
    known."""
    north_rate_mps: float = 0.0
    east_rate_mps: float = 0.0
    """Over ground."""
    position_sd_m: float = 0.0
    """One standard deviation of the horizontal position, along each axis."""
    altitude_m: float | None = None
    """Above the sea floor; None where the altimeter sees none."""
    altitude_time_us: int = 0
    initialised: bool = False
    depth_time_us: int = 0
    """When the depth was last measured and not only carried along."""
    navigation: Navigation = Navigation()


class Trim(NamedTuple):
    """What was learned under way, on top of the trims among the parameters."""

    rudder_rad: float = 0.0
    elevator_rad: float = 0.0
    learned_s: float = 0.0
    """For how long, in steady flight."""


class LoopMemory(NamedTuple):
    """The integrators, in the unit of their loop's output, so that new gains cause no bump; and
    what is under way."""

    heading_integral_rad: float = 0.0
    pitch_integral_rad: float = 0.0
    depth_integral_rad: float = 0.0
    heading_reference: ReferenceState | None = None
    """Of the heading towards its set-point; None where there is no reference model, or the loop was
    open."""
    depth_reference: ReferenceState | None = None
    """Of the depth, likewise."""
    rudder_lead: ReferenceState | None = None
    elevator_lead: ReferenceState | None = None
    """Of the duct; None where its lag is not undone, or the loop was open."""
    trim: Trim = Trim()
    rudder_observer: ObserverState | None = None
    elevator_observer: ObserverState | None = None
    """Of the laws; None where the PIDs fly, or the loop was open."""


class Excitation(NamedTuple):
    """An excitation: what is played, since when, and from where the envelope is counted."""

    axis: int
    rudder_rad: float
    elevator_rad: float
    thrust: float
    """Sizes: of thrust a fraction of full; zero where the axis leaves it alone."""
    start_hz: float
    stop_hz: float
    """Band of a chirp or a multisine; the clock of a pseudo-random sequence."""
    duration_s: float
    wave: int
    fade_s: float
    started_us: int
    heading_rad: float
    """Held by the loop that stays closed, and the reference of the heading envelope."""
    depth_m: float
    seed: int = 0
    """Of a pseudo-random sequence."""
    switch_intervals: tuple[int, ...] = ()
    """Of a square wave: parts of its length for which it is up and down by turns."""


class MissionState(NamedTuple):
    """The uploaded items and how far the vehicle has come."""

    items: tuple[MissionItem, ...] = ()
    current: int = 0
    """The item being done; ``len(items)`` when all are."""
    entered_us: int | None = None
    """When the current item was begun; None before that."""
    jumps: tuple[tuple[int, int], ...] = ()
    """How often each DO_JUMP (by sequence) was taken."""
    reached: int = -1
    paused_setpoint: Setpoint | None = None
    """The set-points in force when another mode took over, for the way back."""
    previous_waypoint_m: complex | None = None
    """The last waypoint that was reached: north + i east from home."""


class Home(NamedTuple):
    """The point of the surface where north, east and depth are zero."""

    lat_deg: float = 0.0
    lon_deg: float = 0.0
    known: bool = False


class ActuatorTest(NamedTuple):
    """One actuator of a disarmed vehicle that is moved for a moment."""

    channel: int
    """0 rudder, 1 elevator, 2 thrust."""
    value: float
    until_us: int


class Ascent(NamedTuple):
    """Progress of mode SURFACE."""

    depth_m: float
    """Depth at the last rise; before the first: where SURFACE began or the propeller stopped."""
    risen_us: int
    """Time of the last rise, likewise."""
    fix_us: int | None = None
    """Time of the first of the satellite fixes that have come since without a gap; None without."""
    stopped: bool = False
    """Whether the propeller was stopped because it did not raise the vehicle."""


class AutopilotState(NamedTuple):
    """All that a tick hands to the next."""

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
    """What the heading follows, where it does."""
    targets: Targets = Targets()
    test: Excitation | None = None
    failsafe: str = ""
    """The cause of the failsafe in force; empty when there is none."""
    home: Home = Home()
    armed_us: int = 0
    """When the vehicle was armed."""
    thrust: float = 0.0
    """Last commanded, as a fraction of full."""
    duct_rad: tuple[float, float] = (0.0, 0.0)
    """Rudder and elevator where the duct should stand by what was commanded."""
    ahrs: Ahrs = Ahrs()
    health: Health = Health()
    actuator_tests: tuple[ActuatorTest, ...] = ()
    """Only while disarmed."""
    ascent: Ascent | None = None
    """Progress of mode SURFACE; None in other modes and before its first tick."""


class Trace(NamedTuple):
    """The inside of the loops in one tick, for telemetry and tests."""

    heading_error_rad: float = 0.0
    pitch_error_rad: float = 0.0
    depth_error_m: float = 0.0
    """Wanted minus actual."""
    pitch_setpoint_rad: float = 0.0
    excitation_rad: float = 0.0
    """What a test adds to rudder or elevator; where it moves both, to the rudder."""
    excitation_hz: float = 0.0
    rudder_rad: float = 0.0
    elevator_rad: float = 0.0
    thrust: float = 0.0
    """Commanded, after limits."""


class Answer(NamedTuple):
    """What became of a request: a MAV_RESULT and, where it was refused, why."""

    result: int
    text: str = ""
    parameter: int = 0
    """The parameter of a mission item that is wrong, 1 to 7; 0 for none in particular."""


US_PER_S = 1_000_000
"""Vehicle time is counted in whole microseconds."""

ACCEPTED, TEMPORARILY_REJECTED, DENIED, UNSUPPORTED, FAILED, IN_PROGRESS, CANCELLED = (
    0,
    1,
    2,
    3,
    4,
    5,
    6,
)
"""MAV_RESULT."""
