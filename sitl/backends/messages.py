"""HIL messages for all MAVLink autopilots: sensor records converted to message fields."""

from __future__ import annotations

from math import atan2, hypot, isnan, pi

from mavlink_io import device_messages, dialect
from mavlink_io.fixed_frame import FixedFrame
from mavlink_io.records import Altimeter, GpsFix

SYSTEM = 1
"""System id of the vehicle."""
COMPONENT = dialect.constant("MAV_COMP_ID_USER1")
"""Component id of the simulator; the autopilot is component 1 of the same system."""

SENSOR = dialect.by_name("HIL_SENSOR")
TRUTH = dialect.by_name("HIL_STATE_QUATERNION")
GPS = dialect.by_name("HIL_GPS")
ALTIMETER = dialect.by_name("DISTANCE_SENSOR")
CONTROLS = dialect.by_name("HIL_ACTUATOR_CONTROLS")
SENSOR_FRAME, CONTROLS_FRAME = FixedFrame(SENSOR), FixedFrame(CONTROLS)
COMMAND, ACKNOWLEDGEMENT = dialect.by_name("COMMAND_LONG"), dialect.by_name("COMMAND_ACK")

TRUTH_PERIOD_US = 100_000
"""Default period of HIL_STATE_QUATERNION in vehicle time, for viewers."""

_DOWN = dialect.constant("MAV_SENSOR_ROTATION_PITCH_270")
_ULTRASOUND = dialect.constant("MAV_DISTANCE_SENSOR_ULTRASOUND")
_UNKNOWN_VARIANCE = 255


def gps_values(fix: GpsFix) -> tuple[object, ...]:
    """Return the fields of HIL_GPS in wire order; eph and epv are in centimetres, as for PX4."""
    speed = hypot(fix.velocity_north_mps, fix.velocity_east_mps)
    course = atan2(fix.velocity_east_mps, fix.velocity_north_mps) % (2.0 * pi)
    return GPS.values(
        time_usec=fix.time_us,
        fix_type=fix.fix_type,
        lat=round(1e7 * fix.lat_deg),
        lon=round(1e7 * fix.lon_deg),
        alt=round(1e3 * fix.alt_m),
        eph=_centimetres(fix.eph_m),
        epv=_centimetres(fix.epv_m),
        vel=round(1e2 * speed),
        vn=round(1e2 * fix.velocity_north_mps),
        ve=round(1e2 * fix.velocity_east_mps),
        vd=round(1e2 * fix.velocity_down_mps),
        cog=round(course * 18000.0 / pi) % 36000,
        satellites_visible=fix.satellites,
    )


def _centimetres(error_m: float) -> int:
    """Convert an accuracy to whole centimetres; NaN becomes MAVLink's value for unknown."""
    return device_messages.UNKNOWN_U16 if isnan(error_m) else round(1e2 * error_m)


def altimeter_values(altimeter: Altimeter) -> tuple[object, ...]:
    """Return the fields of DISTANCE_SENSOR in wire order."""
    return ALTIMETER.values(
        time_boot_ms=altimeter.time_us // 1000,
        min_distance=round(1e2 * altimeter.min_range_m),
        max_distance=round(1e2 * altimeter.max_range_m),
        current_distance=round(1e2 * altimeter.range_m),
        type=_ULTRASOUND,
        id=0,
        orientation=_DOWN,
        covariance=_UNKNOWN_VARIANCE,
    )
