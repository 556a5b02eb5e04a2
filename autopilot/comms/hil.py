"""The HIL link: sensor frames in, actuator frames out. The simulator's own state is never read."""

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
_RANGE, _CONTROLS = dialect.by_name("DISTANCE_SENSOR"), dialect.by_name("HIL_ACTUATOR_CONTROLS")
_COMMAND_ACK = dialect.by_name("COMMAND_ACK")
_LINK, _OFF = constant("FAILURE_UNIT_SYSTEM_MAVLINK_SIGNAL"), constant("FAILURE_TYPE_OFF")
_LOOKING_DOWN = constant("MAV_SENSOR_ROTATION_PITCH_270")
_HULL_PRESSURE = dialect.by_name("SCALED_PRESSURE")
_RELAYED_MESSAGES = frozenset(
    (
        device_messages.ODOMETRY.message_id,
        device_messages.ACTUATOR_OUTPUTS.message_id,
        _HULL_PRESSURE.message_id,
        dialect.by_name("STATUSTEXT").message_id,
    )
)
"""What devices say that the ground hears under their own names: nothing in the autopilot's own
telemetry tells it."""
MAX_TIME_US = 4_102_444_800_000_000
"""The latest sample time that is taken in: 2100-01-01 as UNIX time, for an AHRS that stamps that.
Log times, in whole nanoseconds since 1970 with vehicle time added, then fit 63 bits."""
MAX_QUEUED_FRAMES = 500
"""Of what devices say before the next sample, the newest: where the AHRS has failed none may ever
come."""


class HilSample(NamedTuple):
    """What the sensors told of one instant."""

    sensors: SensorFrame
    gps: GpsFix | None = None
    altimeter: Altimeter | None = None
    dvl: Dvl | None = None
    battery: Battery | None = None
    leak: Leak | None = None
    duct: DuctFeedback | None = None
    links_silent: bool | None = None
    """A simulator wants the links to the ground to fall silent, or to speak again; None for no
    change."""
    relayed: tuple[Frame, ...] = ()
    """What devices want the ground to hear."""
    heard: tuple[Frame, ...] = ()
    """All that came for this sample as it came, the sensors' frame last."""


class HilLink:
    """The autopilot's end of the line to a simulator, or to the vehicle's own sensors and
    tailcone."""

    def __init__(self, transport: Transport, system: int) -> None:
        self.transport = transport
        self.lockstep = baud_rate(transport.address) is None
        """Whether the other end may wait for our answer: a vehicle on a serial line has a clock of
        her own."""
        self._endpoint = Endpoint(transport, system, COMPONENT)
        self._gathered: dict[str, Any] = {}
        self._relayed: deque[Frame] = deque(maxlen=MAX_QUEUED_FRAMES)
        self._heard: deque[Frame] = deque(maxlen=MAX_QUEUED_FRAMES)
        self._verdicts: list[int] = []
        self._refused, self._complaint = False, ""

    def receive(self) -> list[HilSample]:
        """The samples that have arrived. Raises LinkLostError when the other end is gone."""
        samples: list[HilSample] = []
        for frame in self._endpoint.receive():
            if frame.message_id == _SENSOR.message_id:
                sensors = SensorFrame._make(_SENSOR.unpack(frame.payload))
                if sensors.time_us <= MAX_TIME_US:
                    samples.append(self._sample(frame, sensors))
                else:
                    self._refuse(sensors.time_us)
            else:
                self._gather(frame)
        return samples

    def answer(self, frame: ActuatorFrame) -> None:
        """Send the actuators that answer a sample."""
        self._endpoint.send_values(_CONTROLS, frame if self.lockstep else frame._replace(flags=0))

    def order_failure(self, order: InjectionOrder) -> None:
        """Ask the simulator to break something."""
        unit, kind, instance, size = order
        self._endpoint.send(
            "COMMAND_LONG",
            target_system=self._endpoint.system,
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
    def gibberish_bytes(self) -> int:
        """How much was heard that is no MAVLink."""
        return self._endpoint.skipped_bytes

    def take_verdicts(self) -> list[int]:
        """MAV_RESULTs of orders, as they came since the last call."""
        taken, self._verdicts = self._verdicts, []
        return taken

    def take_complaint(self) -> str:
        """Return what was wrong with samples, once; nothing where all is well."""
        complaint, self._complaint = self._complaint, ""
        return complaint

    def _refuse(self, time_us: int) -> None:
        """Drop a sample of an impossible time: every timer on board would run out. Reported
        once."""
        if not self._refused:
            self._refused = True
            self._complaint = f"HIL: sample time {time_us} us ignored: must be 0 to {MAX_TIME_US}"

    def _sample(self, frame: Frame, sensors: SensorFrame) -> HilSample:
        """Slower devices go with the first sample that follows them."""
        if not self._heard:
            return HilSample(sensors, heard=(frame,))
        sample = HilSample(
            sensors, **self._gathered, relayed=tuple(self._relayed), heard=(*self._heard, frame)
        )
        self._gathered = {}
        self._relayed.clear()
        self._heard.clear()
        return sample

    def _gather(self, frame: Frame) -> None:
        """Keep what a device says until the next sample."""
        if frame.message_id == _COMMAND_ACK.message_id:
            self._verdicts.append(frame.decode().result)
        if frame.message_id in _LOGGED_MESSAGES:
            self._heard.append(frame)
        if frame.message_id in _RELAYED_MESSAGES:
            self._relayed.append(frame)
        if reader := _READERS.get(frame.message_id):
            name, read = reader
            record = read(frame.decode())
            if record is not None:
                self._gathered[name] = record


def _gps_fix(m: Message) -> GpsFix:
    return GpsFix(
        m.time_usec,
        m.fix_type,
        m.lat * 1e-7,
        m.lon * 1e-7,
        m.alt * 1e-3,
        m.vn * 1e-2,
        m.ve * 1e-2,
        m.vd * 1e-2,
        m.satellites_visible,
        _metres(m.eph),
        _metres(m.epv),
    )


def _metres(error_cm: int) -> float:
    return math.nan if error_cm == device_messages.UNKNOWN_U16 else error_cm * 1e-2


def _altimeter(m: Message) -> Altimeter | None:
    if m.orientation != _LOOKING_DOWN:
        return None
    return Altimeter(
        m.time_boot_ms * 1000,
        m.current_distance * 1e-2,
        m.min_distance * 1e-2,
        m.max_distance * 1e-2,
    )


def _links_silent(m: Message) -> bool | None:
    """Whether a simulator's order cuts or joins the links to the ground; None for any other
    order."""
    if m.command != MavCmd.INJECT_FAILURE or m.param1 != _LINK:
        return None
    return bool(m.param2 == _OFF)


_READERS: dict[int, tuple[str, Callable[[Message], Any]]] = {
    _GPS.message_id: ("gps", _gps_fix),
    _RANGE.message_id: ("altimeter", _altimeter),
    device_messages.ODOMETRY.message_id: ("dvl", device_messages.dvl_record),
    device_messages.BATTERY_STATUS.message_id: ("battery", device_messages.battery_record),
    device_messages.SYS_STATUS.message_id: ("leak", device_messages.leak_record),
    device_messages.ACTUATOR_OUTPUTS.message_id: ("duct", device_messages.duct_record),
    dialect.by_name("COMMAND_LONG").message_id: ("links_silent", _links_silent),
}
"""For each message that is taken in, the field of ``HilSample`` it fills, and how."""
_LOGGED_MESSAGES = _RELAYED_MESSAGES.union(_READERS)
"""What a log keeps beside the sensors: never the simulator's own state."""
