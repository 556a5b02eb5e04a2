"""The satellite receiver: speaks always, but knows where it is only some time after its antenna has
come up."""

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
"""Of the hull axis below the surface: the antenna on her back is awash when she floats in trim and
drowned below."""
NO_FIX, FIX_3D = 1, 3
"""GPS_FIX_TYPE."""


class Receiver(NamedTuple):
    timing: Timing
    sheet: GpsSheet
    hot_start_us: int
    warm_start_us: int
    hot_within_us: int


class GpsState(NamedTuple):
    """At vehicle time zero the receiver has had the sky: on deck, before she was launched."""

    fix_from_us: int | None = 0
    """When the receiver has, or will have, a fix; None while the antenna is under water."""
    lost_us: int = 0
    """When the sky was last seen."""
    queue: Queue[GpsFix] = ()


def build(sheet: GpsSheet, tick_us: int) -> Receiver:
    hot, warm, within = (
        round(1e6 * s) for s in (sheet.hot_start_s, sheet.warm_start_s, sheet.hot_within_s)
    )
    return Receiver(
        timing(sheet.rate_hz, sheet.latency_s, sheet.dropout, tick_us), sheet, hot, warm, within
    )


def sample(
    receiver: Receiver, truth: Truth, sea: Environment, memory: GpsState, stream: NoiseStream
) -> tuple[GpsState, GpsFix | None]:
    """The report that arrives now, if one does."""
    taken = None
    if is_due(receiver.timing, truth.time_us):
        memory = _update_sky_view(receiver, truth, memory)
        fixed = memory.fix_from_us is not None and memory.fix_from_us <= truth.time_us
        taken = _measure(receiver.sheet, truth, sea, stream) if fixed else no_fix(truth.time_us)
    queue, report = queue_reading(receiver.timing, memory.queue, taken, truth.time_us, stream)
    return (memory if queue is memory.queue else memory._replace(queue=queue)), report


def no_fix(time_us: int) -> GpsFix:
    """What a receiver says that does not know where it is."""
    return GpsFix(time_us, NO_FIX, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0)


def _update_sky_view(receiver: Receiver, truth: Truth, memory: GpsState) -> GpsState:
    """Whether the sky is there, and if it has just come back, how long the search will take."""
    if truth.position_ned_m[2] + truth.surface_m >= MAX_DEPTH_M:
        return memory if memory.fix_from_us is None else memory._replace(fix_from_us=None)
    fix_from_us = memory.fix_from_us
    if fix_from_us is None:
        away_us = truth.time_us - memory.lost_us
        hot = away_us <= receiver.hot_within_us
        fix_from_us = truth.time_us + (receiver.hot_start_us if hot else receiver.warm_start_us)
    return GpsState(fix_from_us, truth.time_us, memory.queue)


def _measure(sheet: GpsSheet, truth: Truth, sea: Environment, stream: NoiseStream) -> GpsFix:
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
