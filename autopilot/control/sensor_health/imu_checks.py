"""What is wrong with the AHRS's sample: groups that fall silent, stand still or tell what cannot
be."""

import math
from typing import NamedTuple

from autopilot.control.params import Config
from autopilot.control.sensor_health.types import (
    NO_READINGS,
    Ahrs,
    Fault,
    Piecemeal,
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
    """One instrument of the sample."""

    name: str
    fresh: int
    first: int
    """Field of SensorFrame where it starts."""
    last: int
    low: float
    high: float
    """What it can tell, in its own unit."""
    jump: float
    """More between two readings in a row cannot be."""


GROUPS = (
    Group("Accelerometer", ACCELEROMETER_FRESH, 1, 4, -100.0, 100.0, 20.0),
    Group("Gyro", GYRO_FRESH, 4, 7, -8.0, 8.0, 2.0),
    Group("Magnetometer", MAGNETOMETER_FRESH, 7, 10, -1.0, 1.0, 0.5),
    Group("Pressure sensor", PRESSURE_FRESH, 10, 11, 500.0, 700_000.0, 100.0),
)
"""The earth's field is below 0.7 gauss; the pressure's jump is a metre of water."""
_ALL_FRESH = ACCELEROMETER_FRESH | GYRO_FRESH | MAGNETOMETER_FRESH | PRESSURE_FRESH
_MIN_JUMP, _PRESSURE_JUMP = min(group.jump for group in GROUPS), GROUPS[3].jump
_A2, _G2, _M2 = (group.high * group.high for group in GROUPS[:3])
_MIN_HPA, _MAX_HPA = GROUPS[3].low, GROUPS[3].high
_NEVER = -1
_CONSECUTIVE_WINDOW_US = 250_000
"""Readings further apart may differ by anything."""

ImuCheckResult = tuple[Ahrs, SensorFrame, tuple[Fault, ...]]


def check_imu(
    old: Ahrs, frame: SensorFrame, excluded: frozenset[str], config: Config
) -> ImuCheckResult:
    """Take in a sample: the memory, the sample with what may be used of it, and what is wrong.

    ``fields_updated`` of what is given back tells the groups that may be used: heard of lately, and
    none of ``excluded``; where this sample has no sound reading of such a group, the last one
    stands in."""
    now_us = frame.time_us
    changed_us = _accepted_frame(old, frame) if old.piecemeal is None and not excluded else ()
    if changed_us and (
        (least_us := min(changed_us)) == now_us or not _is_frozen(now_us, least_us, config)
    ):
        return Ahrs(frame, changed_us, None), frame, ()
    return _check_partial_frame(old, frame, excluded, config)


def _accepted_frame(old: Ahrs, frame: SensorFrame) -> tuple[int, ...]:
    """When each group changed, where all of them speak and are surely possible after the last
    sample; else nothing.

    The common case, in few operations: the bounds are those of ``_is_plausible`` or tighter.
    """
    was, now, hpa, now_us = old.frame[1:10], frame[1:10], frame.pressure_hpa, frame.time_us
    ax, ay, az, p, q, r, mx, my, mz = now
    change_hpa = hpa - old.frame.pressure_hpa
    if not (
        frame.fields_updated & _ALL_FRESH == _ALL_FRESH
        and math.dist(now, was) < _MIN_JUMP
        and -_PRESSURE_JUMP < change_hpa < _PRESSURE_JUMP
        and ax * ax + ay * ay + az * az < _A2
        and p * p + q * q + r * r < _G2
        and mx * mx + my * my + mz * mz < _M2
        and _MIN_HPA < hpa < _MAX_HPA
    ):
        return ()
    if change_hpa and ax != was[0] and p != was[3] and mx != was[6]:
        return (now_us,) * 4
    changes = now[:3] != was[:3], now[3:6] != was[3:6], now[6:] != was[6:], change_hpa != 0.0
    return tuple(
        now_us if change else last_us
        for change, last_us in zip(changes, old.changed_us, strict=True)
    )


def _check_partial_frame(
    old: Ahrs, frame: SensorFrame, excluded: frozenset[str], config: Config
) -> ImuCheckResult:
    """Each group by itself."""
    now_us, values, usable = frame.time_us, list(frame), 0
    known = old.piecemeal or _groups_of_frame(old.frame)
    readings, heard_us, changed_us = (
        list(known.readings),
        list(known.heard_us),
        list(old.changed_us),
    )
    complaints: list[Fault] = []
    for at, group in enumerate(GROUPS):
        sound = False
        if frame.fields_updated & group.fresh == group.fresh:
            reading, before = frame[group.first : group.last], readings[at]
            sound = _is_plausible(
                group,
                reading,
                before if now_us - heard_us[at] < _CONSECUTIVE_WINDOW_US else NO_READINGS[at],
            )
            if sound:
                heard_us[at] = now_us
            else:
                complaints.append(Fault(group.name, IMPLAUSIBLE))
            changed_us[at] = changed_us[at] if reading == before else now_us
            readings[at] = reading
        if heard_us[at] != _NEVER and now_us - heard_us[at] > config.health_lost_s * US_PER_S:
            complaints.append(Fault(group.name, SILENT))
        elif heard_us[at] != _NEVER and _is_frozen(now_us, changed_us[at], config):
            complaints.append(Fault(group.name, STUCK))
        elif group.name not in excluded and heard_us[at] != _NEVER:
            usable |= group.fresh
        if not (sound and group.name not in excluded):
            values[group.first : group.last] = old.frame[group.first : group.last]
    values[-2] = usable
    screened = SensorFrame._make(values)
    whole = usable == _ALL_FRESH and min(heard_us) == now_us
    piecemeal = None if whole else Piecemeal(tuple(readings), tuple(heard_us))
    return Ahrs(screened, tuple(changed_us), piecemeal), screened, tuple(complaints)


def _groups_of_frame(frame: SensorFrame) -> Piecemeal:
    """What a sample is in which every group speaks and makes sense."""
    return Piecemeal(
        tuple(frame[group.first : group.last] for group in GROUPS), (frame.time_us,) * len(GROUPS)
    )


def _is_frozen(now_us: int, changed_us: int, config: Config) -> bool:
    return 0.0 < config.health_stuck_s * US_PER_S < now_us - changed_us


def _is_plausible(group: Group, reading: tuple[float, ...], before: tuple[float, ...]) -> bool:
    """Not-a-number is not possible; anything may follow on no reading at all."""
    for value, last in zip(reading, before, strict=True):
        if not group.low < value < group.high or abs(value - last) > group.jump:
            return False
    return True
