"""The simulator's end of the HIL link: one datagram of sensors out, the answer for the same vehicle
time back.

Nothing else is sent but the verdict on a failure that somebody orders, no heartbeat either: what
goes out depends on vehicle time, seed, answers and orders alone."""

from __future__ import annotations

from collections.abc import Sequence

from mavlink_io import device_messages, dialect
from mavlink_io.codec import Frame
from mavlink_io.dialect import MessageType, Values
from mavlink_io.endpoint import Endpoint
from mavlink_io.mission_items import MavCmd
from mavlink_io.records import ActuatorFrame, TruthFrame
from mavlink_io.transport import Transport, wait
from sitl.backends.messages import (
    ACKNOWLEDGEMENT,
    ALTIMETER,
    COMMAND,
    COMPONENT,
    CONTROLS,
    GPS,
    SENSOR,
    SYSTEM,
    TRUTH,
    altimeter_values,
    gps_values,
)
from sitl.core.sensors import Sensors
from sitl.faults import failure_injection
from sitl.faults.failure_injection import InjectionResult
from sitl.faults.timeline import FaultChange

_TEXT = dialect.by_name("STATUSTEXT")
_WARNING, _NOTICE = (
    dialect.constant("MAV_SEVERITY_WARNING"),
    dialect.constant("MAV_SEVERITY_NOTICE"),
)


class HilClient:
    """Sends the sensors of one instant and hears the actuators that answer it."""

    def __init__(self, transport: Transport) -> None:
        self._transport = transport
        self._endpoint = Endpoint(transport, SYSTEM, COMPONENT)
        self._devices: dict[int, Endpoint] = {}
        self._orders: list[InjectionResult] = []

    @property
    def address(self) -> str:
        return self._transport.address

    def send(self, datagram: bytes) -> None:
        """Send what ``datagram`` made, for the first time or again."""
        self._transport.send(datagram)

    def datagram(
        self, sensors: Sensors, truth: TruthFrame | None, changes: Sequence[FaultChange] = ()
    ) -> bytes:
        """The frames of one instant. HIL_SENSOR comes last: who answers it has heard the others."""
        encode = self._endpoint.encode_values
        frames = [
            b"" if truth is None else encode(TRUTH, truth),
            b"" if sensors.gps is None else encode(GPS, gps_values(sensors.gps)),
            b""
            if sensors.altimeter is None
            else encode(ALTIMETER, altimeter_values(sensors.altimeter)),
            *self._device_frames(sensors),
            *self._fault_frames(changes),
            encode(SENSOR, sensors.frame),
        ]
        return b"".join(frames)

    def _device_frames(self, sensors: Sensors) -> list[bytes]:
        """The frames of devices that speak under component ids of their own."""
        frames = []
        if sensors.dvl is not None:
            frames.append(
                self._of(
                    device_messages.DVL_COMPONENT,
                    device_messages.ODOMETRY,
                    device_messages.dvl_values(sensors.dvl),
                )
            )
        if sensors.battery is not None:
            values = device_messages.battery_values(sensors.battery)
            frames.append(
                self._of(device_messages.BATTERY_COMPONENT, device_messages.BATTERY_STATUS, values)
            )
        if sensors.leak is not None:
            frames.append(
                self._of(
                    device_messages.LEAK_COMPONENT,
                    device_messages.SYS_STATUS,
                    device_messages.leak_values(sensors.leak),
                )
            )
        if sensors.duct is not None:
            values = device_messages.duct_values(sensors.duct)
            frames.append(
                self._of(device_messages.DUCT_COMPONENT, device_messages.ACTUATOR_OUTPUTS, values)
            )
        return frames

    def _fault_frames(self, changes: Sequence[FaultChange]) -> list[bytes]:
        """Faults that begin and end are told to people; a link's is the autopilot's to carry
        out."""
        frames = []
        for change in changes:
            severity = _WARNING if change.began else _NOTICE
            frames.append(
                self._endpoint.encode_values(_TEXT, (severity, change.text.encode(), 0, 0))
            )
            if change.fault.unit == "link":
                frames.append(
                    self._endpoint.encode_values(
                        COMMAND, failure_injection.link_silence_values(change.began)
                    )
                )
        return frames

    def take_orders(self) -> list[InjectionResult]:
        """The failures that were ordered since the last call, acknowledged already."""
        taken, self._orders = self._orders, []
        return taken

    def _judge(self, frame: Frame) -> None:
        """Answer a MAV_CMD_INJECT_FAILURE at once; vehicle time may stand still."""
        m = frame.decode()
        if m.command != MavCmd.INJECT_FAILURE or m.target_component not in (
            0,
            COMPONENT,
        ):
            return
        verdict = failure_injection.parse_order(m.param1, m.param2, m.param3, m.param4)
        if verdict.result == failure_injection.ACCEPTED:
            self._orders.append(verdict)
        answer = (m.command, verdict.result, 0, 0, frame.system, frame.component)
        frames = [self._endpoint.encode_values(ACKNOWLEDGEMENT, answer)]
        if verdict.text:
            frames.insert(
                0, self._endpoint.encode_values(_TEXT, (_WARNING, verdict.text.encode()[:50], 0, 0))
            )
        self._transport.send(b"".join(frames))

    def _of(self, component: int, message: MessageType, values: Values) -> bytes:
        """A frame of a component, numbered in its own sequence."""
        device = self._devices.get(component)
        if device is None:
            device = self._devices[component] = Endpoint(self._transport, SYSTEM, component)
        return device.encode_values(message, values)

    def answer(self, time_us: int, timeout_s: float) -> ActuatorFrame | None:
        """The answer to the sensors of ``time_us`` if one arrives in time; answers to other times
        are dropped.

        Raises LinkLostError when the other end is gone for good.
        """
        wait((self._transport,), timeout_s, eager=True)
        answer = None
        while answer is None and (frames := self._endpoint.receive()):
            for frame in frames:
                controls = self._hear(frame)
                if controls is not None and controls.time_us == time_us:
                    answer = controls
        return answer

    def newest(self) -> ActuatorFrame | None:
        """The last of the actuators that have arrived since anybody listened, whatever they answer.

        Raises LinkLostError when the other end is gone for good.
        """
        newest = None
        while frames := self._endpoint.receive():
            for frame in frames:
                newest = self._hear(frame) or newest
        return newest

    def _hear(self, frame: Frame) -> ActuatorFrame | None:
        """The actuators, where a frame tells them; an order is judged."""
        if frame.message_id == CONTROLS.message_id:
            return ActuatorFrame._make(frame.decode())
        if frame.message_id == COMMAND.message_id:
            self._judge(frame)
        return None
