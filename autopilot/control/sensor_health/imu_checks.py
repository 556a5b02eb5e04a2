"""Checks of the sensor frame: silent, stuck and implausible groups. Pure.

The groups are accelerometer, gyro, magnetometer and pressure sensor.
"""

from typing import NamedTuple

from autopilot.control.params import Config
from autopilot.control.sensor_health.types import (
    NO_READINGS,
    Ahrs,
    ChangeTimes,
    Fault,
    GroupReadings,
)
from autopilot.control.types import PRESSURE_HELD, US_PER_S
from mavlink_io.jit import numeric
from mavlink_io.records import (
    ACCELEROMETER_FRESH,
    GYRO_FRESH,
    MAGNETOMETER_FRESH,
    PRESSURE_FRESH,
    SensorFrame,
)

SILENT, STUCK, IMPLAUSIBLE = "silent", "stuck", "implausible"


class Group(NamedTuple):
    """One sensor of the sensor frame. Units: m/s^2, rad/s, gauss, hPa."""

    name: str
    fresh: int
    """Bit in ``fields_updated``."""
    first: int
    """Index of its first field in SensorFrame."""
    last: int
    """Index after its last field."""
    low: float
    """Lower limit of a plausible reading."""
    high: float
    """Upper limit of a plausible reading."""
    jump: float
    """Maximum plausible change between two consecutive readings."""


GROUPS = (
    Group(
        name="Accelerometer",
        fresh=ACCELEROMETER_FRESH,
        first=1,
        last=4,
        low=-100.0,
        high=100.0,
        jump=20.0,
    ),
    Group(name="Gyro", fresh=GYRO_FRESH, first=4, last=7, low=-8.0, high=8.0, jump=0.4),
    Group(
        name="Magnetometer",
        fresh=MAGNETOMETER_FRESH,
        first=7,
        last=10,
        low=-1.0,
        high=1.0,
        jump=0.5,
    ),
    Group(
        name="Pressure sensor",
        fresh=PRESSURE_FRESH,
        first=10,
        last=11,
        low=500.0,
        high=700_000.0,
        jump=30.0,
    ),
)
"""The magnetic field of the earth is below 0.7 gauss; 100 hPa is about one metre of water.

A gyro jump of 0.4 rad/s in a tick would be 1,100 deg/s2; the hull and its added inertia turn at
less than 30 deg/s2. A pressure jump of 30 hPa is 0.3 m, to which ``PRESSURE_HPAPS`` is added."""
PRESSURE_HPAPS = 300.0
"""Rate of change of the pressure, hPa/s, at a depth rate of 3 m/s."""
_ALL_FRESH = ACCELEROMETER_FRESH | GYRO_FRESH | MAGNETOMETER_FRESH | PRESSURE_FRESH
_MIN_JUMP, _PRESSURE_JUMP = min(group.jump for group in GROUPS), GROUPS[3].jump
_A2, _G2, _M2 = (group.high * group.high for group in GROUPS[:3])
_MIN_HPA, _MAX_HPA = GROUPS[3].low, GROUPS[3].high
_NEVER = -1
_CONSECUTIVE_WINDOW_US = 250_000
"""Maximum interval between two consecutive readings whose change is checked."""

ImuCheckResult = tuple[Ahrs, SensorFrame, tuple[Fault, ...]]


def check_imu(
    old: Ahrs, frame: SensorFrame, excluded: frozenset[str], config: Config
) -> ImuCheckResult:
    """Check a sensor frame.

    Parameters
    ----------
    old : Ahrs
        History of the frames.
    frame : SensorFrame
        Frame of this tick, as received.
    excluded : frozenset[str]
        Names of the groups that must not be used.
    config : Config
        Parameters HLTH_LOST_S and HLTH_STUCK_S.

    Returns
    -------
    ImuCheckResult
        The new history, the frame to use, and the faults. In the frame to use, ``fields_updated``
        names the groups that may be used: those with a recent plausible reading that are not
        excluded. If such a group has no plausible reading in this frame, its last one is used; the
        bit PRESSURE_HELD marks that of the pressure.
    """
    if old.per_group is None and not excluded:
        accepted, changed_us = check_complete_frame(old.frame, old.changed_us, frame, config)
        if accepted:
            return Ahrs(frame, changed_us, None), frame, ()
    return _check_partial_frame(old, frame, excluded, config)


@numeric
def check_complete_frame(
    before: SensorFrame, changed_us: ChangeTimes, frame: SensorFrame, config: Config
) -> tuple[bool, ChangeTimes]:
    """Check a frame after one in which every group was fresh and plausible.

    Fast path of the common case: the limits are those of ``_is_plausible`` or tighter.

    Parameters
    ----------
    before : SensorFrame
        The last frame.
    changed_us : tuple of int
        Time at which the reading of each group last changed.
    frame : SensorFrame
        Frame of this tick, as received.
    config : Config
        Parameter HLTH_STUCK_S.

    Returns
    -------
    tuple[bool, ChangeTimes]
        Whether every group is fresh, plausible and not stuck, and when each last changed.
    """
    now_us, hpa = frame.time_us, frame.pressure_hpa
    ax, ay, az = frame.accel_x_mps2, frame.accel_y_mps2, frame.accel_z_mps2
    p, q, r = frame.gyro_x_radps, frame.gyro_y_radps, frame.gyro_z_radps
    mx, my, mz = frame.mag_x_gauss, frame.mag_y_gauss, frame.mag_z_gauss
    da, db, dc = ax - before.accel_x_mps2, ay - before.accel_y_mps2, az - before.accel_z_mps2
    dp, dq, dr = p - before.gyro_x_radps, q - before.gyro_y_radps, r - before.gyro_z_radps
    dx, dy, dz = mx - before.mag_x_gauss, my - before.mag_y_gauss, mz - before.mag_z_gauss
    change_hpa = hpa - before.pressure_hpa
    jump = da * da + db * db + dc * dc + dp * dp + dq * dq + dr * dr + dx * dx + dy * dy + dz * dz
    if not (
        frame.fields_updated & _ALL_FRESH == _ALL_FRESH
        and jump < _MIN_JUMP * _MIN_JUMP
        and -_PRESSURE_JUMP < change_hpa < _PRESSURE_JUMP
        and ax * ax + ay * ay + az * az < _A2
        and p * p + q * q + r * r < _G2
        and mx * mx + my * my + mz * mz < _M2
        and _MIN_HPA < hpa < _MAX_HPA
    ):
        return False, changed_us
    accelerometer_us, gyro_us, magnetometer_us, pressure_us = changed_us
    if da != 0.0 or db != 0.0 or dc != 0.0:
        accelerometer_us = now_us
    if dp != 0.0 or dq != 0.0 or dr != 0.0:
        gyro_us = now_us
    if dx != 0.0 or dy != 0.0 or dz != 0.0:
        magnetometer_us = now_us
    if change_hpa != 0.0:
        pressure_us = now_us
    changed_us = accelerometer_us, gyro_us, magnetometer_us, pressure_us
    oldest_us = min(accelerometer_us, gyro_us, magnetometer_us, pressure_us)
    return not _is_frozen(now_us, oldest_us, config), changed_us


def _check_partial_frame(
    old: Ahrs, frame: SensorFrame, excluded: frozenset[str], config: Config
) -> ImuCheckResult:
    """Check each group separately."""
    now_us, values, usable = frame.time_us, list(frame), 0
    history = old.per_group or _groups_of_frame(old.frame)
    readings, received_us, changed_us = (
        list(history.readings),
        list(history.received_us),
        list(old.changed_us),
    )
    faults: list[Fault] = []
    for index, group in enumerate(GROUPS):
        plausible = False
        if frame.fields_updated & group.fresh == group.fresh:
            reading, before = frame[group.first : group.last], readings[index]
            plausible = _is_plausible(
                group,
                reading,
                before
                if now_us - received_us[index] < _CONSECUTIVE_WINDOW_US
                else NO_READINGS[index],
                now_us - received_us[index],
            )
            if plausible:
                received_us[index] = now_us
            else:
                faults.append(Fault(group.name, IMPLAUSIBLE))
            changed_us[index] = changed_us[index] if reading == before else now_us
            readings[index] = reading
        if (
            received_us[index] != _NEVER
            and now_us - received_us[index] > config.health_lost_s * US_PER_S
        ):
            faults.append(Fault(group.name, SILENT))
        elif received_us[index] != _NEVER and _is_frozen(now_us, changed_us[index], config):
            faults.append(Fault(group.name, STUCK))
        elif group.name not in excluded and received_us[index] != _NEVER:
            usable |= group.fresh
        if not (plausible and group.name not in excluded):
            values[group.first : group.last] = old.frame[group.first : group.last]
    is_held = usable & PRESSURE_FRESH == PRESSURE_FRESH and received_us[-1] < now_us
    values[-2] = usable | PRESSURE_HELD if is_held else usable
    usable_frame = SensorFrame._make(values)
    complete = usable == _ALL_FRESH and min(received_us) == now_us
    per_group = None if complete else GroupReadings(tuple(readings), tuple(received_us))
    accelerometer_us, gyro_us, magnetometer_us, pressure_us = changed_us
    times = accelerometer_us, gyro_us, magnetometer_us, pressure_us
    return Ahrs(usable_frame, times, per_group), usable_frame, tuple(faults)


def _groups_of_frame(frame: SensorFrame) -> GroupReadings:
    """Return the history after a frame in which every group is fresh and plausible."""
    return GroupReadings(
        tuple(frame[group.first : group.last] for group in GROUPS), (frame.time_us,) * len(GROUPS)
    )


@numeric
def _is_frozen(now_us: int, changed_us: int, config: Config) -> bool:
    """Return whether a reading has not changed for HLTH_STUCK_S."""
    return 0.0 < config.health_stuck_s * US_PER_S < now_us - changed_us


def _is_plausible(
    group: Group, reading: tuple[float, ...], before: tuple[float, ...], interval_us: int
) -> bool:
    """Check limits and change; NaN is implausible, and ``before`` NaN accepts any change."""
    jump = group.jump
    if group.fresh == PRESSURE_FRESH:
        jump += PRESSURE_HPAPS * interval_us / US_PER_S
    for value, last in zip(reading, before, strict=True):
        if not group.low < value < group.high or abs(value - last) > jump:
            return False
    return True
