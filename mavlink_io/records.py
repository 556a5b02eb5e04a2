"""Records of the HIL link: sensors, actuators and true state.

Body axes are forward-right-down (FRD), world axes north-east-down (NED); units are in the names.
The fields of ``SensorFrame``, ``ActuatorFrame`` and ``TruthFrame`` are in the wire order of their
MAVLink messages, so that a record is encoded by writing its tuple.
"""

from math import nan
from typing import NamedTuple

ACCELEROMETER_FRESH, GYRO_FRESH, MAGNETOMETER_FRESH, PRESSURE_FRESH = 0x07, 0x38, 0x1C0, 0x1A00
"""Bits of HIL_SENSOR.fields_updated per instrument, set in a tick with a new reading of it."""
ATTITUDE_FRESH = ACCELEROMETER_FRESH | MAGNETOMETER_FRESH
"""Sensor groups that show the attitude without the gyro."""
SENSORS_ALL = ACCELEROMETER_FRESH | GYRO_FRESH | MAGNETOMETER_FRESH | PRESSURE_FRESH
"""HIL_SENSOR.fields_updated with every accelerometer, gyro, magnetometer and barometer bit."""

ARMED_FLAG = 128
"""MAV_MODE_FLAG_SAFETY_ARMED in HIL_ACTUATOR_CONTROLS.mode."""
CUSTOM_MODE_FLAG = 1
"""MAV_MODE_FLAG_CUSTOM_MODE_ENABLED in HIL_ACTUATOR_CONTROLS.mode."""
LOCKSTEP_FLAG = 1
"""HIL_ACTUATOR_CONTROLS_FLAGS_LOCKSTEP in HIL_ACTUATOR_CONTROLS.flags."""


class SensorFrame(NamedTuple):
    """HIL_SENSOR: one sample of the inertial, magnetic and pressure sensors.

    Acceleration is specific force: an accelerometer at rest and level reads z = -9.81 m/s^2.
    Pressure is the absolute pressure of the water.
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
    """HIL_ACTUATOR_CONTROLS: commands of the autopilot to the actuators."""

    time_us: int
    """Vehicle time of the sensor sample that the command answers."""
    flags: int
    """HIL_ACTUATOR_CONTROLS_FLAGS."""
    controls: tuple[float, ...]
    """16 numbers in [-1, 1]: rudder, elevator, thrust, drop weight; the others are zero.

    Rudder and elevator are fractions of the duct's travel (positive: nose to starboard, nose up),
    thrust is a fraction of full thrust (58 % is 0.58). 1 releases the drop weight."""
    mode: int
    """MAV_MODE_FLAG."""

    @property
    def armed(self) -> bool:
        """Whether the vehicle is armed."""
        return bool(self.mode & ARMED_FLAG)


class TruthFrame(NamedTuple):
    """HIL_STATE_QUATERNION: the simulator's true state, for logs and viewers, never for control."""

    time_us: int
    attitude_q: tuple[float, float, float, float]
    """Attitude quaternion from body (FRD) to world (NED), scalar first."""
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
    """HIL_GPS: a fix of a satellite receiver."""

    time_us: int
    fix_type: int
    """GPS_FIX_TYPE; below 2 there is no fix, and the other fields are meaningless."""
    lat_deg: float
    lon_deg: float
    alt_m: float
    velocity_north_mps: float
    velocity_east_mps: float
    velocity_down_mps: float
    satellites: int
    eph_m: float = nan
    """Horizontal error estimated by the receiver, in m; NaN if it gives none."""
    epv_m: float = nan
    """Vertical error estimated by the receiver, in m; NaN if it gives none."""


NO_FIX = GpsFix(0, 0, *(nan,) * 6, 0)
"""Record of a receiver without a position."""


class Altimeter(NamedTuple):
    """DISTANCE_SENSOR facing down: range to the sea floor."""

    time_us: int
    range_m: float
    min_range_m: float
    max_range_m: float


class Dvl(NamedTuple):
    """ODOMETRY of a Doppler velocity log (DVL): velocity in body axes (FRD).

    In the message, ``frame_id`` is LOCAL_FRD (fixed to the earth) for velocity over ground (bottom
    track) and BODY_FRD for a velocity through the water (water track). Position and attitude are
    NaN, because a DVL measures neither.
    """

    time_us: int
    velocity_x_mps: float
    velocity_y_mps: float
    velocity_z_mps: float
    over_ground: bool
    """Whether the velocity is relative to the ground and not to the water."""
    figure_of_merit_mps: float
    """Standard deviation of the velocity that the DVL estimates from its beams."""
    quality_pct: int
    """Share of the beams with an echo: 1 to 100 %."""


NO_PING = Dvl(0, nan, nan, nan, over_ground=False, figure_of_merit_mps=nan, quality_pct=0)
"""Record without a velocity."""


class Battery(NamedTuple):
    """BATTERY_STATUS: measurements of the battery gauge."""

    voltage_v: float
    """Voltage of the battery."""
    current_a: float
    """Current, positive while the battery discharges; NaN if unknown."""
    consumed_ah: float
    """Consumed charge; NaN if unknown."""
    remaining: float
    """Remaining fraction of the capacity, 0 to 1; NaN if unknown."""


class Leak(NamedTuple):
    """SYS_STATUS of a leak detector: the health bit of its sensor means dry."""

    wet: bool
    """Whether there is water in the hull."""


class DuctFeedback(NamedTuple):
    """ACTUATOR_OUTPUT_STATUS of the tailcone: measured deflection of the duct.

    Fractions of the duct's travel with the signs of ``ActuatorFrame.controls``.
    """

    time_us: int
    rudder: float
    elevator: float
