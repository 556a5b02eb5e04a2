"""The satellite receiver: reports at its rate; a fix takes some time after the antenna surfaces."""

from __future__ import annotations

from math import isnan, nan
from typing import NamedTuple

from mavlink_io.frames import offset_to_geodetic
from mavlink_io.jit import kernel
from sitl.core.environment import Surroundings
from sitl.core.sensors.datasheets import GpsSheet
from sitl.core.sensors.noise import NoiseStream, normals
from sitl.core.sensors.sample_timing import NOT_FITTED, Timing, deliver, is_due, lose, row, timing
from sitl.core.sensors.true_motion import TrueMotion
from sitl.vehicle.vectors import Vector

MAX_DEPTH_M = 0.4
"""Depth of the hull axis at which the antenna, on top of the hull, is submerged."""
NO_FIX, FIX_3D = 1, 3
"""Values of GPS_FIX_TYPE."""
FIX_FROM_US, SEEN_US = 0, 1
"""Indices of the state: vehicle time from which there is a fix, NaN while the antenna is under
water; vehicle time of the last report with the antenna above water. Both are zero at vehicle time
zero: there is a fix from the time before the launch."""
STATE = 2
"""Length of the state."""


class GpsReceiver(NamedTuple):
    """Parameters of the receiver."""

    timing: Timing = NOT_FITTED
    horizontal_noise_m: float = 0.0
    vertical_noise_m: float = 0.0
    velocity_noise_mps: float = 0.0
    satellites: int = 0
    hot_start_us: int = 0
    warm_start_us: int = 0
    hot_within_us: int = 0


def build(sheet: GpsSheet, tick_us: int) -> GpsReceiver:
    """Build the receiver from its data sheet."""
    hot, warm, within = (
        round(1e6 * s) for s in (sheet.hot_start_s, sheet.warm_start_s, sheet.hot_within_s)
    )
    return GpsReceiver(
        timing=timing(sheet.rate_hz, sheet.latency_s, sheet.dropout, tick_us),
        horizontal_noise_m=sheet.horizontal_noise_m,
        vertical_noise_m=sheet.vertical_noise_m,
        velocity_noise_mps=sheet.velocity_noise_mps,
        satellites=sheet.satellites,
        hot_start_us=hot,
        warm_start_us=warm,
        hot_within_us=within,
    )


@kernel
def sample(
    receiver: GpsReceiver,
    truth: TrueMotion,
    sea: Surroundings,
    state: Vector,
    stream: NoiseStream,
    transit: Vector,
    latest: Vector,
) -> bool:
    """Report if due; return whether ``latest``, the numbers of a ``GpsFix``, is new."""
    if is_due(receiver.timing, truth.time_us):
        reading = row(receiver.timing, transit, truth.time_us)
        reading[:] = 0.0
        _update_sky_view(receiver, truth, state)
        if state[FIX_FROM_US] <= truth.time_us:
            _measure(receiver, truth, sea, stream, reading)
        else:
            reading[1] = NO_FIX
            reading[9] = nan
            reading[10] = nan
        reading[0] = truth.time_us
        lose(receiver.timing, reading, stream)
    return deliver(receiver.timing, transit, truth.time_us, latest)


@kernel
def _update_sky_view(receiver: GpsReceiver, truth: TrueMotion, state: Vector) -> None:
    """Update whether the antenna is above water; after surfacing set the time of the next fix."""
    if truth.position_ned_m[2] + truth.surface_m >= MAX_DEPTH_M:
        state[FIX_FROM_US] = nan
        return
    if isnan(state[FIX_FROM_US]):
        is_hot = truth.time_us - state[SEEN_US] <= receiver.hot_within_us
        start_us = receiver.hot_start_us if is_hot else receiver.warm_start_us
        state[FIX_FROM_US] = truth.time_us + start_us
    state[SEEN_US] = truth.time_us


@kernel
def _measure(
    receiver: GpsReceiver,
    truth: TrueMotion,
    sea: Surroundings,
    stream: NoiseStream,
    reading: Vector,
) -> None:
    """Write a fix with white noise on position and velocity, without its time."""
    # measured = true + sd n, with n standard normal, independent in each axis and report; position
    # (m) and velocity (m/s) in NED, altitude upwards.
    n = normals(stream, 6)
    north_m, east_m, down_m = truth.position_ned_m
    latitude, longitude = offset_to_geodetic(
        north_m + receiver.horizontal_noise_m * n[0],
        east_m + receiver.horizontal_noise_m * n[1],
        sea.latitude_deg,
        sea.longitude_deg,
    )
    reading[1] = FIX_3D
    reading[2] = latitude
    reading[3] = longitude
    reading[4] = -down_m + receiver.vertical_noise_m * n[2]
    for axis in range(3):
        reading[5 + axis] = truth.velocity_ned_mps[axis] + receiver.velocity_noise_mps * n[3 + axis]
    reading[8] = receiver.satellites
    reading[9] = receiver.horizontal_noise_m
    reading[10] = receiver.vertical_noise_m
