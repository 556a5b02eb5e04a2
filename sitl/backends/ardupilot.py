"""ArduPilot over its JSON simulator backend: a datagram of servo pulses in, one of physics out.

Protocol: ArduPilot, libraries/SITL/examples/JSON/readme.md. ArduPilot leads: each of its frames
requests one step of 1 / frame_rate, and it waits for the answer. The rate changes by 1 Hz a frame
from the first one (1200 Hz) to SIM_RATE_HZ (SIM_JSON.cpp), so the tick of the plant is that of the
first frame, and an answer between two ticks is extrapolated. It numbers its frames. A repeated
frame gets the same answer again, without a step; a frame number that starts again from zero comes
from a restarted ArduPilot. The answer holds the true motion, as the protocol requires: ArduPilot
simulates its own sensors, except the altimeter and the battery gauge.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Callable, Sequence
from math import sqrt
from typing import NamedTuple

from mavlink_io.frames import euler_from_quaternion
from mavlink_io.records import ActuatorFrame, Altimeter, Battery
from mavlink_io.tick import TICK_US
from mavlink_io.transport import Transport, wait
from sitl.backends.servo_outputs import ServoOutputs, controls_from_outputs
from sitl.core.plant import Plant, PlantState
from sitl.core.sensors import Sensors
from sitl.core.timestep import Timestep
from sitl.core.truth import Truth
from sitl.faults.failure_injection import InjectionResult

MAGIC_16, MAGIC_32 = 18458, 29569
"""First field of a frame with 16 and with 32 outputs."""
NEUTRAL_US, FULL_TRAVEL_US = 1500, 400
"""Servo pulse at neutral and its change at full travel: 1100 to 1900 us, as for ArduSub."""
MIN_STEP_US = 100
"""Shortest step, also used for higher frame rates; the longest is Caribou's own tick."""

_LAYOUTS = {
    struct.calcsize(f"<HHI{n}H"): (magic, struct.Struct(f"<HHI{n}H"))
    for magic, n in ((MAGIC_16, 16), (MAGIC_32, 32))
}
_STOP_CHECK_S = 0.1
"""Wall time between checks whether the process was asked to stop."""


class Servos(NamedTuple):
    """One servo frame from ArduPilot."""

    frame_rate_hz: int
    number: int
    pulses_us: tuple[int, ...]
    """Pulse of each output; 0 where an output is not in use."""


class ArduPilot:
    """Backend that answers each servo frame with the motion after the requested step."""

    def __init__(
        self, transport: Transport, stopped: Callable[[], bool], *, outputs: ServoOutputs
    ) -> None:
        self._transport, self._stopped, self._outputs = transport, stopped, outputs
        self._request: Servos | None = None
        """Frame to be answered next."""
        self._answer = b""
        """Answer to the frame before, sent again if that frame is repeated."""
        self._range: Altimeter | None = None
        self._battery: Battery | None = None
        self._due_us = 0
        """Vehicle time of the next answer."""

    def wait_for_autopilot(self) -> Timestep | None:
        """Wait for the first servo frame and return the step that it requests."""
        while self._request is None and not self._stopped():
            wait((self._transport,), _STOP_CHECK_S)
            self._request = self._newest()
        self._range = self._battery = None
        if self._request is None or self._stopped():
            return None
        timestep = timestep_for_rate(self._request.frame_rate_hz)
        self._due_us = timestep.tick_us
        return timestep

    def exchange(self, plant: Plant, state: PlantState, sensors: Sensors) -> ActuatorFrame | None:
        """Answer the servo frames that are due at this tick; return the controls of the next."""
        self._range = sensors.altimeter or self._range
        self._battery = sensors.battery or self._battery
        while self._due_us <= state.time_us + plant.tick_us // 2:
            truth = extrapolated(state.truth, self._due_us)
            self._answer = reply_json(truth, self._range, self._battery)
            self._transport.send(self._answer)
            if not self._await_next_frame() or self._request is None:
                return None
            self._due_us += timestep_for_rate(self._request.frame_rate_hz).tick_us
        assert self._request is not None
        return ActuatorFrame(
            state.time_us,
            0,
            controls_from_outputs(self._outputs, controls_from_pulses(self._request.pulses_us)),
            0,
        )

    def take_injections(self) -> Sequence[InjectionResult]:
        """Return nothing: this backend accepts no failure commands."""
        return ()

    def _await_next_frame(self) -> bool:
        """Wait for the next servo frame; return False on a stop, or if ArduPilot has restarted."""
        while not self._stopped():
            wait((self._transport,), _STOP_CHECK_S)
            previous, received = self._request, self._newest()
            if received is None or previous is None:
                continue
            if received.number == previous.number:
                self._transport.send(self._answer)
            elif is_restart(received, previous):
                self._request = received
                return False
            elif received.number > previous.number:
                self._request = received
                return True
        return False

    def _newest(self) -> Servos | None:
        """Return the last of the frames that have arrived; repeated frames need only one answer."""
        newest = None
        while datagram := self._transport.receive():
            newest = parse_servos(datagram) or newest
        return newest


def parse_servos(datagram: bytes) -> Servos | None:
    """Decode a servo frame; None if the datagram is something else."""
    magic, layout = _LAYOUTS.get(len(datagram), (0, None))
    if layout is None:
        return None
    received_magic, frame_rate_hz, number, *pulses_us = layout.unpack(datagram)
    return (
        Servos(frame_rate_hz, number, tuple(pulses_us))
        if received_magic == magic and frame_rate_hz
        else None
    )


def is_restart(received: Servos, previous: Servos) -> bool:
    """Return whether a frame comes from a restarted ArduPilot; less than 1 s older is only late."""
    return received.number < previous.number and (
        received.number == 0 or previous.number - received.number > previous.frame_rate_hz
    )


def timestep_for_rate(frame_rate_hz: int) -> Timestep:
    """Return the step for a frame rate in whole microseconds."""
    return Timestep(min(TICK_US, max(MIN_STEP_US, round(1e6 / frame_rate_hz))))


def controls_from_pulses(pulses_us: Sequence[int]) -> list[float]:
    """Convert servo pulses (us) to fractions of full travel, -1 to 1."""
    return [
        max(-1.0, min(1.0, (pulse - NEUTRAL_US) / FULL_TRAVEL_US)) if pulse else 0.0
        for pulse in pulses_us
    ]


def extrapolated(truth: Truth, time_us: int) -> Truth:
    """Return the motion at a time less than a tick away, at constant velocity and rates.

    Parameters
    ----------
    truth : Truth
        Motion at a tick.
    time_us : int
        Vehicle time of the result.
    """
    span_s = (time_us - truth.time_us) * 1e-6
    if span_s == 0.0:
        return truth
    north, east, down = (
        position + velocity * span_s
        for position, velocity in zip(truth.position_ned_m, truth.velocity_ned_mps, strict=True)
    )
    # q' = q (0, rates) / 2
    w, x, y, z = truth.attitude_q
    p, q, r = (0.5 * span_s * rate for rate in truth.rates_radps)
    turned = (
        w - x * p - y * q - z * r,
        x + w * p + y * r - z * q,
        y + w * q + z * p - x * r,
        z + w * r + x * q - y * p,
    )
    norm = sqrt(sum(part * part for part in turned))
    w, x, y, z = (part / norm for part in turned)
    return truth._replace(
        time_us=time_us, position_ned_m=(north, east, down), attitude_q=(w, x, y, z)
    )


def reply_json(truth: Truth, echo: Altimeter | None, battery: Battery | None) -> bytes:
    """Return the JSON line for ArduPilot, which matches ``"key":`` as text: no blank after colons.

    Units are SI, axes NED and FRD. ``echo`` and ``battery`` are left out when they are None.
    """
    message = {
        "timestamp": truth.time_us / 1e6,
        "imu": {"gyro": truth.rates_radps, "accel_body": truth.specific_force_mps2},
        "position": truth.position_ned_m,
        "attitude": euler_from_quaternion(*truth.attitude_q),
        "quaternion": truth.attitude_q,
        "velocity": truth.velocity_ned_mps,
    }
    if echo is not None:
        message["rng_1"] = echo.range_m
    if battery is not None:
        message["battery"] = {"voltage": battery.voltage_v, "current": battery.current_a}
    return b"\n" + json.dumps(message, separators=(",", ":")).encode() + b"\n"
