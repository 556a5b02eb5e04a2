"""The vehicle's devices on the wire: their records as standard MAVLink messages, both ways.

Each device speaks under a component id of its own, in the vehicle's system. All numbers that a
message has no use for say unknown: NaN, or the largest the field holds."""

from math import isnan, nan

from mavlink_io import dialect
from mavlink_io.dialect import Message, Values, constant
from mavlink_io.records import Battery, DuctFeedback, Dvl, Leak

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
UNKNOWN_TEMPERATURE = 32_767

_EARTH_FIXED, _BODY = constant("MAV_FRAME_LOCAL_FRD"), constant("MAV_FRAME_BODY_FRD")
_UNKNOWN_ESTIMATOR = constant("MAV_ESTIMATOR_TYPE_UNKNOWN")
_NO_POSE = (nan,) * 3
_NO_COVARIANCE = (nan,) + (0.0,) * 20
_ALL_FUNCTIONS, _LIPO = constant("MAV_BATTERY_FUNCTION_ALL"), constant("MAV_BATTERY_TYPE_LIPO")
_MAX_CELL_MV = UNKNOWN_U16 - 1
_CELLS = 10
_BOTH_AXES = 0b11


def dvl_values(dvl: Dvl) -> Values:
    """ODOMETRY's fields in wire order. ``frame_id`` tells what the velocity is relative to: a frame
    that the earth carries (LOCAL_FRD, bottom track) or one that it does not (BODY_FRD, water
    track)."""
    variance, none = dvl.figure_of_merit_mps**2, 0.0
    covariance = (
        variance,
        none,
        none,
        none,
        none,
        none,
        variance,
        none,
        none,
        none,
        none,
        variance,
        none,
        none,
        none,
        nan,
        none,
        none,
        nan,
        none,
        nan,
    )
    velocity = dvl.velocity_x_mps, dvl.velocity_y_mps, dvl.velocity_z_mps
    frame = _EARTH_FIXED if dvl.over_ground else _BODY
    return (
        dvl.time_us,
        *_NO_POSE,
        (nan,) * 4,
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


def dvl_record(m: Message) -> Dvl | None:
    """None for an odometry that is no body velocity."""
    variance = m.velocity_covariance[0]
    if m.child_frame_id != _BODY or m.frame_id not in (_EARTH_FIXED, _BODY) or isnan(m.vx):
        return None
    over_ground = m.frame_id == _EARTH_FIXED
    return Dvl(m.time_usec, m.vx, m.vy, m.vz, over_ground, max(0.0, variance) ** 0.5, m.quality)


def battery_values(battery: Battery, charge_state: int = 0) -> Values:
    """BATTERY_STATUS's fields in wire order; the pack's voltage stands in the first cells, 65.5 V
    in each at most."""
    rest_mv = round(1e3 * max(0.0, battery.voltage_v))
    cells: list[int] = []
    while rest_mv > _MAX_CELL_MV and len(cells) < _CELLS - 1:
        cells.append(_MAX_CELL_MV)
        rest_mv -= _MAX_CELL_MV
    cells.append(min(rest_mv, _MAX_CELL_MV))
    voltages = (*cells, *(UNKNOWN_U16,) * (_CELLS - len(cells)))
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


def battery_record(m: Message) -> Battery | None:
    """None where the gauge knows no voltage."""
    known_mv = [mv for mv in m.voltages if mv != UNKNOWN_U16]
    if not known_mv:
        return None
    current_a = nan if m.current_battery == -1 else 1e-2 * m.current_battery
    consumed_ah = nan if m.current_consumed == -1 else 1e-3 * m.current_consumed
    remaining = nan if m.battery_remaining == -1 else 1e-2 * m.battery_remaining
    return Battery(1e-3 * sum(known_mv), current_a, consumed_ah, remaining)


def centiamperes(current_a: float) -> int:
    """A current as the messages hold it, where -1 would say unknown."""
    return -1 if isnan(current_a) else max(0, min(32_767, round(1e2 * current_a)))


def leak_values(leak: Leak) -> Values:
    """SYS_STATUS's fields in wire order, of a device that has a leak detector and nothing else."""
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


def leak_record(m: Message) -> Leak | None:
    """None of a device that has no leak detector."""
    if not m.onboard_control_sensors_present_extended & LEAK_BIT:
        return None
    return Leak(not m.onboard_control_sensors_health_extended & LEAK_BIT)


def duct_values(duct: DuctFeedback) -> Values:
    """ACTUATOR_OUTPUT_STATUS's fields in wire order: rudder and elevator, as the channels that
    command them."""
    return duct.time_us, _BOTH_AXES, (duct.rudder, duct.elevator, *(0.0,) * 30)


def duct_record(m: Message) -> DuctFeedback | None:
    """None where an axis is not measured."""
    if m.active & _BOTH_AXES != _BOTH_AXES:
        return None
    return DuctFeedback(m.time_usec, m.actuator[0], m.actuator[1])
