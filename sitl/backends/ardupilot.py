"""ArduPilot at the helm, over its JSON backend: a datagram of servos in, one of physics out.

Protocol: ArduPilot, libraries/SITL/examples/JSON/readme.md. ArduPilot leads: each of its frames
asks for one step of 1 / frame_rate, and it waits for the answer. It counts its frames, so that one
which comes again is answered again and moves nothing; a count that is back at the beginning is an
ArduPilot that was started anew. What it gets is the true motion, as the protocol has it: ArduPilot
simulates its own instruments, all but the altimeter and the battery's gauge."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable, Sequence
from typing import NamedTuple

from mavlink_io.records import ActuatorFrame, Altimeter, Battery
from mavlink_io.transport import Transport, wait
from sitl.backends.servo_outputs import ServoOutputs, controls_from_outputs
from sitl.core.plant import Plant, PlantState
from sitl.core.sensors import Sensors
from sitl.core.timestep import TICK_US, Timestep
from sitl.core.truth import Truth
from sitl.faults.failure_injection import InjectionResult

MAGIC_16, MAGIC_32 = 18458, 29569
NEUTRAL_US, FULL_TRAVEL_US = 1500, 400
"""A servo's pulse in the middle, and from there to either end: 1100 to 1900 us, as ArduPilot's own
submarine has it."""
MIN_STEP_US = 100
"""No frame rate is taken that asks for shorter steps, nor for longer ones than our own
autopilot's."""

_LAYOUTS = {
    struct.calcsize(f"<HHI{n}H"): (magic, struct.Struct(f"<HHI{n}H"))
    for magic, n in ((MAGIC_16, 16), (MAGIC_32, 32))
}
_STOP_CHECK_S = 0.1
"""Wall time after which a wait for servos looks whether the process was told to stop."""


class Servos(NamedTuple):
    """One frame of ArduPilot's."""

    frame_rate_hz: int
    number: int
    pulses_us: tuple[int, ...]
    """0 where an output is not in use."""


class ArduPilot:
    """Answers each frame of servos with the motion after the step that it asked for."""

    def __init__(
        self, transport: Transport, stopped: Callable[[], bool], *, outputs: ServoOutputs
    ) -> None:
        self._transport, self._stopped, self._outputs = transport, stopped, outputs
        self._asked: Servos | None = None
        """The frame that is to be answered."""
        self._answer = b""
        """To the frame before, in case it comes again."""
        self._range: Altimeter | None = None
        self._battery: Battery | None = None

    def meet(self) -> Timestep | None:
        while self._asked is None and not self._stopped():
            wait((self._transport,), _STOP_CHECK_S)
            self._asked = self._newest()
        self._range = self._battery = None
        return (
            None
            if self._asked is None or self._stopped()
            else timestep_for_rate(self._asked.frame_rate_hz)
        )

    def ask(self, sea: Plant, state: PlantState, sensors: Sensors) -> ActuatorFrame | None:
        self._range = sensors.altimeter or self._range
        self._battery = sensors.battery or self._battery
        if state.time_us > 0:
            self._answer = reply_json(state.truth, self._range, self._battery)
            self._transport.send(self._answer)
            if not self._is_asked_on():
                return None
        assert self._asked is not None
        return ActuatorFrame(
            state.time_us,
            0,
            controls_from_outputs(self._outputs, controls_from_pulses(self._asked.pulses_us)),
            0,
        )

    def take_orders(self) -> Sequence[InjectionResult]:
        return ()

    def _is_asked_on(self) -> bool:
        """Wait for the next frame; False when none comes, or the first of an ArduPilot that began
        anew."""
        while not self._stopped():
            wait((self._transport,), _STOP_CHECK_S)
            before, heard = self._asked, self._newest()
            if heard is None or before is None:
                continue
            if heard.number == before.number:
                self._transport.send(self._answer)
            elif is_restart(heard, before):
                self._asked = heard
                return False
            elif heard.number > before.number:
                self._asked = heard
                return True
        return False

    def _newest(self) -> Servos | None:
        """The last of the frames that have arrived: one that was sent again and again wants one
        answer."""
        newest = None
        while datagram := self._transport.receive():
            newest = parse_servos(datagram) or newest
        return newest


def parse_servos(datagram: bytes) -> Servos | None:
    """A frame of servos, None of anything else."""
    magic, layout = _LAYOUTS.get(len(datagram), (0, None))
    if layout is None:
        return None
    told, frame_rate_hz, number, *pulses_us = layout.unpack(datagram)
    return (
        Servos(frame_rate_hz, number, tuple(pulses_us)) if told == magic and frame_rate_hz else None
    )


def is_restart(heard: Servos, before: Servos) -> bool:
    """Whether a frame comes from an ArduPilot that was started since; one less than a second old is
    merely late."""
    return heard.number < before.number and (
        heard.number == 0 or before.number - heard.number > before.frame_rate_hz
    )


def timestep_for_rate(frame_rate_hz: int) -> Timestep:
    """The steps of a frame rate, in whole microseconds; a voyage keeps the rate that it began
    with."""
    return Timestep(min(TICK_US, max(MIN_STEP_US, round(1e6 / frame_rate_hz))))


def controls_from_pulses(pulses_us: Sequence[int]) -> list[float]:
    """Pulses as fractions of full deflection, -1 to 1."""
    return [
        max(-1.0, min(1.0, (pulse - NEUTRAL_US) / FULL_TRAVEL_US)) if pulse else 0.0
        for pulse in pulses_us
    ]


def reply_json(truth: Truth, echo: Altimeter | None, battery: Battery | None) -> bytes:
    """The line of JSON that ArduPilot reads. It looks for ``"key":`` as text, so no blank may stand
    after the colon."""
    told = {
        "timestamp": truth.time_us / 1e6,
        "imu": {"gyro": truth.rates_radps, "accel_body": truth.specific_force_mps2},
        "position": truth.position_ned_m,
        "quaternion": truth.attitude_q,
        "velocity": truth.velocity_ned_mps,
    }
    if echo is not None:
        told["rng_1"] = echo.range_m
    if battery is not None:
        told["battery"] = {"voltage": battery.voltage_v, "current": battery.current_a}
    return b"\n" + json.dumps(told, separators=(",", ":")).encode() + b"\n"
