"""Records that cross the HIL link. Body axes FRD, world NED, units in the names.

The fields of ``SensorFrame``, ``ActuatorFrame`` and ``TruthFrame`` stand in the wire order of the
MAVLink messages that carry them, so a frame is encoded by writing its tuple."""

from math import nan
from typing import NamedTuple

ACCELEROMETER_FRESH, GYRO_FRESH, MAGNETOMETER_FRESH, PRESSURE_FRESH = 0x07, 0x38, 0x1C0, 0x1A00
"""HIL_SENSOR.fields_updated by instrument: all bits of a group are set in the tick that brings a
new reading of it."""
SENSORS_ALL = ACCELEROMETER_FRESH | GYRO_FRESH | MAGNETOMETER_FRESH | PRESSURE_FRESH
"""HIL_SENSOR.fields_updated with every accelerometer, gyro, magnetometer and barometer bit."""

ARMED_FLAG = 128
CUSTOM_MODE_FLAG = 1
LOCKSTEP_FLAG = 1
"""MAV_MODE_FLAG bits of HIL_ACTUATOR_CONTROLS.mode, and bit 0 of its flags."""


class SensorFrame(NamedTuple):
    """HIL_SENSOR: one sample of the inertial, magnetic and pressure sensors.

    Specific force (an accelerometer at rest and level reads z = -9.81), absolute water pressure.
    """

    time_us: int
    accel_x_mps2: float
    accel_y_mps2: float
    accel_z_mps2: float
    gyro_x_radps: float
    gyro_y_radps: float
    gyro_z_radps: float
    mag_x_gauss: float
    mag_y_gauss: float
    mag_z_gauss: float
    pressure_hpa: float
    differential_pressure_hpa: float
    pressure_altitude_m: float
    temperature_degc: float
    fields_updated: int
    sensor_id: int


class ActuatorFrame(NamedTuple):
    """HIL_ACTUATOR_CONTROLS: what the autopilot asks of the tailcone.

    ``controls`` holds 16 numbers in [-1, 1]: rudder and elevator as a fraction of the duct's travel
    (positive: nose to starboard, nose up), thrust as a fraction of full (58 % is 0.58), the rest
    zero."""

    time_us: int
    flags: int
    controls: tuple[float, ...]
    mode: int

    @property
    def armed(self) -> bool:
        return bool(self.mode & ARMED_FLAG)


class TruthFrame(NamedTuple):
    """HIL_STATE_QUATERNION: the simulator's own state, for logs and viewers; no controller may use
    it."""

    time_us: int
    attitude_q: tuple[float, float, float, float]
    roll_rate_radps: float
    pitch_rate_radps: float
    yaw_rate_radps: float
    lat_dege7: int
    lon_dege7: int
    alt_mm: int
    vx_cmps: int
    vy_cmps: int
    vz_cmps: int
    indicated_airspeed_cmps: int
    true_airspeed_cmps: int
    xacc_mg: int
    yacc_mg: int
    zacc_mg: int


class GpsFix(NamedTuple):
    """HIL_GPS: what a satellite receiver says. ``fix_type`` below 2 is no fix: the rest then means
    nothing.

    Velocities NED. ``eph_m`` and ``epv_m`` are the receiver's own idea of its error, NaN where it
    has none."""

    time_us: int
    fix_type: int
    lat_deg: float
    lon_deg: float
    alt_m: float
    velocity_north_mps: float
    velocity_east_mps: float
    velocity_down_mps: float
    satellites: int
    eph_m: float = nan
    epv_m: float = nan


class Altimeter(NamedTuple):
    """DISTANCE_SENSOR looking down: range to the sea floor."""

    time_us: int
    range_m: float
    min_range_m: float
    max_range_m: float


class Dvl(NamedTuple):
    """ODOMETRY of a Doppler velocity log: velocity in body axes, over ground or through the water.

    ``frame_id`` tells which: LOCAL_FRD, whose origin is fixed to the earth, for bottom track;
    BODY_FRD, whose origin is not, for water track. Position and attitude are NaN: a log has none.
    """

    time_us: int
    velocity_x_mps: float
    velocity_y_mps: float
    velocity_z_mps: float
    over_ground: bool
    figure_of_merit_mps: float
    """The log's own estimate of one standard deviation, from how well its beams agree."""
    quality_pct: int
    """Of the beams, how many gave an echo: 1 to 100."""


class Battery(NamedTuple):
    """BATTERY_STATUS: what the pack's gauge says. Current is positive while it discharges."""

    voltage_v: float
    current_a: float
    consumed_ah: float
    remaining: float
    """Fraction of the capacity, 0 to 1."""


class Leak(NamedTuple):
    """SYS_STATUS with the extended LEAK bit, as a leak detector sends it: healthy means dry."""

    wet: bool


class DuctFeedback(NamedTuple):
    """ACTUATOR_OUTPUT_STATUS of the tailcone: where the duct really stands, as the channels of
    ``ActuatorFrame``."""

    time_us: int
    rudder: float
    """Fraction of the duct's travel."""
    elevator: float
