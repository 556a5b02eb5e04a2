"""The satellite receiver: reports at its rate; a fix takes some time after the antenna surfaces."""

from __future__ import annotations

from typing import NamedTuple

from mavlink_io.frames import offset_to_geodetic
from mavlink_io.records import GpsFix
from sitl.core.environment import Environment
from sitl.core.sensors.datasheets import GpsSheet
from sitl.core.sensors.noise import NoiseStream
from sitl.core.sensors.sample_timing import Queue, Timing, is_due, queue_reading, timing
from sitl.core.truth import Truth

MAX_DEPTH_M = 0.4
"""Depth of the hull axis at which the antenna, on top of the hull, is submerged."""
NO_FIX, FIX_3D = 1, 3
"""Values of GPS_FIX_TYPE."""


class GpsReceiver(NamedTuple):
    """Parameters of the receiver."""

    timing: Timing
    sheet: GpsSheet
    hot_start_us: int
    warm_start_us: int
    hot_within_us: int


class GpsState(NamedTuple):
    """State of the receiver; at vehicle time zero it has a fix, from the time before the launch."""

    fix_from_us: int | None = 0
    """Vehicle time from which there is a fix; None while the antenna is under water."""
    lost_us: int = 0
    """Vehicle time of the last report with the antenna above water."""
    queue: Queue[GpsFix] = ()


def build(sheet: GpsSheet, tick_us: int) -> GpsReceiver:
    """Build the receiver from its data sheet."""
    hot, warm, within = (
        round(1e6 * s) for s in (sheet.hot_start_s, sheet.warm_start_s, sheet.hot_within_s)
    )
    return GpsReceiver(
        timing=timing(sheet.rate_hz, sheet.latency_s, sheet.dropout, tick_us),
        sheet=sheet,
        hot_start_us=hot,
        warm_start_us=warm,
        hot_within_us=within,
    )


def sample(
    receiver: GpsReceiver, truth: Truth, sea: Environment, state: GpsState, stream: NoiseStream
) -> tuple[GpsState, GpsFix | None]:
    """Report if due; return the new state and the report that arrives now, if any."""
    measured = None
    if is_due(receiver.timing, truth.time_us):
        state = _update_sky_view(receiver, truth, state)
        has_fix = state.fix_from_us is not None and state.fix_from_us <= truth.time_us
        measured = (
            _measure(receiver.sheet, truth, sea, stream) if has_fix else no_fix(truth.time_us)
        )
    queue, report = queue_reading(receiver.timing, state.queue, measured, truth.time_us, stream)
    return (state if queue is state.queue else state._replace(queue=queue)), report


def no_fix(time_us: int) -> GpsFix:
    """Return the report of a receiver without a fix."""
    return GpsFix(
        time_us=time_us,
        fix_type=NO_FIX,
        lat_deg=0.0,
        lon_deg=0.0,
        alt_m=0.0,
        velocity_north_mps=0.0,
        velocity_east_mps=0.0,
        velocity_down_mps=0.0,
        satellites=0,
    )


def _update_sky_view(receiver: GpsReceiver, truth: Truth, state: GpsState) -> GpsState:
    """Update whether the antenna is above water; after surfacing set the time of the next fix."""
    if truth.position_ned_m[2] + truth.surface_m >= MAX_DEPTH_M:
        return state if state.fix_from_us is None else state._replace(fix_from_us=None)
    fix_from_us = state.fix_from_us
    if fix_from_us is None:
        submerged_us = truth.time_us - state.lost_us
        is_hot = submerged_us <= receiver.hot_within_us
        start_us = receiver.hot_start_us if is_hot else receiver.warm_start_us
        fix_from_us = truth.time_us + start_us
    return GpsState(fix_from_us, truth.time_us, state.queue)


def _measure(sheet: GpsSheet, truth: Truth, sea: Environment, stream: NoiseStream) -> GpsFix:
    """Return a fix with white noise on position and velocity."""
    # measured = true + sd n, with n standard normal, independent in each axis and report; position
    # (m) and velocity (m/s) in NED, altitude upwards.
    north, east, up, v_north, v_east, v_down = stream.normals(6)
    latitude, longitude = offset_to_geodetic(
        truth.position_ned_m[0] + sheet.horizontal_noise_m * north,
        truth.position_ned_m[1] + sheet.horizontal_noise_m * east,
        sea.latitude_deg,
        sea.longitude_deg,
    )
    return GpsFix(
        truth.time_us,
        FIX_3D,
        latitude,
        longitude,
        -truth.position_ned_m[2] + sheet.vertical_noise_m * up,
        truth.velocity_ned_mps[0] + sheet.velocity_noise_mps * v_north,
        truth.velocity_ned_mps[1] + sheet.velocity_noise_mps * v_east,
        truth.velocity_ned_mps[2] + sheet.velocity_noise_mps * v_down,
        sheet.satellites,
        sheet.horizontal_noise_m,
        sheet.vertical_noise_m,
    )
