"""What is wrong with the AHRS's sample: groups that fall silent, stand still or tell what cannot be."""

from typing import NamedTuple

from autopilot.params import Config
from autopilot.types import NO_READINGS, US_PER_S, Ahrs, Complaint
from link.records import ACCELEROMETER_FRESH, GYRO_FRESH, MAGNETOMETER_FRESH, PRESSURE_FRESH, SensorFrame

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
ALL_FRESH = ACCELEROMETER_FRESH | GYRO_FRESH | MAGNETOMETER_FRESH | PRESSURE_FRESH
(_A, _DA), (_G, _DG), (_M, _DM) = ((group.high, group.jump) for group in GROUPS[:3])
_P, _PP, _DP = GROUPS[3].low, GROUPS[3].high, GROUPS[3].jump
_NEVER = -1
_IN_A_ROW_US = 250_000
"""Readings further apart may differ by anything."""


def hear(
    old: Ahrs, frame: SensorFrame, excluded: frozenset[str], config: Config
) -> tuple[Ahrs, SensorFrame, tuple[Complaint, ...]]:
    """Take in a sample: the memory, the sample with what may be used of it, and what is wrong.

    ``fields_updated`` of what is given back tells the groups that may be used: heard of lately, and none of
    ``excluded``; where this sample has no sound reading of such a group, the last one stands in.
    """
    now_us = frame.time_us
    if not excluded and frame.fields_updated & ALL_FRESH == ALL_FRESH and (moved := _moved_soundly(old, frame)):
        return Ahrs(frame, moved, (now_us,) * 4, (now_us,) * 4), frame, ()
    return _picked(old, frame, excluded, config)


def _moved_soundly(old: Ahrs, frame: SensorFrame) -> tuple[tuple[float, ...], ...]:
    """The readings by group where every one is new, possible and near the last; empty otherwise: the common case.

    What ``_possible`` says of the groups, in one expression for speed.
    """
    (ax, ay, az), (gx, gy, gz), (mx, my, mz), (p,) = old.readings
    _, x, y, z, u, v, w, k, m, n, pressure, *_ = frame
    if (
        (x != ax or y != ay or z != az) and (u != gx or v != gy or w != gz) and (k != mx or m != my or n != mz)
        and pressure != p
        and -_A < x < _A and -_A < y < _A and -_A < z < _A
        and -_DA < x - ax < _DA and -_DA < y - ay < _DA and -_DA < z - az < _DA
        and -_DG < u - gx < _DG and -_DG < v - gy < _DG and -_DG < w - gz < _DG
        and -_G < u < _G and -_G < v < _G and -_G < w < _G
        and -_M < k < _M and -_M < m < _M and -_M < n < _M
        and -_DM < k - mx < _DM and -_DM < m - my < _DM and -_DM < n - mz < _DM
        and _P < pressure < _PP and -_DP < pressure - p < _DP
    ):  # fmt: skip
        return (x, y, z), (u, v, w), (k, m, n), (pressure,)
    return ()


def _picked(
    old: Ahrs, frame: SensorFrame, excluded: frozenset[str], config: Config
) -> tuple[Ahrs, SensorFrame, tuple[Complaint, ...]]:
    """Each group by itself."""
    now_us, values, usable = frame.time_us, list(frame), 0
    readings, heard_us, changed_us = list(old.readings), list(old.heard_us), list(old.changed_us)
    complaints: list[Complaint] = []
    for at, group in enumerate(GROUPS):
        sound = False
        if frame.fields_updated & group.fresh == group.fresh:
            reading, before = frame[group.first : group.last], readings[at]
            sound = _possible(group, reading, before if now_us - heard_us[at] < _IN_A_ROW_US else NO_READINGS[at])
            if sound:
                heard_us[at] = now_us
            else:
                complaints.append(Complaint(group.name, IMPLAUSIBLE))
            changed_us[at] = changed_us[at] if reading == before else now_us
            readings[at] = reading
        if heard_us[at] != _NEVER and now_us - heard_us[at] > config.health_lost_s * US_PER_S:
            complaints.append(Complaint(group.name, SILENT))
        elif 0.0 < config.health_stuck_s * US_PER_S < now_us - changed_us[at] and heard_us[at] != _NEVER:
            complaints.append(Complaint(group.name, STUCK))
        elif group.name not in excluded and heard_us[at] != _NEVER:
            usable |= group.fresh
        if not (sound and group.name not in excluded):
            values[group.first : group.last] = old.frame[group.first : group.last]
    values[-2] = usable
    screened = SensorFrame._make(values)
    return Ahrs(screened, tuple(readings), tuple(heard_us), tuple(changed_us)), screened, tuple(complaints)


def _possible(group: Group, reading: tuple[float, ...], before: tuple[float, ...]) -> bool:
    """Not-a-number is not possible; anything may follow on no reading at all."""
    for value, last in zip(reading, before, strict=True):
        if not group.low < value < group.high or abs(value - last) > group.jump:
            return False
    return True
