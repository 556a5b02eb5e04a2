"""Frames of the telemetry of steady ticks, encoded by compiled code.

The builders are those of the telemetry table. Streams that need more than the numbers of a tick
stay Python. Importing this module loads the compiler.
"""

from __future__ import annotations

from array import array
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, cast

from autopilot.control import core, params, steady_kernel
from autopilot.control.params import Config
from autopilot.control.types import Home
from autopilot.reports import TickReport
from autopilot.telemetry import tick_messages
from mavlink_io import jit
from mavlink_io.codec import LARGEST_FRAME
from mavlink_io.jit import Native, Numbers, entry_point, numeric
from mavlink_io.lockstep_frames import HEAD, message_layout, seal_at

if TYPE_CHECKING:  # the machine code does not depend on them
    from autopilot.reports import SteadyReport
    from autopilot.telemetry.streams import StreamGroup
    from mavlink_io.endpoint import Endpoint

_pack = jit.packer()
_NO_HOME, _MESSAGES = Home(), 10
"""Number of messages of ``encode``."""


_ATTITUDE, _ATTITUDE_FORMAT = message_layout("ATTITUDE")
_QUATERNION, _QUATERNION_FORMAT = message_layout("ATTITUDE_QUATERNION")
_POSITION, _POSITION_FORMAT = message_layout("LOCAL_POSITION_NED")
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
    values: Numbers,
    config: Native,
    octets: Any,
    sequence: int,
    sender: int,
) -> int:
    """Encode messages of one tick.

    Parameters
    ----------
    numbers : sequence of int
        Message ids.
    values : Numbers
        The array of ``steady_kernel`` after the tick.
    config : Native
        Parameters, from ``params.flat``.
    octets : array of octets
        Receives the frames, one after the other.
    sequence, sender : int
        Sequence number of the first frame; 256 times the system id plus the component id.

    Returns
    -------
    int
        Length of all frames.
    """
    s = _report(values, config.value)
    end = 0
    for i in range(len(numbers)):
        number, at, layout = numbers[i], end + HEAD, _ATTITUDE
        if number == _ATTITUDE.number:
            _pack(octets, at, tick_messages.attitude(s), _ATTITUDE_FORMAT)
        elif number == _QUATERNION.number:
            layout = _QUATERNION
            _pack(octets, at, tick_messages.attitude_quaternion(s), _QUATERNION_FORMAT)
        elif number == _POSITION.number:
            layout = _POSITION
            _pack(octets, at, tick_messages.local_position(s), _POSITION_FORMAT)
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
        end += seal_at(octets, end, layout, sequence, sender)
        sequence = (sequence + 1) & 0xFF
    return end


@numeric
def _report(values: Numbers, config: Config) -> TickReport:
    """Return the results of a tick; path, home and altimeter have no meaning."""
    sensors = steady_kernel.sensors(values)
    motion, setpoint, trace = steady_kernel.results(values)
    actuators = core.armed_frame(sensors.time_us, trace, config)
    return TickReport(
        sensors.time_us, motion, setpoint, None, _NO_HOME, trace, actuators, sensors, None
    )


class FrameEncoder:
    """Encodes groups of streams whose builders are all numeric."""

    def __init__(self) -> None:
        self._octets = jit.octets(_MESSAGES * LARGEST_FRAME)
        self._memory = memoryview(self._octets)
        values = jit.numbers(steady_kernel.SIZE)
        config = jit.native(cast(tuple[Any, ...], params.flat(params.config({}))))
        arguments = array("q"), values, config, self._octets, 0, 0
        self._encode = jit.machine_code(encode, *arguments)
        self._encode(*arguments)

    def encode(self, group: StreamGroup, report: SteadyReport, endpoint: Endpoint) -> bytes:
        """Return the next frames of an endpoint that does not sign, one after the other.

        Parameters
        ----------
        group : StreamGroup
            Streams with numeric builders.
        report : SteadyReport
            Results of the tick.
        endpoint : Endpoint
            Sender of the frames.

        Returns
        -------
        bytes
            One frame for each stream; fewer octets than a datagram may have.
        """
        results, numbers = report.results, group.numbers
        length = self._encode(
            *(numbers, results.values, results.config, self._octets),
            *(endpoint.sequence, endpoint.sender),
        )
        endpoint.take_sequence(len(numbers))
        return bytes(self._memory[:length])
