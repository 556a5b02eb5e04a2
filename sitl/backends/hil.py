"""The simulator's end of the HIL link: one datagram of sensors per tick, and the answer to it.

Beside the sensors only the result of a commanded failure is sent, and no heartbeat: the output
depends on vehicle time, seed, answers and commands only.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from mavlink_io import device_messages, dialect
from mavlink_io.codec import Frame
from mavlink_io.dialect import MessageType, Values
from mavlink_io.endpoint import Endpoint
from mavlink_io.fixed_frame import FIELDS
from mavlink_io.mission_items import MavCmd
from mavlink_io.records import ActuatorFrame, TruthFrame
from mavlink_io.transport import Transport, wait
from sitl.backends.messages import (
    ACKNOWLEDGEMENT,
    ALTIMETER,
    COMMAND,
    COMPONENT,
    CONTROLS,
    CONTROLS_FRAME,
    GPS,
    SENSOR_FRAME,
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
    """Client of the HIL link: sends the sensors of one tick, receives the actuators for it."""

    def __init__(self, transport: Transport) -> None:
        self._transport = transport
        self.endpoint = Endpoint(transport, SYSTEM, COMPONENT)
        """The link's own participant, for compiled code that encodes frames itself."""
        self._devices: dict[int, Endpoint] = {}
        self._injections: list[InjectionResult] = []

    @property
    def address(self) -> str:
        """Address of the link."""
        return self._transport.address

    def send(self, datagram: bytes) -> None:
        """Send a datagram made by ``datagram``, for the first time or again."""
        self._transport.send(datagram)

    def datagram(
        self, sensors: Sensors, truth: TruthFrame | None, changes: Sequence[FaultChange] = ()
    ) -> bytes:
        """Encode the frames of one tick, with HIL_SENSOR last: it starts the autopilot's tick.

        Parameters
        ----------
        sensors : Sensors
            Sensor output of this tick.
        truth : TruthFrame or None
            True state for viewers, if due.
        changes : sequence of FaultChange
            Faults that began or ended in this tick.

        Returns
        -------
        bytes
            MAVLink frames, concatenated.
        """
        encode, frames = self.endpoint.encode_values, []
        if truth is not None:
            frames.append(encode(TRUTH, truth))
        if sensors.has_devices:
            frames += self._device_frames(sensors)
        if changes:
            frames += self._fault_frames(changes)
        sample = self.endpoint.encode_fixed(SENSOR_FRAME, sensors.frame)
        return b"".join((*frames, sample)) if frames else sample

    def _device_frames(self, sensors: Sensors) -> list[bytes]:
        """Encode the frames of the slower sensors; most have component ids of their own."""
        encode, frames = self.endpoint.encode_values, []
        if sensors.gps is not None:
            frames.append(encode(GPS, gps_values(sensors.gps)))
        if sensors.altimeter is not None:
            frames.append(encode(ALTIMETER, altimeter_values(sensors.altimeter)))
        if sensors.dvl is not None:
            frames.append(
                self._encode_from(
                    device_messages.DVL_COMPONENT,
                    device_messages.ODOMETRY,
                    device_messages.dvl_values(sensors.dvl),
                )
            )
        if sensors.battery is not None:
            values = device_messages.battery_values(sensors.battery)
            frames.append(
                self._encode_from(
                    device_messages.BATTERY_COMPONENT, device_messages.BATTERY_STATUS, values
                )
            )
        if sensors.leak is not None:
            frames.append(
                self._encode_from(
                    device_messages.LEAK_COMPONENT,
                    device_messages.SYS_STATUS,
                    device_messages.leak_values(sensors.leak),
                )
            )
        if sensors.duct is not None:
            values = device_messages.duct_values(sensors.duct)
            frames.append(
                self._encode_from(
                    device_messages.DUCT_COMPONENT, device_messages.ACTUATOR_OUTPUTS, values
                )
            )
        return frames

    def _fault_frames(self, changes: Sequence[FaultChange]) -> list[bytes]:
        """Encode a STATUSTEXT per fault change; a link fault is a command to the autopilot."""
        frames = []
        for change in changes:
            severity = _WARNING if change.began else _NOTICE
            frames.append(
                self.endpoint.encode_values(_TEXT, (severity, change.text.encode(), 0, 0))
            )
            if change.fault.unit == "link":
                frames.append(
                    self.endpoint.encode_values(
                        COMMAND, failure_injection.link_silence_values(change.began)
                    )
                )
        return frames

    def take_injections(self) -> list[InjectionResult]:
        """Return the failures commanded since the last call; they are already acknowledged."""
        taken, self._injections = self._injections, []
        return taken

    def _handle_command(self, frame: Frame) -> None:
        """Acknowledge a MAV_CMD_INJECT_FAILURE at once, because vehicle time may be stopped."""
        m = frame.decode()
        if m.command != MavCmd.INJECT_FAILURE or m.target_component not in (
            0,
            COMPONENT,
        ):
            return
        injection = failure_injection.parse_command(m.param1, m.param2, m.param3, m.param4)
        if injection.result == failure_injection.ACCEPTED:
            self._injections.append(injection)
        answer = (m.command, injection.result, 0, 0, frame.system, frame.component)
        frames = [self.endpoint.encode_values(ACKNOWLEDGEMENT, answer)]
        if injection.text:
            text = (_WARNING, injection.text.encode()[:50], 0, 0)
            frames.insert(0, self.endpoint.encode_values(_TEXT, text))
        self._transport.send(b"".join(frames))

    def _encode_from(self, component: int, message: MessageType, values: Values) -> bytes:
        """Encode a frame of a component, with that component's sequence number."""
        return self.sender(component).encode_values(message, values)

    def sender(self, component: int) -> Endpoint:
        """Return the participant of the link with a component id, for compiled code.

        Parameters
        ----------
        component : int
            Component id of the simulator or of one of its sensors.

        Returns
        -------
        Endpoint
            It counts the frames of that component.
        """
        if component == COMPONENT:
            return self.endpoint
        device = self._devices.get(component)
        if device is None:
            device = self._devices[component] = Endpoint(self._transport, SYSTEM, component)
        return device

    def answer(self, time_us: int, timeout_s: float) -> ActuatorFrame | None:
        """Wait for the answer to the sensors of ``time_us``; answers to other times are dropped.

        Parameters
        ----------
        time_us : int
            Vehicle time of the sensors.
        timeout_s : float
            Wall time to wait.

        Returns
        -------
        ActuatorFrame or None
            The answer; None if it does not arrive in time.

        Raises
        ------
        LinkLostError
            The link is closed and cannot be opened again.
        """
        decoded, _, frames = self.endpoint.receive_fixed(CONTROLS_FRAME, eager=True)
        if decoded is not None:
            if decoded[FIELDS] == time_us:
                return _actuators(decoded)
            frames = self.endpoint.receive()
        elif not frames and wait((self._transport,), timeout_s):
            frames = self.endpoint.receive()
        answer = None
        while frames:
            for frame in frames:
                controls = self._parse_actuators(frame)
                if controls is not None and controls.time_us == time_us:
                    answer = controls
            frames = [] if answer else self.endpoint.receive()
        return answer

    def newest(self) -> ActuatorFrame | None:
        """Return the last actuators received since the previous call, whichever time they answer.

        Raises
        ------
        LinkLostError
            The link is closed and cannot be opened again.
        """
        newest = None
        while frames := self.endpoint.receive():
            for frame in frames:
                newest = self._parse_actuators(frame) or newest
        return newest

    def _parse_actuators(self, frame: Frame) -> ActuatorFrame | None:
        """Return the actuators if the frame holds some; execute the frame if it is a command."""
        if frame.message_id == CONTROLS.message_id:
            return ActuatorFrame._make(frame.decode())
        if frame.message_id == COMMAND.message_id:
            self._handle_command(frame)
        return None


def _actuators(decoded: tuple[Any, ...]) -> ActuatorFrame:
    """Return the actuators of a frame that `CONTROLS_FRAME` has decoded."""
    time_us, flags, *controls, mode = decoded[FIELDS:]
    return ActuatorFrame(time_us, flags, tuple(controls), mode)
