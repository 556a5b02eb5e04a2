"""The HIL link: sensor samples in, actuators out; the simulated truth is never read."""

import math
from collections import deque
from collections.abc import Callable
from typing import Any, NamedTuple

from autopilot.commands.failure_injection import InjectionOrder
from autopilot.telemetry.identity import COMPONENT
from mavlink_io import device_messages, dialect
from mavlink_io.codec import Frame
from mavlink_io.dialect import Message, constant
from mavlink_io.endpoint import Endpoint
from mavlink_io.fixed_frame import (
    CRC_LENGTH,
    FIELDS,
    HEAD_LENGTH,
    SENDER,
    SEQUENCE,
    FixedFrame,
)
from mavlink_io.mission_items import MavCmd
from mavlink_io.records import (
    ActuatorFrame,
    Altimeter,
    Battery,
    DuctFeedback,
    Dvl,
    GpsFix,
    Leak,
    SensorFrame,
)
from mavlink_io.transport import Transport, baud_rate

_SENSOR, _GPS = dialect.by_name("HIL_SENSOR"), dialect.by_name("HIL_GPS")
_SENSOR_FRAME = FixedFrame(_SENSOR)
_CONTROLS_FRAME = FixedFrame(dialect.by_name("HIL_ACTUATOR_CONTROLS"))
_RANGE = dialect.by_name("DISTANCE_SENSOR")
_COMMAND_ACK = dialect.by_name("COMMAND_ACK")
_LINK, _OFF = constant("FAILURE_UNIT_SYSTEM_MAVLINK_SIGNAL"), constant("FAILURE_TYPE_OFF")
_HULL_PRESSURE = dialect.by_name("SCALED_PRESSURE")
_RELAYED_MESSAGES = frozenset(
    (
        device_messages.ODOMETRY.message_id,
        device_messages.ACTUATOR_OUTPUTS.message_id,
        _HULL_PRESSURE.message_id,
        dialect.by_name("STATUSTEXT").message_id,
    )
)
"""Device messages relayed to ground, because no autopilot telemetry contains their content."""
MAX_TIME_US = 4_102_444_800_000_000
"""Latest accepted sample time: 2100-01-01 as UNIX time, for an AHRS that stamps UNIX time.

Log times in nanoseconds since 1970, with vehicle time added, then fit 63 bits."""
MAX_QUEUED_FRAMES = 500
"""Maximum number of device frames kept until the next sample; the oldest are dropped.

No sample may ever arrive when the AHRS has failed."""


class HilSample(NamedTuple):
    """Sensor data of one sample."""

    sensors: SensorFrame
    gps: GpsFix | None = None
    altimeter: Altimeter | None = None
    dvl: Dvl | None = None
    battery: Battery | None = None
    leak: Leak | None = None
    duct: DuctFeedback | None = None
    links_silent: bool | None = None
    """A simulator starts (True) or ends (False) a loss of the ground links; None: no change."""
    relayed: tuple[Frame, ...] = ()
    """Device messages to relay to ground."""
    frames: tuple[Frame, ...] = ()
    """All received frames of this sample, the HIL_SENSOR frame last."""


class HilLink:
    """Autopilot's end of the link to a simulator, or to the vehicle's sensors and tailcone."""

    def __init__(self, transport: Transport, system: int) -> None:
        self.transport = transport
        self.lockstep = baud_rate(transport.address) is None
        """Whether the other end may wait for each answer. A vehicle on a serial line does not."""
        self.endpoint = Endpoint(transport, system, COMPONENT)
        """The link's own participant, for compiled code that encodes frames itself."""
        self._records: dict[str, Any] = {}
        self._relayed: deque[Frame] = deque(maxlen=MAX_QUEUED_FRAMES)
        self._frames: deque[Frame] = deque(maxlen=MAX_QUEUED_FRAMES)
        self._failure_results: list[int] = []
        self._time_error_reported, self._error = False, ""

    def receive(self, *, eager: bool = False) -> list[HilSample] | None:
        """Return the samples in the frames that have arrived; None if no frame has.

        With ``eager`` wait for frames, at most `SPIN_S`. Raises LinkLostError when the link is
        lost.
        """
        decoded, raw, frames = self.endpoint.receive_fixed(_SENSOR_FRAME, eager=eager)
        if decoded is not None:
            system, component = decoded[SENDER]
            head = system, component, _SENSOR.message_id, decoded[SEQUENCE]
            frame = Frame._make((*head, raw[HEAD_LENGTH:-CRC_LENGTH], raw))
            return self._samples(frame, SensorFrame._make(decoded[FIELDS:]))
        if not frames:
            return None
        samples: list[HilSample] = []
        for frame in frames:
            if frame.message_id == _SENSOR.message_id:
                sensors = SensorFrame._make(_SENSOR.unpack(frame.payload))
                samples += self._samples(frame, sensors)
            else:
                self._collect(frame)
        return samples

    @property
    def has_waiting_frames(self) -> bool:
        """Whether device frames wait for the next sample."""
        return bool(self._frames)

    def answer(self, frame: ActuatorFrame) -> None:
        """Send the actuators in reply to a sample."""
        flags = frame.flags if self.lockstep else 0
        fields = (frame.time_us, flags, *frame.controls, frame.mode)
        self.transport.send(self.endpoint.encode_fixed(_CONTROLS_FRAME, fields))

    def send_failure_order(self, order: InjectionOrder) -> None:
        """Send a failure-injection order to the simulator."""
        unit, kind, instance, size = order
        self.endpoint.send(
            "COMMAND_LONG",
            target_system=self.endpoint.system,
            target_component=0,
            command=MavCmd.INJECT_FAILURE,
            confirmation=0,
            param1=unit,
            param2=kind,
            param3=instance,
            param4=size,
            param5=math.nan,
            param6=math.nan,
            param7=math.nan,
        )

    @property
    def non_mavlink_bytes(self) -> int:
        """Number of received bytes that are not MAVLink."""
        return self.endpoint.skipped_bytes

    def pop_failure_results(self) -> list[int]:
        """Return the MAV_RESULTs of failure orders since the last call, in order."""
        results, self._failure_results = self._failure_results, []
        return results

    def pop_error(self) -> str:
        """Return the error text about samples once; "" without an error."""
        error, self._error = self._error, ""
        return error

    def _samples(self, frame: Frame, sensors: SensorFrame) -> list[HilSample]:
        """Return the sample of a frame; nothing if its time is impossible."""
        if sensors.time_us > MAX_TIME_US:
            self._report_time(sensors.time_us)
            return []
        if self._frames:
            return [self._sample_with_devices(frame, sensors)]
        return [HilSample(sensors, frames=(frame,))]

    def _report_time(self, time_us: int) -> None:
        """Report once that a sample is dropped because its time would expire every timer."""
        if not self._time_error_reported:
            self._time_error_reported = True
            self._error = f"HIL: sample time {time_us} us ignored: must be 0 to {MAX_TIME_US}"

    def _sample_with_devices(self, frame: Frame, sensors: SensorFrame) -> HilSample:
        """Return the sample, with the device messages received since the one before."""
        sample = HilSample(
            sensors, **self._records, relayed=tuple(self._relayed), frames=(*self._frames, frame)
        )
        self._records = {}
        self._relayed.clear()
        self._frames.clear()
        return sample

    def _collect(self, frame: Frame) -> None:
        """Keep a device message until the next sample."""
        if frame.message_id == _COMMAND_ACK.message_id:
            self._failure_results.append(frame.decode().result)
        if frame.message_id in _LOGGED_MESSAGES:
            self._frames.append(frame)
        if frame.message_id in _RELAYED_MESSAGES:
            self._relayed.append(frame)
        if reader := _READERS.get(frame.message_id):
            m = frame.decode()
            if reader.applies(m):
                self._records[reader.name] = reader.read(m)


def _is_link_order(m: Message) -> bool:
    """Return whether a command starts or ends a loss of the ground links."""
    return bool(m.command == MavCmd.INJECT_FAILURE and m.param1 == _LINK)


def _links_silent(m: Message) -> bool:
    """Return whether an order of ``_is_link_order`` starts a loss of the ground links."""
    return bool(m.param2 == _OFF)


class _Reader(NamedTuple):
    """Conversion of a device message."""

    name: str
    """Field of ``HilSample`` that it fills."""
    applies: Callable[[Message], bool]
    """Whether a message contains the record."""
    read: Callable[[Message], Any]


_READERS = {
    _GPS.message_id: _Reader("gps", lambda m: True, device_messages.gps_record),
    _RANGE.message_id: _Reader(
        "altimeter", device_messages.looks_down, device_messages.altimeter_record
    ),
    device_messages.ODOMETRY.message_id: _Reader(
        "dvl", device_messages.has_velocity, device_messages.dvl_record
    ),
    device_messages.BATTERY_STATUS.message_id: _Reader(
        "battery", device_messages.has_voltage, device_messages.battery_record
    ),
    device_messages.SYS_STATUS.message_id: _Reader(
        "leak", device_messages.has_leak_detector, device_messages.leak_record
    ),
    device_messages.ACTUATOR_OUTPUTS.message_id: _Reader(
        "duct", device_messages.has_deflections, device_messages.duct_record
    ),
    dialect.by_name("COMMAND_LONG").message_id: _Reader(
        "links_silent", _is_link_order, _links_silent
    ),
}
"""Conversion of each device message."""
_LOGGED_MESSAGES = _RELAYED_MESSAGES.union(_READERS)
"""Messages that are logged beside HIL_SENSOR; never the simulated truth."""
