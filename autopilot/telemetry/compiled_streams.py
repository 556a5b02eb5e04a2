"""Frames of the telemetry of steady ticks, encoded by compiled code, many ticks in a call.

The builders are those of the telemetry table. Streams that need more than the numbers of a tick
stay Python. Importing this module loads the compiler.
"""

from __future__ import annotations

import math
from array import array
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, cast

from autopilot.control import core, params, steady_kernel
from autopilot.control.params import Config
from autopilot.control.types import Home
from autopilot.reports import TickReport
from autopilot.telemetry import tick_messages
from mavlink_io import jit
from mavlink_io.codec import MAX_FRAME_BYTES
from mavlink_io.jit import Native, Numbers, entry_point, kernel, numeric
from mavlink_io.lockstep_frames import HEAD, message_layout, seal_at
from mavlink_io.records import Altimeter

if TYPE_CHECKING:  # the machine code does not depend on them
    from autopilot.reports import SteadyReport
    from autopilot.telemetry.streams import StreamGroup
    from mavlink_io.endpoint import Endpoint

_pack = jit.packer()
MAX_BYTES = 16_384
"""Largest batch."""
_NO_LIMITS = Altimeter(0, math.nan, 0.0, math.inf)
"""Record of an altimeter before the first one: no limits of its range."""


_ATTITUDE, _ATTITUDE_FORMAT = message_layout("ATTITUDE")
_QUATERNION, _QUATERNION_FORMAT = message_layout("ATTITUDE_QUATERNION")
_POSITION, _POSITION_FORMAT = message_layout("LOCAL_POSITION_NED")
_GLOBAL, _GLOBAL_FORMAT = message_layout("GLOBAL_POSITION_INT")
_HUD, _HUD_FORMAT = message_layout("VFR_HUD")
_RANGE, _RANGE_FORMAT = message_layout("DISTANCE_SENSOR")
_TIME, _TIME_FORMAT = message_layout("SYSTEM_TIME")
_ALTITUDE, _ALTITUDE_FORMAT = message_layout("ALTITUDE")
_PRESSURE, _PRESSURE_FORMAT = message_layout("SCALED_PRESSURE2")
_TARGET, _TARGET_FORMAT = message_layout("ATTITUDE_TARGET")
_SERVO, _SERVO_FORMAT = message_layout("SERVO_OUTPUT_RAW")
_ACTUATOR, _ACTUATOR_FORMAT = message_layout("ACTUATOR_OUTPUT_STATUS")
_IMU, _IMU_FORMAT = message_layout("HIGHRES_IMU")
_ODOMETRY, _ODOMETRY_FORMAT = message_layout("ODOMETRY")


@entry_point
def encode(
    numbers: Sequence[int],
    counts: Sequence[int],
    starts: Sequence[int],
    rows: Numbers,
    config: Native,
    home: Home,
    altimeter: Altimeter,
    octets: Any,
    sequence: int,
    sender: int,
) -> int:
    """Encode messages of some ticks.

    Parameters
    ----------
    numbers : sequence of int
        Message ids, those of one tick after the other.
    counts, starts : sequence of int
        Number of messages of each tick; index of its first number in ``rows``.
    rows : Numbers
        Arrays of ``steady_kernel`` after the ticks.
    config : Native
        Parameters, from ``params.flat``.
    home : Home
        Origin of the positions.
    altimeter : Altimeter
        Record with the limits of the range.
    octets : array of octets
        Receives the frames, one after the other.
    sequence, sender : int
        Sequence number of the first frame; 256 times the system id plus the component id.

    Returns
    -------
    int
        Length of all frames.
    """
    end = first = 0
    for tick in range(len(counts)):
        s = _report(rows[starts[tick] :], config.value, home, altimeter)
        for i in range(first, first + counts[tick]):
            end += _encode_message(numbers[i], s, octets, end, sequence, sender)
            sequence = (sequence + 1) & 0xFF
        first += counts[tick]
    return end


@kernel
def _encode_message(
    number: int, s: TickReport, octets: Any, end: int, sequence: int, sender: int
) -> int:
    """Encode a message of a tick behind the octet ``end``; return the length of its frame."""
    at, layout = end + HEAD, _ATTITUDE
    if number == _ATTITUDE.number:
        _pack(octets, at, tick_messages.attitude(s), _ATTITUDE_FORMAT)
    elif number == _QUATERNION.number:
        layout = _QUATERNION
        _pack(octets, at, tick_messages.attitude_quaternion(s), _QUATERNION_FORMAT)
    elif number == _POSITION.number:
        layout = _POSITION
        _pack(octets, at, tick_messages.local_position(s), _POSITION_FORMAT)
    elif number == _GLOBAL.number:
        layout = _GLOBAL
        _pack(octets, at, tick_messages.global_position(s), _GLOBAL_FORMAT)
    elif number == _HUD.number:
        layout = _HUD
        _pack(octets, at, tick_messages.vfr_hud(s), _HUD_FORMAT)
    elif number == _RANGE.number:
        layout = _RANGE
        _pack(octets, at, tick_messages.distance_sensor(s), _RANGE_FORMAT)
    elif number == _TIME.number:
        layout = _TIME
        _pack(octets, at, tick_messages.system_time(s), _TIME_FORMAT)
    elif number == _ALTITUDE.number:
        layout = _ALTITUDE
        _pack(octets, at, tick_messages.altitude(s), _ALTITUDE_FORMAT)
    elif number == _PRESSURE.number:
        layout = _PRESSURE
        _pack(octets, at, tick_messages.water_pressure(s), _PRESSURE_FORMAT)
    elif number == _TARGET.number:
        layout = _TARGET
        _pack(octets, at, tick_messages.attitude_target(s), _TARGET_FORMAT)
    elif number == _SERVO.number:
        layout = _SERVO
        _pack(octets, at, tick_messages.servo_outputs(s), _SERVO_FORMAT)
    elif number == _ACTUATOR.number:
        layout = _ACTUATOR
        _pack(octets, at, tick_messages.actuator_outputs(s), _ACTUATOR_FORMAT)
    elif number == _IMU.number:
        layout = _IMU
        _pack(octets, at, tick_messages.imu(s), _IMU_FORMAT)
    else:
        layout = _ODOMETRY
        _pack(octets, at, tick_messages.odometry(s), _ODOMETRY_FORMAT)
    return seal_at(octets, end, layout, sequence, sender)


@numeric
def _report(values: Numbers, config: Config, home: Home, altimeter: Altimeter) -> TickReport:
    """Return the results of a tick; the path has no meaning."""
    sensors = steady_kernel.sensors(values)
    motion, setpoint, trace = steady_kernel.results(values)
    actuators = core.armed_frame(sensors.time_us, trace, config)
    return TickReport(
        sensors.time_us, motion, setpoint, None, home, trace, actuators, sensors, altimeter
    )


class FrameEncoder:
    """Encodes groups of streams whose builders are all numeric, as batches of ticks."""

    def __init__(self) -> None:
        self._octets = jit.octets(MAX_BYTES + MAX_FRAME_BYTES)
        self._memory = memoryview(self._octets)
        self._first: SteadyReport | None = None
        """First report of the batch."""
        self._bytes = 0
        """Upper bound of the bytes of the batch."""
        self._numbers, self._counts, self._starts = array("q"), array("q"), array("q")
        rows = jit.numbers(steady_kernel.SIZE)
        config = jit.native(cast(tuple[Any, ...], params.flat(params.config({}))))
        arguments = (
            *(self._numbers, self._counts, self._starts, rows, config),
            *(_flat_home(Home()), _NO_LIMITS, self._octets, 0, 0),
        )
        self._encode = jit.machine_code(encode, *arguments)
        self._encode(*arguments)

    def add(self, group: StreamGroup, report: SteadyReport, max_bytes: int) -> bool:
        """Add messages of a tick to the batch.

        Parameters
        ----------
        group : StreamGroup
            Streams with numeric builders.
        report : SteadyReport
            Results of the tick.
        max_bytes : int
            Upper bound of the bytes of a batch of more than one group, at most `MAX_BYTES`.

        Returns
        -------
        bool
            Whether it was added; if not, the batch has to be taken first.
        """
        first, results = self._first, report.results
        if first is None:
            self._first = report
        elif (
            results.rows is not first.results.rows
            or report.home is not first.home
            or self._bytes + group.max_bytes > max_bytes
            or not _has_equal_limits(report.altimeter, first.altimeter)
        ):
            return False
        self._bytes += group.max_bytes
        self._numbers.extend(group.numbers)
        self._counts.append(len(group.numbers))
        self._starts.append(results.start)
        return True

    def take(self, endpoint: Endpoint) -> bytes:
        """Return the frames of the batch as the next ones of an endpoint that does not sign.

        Parameters
        ----------
        endpoint : Endpoint
            Sender of the frames.

        Returns
        -------
        bytes
            The frames, one after the other; none without a batch.
        """
        report, self._first, self._bytes = self._first, None, 0
        if report is None:
            return b""
        numbers, counts, starts = self._numbers, self._counts, self._starts
        self._numbers, self._counts, self._starts = array("q"), array("q"), array("q")
        results = report.results
        length = self._encode(
            *(numbers, counts, starts, results.rows, results.config),
            *(_flat_home(report.home), _limits(report.altimeter), self._octets),
            *(endpoint.sequence, endpoint.sender),
        )
        endpoint.take_sequence(len(numbers))
        return bytes(self._memory[:length])


def _flat_home(home: Home) -> Home:
    """Return home with the types of compiled code."""
    return Home(float(home.lat_deg), float(home.lon_deg), bool(home.known))


def _limits(altimeter: Altimeter | None) -> Altimeter:
    """Return a record with the limits of an altimeter, and the types of compiled code."""
    if altimeter is None:
        return _NO_LIMITS
    nearest_m, farthest_m = float(altimeter.min_range_m), float(altimeter.max_range_m)
    return Altimeter(0, math.nan, nearest_m, farthest_m)


def _has_equal_limits(one: Altimeter | None, other: Altimeter | None) -> bool:
    """Return whether the limits of two altimeter records are equal."""
    return one is other or _limits(one)[2:] == _limits(other)[2:]
