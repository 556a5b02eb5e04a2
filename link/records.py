"""Records that cross the HIL link. Body axes FRD, world NED, units in the names.

The fields of ``SensorFrame``, ``ActuatorFrame`` and ``TruthFrame`` stand in the wire order of the MAVLink
messages that carry them, so a frame is encoded by writing its tuple.
"""

from typing import NamedTuple

SENSORS_ALL = 0x1FFF
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
    (positive: nose to starboard, nose up), thrust as a fraction of full (58 % is 0.58), the rest zero.
    """

    time_us: int
    flags: int
    controls: tuple[float, ...]
    mode: int

    @property
    def armed(self) -> bool:
        return bool(self.mode & ARMED_FLAG)


class TruthFrame(NamedTuple):
    """HIL_STATE_QUATERNION: the simulator's own state, for logs and viewers; no controller may use it."""

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
    """HIL_GPS: a satellite fix, present only at the surface. Velocities NED."""

    time_us: int
    fix_type: int
    lat_deg: float
    lon_deg: float
    alt_m: float
    velocity_north_mps: float
    velocity_east_mps: float
    velocity_down_mps: float
    satellites: int


class Altimeter(NamedTuple):
    """DISTANCE_SENSOR looking down: range to the sea floor."""

    time_us: int
    range_m: float
    min_range_m: float
    max_range_m: float
