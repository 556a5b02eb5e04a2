"""The simulator's end of the HIL link: one datagram of sensors out, the answer for the same vehicle time back.

Nothing else is sent, no heartbeat either: what goes out depends on vehicle time, seed and answers alone.
"""

from __future__ import annotations

from math import atan2, hypot, isnan, pi

from link import devices, dialect
from link.dialect import MessageType
from link.endpoint import Endpoint
from link.records import ActuatorFrame, Altimeter, GpsFix, TruthFrame
from link.transport import Transport, wait
from sitl.sensors import Sensors

SYSTEM = 1
COMPONENT = dialect.constant("MAV_COMP_ID_USER1")
"""The same vehicle, a component of its own: the autopilot is component 1."""

_SENSOR = dialect.by_name("HIL_SENSOR")
_TRUTH = dialect.by_name("HIL_STATE_QUATERNION")
_GPS = dialect.by_name("HIL_GPS")
_ALTIMETER = dialect.by_name("DISTANCE_SENSOR")
_CONTROLS = dialect.by_name("HIL_ACTUATOR_CONTROLS")
_DOWN = dialect.constant("MAV_SENSOR_ROTATION_PITCH_270")
_ULTRASOUND = dialect.constant("MAV_DISTANCE_SENSOR_ULTRASOUND")
_UNKNOWN_VARIANCE = 255


class HilLink:
    """Sends the sensors of one instant and hears the actuators that answer it."""

    def __init__(self, transport: Transport) -> None:
        self._transport = transport
        self._endpoint = Endpoint(transport, SYSTEM, COMPONENT)
        self._devices: dict[int, Endpoint] = {}

    @property
    def address(self) -> str:
        return self._transport.address

    def send(self, datagram: bytes) -> None:
        """Send what ``datagram`` made, for the first time or again."""
        self._transport.send(datagram)

    def datagram(self, sensors: Sensors, truth: TruthFrame | None) -> bytes:
        """The frames of one instant. HIL_SENSOR comes last: who answers it has heard the others."""
        encode = self._endpoint.encode_values
        frames = [
            b"" if truth is None else encode(_TRUTH, truth),
            b"" if sensors.gps is None else encode(_GPS, _gps_fields(sensors.gps)),
            b"" if sensors.altimeter is None else encode(_ALTIMETER, _altimeter_fields(sensors.altimeter)),
            *self._device_frames(sensors),
            encode(_SENSOR, sensors.frame),
        ]
        return b"".join(frames)

    def _device_frames(self, sensors: Sensors) -> list[bytes]:
        """The frames of devices that speak under component ids of their own."""
        frames = []
        if sensors.dvl is not None:
            frames.append(self._of(devices.DVL_COMPONENT, devices.ODOMETRY, devices.dvl_values(sensors.dvl)))
        if sensors.battery is not None:
            values = devices.battery_values(sensors.battery)
            frames.append(self._of(devices.BATTERY_COMPONENT, devices.BATTERY_STATUS, values))
        if sensors.leak is not None:
            frames.append(self._of(devices.LEAK_COMPONENT, devices.SYS_STATUS, devices.leak_values(sensors.leak)))
        if sensors.duct is not None:
            values = devices.duct_values(sensors.duct)
            frames.append(self._of(devices.DUCT_COMPONENT, devices.ACTUATOR_OUTPUTS, values))
        return frames

    def _of(self, component: int, message: MessageType, values: devices.Values) -> bytes:
        """A frame of a component, numbered in its own sequence."""
        device = self._devices.get(component)
        if device is None:
            device = self._devices[component] = Endpoint(self._transport, SYSTEM, component)
        return device.encode_values(message, values)

    def answer(self, time_us: int, timeout_s: float) -> ActuatorFrame | None:
        """The answer to the sensors of ``time_us`` if one arrives in time; answers to other times are dropped.

        Raises LinkLostError when the other end is gone for good.
        """
        wait((self._transport,), timeout_s, eager=True)
        while frames := self._endpoint.receive():
            for frame in frames:
                if frame.message_id == _CONTROLS.message_id:
                    controls = ActuatorFrame._make(frame.decode())
                    if controls.time_us == time_us:
                        return controls
        return None


def _gps_fields(fix: GpsFix) -> tuple[object, ...]:
    speed = hypot(fix.velocity_north_mps, fix.velocity_east_mps)
    course = atan2(fix.velocity_east_mps, fix.velocity_north_mps) % (2.0 * pi)
    return _GPS.values(
        time_usec=fix.time_us,
        fix_type=fix.fix_type,
        lat=round(1e7 * fix.lat_deg),
        lon=round(1e7 * fix.lon_deg),
        alt=round(1e3 * fix.alt_m),
        eph=_centimetres(fix.eph_m),
        epv=_centimetres(fix.epv_m),
        vel=round(1e2 * speed),
        vn=round(1e2 * fix.velocity_north_mps),
        ve=round(1e2 * fix.velocity_east_mps),
        vd=round(1e2 * fix.velocity_down_mps),
        cog=round(course * 18000.0 / pi) % 36000,
        satellites_visible=fix.satellites,
    )


def _centimetres(error_m: float) -> int:
    return devices.UNKNOWN_U16 if isnan(error_m) else round(1e2 * error_m)


def _altimeter_fields(altimeter: Altimeter) -> tuple[object, ...]:
    return _ALTIMETER.values(
        time_boot_ms=altimeter.time_us // 1000,
        min_distance=round(1e2 * altimeter.min_range_m),
        max_distance=round(1e2 * altimeter.max_range_m),
        current_distance=round(1e2 * altimeter.range_m),
        type=_ULTRASOUND,
        id=0,
        orientation=_DOWN,
        covariance=_UNKNOWN_VARIANCE,
    )
