"""PX4 over its simulator API: PX4 connects to the simulator, and HIL_SENSOR drives its clock.

Protocol: docs.px4.io, "Simulation", and PX4's module simulator_mavlink. PX4 connects by TCP (or,
with ``-u``, waits for the first datagram), requests HIL_STATE_QUATERNION with
MAV_CMD_SET_MESSAGE_INTERVAL, and runs from one HIL_SENSOR to the next. It uses each group of
``fields_updated`` as a whole or not at all, and reads eph and epv of HIL_GPS as centimetres.
"""

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
    ODOMETRY,
    SENSOR,
    SYSTEM,
    TRUTH,
    TRUTH_PERIOD_US,
    altimeter_values,
    gps_values,
    true_fix,
    true_pose_values,
)
from sitl.backends.rate_control import AnswerRate
from sitl.backends.servo_outputs import ServoOutputs, controls_from_outputs
from sitl.core import truth
from sitl.core.plant import Plant, PlantState
from sitl.core.sensors import Sensors
from sitl.core.timestep import Timestep
from sitl.faults.failure_injection import InjectionResult

Barometer = Literal["water", "air_equivalent"]
"""Meaning of HIL_SENSOR.abs_pressure: water pressure, or air pressure at altitude minus depth."""

Position = Literal["sensors", "gps", "vision"]
"""Position under water: none, fixes as at the surface, or the pose as a camera or an acoustic
network would give it. The last two are the true position."""

POSITION_PERIOD_US = 100_000
"""Period of a true position."""

SEA_LEVEL_HPA, SEA_LEVEL_K, LAPSE_KPM, EXPONENT = 1013.25, 288.15, 0.0065, 5.25588
"""ISA troposphere (ICAO Doc 7488): p = p0 (1 - L h / T0)^(g M / (R L))."""

_STOP_CHECK_S = 0.1
"""Wall time between checks whether the process was asked to stop."""
_ACCEPTED, _UNSUPPORTED = constant("MAV_RESULT_ACCEPTED"), constant("MAV_RESULT_UNSUPPORTED")
_NEUTRAL = (0.0, 0.0, 0.0)


class _Connection:
    """One connection of PX4."""

    def __init__(self, peer: Handle, tick_us: int) -> None:
        self.peer = peer
        self.answer_rate = AnswerRate(tick_us)
        self.truth_period_us = TRUTH_PERIOD_US
        """Period of HIL_STATE_QUATERNION in vehicle time; 0 for none."""
        self.actuators = ActuatorFrame(0, 0, _NEUTRAL, 0)
        """Newest actuators received."""
        self.sent_us = 0
        """Vehicle time of the last frame sent; 0 before the first."""
        self.is_answered = False
        """Whether the last frame has been answered."""


class Px4:
    """Backend for PX4; each new connection starts a new run."""

    def __init__(
        self,
        transport: Transport,
        stopped: Callable[[], bool],
        *,
        rate_hz: int,
        outputs: ServoOutputs,
        barometer: Barometer,
        position: Position = "sensors",
    ) -> None:
        self._transport, self._stopped, self._outputs = transport, stopped, outputs
        self._barometer, self._position = barometer, position
        self._endpoint = Endpoint(transport, SYSTEM, COMPONENT)
        self._timestep = Timestep(round(1e6 / rate_hz), imu_every_tick=True)
        self._connection: _Connection | None = None
        """Connection that is open now."""
        self._run_connection: _Connection | None = None
        """Connection that the present run belongs to."""

    def wait_for_autopilot(self) -> Timestep | None:
        """Wait for a connection of PX4."""
        self._receive()
        while self._connection is None and not self._stopped():
            wait((self._transport,), _STOP_CHECK_S)
            self._receive()
        self._run_connection = self._connection
        return None if self._stopped() else self._timestep

    def exchange(self, plant: Plant, state: PlantState, sensors: Sensors) -> ActuatorFrame | None:
        """Send the sensors, wait for an answer if one is due, and return the newest actuators."""
        self._receive()  # late answers also update the estimate of the answer's lag
        connection = self._connection
        if connection is None or connection is not self._run_connection or self._stopped():
            return None
        if state.time_us > 0:  # PX4 treats a time of zero as not set
            connection.sent_us, connection.is_answered = state.time_us, False
            self._transport.send(self._encode(connection, plant, state, sensors))
            self._await_answer(connection)
        return connection.actuators

    def _await_answer(self, connection: _Connection) -> None:
        """Wait for the answer to the last frame, for at most the time that ``AnswerRate`` gives."""
        deadline_s = wall_s() + connection.answer_rate.wait_timeout_s(connection.sent_us)
        self._receive()
        while (
            not connection.is_answered
            and self._connection is connection
            and (remaining_s := deadline_s - wall_s()) > 0.0
        ):
            wait((self._transport,), remaining_s, eager=connection.answer_rate.lockstep)
            self._receive()
        if not connection.is_answered:
            connection.answer_rate.record_timeout(connection.sent_us)

    def take_injections(self) -> Sequence[InjectionResult]:
        """Return nothing: this backend accepts no failure commands."""
        return ()

    def _receive(self) -> None:
        """Process the frames that have arrived, and open a new connection when the peer changes."""
        frames = self._endpoint.receive()
        peer = self._peer()
        if peer is None:
            self._connection = None
        elif self._connection is None or peer is not self._connection.peer:
            self._connection = _Connection(peer, self._timestep.tick_us)
        if (connection := self._connection) is None:
            return
        for frame in frames:
            # Controls before the first sensor frame were sent on an earlier connection.
            if frame.message_id == CONTROLS.message_id and connection.sent_us:
                self._update_actuators(connection, frame)
            elif frame.message_id == COMMAND.message_id:
                self._handle_command(connection, frame)

    def _peer(self) -> Handle | None:
        """Return the newest TCP client, or the transport itself where it has no connections."""
        return self._transport.newest if isinstance(self._transport, TcpServer) else self._transport

    def _update_actuators(self, connection: _Connection, frame: Frame) -> None:
        """Store the controls of an answer and record its time."""
        answer = ActuatorFrame._make(frame.decode())
        connection.actuators = answer._replace(
            controls=controls_from_outputs(self._outputs, answer.controls)
        )
        connection.is_answered |= connection.answer_rate.record_answer(
            answer.time_us, connection.sent_us, bool(answer.flags & LOCKSTEP_FLAG)
        )

    def _handle_command(self, connection: _Connection, frame: Frame) -> None:
        """Set the interval of HIL_STATE_QUATERNION: 0 is the default rate, negative is off."""
        m = frame.decode()
        is_supported = (
            m.command == MavCmd.SET_MESSAGE_INTERVAL
            and m.param1 == TRUTH.message_id
            and isfinite(m.param2)
        )
        if is_supported:
            connection.truth_period_us = max(0, round(m.param2)) if m.param2 else TRUTH_PERIOD_US
        result = _ACCEPTED if is_supported else _UNSUPPORTED
        values = (m.command, result, 0, 0, frame.system, frame.component)
        self._endpoint.send_values(ACKNOWLEDGEMENT, values)

    def _encode(
        self, connection: _Connection, plant: Plant, state: PlantState, sensors: Sensors
    ) -> bytes:
        """Encode the frames of one tick, with HIL_SENSOR last: it advances PX4's clock."""
        encode, frames = self._endpoint.encode_values, []
        if _is_due(connection.truth_period_us, state.time_us, self._timestep.tick_us):
            frame = truth.to_frame(state.truth, plant.sea.latitude_deg, plant.sea.longitude_deg)
            frames.append(encode(TRUTH, frame))
        located = _is_due(POSITION_PERIOD_US, state.time_us, self._timestep.tick_us)
        if self._position == "gps":
            if located:
                fix = true_fix(state.truth, plant.sea.latitude_deg, plant.sea.longitude_deg)
                frames.append(encode(GPS, gps_values(fix)))
        elif sensors.gps is not None:
            frames.append(encode(GPS, gps_values(sensors.gps)))
        if self._position == "vision" and located:
            frames.append(encode(ODOMETRY, true_pose_values(state.truth)))
        if sensors.altimeter is not None:
            frames.append(encode(ALTIMETER, altimeter_values(sensors.altimeter)))
        # PX4 treats every velocity in ODOMETRY as a velocity over ground.
        if sensors.dvl is not None and sensors.dvl.over_ground:
            frames.append(encode(ODOMETRY, device_messages.dvl_values(sensors.dvl)))
        frames.append(encode(SENSOR, _sensor_frame(sensors.frame, self._barometer)))
        return b"".join(frames)


def _is_due(period_us: int, time_us: int, tick_us: int) -> bool:
    """Return whether a multiple of the period lies in the tick that ends at ``time_us``."""
    return period_us > 0 and time_us // period_us > (time_us - tick_us) // period_us


def _sensor_frame(frame: SensorFrame, barometer: Barometer) -> SensorFrame:
    """Replace the pressure of a frame as the barometer option requires."""
    return (
        frame
        if barometer == "water"
        else frame._replace(pressure_hpa=air_pressure_hpa(frame.pressure_altitude_m))
    )


def air_pressure_hpa(altitude_m: float) -> float:
    """Return the pressure of the standard atmosphere at an altitude (m, negative below sea level).

    PX4 converts every pressure to an altitude with the formula for air (PX4 issue 20073). This is
    the inverse of that formula, so PX4 computes an altitude of minus the depth.
    """
    return SEA_LEVEL_HPA * pow(1.0 - LAPSE_KPM * altitude_m / SEA_LEVEL_K, EXPONENT)
