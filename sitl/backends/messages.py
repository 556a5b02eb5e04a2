"""HIL messages for all MAVLink autopilots: sensor records converted to message fields."""

from __future__ import annotations

from math import atan2, hypot, isnan, nan, pi

from mavlink_io import device_messages, dialect
from mavlink_io.fixed_frame import FixedFrame
from mavlink_io.frames import offset_to_geodetic
from mavlink_io.jit import numeric
from mavlink_io.records import Altimeter, GpsFix
from sitl.core.truth import Truth

SYSTEM = 1
"""System id of the vehicle."""
COMPONENT = dialect.constant("MAV_COMP_ID_USER1")
"""Component id of the simulator; the autopilot is component 1 of the same system."""

SENSOR = dialect.by_name("HIL_SENSOR")
TRUTH = dialect.by_name("HIL_STATE_QUATERNION")
GPS = dialect.by_name("HIL_GPS")
ALTIMETER = dialect.by_name("DISTANCE_SENSOR")
CONTROLS = dialect.by_name("HIL_ACTUATOR_CONTROLS")
ODOMETRY = device_messages.ODOMETRY
SENSOR_FRAME, CONTROLS_FRAME = FixedFrame(SENSOR), FixedFrame(CONTROLS)
COMMAND, ACKNOWLEDGEMENT = dialect.by_name("COMMAND_LONG"), dialect.by_name("COMMAND_ACK")

TRUTH_PERIOD_US = 100_000
"""Default period of HIL_STATE_QUATERNION in vehicle time, for viewers."""

_NO_ID_NO_YAW = (0, 0)
"""Last fields of HIL_GPS, which the simulator does not use."""
_NO_BEAM = (0.0, 0.0, (0.0,) * 4, 0)
"""Last fields of DISTANCE_SENSOR, which the simulator does not use."""
_DOWN = dialect.constant("MAV_SENSOR_ROTATION_PITCH_270")
_ULTRASOUND = dialect.constant("MAV_DISTANCE_SENSOR_ULTRASOUND")
_UNKNOWN_VARIANCE = 255
POSITION_SD_M, _ATTITUDE_SD_RAD = 0.3, 0.02
"""Standard deviations that are reported with a true position, and with a true attitude."""
_FIX_3D, _SATELLITES = 3, 12
_LOCAL_NED = dialect.constant("MAV_FRAME_LOCAL_NED")
_BODY_FRD = dialect.constant("MAV_FRAME_BODY_FRD")
_VISION = dialect.constant("MAV_ESTIMATOR_TYPE_VISION")
_UPPER_TRIANGLE = tuple((row, column) for row in range(6) for column in range(row, 6))
"""Row and column of each element of a covariance in ODOMETRY."""


@numeric
def gps_values(fix: GpsFix) -> tuple[object, ...]:
    """Return the fields of HIL_GPS in wire order; eph and epv are in centimetres, as for PX4."""
    speed = hypot(fix.velocity_north_mps, fix.velocity_east_mps)
    course = atan2(fix.velocity_east_mps, fix.velocity_north_mps) % (2.0 * pi)
    return (
        fix.time_us,
        round(1e7 * fix.lat_deg),
        round(1e7 * fix.lon_deg),
        round(1e3 * fix.alt_m),
        _centimetres(fix.eph_m),
        _centimetres(fix.epv_m),
        round(1e2 * speed),
        round(1e2 * fix.velocity_north_mps),
        round(1e2 * fix.velocity_east_mps),
        round(1e2 * fix.velocity_down_mps),
        round(course * 18000.0 / pi) % 36000,
        fix.fix_type,
        fix.satellites,
        *_NO_ID_NO_YAW,
    )


@numeric
def _centimetres(error_m: float) -> int:
    """Convert an accuracy to whole centimetres; NaN becomes MAVLink's value for unknown."""
    return device_messages.UNKNOWN_U16 if isnan(error_m) else round(1e2 * error_m)


@numeric
def altimeter_values(altimeter: Altimeter) -> tuple[object, ...]:
    """Return the fields of DISTANCE_SENSOR in wire order."""
    return (
        altimeter.time_us // 1000,
        round(1e2 * altimeter.min_range_m),
        round(1e2 * altimeter.max_range_m),
        round(1e2 * altimeter.range_m),
        _ULTRASOUND,
        0,
        _DOWN,
        _UNKNOWN_VARIANCE,
        *_NO_BEAM,
    )


def true_fix(truth: Truth, latitude_deg: float, longitude_deg: float) -> GpsFix:
    """Return a satellite fix at the true position, also under water.

    Parameters
    ----------
    truth : Truth
        True motion.
    latitude_deg, longitude_deg : float
        Position of the origin of NED.
    """
    north_m, east_m, down_m = truth.position_ned_m
    latitude, longitude = offset_to_geodetic(north_m, east_m, latitude_deg, longitude_deg)
    north_mps, east_mps, down_mps = truth.velocity_ned_mps
    return GpsFix(
        time_us=truth.time_us,
        fix_type=_FIX_3D,
        lat_deg=latitude,
        lon_deg=longitude,
        alt_m=-down_m,
        velocity_north_mps=north_mps,
        velocity_east_mps=east_mps,
        velocity_down_mps=down_mps,
        satellites=_SATELLITES,
        eph_m=POSITION_SD_M,
        epv_m=POSITION_SD_M,
    )


def true_pose_values(truth: Truth) -> tuple[object, ...]:
    """Return the fields of an ODOMETRY with the true position and attitude, in NED."""
    variance = POSITION_SD_M**2
    diagonal = (variance, variance, variance, *(_ATTITUDE_SD_RAD**2,) * 3)
    covariance = [diagonal[row] if row == column else 0.0 for row, column in _UPPER_TRIANGLE]
    return ODOMETRY.values(
        time_usec=truth.time_us,
        frame_id=_LOCAL_NED,
        child_frame_id=_BODY_FRD,
        x=truth.position_ned_m[0],
        y=truth.position_ned_m[1],
        z=truth.position_ned_m[2],
        q=truth.attitude_q,
        vx=nan,
        vy=nan,
        vz=nan,
        rollspeed=nan,
        pitchspeed=nan,
        yawspeed=nan,
        pose_covariance=covariance,
        velocity_covariance=[nan] * len(_UPPER_TRIANGLE),
        reset_counter=0,
        estimator_type=_VISION,
        quality=100,
    )
