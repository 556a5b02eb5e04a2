"""The HIL link: sensor frames in, actuator frames out. The simulator's own state is never read."""

from typing import NamedTuple

from autopilot.identity import COMPONENT
from link import dialect
from link.codec import Frame
from link.dialect import constant
from link.endpoint import Endpoint
from link.records import ActuatorFrame, Altimeter, GpsFix, SensorFrame
from link.transport import Transport

_SENSOR, _GPS = dialect.by_name("HIL_SENSOR"), dialect.by_name("HIL_GPS")
_RANGE, _CONTROLS = dialect.by_name("DISTANCE_SENSOR"), dialect.by_name("HIL_ACTUATOR_CONTROLS")
_LOOKING_DOWN = constant("MAV_SENSOR_ROTATION_PITCH_270")


class Sample(NamedTuple):
    """What the sensors told of one instant."""

    sensors: SensorFrame
    gps: GpsFix | None
    altimeter: Altimeter | None


class HilLink:
    """The autopilot's end of the line to a simulator, or to the vehicle's own sensors and tailcone."""

    def __init__(self, transport: Transport, system: int) -> None:
        self.transport = transport
        self._endpoint = Endpoint(transport, system, COMPONENT)
        self._gps: GpsFix | None = None
        self._altimeter: Altimeter | None = None

    def receive(self) -> list[Sample]:
        """The samples that have arrived. Raises LinkLostError when the other end is gone."""
        sensors: list[SensorFrame] = []
        for frame in self._endpoint.receive():
            if frame.message_id == _SENSOR.message_id:
                sensors.append(SensorFrame._make(_SENSOR.unpack(frame.payload)))
            elif frame.message_id == _GPS.message_id:
                self._gps = _fix(frame)
            elif frame.message_id == _RANGE.message_id:
                self._altimeter = _range(frame) or self._altimeter
        return [self._sample(sample) for sample in sensors]

    def answer(self, frame: ActuatorFrame) -> None:
        """Send the actuators that answer a sample."""
        self._endpoint.send_values(_CONTROLS, frame)

    def _sample(self, sensors: SensorFrame) -> Sample:
        """Slower sensors go with the first sample that follows them or shares their datagram."""
        sample = Sample(sensors, self._gps, self._altimeter)
        self._gps = self._altimeter = None
        return sample


def _fix(frame: Frame) -> GpsFix:
    m = frame.decode()
    return GpsFix(
        m.time_usec, m.fix_type, m.lat * 1e-7, m.lon * 1e-7, m.alt * 1e-3, m.vn * 1e-2, m.ve * 1e-2, m.vd * 1e-2,
        m.satellites_visible,
    )  # fmt: skip


def _range(frame: Frame) -> Altimeter | None:
    m = frame.decode()
    if m.orientation != _LOOKING_DOWN:
        return None
    return Altimeter(m.time_boot_ms * 1000, m.current_distance * 1e-2, m.min_distance * 1e-2, m.max_distance * 1e-2)
