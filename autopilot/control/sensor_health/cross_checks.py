"""Comparison of sensors with each other and with the estimate. Pure, part of the slow checks.

Each check is without memory: the sensor monitor confirms a fault that persists, names the sensor
and does not use it until it agrees again. The symbols are those of ``estimator``.
"""

import math

from autopilot.control import estimator
from autopilot.control.params import Config
from autopilot.control.sensor_health.types import Ahrs
from autopilot.control.types import US_PER_S, VehicleEstimate
from mavlink_io.frames import STANDARD_GRAVITY_MPS2, rotate
from mavlink_io.jit import numeric
from mavlink_io.records import (
    ACCELEROMETER_FRESH,
    GYRO_FRESH,
    MAGNETOMETER_FRESH,
    PRESSURE_FRESH,
    Dvl,
    GpsFix,
    SensorFrame,
)

MAX_GRAVITY_ERROR_MPS2 = 0.6
"""Deviation of the specific force from the standard gravity; waves exceed it for moments only."""
MAX_ACCELERATION_ERROR_MPS2 = 0.5
"""Bias of the downward acceleration, by the measured depth: an attitude error of 18 deg gives 0.5.
Waves at the surface, where pressure and depth differ, exceed it for a second."""
MAX_FIELD_ERROR_GAUSS = 0.08
"""Change of the horizontal or vertical magnetic field since arming; the field changes by 0.01 gauss
in hundreds of kilometres (World Magnetic Model), and an attitude error of 5 deg by 0.04."""
MAX_ATTITUDE_ERROR_RAD = math.radians(12.0)
"""Angle between the gyro's attitude and that of accelerometer and magnetometer.

A gyro bias b beyond the limit of its estimate b_0 gives (b - b_0) / EST_ATT_GAIN."""
MAX_RATE_ERROR_RADPS = math.radians(2.0)
"""Difference between a gyro that is not used and the rates that replace it.

A larger one is used again and excluded again in turn: MAX_ATTITUDE_ERROR_RAD shows 1.8 deg/s."""
MAX_DEPTH_ERROR_M, DEPTH_DRIFT_MPS, MAX_INTEGRATION_S = 0.5, 0.15, 6.0
"""Difference between a pressure sensor that is not used and the integrated acceleration: at first,
and its growth with time. After ``MAX_INTEGRATION_S`` the integral has drifted too far to refute a
sensor; FS_PRESS_S (5 s) has brought the vehicle to SURFACE by then."""
MIN_DEPTH_M = -0.7
"""Depth reading above the water, beyond weather (0.3 m) and waves, that is a fault."""
MAX_DESCENT_ERROR_MPS = 0.2
"""Rate of descent by Doppler log, and by speed and pitch, less that of the measured depth. Waves
and the start of a dive exceed it for 3 s."""
MAX_CURRENT_MPS, MIN_COURSE_MPS = 1.5, 0.8
"""Difference between velocity over ground and through the water that no current explains, and the
speed at which it is checked."""
MAX_SLIP_MPS = 0.8
"""Difference between measured and predicted velocity through the water that neither sideslip (0.3
m/s in the tightest turn) nor the error of the speed model (a third at cruise) explains."""
MAX_AFLOAT_DEPTH_M = 1.0
"""Depth reading at which no satellite is received: weather moves the reading by 0.3 m."""
RECENT_US = 250_000
"""Maximum age of a reading that is compared: a silent or stuck sensor is another fault."""
_GROUP_BITS = ACCELEROMETER_FRESH, GYRO_FRESH, MAGNETOMETER_FRESH, PRESSURE_FRESH
_GYRO, _PRESSURE = 1, 3
"""Indices of ``GroupReadings.readings``."""


@numeric
def field_of(frame: SensorFrame) -> tuple[float, float]:
    """Return the magnetic field along gravity and across it, as measured at the same time.

    With m the field and f the specific force, m_d = -m . f / |f| and m_h = sqrt(|m|^2 - m_d^2): the
    estimated attitude, which a wrong gyro rotates, is not used.

    Parameters
    ----------
    frame : SensorFrame
        Sensor frame.

    Returns
    -------
    tuple of 2 floats
        Horizontal and downward field (gauss); NaN without a specific force.
    """
    fx, fy, fz = frame.accel_x_mps2, frame.accel_y_mps2, frame.accel_z_mps2
    mx, my, mz = frame.mag_x_gauss, frame.mag_y_gauss, frame.mag_z_gauss
    force = math.sqrt(fx * fx + fy * fy + fz * fz)
    if force == 0.0:
        return math.nan, math.nan
    down = -(mx * fx + my * fy + mz * fz) / force
    square = mx * mx + my * my + mz * mz - down * down
    return math.sqrt(max(0.0, square)), down


@numeric
def gravity_differs(frame: SensorFrame) -> bool:
    """Return whether the specific force is not that of a vehicle in steady motion.

    Parameters
    ----------
    frame : SensorFrame
        Sensor frame.
    """
    x, y, z = frame.accel_x_mps2, frame.accel_y_mps2, frame.accel_z_mps2
    force_mps2 = math.sqrt(x * x + y * y + z * z)
    return abs(force_mps2 - STANDARD_GRAVITY_MPS2) > MAX_GRAVITY_ERROR_MPS2


@numeric
def acceleration_differs(estimate: VehicleEstimate) -> bool:
    """Return whether the downward acceleration contradicts the measured depth.

    Parameters
    ----------
    estimate : VehicleEstimate
        Estimated motion, with accelerometer and pressure sensor in use.
    """
    return abs(estimate.accel_bias_mps2) > MAX_ACCELERATION_ERROR_MPS2


@numeric
def field_differs(frame: SensorFrame, horizontal_gauss: float, down_gauss: float) -> bool:
    """Return whether the magnetic field has changed since arming.

    Parameters
    ----------
    frame : SensorFrame
        Sensor frame.
    horizontal_gauss, down_gauss : float
        Field at arming; NaN if it is unknown.
    """
    horizontal, down = field_of(frame)
    error = max(abs(horizontal - horizontal_gauss), abs(down - down_gauss))
    return error > MAX_FIELD_ERROR_GAUSS


@numeric
def attitude_differs(estimate: VehicleEstimate, frame: SensorFrame, config: Config) -> bool:
    """Return whether gravity and magnetic field contradict the attitude that the gyro carries.

    Parameters
    ----------
    estimate : VehicleEstimate
        Estimated motion.
    frame : SensorFrame
        Sensor frame of the same time.
    config : Config
        Parameters.
    """
    (tx, ty, tz), (mx, my, mz) = estimator.attitude_errors(
        estimate.attitude, frame, estimate.speed_mps, estimate.q_radps, estimate.r_radps, config
    )
    x, y, z = tx + mx, ty + my, tz + mz
    return x * x + y * y + z * z > MAX_ATTITUDE_ERROR_RAD * MAX_ATTITUDE_ERROR_RAD


@numeric
def above_water(estimate: VehicleEstimate, frame: SensorFrame, config: Config) -> bool:
    """Return whether the pressure is one that exists above the water only.

    Parameters
    ----------
    estimate : VehicleEstimate
        Estimated motion.
    frame : SensorFrame
        Sensor frame of the same time.
    config : Config
        Parameters.
    """
    return estimator.depth_of(frame.pressure_hpa, config) < MIN_DEPTH_M


@numeric
def agree(
    estimate: VehicleEstimate,
    frame: SensorFrame,
    reference: tuple[float, float],
    config: Config,
) -> bool:
    """Return whether all sensors of a complete frame agree.

    Parameters
    ----------
    estimate : VehicleEstimate
        Estimate of the tick of the frame.
    frame : SensorFrame
        Sensor frame.
    reference : tuple of 2 floats
        Magnetic field at arming; NaN if it is unknown.
    config : Config
        Parameters.

    Returns
    -------
    bool
        False if any of the checks of this module finds a difference.
    """
    return not (
        gravity_differs(frame)
        or acceleration_differs(estimate)
        or field_differs(frame, reference[0], reference[1])
        or attitude_differs(estimate, frame, config)
        or above_water(estimate, frame, config)
    )


def raw_frame(ahrs: Ahrs) -> SensorFrame:
    """Return the last readings of accelerometer and magnetometer, used or not.

    Parameters
    ----------
    ahrs : Ahrs
        History of the sensor frame.

    Returns
    -------
    SensorFrame
        ``fields_updated`` names the groups that still change.
    """
    frame, history = ahrs.frame, ahrs.per_group
    if history is None:
        return frame
    (ax, ay, az), _, (mx, my, mz), _ = history.readings
    fresh = 0
    for changed_us, bits in zip(ahrs.changed_us, _GROUP_BITS, strict=True):
        if frame.time_us - changed_us <= RECENT_US:
            fresh |= bits
    return frame._replace(
        accel_x_mps2=ax,
        accel_y_mps2=ay,
        accel_z_mps2=az,
        mag_x_gauss=mx,
        mag_y_gauss=my,
        mag_z_gauss=mz,
        fields_updated=fresh,
    )


def gyro_differs(estimate: VehicleEstimate, ahrs: Ahrs) -> bool:
    """Return whether a gyro that is not used differs from the rates that replace it.

    Parameters
    ----------
    estimate : VehicleEstimate
        Estimated motion.
    ahrs : Ahrs
        History of the sensor frame.
    """
    reading = _excluded_reading(ahrs, _GYRO, GYRO_FRESH)
    if reading is None:
        return False
    p, q, r = reading
    bx, by, bz = estimate.gyro_bias_radps
    errors = p - bx - estimate.p_radps, q - by - estimate.q_radps, r - bz - estimate.r_radps
    return max(map(abs, errors)) > MAX_RATE_ERROR_RADPS


def pressure_differs(estimate: VehicleEstimate, ahrs: Ahrs, config: Config) -> bool:
    """Return whether a pressure sensor that is not used differs from the integrated depth.

    Parameters
    ----------
    estimate : VehicleEstimate
        Estimated motion; its depth comes from the acceleration alone.
    ahrs : Ahrs
        History of the sensor frame.
    config : Config
        Parameters.
    """
    reading = _excluded_reading(ahrs, _PRESSURE, PRESSURE_FRESH)
    if reading is None:
        return False
    unmeasured_s = (ahrs.frame.time_us - estimate.depth_time_us) / US_PER_S
    if unmeasured_s > MAX_INTEGRATION_S:
        return False
    limit_m = MAX_DEPTH_ERROR_M + DEPTH_DRIFT_MPS * unmeasured_s
    return abs(estimator.depth_of(reading[0], config) - estimate.depth_m) > limit_m


def reads_above_water(estimate: VehicleEstimate, ahrs: Ahrs, config: Config) -> bool:
    """Return whether the present pressure, used or not, exists above the water only.

    Parameters
    ----------
    estimate : VehicleEstimate
        Estimated motion.
    ahrs : Ahrs
        History of the sensor frame.
    config : Config
        Parameters.
    """
    frame, reading = ahrs.frame, _excluded_reading(ahrs, _PRESSURE, PRESSURE_FRESH)
    if reading is not None:
        frame = frame._replace(pressure_hpa=reading[0])
    elif not frame.fields_updated & PRESSURE_FRESH:
        return False
    return above_water(estimate, frame, config)


def deeper_than_afloat(ahrs: Ahrs, config: Config) -> bool:
    """Return whether the pressure, used or not, is that of a depth without satellite reception.

    Parameters
    ----------
    ahrs : Ahrs
        History of the sensor frame.
    config : Config
        Parameters.
    """
    reading = _excluded_reading(ahrs, _PRESSURE, PRESSURE_FRESH)
    pressure_hpa = ahrs.frame.pressure_hpa if reading is None else reading[0]
    return estimator.depth_of(pressure_hpa, config) > MAX_AFLOAT_DEPTH_M


def _excluded_reading(ahrs: Ahrs, group: int, fresh: int) -> tuple[float, ...] | None:
    """Return the present reading of a sensor that is not used; None if it is used or silent."""
    if ahrs.per_group is None or ahrs.frame.fields_updated & fresh:
        return None
    if ahrs.frame.time_us - ahrs.changed_us[group] > RECENT_US:
        return None
    return ahrs.per_group.readings[group]


@numeric
def course_differs(estimate: VehicleEstimate, fix: GpsFix) -> bool:
    """Return whether the velocity by satellites does not follow from heading, speed and a current.

    Parameters
    ----------
    estimate : VehicleEstimate
        Estimated motion.
    fix : GpsFix
        Newest record of the receiver.
    """
    if fix.fix_type < 3:
        return False
    course = complex(fix.velocity_north_mps, fix.velocity_east_mps)
    heading, speed_mps = estimate.heading_rad, estimate.speed_mps * math.cos(estimate.pitch_rad)
    water = complex(speed_mps * math.cos(heading), speed_mps * math.sin(heading))
    return speed_mps > MIN_COURSE_MPS and abs(course - water) > MAX_CURRENT_MPS


@numeric
def doppler_differs(estimate: VehicleEstimate, ping: Dvl) -> bool:
    """Return whether a Doppler log shows a velocity that neither vehicle nor current explains.

    The vehicle's own velocity along x is between 0, with a propeller that has failed, and the
    predicted speed U. With v the measurement, the difference is the distance of v from the segment
    (0..U, 0, 0).

    Parameters
    ----------
    estimate : VehicleEstimate
        Estimated motion.
    ping : Dvl
        Newest record of the Doppler log.
    """
    x, y, z = ping.velocity_x_mps, ping.velocity_y_mps, ping.velocity_z_mps
    along = x - min(max(x, 0.0), max(estimate.speed_mps, 0.0))
    limit_mps = MAX_CURRENT_MPS if ping.over_ground else MAX_SLIP_MPS
    return along * along + y * y + z * z > limit_mps * limit_mps


@numeric
def depth_lags(estimate: VehicleEstimate, ping: Dvl) -> bool:
    """Return whether the vehicle sinks, and the measured depth does not show it.

    With U the predicted speed, theta the pitch, v the velocity of the Doppler log rotated to the
    vertical, and w the measured rate of descent: both -U sin(theta) and v exceed w by more than
    ``MAX_DESCENT_ERROR_MPS``, and the nose is down.

    Parameters
    ----------
    estimate : VehicleEstimate
        Estimated motion.
    ping : Dvl
        Newest record of the Doppler log.
    """
    descent_mps = -estimate.speed_mps * math.sin(estimate.pitch_rad)
    _, _, v_mps = rotate(
        estimate.attitude, (ping.velocity_x_mps, ping.velocity_y_mps, ping.velocity_z_mps)
    )
    least_mps = min(descent_mps, v_mps) - estimate.depth_rate_mps
    return descent_mps > 0.0 and least_mps > MAX_DESCENT_ERROR_MPS


@numeric
def speed_differs(estimate: VehicleEstimate, ping: Dvl) -> bool:
    """Return whether a Doppler log shows less speed than predicted: no thrust, or a wrong log.

    Parameters
    ----------
    estimate : VehicleEstimate
        Estimated motion.
    ping : Dvl
        Newest record of the Doppler log.
    """
    limit_mps = MAX_CURRENT_MPS if ping.over_ground else MAX_SLIP_MPS
    return estimate.speed_mps - ping.velocity_x_mps > limit_mps
