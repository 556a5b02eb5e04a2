"""Checks of the sensor frame: silent, stuck and implausible groups. Pure.

The groups are accelerometer, gyro, magnetometer and pressure sensor.
"""

import math
from typing import NamedTuple

from autopilot.control.params import Config
from autopilot.control.sensor_health.types import (
    NO_READINGS,
    Ahrs,
    Fault,
    GroupReadings,
)
from autopilot.control.types import US_PER_S
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
    Group(name="Gyro", fresh=GYRO_FRESH, first=4, last=7, low=-8.0, high=8.0, jump=2.0),
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
        jump=100.0,
    ),
)
"""The magnetic field of the earth is below 0.7 gauss; 100 hPa is about one metre of water."""
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
        excluded. If such a group has no plausible reading in this frame, its last one is used.
    """
    now_us = frame.time_us
    changed_us = _accepted_frame(old, frame) if old.per_group is None and not excluded else ()
    if changed_us and (
        (oldest_us := min(changed_us)) == now_us or not _is_frozen(now_us, oldest_us, config)
    ):
        return Ahrs(frame, changed_us, None), frame, ()
    return _check_partial_frame(old, frame, excluded, config)


def _accepted_frame(old: Ahrs, frame: SensorFrame) -> tuple[int, ...]:
    """Return when each group last changed; empty if a group may be missing or implausible.

    Fast path of the common case: the limits are those of ``_is_plausible`` or tighter.
    """
    before, now, hpa, now_us = old.frame[1:10], frame[1:10], frame.pressure_hpa, frame.time_us
    ax, ay, az, p, q, r, mx, my, mz = now
    change_hpa = hpa - old.frame.pressure_hpa
    if not (
        frame.fields_updated & _ALL_FRESH == _ALL_FRESH
        and math.dist(now, before) < _MIN_JUMP
        and -_PRESSURE_JUMP < change_hpa < _PRESSURE_JUMP
        and ax * ax + ay * ay + az * az < _A2
        and p * p + q * q + r * r < _G2
        and mx * mx + my * my + mz * mz < _M2
        and _MIN_HPA < hpa < _MAX_HPA
    ):
        return ()
    if change_hpa and ax != before[0] and p != before[3] and mx != before[6]:
        return (now_us,) * 4
    changes = (
        now[:3] != before[:3],
        now[3:6] != before[3:6],
        now[6:] != before[6:],
        change_hpa != 0.0,
    )
    return tuple(
        now_us if change else last_us
        for change, last_us in zip(changes, old.changed_us, strict=True)
    )


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
    values[-2] = usable
    usable_frame = SensorFrame._make(values)
    complete = usable == _ALL_FRESH and min(received_us) == now_us
    per_group = None if complete else GroupReadings(tuple(readings), tuple(received_us))
    return Ahrs(usable_frame, tuple(changed_us), per_group), usable_frame, tuple(faults)


def _groups_of_frame(frame: SensorFrame) -> GroupReadings:
    """Return the history after a frame in which every group is fresh and plausible."""
    return GroupReadings(
        tuple(frame[group.first : group.last] for group in GROUPS), (frame.time_us,) * len(GROUPS)
    )


def _is_frozen(now_us: int, changed_us: int, config: Config) -> bool:
    """Return whether a reading has not changed for HLTH_STUCK_S."""
    return 0.0 < config.health_stuck_s * US_PER_S < now_us - changed_us


def _is_plausible(group: Group, reading: tuple[float, ...], before: tuple[float, ...]) -> bool:
    """Check limits and change; NaN is implausible, and ``before`` NaN accepts any change."""
    for value, last in zip(reading, before, strict=True):
        if not group.low < value < group.high or abs(value - last) > group.jump:
            return False
    return True
