"""The telemetry table: each message, its default rate and its builder.

Messages are due by vehicle time, in whole ticks and with a fixed phase, so that identical flights
give identical bytes. Builders take a snapshot and return the fields of a message in wire order;
integers are limited to the range of their field.
"""

import math
from array import array
from collections.abc import Sequence
from typing import NamedTuple

from autopilot.control.types import Trace
from autopilot.reports import Snapshot
from autopilot.telemetry import navigation, status, tick_messages
from autopilot.telemetry.encoding import (
    Builder,
    Report,
    boot_ms,
    int32,
    time_us,
    uint16,
    uint32,
)
from mavlink_io import dialect
from mavlink_io.codec import largest_frame
from mavlink_io.device_messages import UNKNOWN_U16
from mavlink_io.dialect import MessageType, Values, constant
from mavlink_io.jit import NUMERIC

_NO_FIX = constant("GPS_FIX_TYPE_NO_FIX")


def gps_raw(s: Snapshot) -> Values:
    """Return GPS_RAW_INT of the newest satellite fix: degE7, mm and cm/s."""
    fix, unknown = s.fix, UNKNOWN_U16
    if fix is None:
        return time_us(s), 0, 0, 0, unknown, unknown, unknown, unknown, _NO_FIX, 0, 0, 0, 0, 0, 0, 0
    lat, lon = int32(fix.lat_deg * 1e7), int32(fix.lon_deg * 1e7)
    speed = uint16(math.hypot(fix.velocity_north_mps, fix.velocity_east_mps) * 100.0)
    sd_mm, vertical_sd_mm = (uint32(sd_m * 1000.0) for sd_m in (fix.eph_m, fix.epv_m))
    return (
        fix.time_us,
        lat,
        lon,
        int32(fix.alt_m * 1000.0),
        unknown,
        unknown,
        speed,
        unknown,
        fix.fix_type,
        fix.satellites,
        0,
        sd_mm,
        vertical_sd_mm,
        0,
        0,
        0,
    )


def global_origin(s: Report) -> Values:
    """Return GPS_GLOBAL_ORIGIN: home at the surface is the origin of north and east."""
    home = s.home
    return int32(home.lat_deg * 1e7), int32(home.lon_deg * 1e7), 0, time_us(s)


TRACE_NAME, TRACE_ID = b"TRACE", 1
"""Name and id of the DEBUG_FLOAT_ARRAY with the control-loop signals, the fields of ``Trace``."""
_TRACE_PADDING = (0.0,) * (58 - len(Trace._fields))


def loop_trace(s: Report) -> Values:
    """Return DEBUG_FLOAT_ARRAY with the control-loop signals."""
    return time_us(s), TRACE_ID, TRACE_NAME, (*s.trace, *_TRACE_PADDING)


NAMED = {
    "DPT_ERR": "depth_error_m",
    "PTCH_ERR": "pitch_error_rad",
    "HDG_ERR": "heading_error_rad",
    "SID_IN": "excitation_rad",
    "SID_FREQ": "excitation_hz",
}
"""Field of ``Trace`` by name of a NAMED_VALUE_FLOAT, for clients that cannot plot arrays."""


def _named_value(name: str, index: int) -> Builder:
    """Return the builder of a NAMED_VALUE_FLOAT."""
    return lambda s: (boot_ms(s), s.trace[index], name.encode())


class TelemetryStream(NamedTuple):
    """One row of the telemetry table."""

    message: MessageType
    rate_hz: float
    """Default rate; 0: sent only on request."""
    build: Builder
    more_builders: tuple[Builder, ...] = ()
    """Builders of further messages of the same type."""
    of_tick: bool = False
    """Whether ``TickReport`` is enough for its only builder, which then needs no ``Snapshot``."""

    @property
    def is_numeric(self) -> bool:
        """Whether its builder is compiled, in ``compiled_streams``, where ticks are compiled."""
        return self.of_tick and self.build in NUMERIC

    @property
    def builders(self) -> tuple[Builder, ...]:
        """All builders of the stream."""
        return self.build, *self.more_builders


class StreamGroup(NamedTuple):
    """Streams to send in a tick that follow each other in the table."""

    of_tick: bool
    """``TelemetryStream.of_tick`` of each of them."""
    is_numeric: bool
    """``TelemetryStream.is_numeric`` of each of them."""
    streams: Sequence[TelemetryStream]
    numbers: "array[int]"
    """Their message ids, for compiled code."""
    max_bytes: int
    """Upper bound of the bytes of all frames."""


def stream_group(streams: Sequence[TelemetryStream]) -> StreamGroup:
    """Return the group of streams with equal ``of_tick`` and ``is_numeric``."""
    numbers = array("q", [stream.message.message_id for stream in streams])
    max_bytes = sum(largest_frame(stream.message) for stream in streams)
    return StreamGroup(streams[0].of_tick, streams[0].is_numeric, streams, numbers, max_bytes)


def stream(name: str, rate_hz: float, build: Builder, *more_builders: Builder) -> TelemetryStream:
    """Return a row for a message name."""
    return TelemetryStream(
        message=dialect.by_name(name),
        rate_hz=rate_hz,
        build=build,
        more_builders=more_builders,
        of_tick=build in _OF_TICK,
    )


_OF_TICK = frozenset(
    (
        tick_messages.attitude,
        tick_messages.attitude_quaternion,
        tick_messages.local_position,
        tick_messages.global_position,
        tick_messages.vfr_hud,
        tick_messages.altitude,
        tick_messages.water_pressure,
        tick_messages.distance_sensor,
        navigation.navigation,
        tick_messages.attitude_target,
        navigation.position_target,
        tick_messages.servo_outputs,
        tick_messages.actuator_outputs,
        tick_messages.imu,
        tick_messages.odometry,
        tick_messages.system_time,
        loop_trace,
    )
)
"""Builders for which ``TickReport`` is enough."""


STREAMS = (
    stream("ATTITUDE", 10, tick_messages.attitude),
    stream("ATTITUDE_QUATERNION", 10, tick_messages.attitude_quaternion),
    stream("LOCAL_POSITION_NED", 5, tick_messages.local_position),
    stream("GLOBAL_POSITION_INT", 5, tick_messages.global_position),
    stream("VFR_HUD", 4, tick_messages.vfr_hud),
    stream("ALTITUDE", 2, tick_messages.altitude),
    stream("SCALED_PRESSURE2", 5, tick_messages.water_pressure),
    stream("DISTANCE_SENSOR", 5, tick_messages.distance_sensor),
    stream("NAV_CONTROLLER_OUTPUT", 2, navigation.navigation),
    stream("ATTITUDE_TARGET", 4, tick_messages.attitude_target),
    stream("POSITION_TARGET_LOCAL_NED", 2, navigation.position_target),
    stream("SERVO_OUTPUT_RAW", 4, tick_messages.servo_outputs),
    stream("ACTUATOR_OUTPUT_STATUS", 4, tick_messages.actuator_outputs),
    stream("HIGHRES_IMU", 10, tick_messages.imu),
    stream("ODOMETRY", 5, tick_messages.odometry),
    stream("ESTIMATOR_STATUS", 1, navigation.estimator_status),
    stream("WIND_COV", 1, navigation.current),
    stream("GPS_RAW_INT", 1, gps_raw),
    stream("SYSTEM_TIME", 1, tick_messages.system_time),
    stream("SYS_STATUS", 1, status.system_status),
    stream("EXTENDED_SYS_STATE", 1, status.extended_state),
    stream("MISSION_CURRENT", 1, status.mission_current),
    stream("CURRENT_MODE", 0.5, status.current_mode),
    stream("BATTERY_STATUS", 0.5, status.battery),
    stream("HOME_POSITION", 0.2, status.home_position),
    stream("FENCE_STATUS", 0, status.fence_status),
    stream("DEBUG_FLOAT_ARRAY", 0, loop_trace),
    stream(
        "NAMED_VALUE_FLOAT",
        0,
        *(_named_value(name, Trace._fields.index(field)) for name, field in NAMED.items()),
    ),
)
