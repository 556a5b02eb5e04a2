"""Conversion between the records of the vehicle's devices and standard MAVLink messages.

Each device sends under its own component id in the vehicle's system. Fields that a device does not
measure contain MAVLink's value for unknown: NaN, -1, or the maximum of the field.
"""

from math import isnan, nan, sqrt

from mavlink_io import dialect
from mavlink_io.dialect import Message, Values, constant
from mavlink_io.jit import numeric
from mavlink_io.records import Altimeter, Battery, DuctFeedback, Dvl, GpsFix, Leak

ODOMETRY, BATTERY_STATUS = dialect.by_name("ODOMETRY"), dialect.by_name("BATTERY_STATUS")
SYS_STATUS, ACTUATOR_OUTPUTS = (
    dialect.by_name("SYS_STATUS"),
    dialect.by_name("ACTUATOR_OUTPUT_STATUS"),
)

DVL_COMPONENT = constant("MAV_COMP_ID_VISUAL_INERTIAL_ODOMETRY")
BATTERY_COMPONENT = constant("MAV_COMP_ID_BATTERY")
LEAK_COMPONENT = constant("MAV_COMP_ID_PERIPHERAL")
DUCT_COMPONENT = constant("MAV_COMP_ID_SERVO1")

EXTENSION_USED, LEAK_BIT = (
    constant("MAV_SYS_STATUS_EXTENSION_USED"),
    constant("MAV_SYS_STATUS_SENSOR_LEAK"),
)
UNKNOWN_U16 = 0xFFFF
"""Unknown value of an unsigned 16-bit field."""
UNKNOWN_TEMPERATURE = 32_767
"""Unknown temperature in BATTERY_STATUS."""

_LOOKING_DOWN = constant("MAV_SENSOR_ROTATION_PITCH_270")
_EARTH_FIXED, _BODY = constant("MAV_FRAME_LOCAL_FRD"), constant("MAV_FRAME_BODY_FRD")
_UNKNOWN_ESTIMATOR = constant("MAV_ESTIMATOR_TYPE_UNKNOWN")
_NO_POSITION, _NO_ATTITUDE = (nan,) * 3, (nan,) * 4
_NO_COVARIANCE = (nan,) + (0.0,) * 20
_ALL_FUNCTIONS, _LIPO = constant("MAV_BATTERY_FUNCTION_ALL"), constant("MAV_BATTERY_TYPE_LIPO")
_MAX_CELL_MV = UNKNOWN_U16 - 1
"""Maximum voltage of one cell field, in mV."""
_BOTH_AXES = 0b11
"""ACTUATOR_OUTPUT_STATUS.active with rudder and elevator."""


@numeric
def gps_record(m: Message) -> GpsFix:
    """Return the satellite fix in a HIL_GPS.

    Parameters
    ----------
    m : namedtuple
        Decoded HIL_GPS.

    Returns
    -------
    GpsFix
        Fix in degrees, m and m/s.
    """
    return GpsFix(
        m.time_usec,
        m.fix_type,
        m.lat * 1e-7,
        m.lon * 1e-7,
        m.alt * 1e-3,
        m.vn * 1e-2,
        m.ve * 1e-2,
        m.vd * 1e-2,
        m.satellites_visible,
        nan if m.eph == UNKNOWN_U16 else m.eph * 1e-2,
        nan if m.epv == UNKNOWN_U16 else m.epv * 1e-2,
    )


@numeric
def looks_down(m: Message) -> bool:
    """Return whether a range is that of an altimeter.

    Parameters
    ----------
    m : namedtuple
        Decoded DISTANCE_SENSOR.

    Returns
    -------
    bool
        Whether its beam points down.
    """
    return bool(m.orientation == _LOOKING_DOWN)


@numeric
def altimeter_record(m: Message) -> Altimeter:
    """Return the range in the DISTANCE_SENSOR of an altimeter.

    Parameters
    ----------
    m : namedtuple
        Decoded DISTANCE_SENSOR that ``looks_down``.

    Returns
    -------
    Altimeter
        Range in m.
    """
    return Altimeter(
        m.time_boot_ms * 1000,
        m.current_distance * 1e-2,
        m.min_distance * 1e-2,
        m.max_distance * 1e-2,
    )


@numeric
def dvl_values(dvl: Dvl) -> Values:
    """Return the fields of the ODOMETRY of a DVL.

    Parameters
    ----------
    dvl : Dvl
        The measurement.

    Returns
    -------
    tuple
        Fields in wire order. ``frame_id`` is LOCAL_FRD for a velocity over ground (bottom track)
        and BODY_FRD for a velocity through the water (water track).

    Notes
    -----
    The covariance is the upper triangle of a 6x6 matrix, row by row: the variance of x, y and z on
    the diagonal, NaN (unknown) for the angular rates.
    """
    variance = dvl.figure_of_merit_mps**2
    covariance = (
        *(variance, 0.0, 0.0, 0.0, 0.0, 0.0),
        *(variance, 0.0, 0.0, 0.0, 0.0),
        *(variance, 0.0, 0.0, 0.0),
        *(nan, 0.0, 0.0),
        *(nan, 0.0),
        nan,
    )
    velocity = dvl.velocity_x_mps, dvl.velocity_y_mps, dvl.velocity_z_mps
    frame = _EARTH_FIXED if dvl.over_ground else _BODY
    return (
        dvl.time_us,
        *_NO_POSITION,
        _NO_ATTITUDE,
        *velocity,
        nan,
        nan,
        nan,
        _NO_COVARIANCE,
        covariance,
        frame,
        _BODY,
        0,
        _UNKNOWN_ESTIMATOR,
        dvl.quality_pct,
    )


@numeric
def has_velocity(m: Message) -> bool:
    """Return whether an ODOMETRY contains a velocity in body axes.

    Parameters
    ----------
    m : namedtuple
        Decoded ODOMETRY.

    Returns
    -------
    bool
        Whether ``dvl_record`` reads it.
    """
    is_known_frame = m.frame_id == _EARTH_FIXED or m.frame_id == _BODY
    return bool(m.child_frame_id == _BODY and is_known_frame and not isnan(m.vx))


@numeric
def dvl_record(m: Message) -> Dvl:
    """Return the DVL measurement in an ODOMETRY.

    Parameters
    ----------
    m : namedtuple
        Decoded ODOMETRY that ``has_velocity``.

    Returns
    -------
    Dvl
        The measurement.
    """
    variance = m.velocity_covariance[0]
    return Dvl(
        m.time_usec,
        m.vx,
        m.vy,
        m.vz,
        m.frame_id == _EARTH_FIXED,
        sqrt(variance) if variance > 0.0 else 0.0,
        m.quality,
    )


@numeric
def battery_values(battery: Battery, charge_state: int = 0) -> Values:
    """Return the fields of the BATTERY_STATUS of a battery.

    Parameters
    ----------
    battery : Battery
        The measurement.
    charge_state : int
        MAV_BATTERY_CHARGE_STATE.

    Returns
    -------
    tuple
        Fields in wire order. The voltage of the battery is divided among the first cell fields, at
        most 65.534 V each.
    """
    total_mv = round(1e3 * max(0.0, battery.voltage_v))
    voltages = (
        min(total_mv, _MAX_CELL_MV),
        _further_cell_mv(total_mv, 1),
        _further_cell_mv(total_mv, 2),
        _further_cell_mv(total_mv, 3),
        _further_cell_mv(total_mv, 4),
        _further_cell_mv(total_mv, 5),
        _further_cell_mv(total_mv, 6),
        _further_cell_mv(total_mv, 7),
        _further_cell_mv(total_mv, 8),
        _further_cell_mv(total_mv, 9),
    )
    consumed_mah = -1 if isnan(battery.consumed_ah) else round(1e3 * battery.consumed_ah)
    percent = -1 if isnan(battery.remaining) else round(100.0 * battery.remaining)
    return (
        consumed_mah,
        -1,
        UNKNOWN_TEMPERATURE,
        voltages,
        centiamperes(battery.current_a),
        0,
        _ALL_FUNCTIONS,
        _LIPO,
        percent,
        0,
        charge_state,
        (0,) * 4,
        0,
        0,
    )


@numeric
def _further_cell_mv(total_mv: int, index: int) -> int:
    """Return the cell field of an index above 0: what the fields before it cannot hold."""
    rest_mv = total_mv - index * _MAX_CELL_MV
    return min(rest_mv, _MAX_CELL_MV) if rest_mv > 0 else UNKNOWN_U16


@numeric
def has_voltage(m: Message) -> bool:
    """Return whether a BATTERY_STATUS contains a voltage.

    Parameters
    ----------
    m : namedtuple
        Decoded BATTERY_STATUS.

    Returns
    -------
    bool
        Whether ``battery_record`` reads it.
    """
    known = False
    for cell_mv in m.voltages:
        known = known or cell_mv != UNKNOWN_U16
    return known


@numeric
def battery_record(m: Message) -> Battery:
    """Return the battery measurement in a BATTERY_STATUS.

    Parameters
    ----------
    m : namedtuple
        Decoded BATTERY_STATUS that ``has_voltage``.

    Returns
    -------
    Battery
        The measurement.
    """
    total_mv = 0
    for cell_mv in m.voltages:
        if cell_mv != UNKNOWN_U16:
            total_mv += cell_mv
    current_a = nan if m.current_battery == -1 else 1e-2 * m.current_battery
    consumed_ah = nan if m.current_consumed == -1 else 1e-3 * m.current_consumed
    remaining = nan if m.battery_remaining == -1 else 1e-2 * m.battery_remaining
    return Battery(1e-3 * total_mv, current_a, consumed_ah, remaining)


@numeric
def centiamperes(current_a: float) -> int:
    """Return a current in the unit of BATTERY_STATUS and SYS_STATUS.

    Parameters
    ----------
    current_a : float
        Current, in A, positive while the battery discharges; NaN if unknown.

    Returns
    -------
    int
        Current in cA, 0 to 32,767; -1 if unknown.
    """
    return -1 if isnan(current_a) else max(0, min(32_767, round(1e2 * current_a)))


@numeric
def leak_values(leak: Leak) -> Values:
    """Return the fields of the SYS_STATUS of a leak detector without other sensors.

    Parameters
    ----------
    leak : Leak
        The measurement.

    Returns
    -------
    tuple
        Fields in wire order.
    """
    health = 0 if leak.wet else LEAK_BIT
    return (
        EXTENSION_USED,
        EXTENSION_USED,
        EXTENSION_USED,
        0,
        UNKNOWN_U16,
        -1,
        *(0,) * 6,
        -1,
        LEAK_BIT,
        LEAK_BIT,
        health,
    )


@numeric
def has_leak_detector(m: Message) -> bool:
    """Return whether the sender of a SYS_STATUS has a leak detector.

    Parameters
    ----------
    m : namedtuple
        Decoded SYS_STATUS.

    Returns
    -------
    bool
        Whether ``leak_record`` reads it.
    """
    return bool(m.onboard_control_sensors_present_extended & LEAK_BIT != 0)


@numeric
def leak_record(m: Message) -> Leak:
    """Return the leak measurement in a SYS_STATUS.

    Parameters
    ----------
    m : namedtuple
        Decoded SYS_STATUS of a sender that ``has_leak_detector``.

    Returns
    -------
    Leak
        The measurement.
    """
    return Leak(m.onboard_control_sensors_health_extended & LEAK_BIT == 0)


@numeric
def duct_values(duct: DuctFeedback) -> Values:
    """Return the fields of the ACTUATOR_OUTPUT_STATUS of the duct.

    Parameters
    ----------
    duct : DuctFeedback
        The measurement.

    Returns
    -------
    tuple
        Fields in wire order; rudder and elevator are actuators 1 and 2.
    """
    return duct.time_us, _BOTH_AXES, (duct.rudder, duct.elevator, *(0.0,) * 30)


@numeric
def has_deflections(m: Message) -> bool:
    """Return whether an ACTUATOR_OUTPUT_STATUS contains rudder and elevator.

    Parameters
    ----------
    m : namedtuple
        Decoded ACTUATOR_OUTPUT_STATUS.

    Returns
    -------
    bool
        Whether ``duct_record`` reads it.
    """
    return bool(m.active & _BOTH_AXES == _BOTH_AXES)


@numeric
def duct_record(m: Message) -> DuctFeedback:
    """Return the measured duct deflection in an ACTUATOR_OUTPUT_STATUS.

    Parameters
    ----------
    m : namedtuple
        Decoded ACTUATOR_OUTPUT_STATUS that ``has_deflections``.

    Returns
    -------
    DuctFeedback
        The measurement.
    """
    return DuctFeedback(m.time_usec, m.actuator[0], m.actuator[1])
