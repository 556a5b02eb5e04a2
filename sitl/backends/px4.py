"""PX4 at the helm, over its simulator API: PX4 connects to us, and HIL_SENSOR is its clock.

Protocol: docs.px4.io, "Simulation", and PX4's module simulator_mavlink. PX4 connects by TCP (or,
with ``-u``, waits for our first datagram), asks for HIL_STATE_QUATERNION by
MAV_CMD_SET_MESSAGE_INTERVAL, and runs from one HIL_SENSOR to the next. It takes every group of
``fields_updated`` whole or not at all, and HIL_GPS's eph and epv as centimetres."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import isfinite, pow
from typing import Literal

from mavlink_io import device_messages
from mavlink_io.clock import wall_s
from mavlink_io.codec import Frame
from mavlink_io.dialect import constant
from mavlink_io.endpoint import Endpoint
from mavlink_io.mission_items import MavCmd
from mavlink_io.records import LOCKSTEP_FLAG, ActuatorFrame, SensorFrame
from mavlink_io.transport import Handle, TcpServer, Transport, wait
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
    TRUTH_PERIOD_US,
    altimeter_values,
    gps_values,
)
from sitl.backends.rate_control import AnswerRate
from sitl.backends.servo_outputs import ServoOutputs, controls_from_outputs
from sitl.core import truth
from sitl.core.plant import Plant, PlantState
from sitl.core.sensors import Sensors
from sitl.core.timestep import Timestep
from sitl.faults.failure_injection import InjectionResult

Barometer = Literal["water", "air_equivalent"]
"""What HIL_SENSOR.abs_pressure tells: the water's pressure, or the air's at an altitude of minus
her depth."""

SEA_LEVEL_HPA, SEA_LEVEL_K, LAPSE_KPM, EXPONENT = 1013.25, 288.15, 0.0065, 5.25588
"""Of the ISA's troposphere (ICAO Doc 7488): p = p0 (1 - L h / T0)^(g M / (R L))."""

_STOP_CHECK_S = 0.1
"""Wall time after which a wait for a connection looks whether the process was told to stop."""
_ACCEPTED, _UNSUPPORTED = constant("MAV_RESULT_ACCEPTED"), constant("MAV_RESULT_UNSUPPORTED")
_NEUTRAL = (0.0, 0.0, 0.0)


class _Connection:
    """One connection, from the first message to the last."""

    def __init__(self, caller: Handle, tick_us: int) -> None:
        self.caller = caller
        self.rhythm = AnswerRate(tick_us)
        self.truth_period_us = TRUTH_PERIOD_US
        """0 for none at all."""
        self.actuators = ActuatorFrame(0, 0, _NEUTRAL, 0)
        """The newest that were heard."""
        self.asked_us = 0
        """The frame that was sent last, and whether an answer to it has come."""
        self.is_answered = False


class Px4:
    """Waits for PX4 to connect, and starts a new voyage with every new connection."""

    def __init__(
        self,
        transport: Transport,
        stopped: Callable[[], bool],
        *,
        rate_hz: int,
        outputs: ServoOutputs,
        barometer: Barometer,
    ) -> None:
        self._transport, self._stopped, self._outputs, self._barometer = (
            transport,
            stopped,
            outputs,
            barometer,
        )
        self._endpoint = Endpoint(transport, SYSTEM, COMPONENT)
        self._pace = Timestep(round(1e6 / rate_hz), brisk=True)
        self._talk: _Connection | None = None
        self._sailing: _Connection | None = None
        """The talk that this voyage belongs to."""

    def meet(self) -> Timestep | None:
        self._listen()
        while self._talk is None and not self._stopped():
            wait((self._transport,), _STOP_CHECK_S)
            self._listen()
        self._sailing = self._talk
        return None if self._stopped() else self._pace

    def ask(self, sea: Plant, state: PlantState, sensors: Sensors) -> ActuatorFrame | None:
        self._listen()  # what comes late still tells how late it comes
        talk = self._talk
        if talk is None or talk is not self._sailing or self._stopped():
            return None
        if state.time_us > 0:  # PX4 takes a time of zero for never
            talk.asked_us, talk.is_answered = state.time_us, False
            self._transport.send(self._frames(talk, sea, state, sensors))
            self._await(talk)
        return talk.actuators

    def _await(self, talk: _Connection) -> None:
        """Wait for the answer to the frame that was sent last, as long as it is worth it."""
        until_s = wall_s() + talk.rhythm.patience_s(talk.asked_us)
        self._listen()
        while not talk.is_answered and self._talk is talk and (left_s := until_s - wall_s()) > 0.0:
            wait((self._transport,), left_s, eager=talk.rhythm.lockstep)
            self._listen()
        if not talk.is_answered:
            talk.rhythm.miss(talk.asked_us)

    def take_orders(self) -> Sequence[InjectionResult]:
        return ()

    def _listen(self) -> None:
        """Take in what has arrived; a new connection begins a new talk."""
        frames = self._endpoint.receive()
        caller = self._caller()
        if caller is None:
            self._talk = None
        elif self._talk is None or caller is not self._talk.caller:
            self._talk = _Connection(caller, self._pace.tick_us)
        if (talk := self._talk) is None:
            return
        for frame in frames:
            if (
                frame.message_id == CONTROLS.message_id and talk.asked_us
            ):  # before that it is a last word of another
                self._hear(talk, frame)
            elif frame.message_id == COMMAND.message_id:
                self._obey(talk, frame)

    def _caller(self) -> Handle | None:
        """Who is at the other end of a connection; where there are none, always the same
        somebody."""
        return self._transport.newest if isinstance(self._transport, TcpServer) else self._transport

    def _hear(self, talk: _Connection, frame: Frame) -> None:
        told = ActuatorFrame._make(frame.decode())
        talk.actuators = told._replace(controls=controls_from_outputs(self._outputs, told.controls))
        talk.is_answered |= talk.rhythm.hear(
            told.time_us, talk.asked_us, bool(told.flags & LOCKSTEP_FLAG)
        )

    def _obey(self, talk: _Connection, frame: Frame) -> None:
        """Send the truth as often as PX4 asks for it: 0 is the rate it has anyway, a negative
        interval stops it."""
        m = frame.decode()
        known = (
            m.command == MavCmd.SET_MESSAGE_INTERVAL
            and m.param1 == TRUTH.message_id
            and isfinite(m.param2)
        )
        if known:
            talk.truth_period_us = max(0, round(m.param2)) if m.param2 else TRUTH_PERIOD_US
        result = _ACCEPTED if known else _UNSUPPORTED
        values = (m.command, result, 0, 0, frame.system, frame.component)
        self._endpoint.send_values(ACKNOWLEDGEMENT, values)

    def _frames(self, talk: _Connection, sea: Plant, state: PlantState, sensors: Sensors) -> bytes:
        """The frames of one instant. HIL_SENSOR comes last: when it moves PX4's clock, the others
        are there."""
        encode, frames = self._endpoint.encode_values, []
        if _is_due(talk.truth_period_us, state.time_us, self._pace.tick_us):
            frame = truth.to_frame(state.truth, sea.sea.latitude_deg, sea.sea.longitude_deg)
            frames.append(encode(TRUTH, frame))
        if sensors.gps is not None:
            frames.append(encode(GPS, gps_values(sensors.gps)))
        if sensors.altimeter is not None:
            frames.append(encode(ALTIMETER, altimeter_values(sensors.altimeter)))
        if (
            sensors.dvl is not None and sensors.dvl.over_ground
        ):  # PX4 takes any velocity for one over ground
            frames.append(encode(device_messages.ODOMETRY, device_messages.dvl_values(sensors.dvl)))
        frames.append(encode(SENSOR, _sensor_frame(sensors.frame, self._barometer)))
        return b"".join(frames)


def _is_due(period_us: int, time_us: int, tick_us: int) -> bool:
    """Whether a multiple of the period has been reached in the tick that ends at ``time_us``."""
    return period_us > 0 and time_us // period_us > (time_us - tick_us) // period_us


def _sensor_frame(frame: SensorFrame, barometer: Barometer) -> SensorFrame:
    return (
        frame
        if barometer == "water"
        else frame._replace(pressure_hpa=air_pressure_hpa(frame.pressure_altitude_m))
    )


def air_pressure_hpa(altitude_m: float) -> float:
    """Pressure of the standard atmosphere at an altitude, also below the sea's level; the inverse
    of what PX4 reckons.

    PX4 turns any pressure into an altitude by the air's formula (PX4 issue 20073), so that only
    this gives it a depth."""
    return SEA_LEVEL_HPA * pow(1.0 - LAPSE_KPM * altitude_m / SEA_LEVEL_K, EXPONENT)
