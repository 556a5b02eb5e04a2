"""Processor time of HIL messages and of the recorder, per tick and per message."""

import time
from collections.abc import Callable
from pathlib import Path

from pymavlink.dialects.v20 import all as mavlink

from benchmarks.speed.results import Measurement, Reference
from benchmarks.speed.session import Session
from ground.client.recorder import Recorder
from mavlink_io import codec, dialect
from mavlink_io.codec import Frame, Framer
from mavlink_io.dialect import MessageType
from mavlink_io.fixed_frame import FIELDS, FixedFrame
from mavlink_io.records import ActuatorFrame, SensorFrame
from mavlink_io.tick import TICK_US
from sitl import scenario
from sitl.core import plant
from sitl.vehicle import config

SENSOR, CONTROLS = dialect.by_name("HIL_SENSOR"), dialect.by_name("HIL_ACTUATOR_CONTROLS")
ROUNDS = 2000
"""Ticks of a repetition of the codec."""
RECORDED_TICKS = 10_000
"""Ticks of a repetition of the recorder."""
TELEMETRY = ("ATTITUDE", "ACTUATOR_OUTPUT_STATUS", "LOCAL_POSITION_NED")
"""Messages of the telemetry of a tick."""
SYSTEM, COMPONENT = 1, 1


def _tick_values() -> tuple[SensorFrame, ActuatorFrame]:
    """Return the values of both messages of a tick."""
    sea = plant.build(config.load("caribou_truth"), scenario.load("disturbed"))
    _, reading = plant.initial_state(sea, plant.random_streams(1))
    controls = (0.1, -0.05, 0.58, *(0.0,) * 13)
    values = CONTROLS.values(time_usec=reading.frame.time_us, controls=controls, mode=1, flags=0)
    return reading.frame, ActuatorFrame._make(values)


def _own_codec(sensors: SensorFrame, actuators: ActuatorFrame) -> Callable[[int], object]:
    """Return a function that encodes and decodes both messages as the HIL link does."""
    sensor, controls = FixedFrame(SENSOR), FixedFrame(CONTROLS)
    time_us, flags, outputs, mode = actuators

    def exchange(sequence: int) -> object:
        data = sensor.encode(sensors, sequence, SYSTEM, COMPONENT)
        received = sensor.decode(data)
        answer = (time_us, flags, *outputs, mode)
        decoded = controls.decode(controls.encode(answer, sequence, SYSTEM, COMPONENT))
        assert received is not None
        assert decoded is not None
        stamp, bits, *values, state = decoded[FIELDS:]
        return SensorFrame._make(received[FIELDS:]), ActuatorFrame(
            stamp, bits, tuple(values), state
        )

    return exchange


def _pymavlink(sensors: SensorFrame, actuators: ActuatorFrame) -> Callable[[int], object]:
    """Return a function that encodes and decodes both messages with pymavlink."""
    simulator, autopilot = (mavlink.MAVLink(None, SYSTEM, COMPONENT) for _ in range(2))
    definitions = mavlink.MAVLink_hil_sensor_message, mavlink.MAVLink_hil_actuator_controls_message
    sensor_fields, control_fields = (
        dict(zip(definition.ordered_fieldnames, values, strict=True))
        for definition, values in zip(definitions, (sensors, actuators), strict=True)
    )

    def exchange(sequence: int) -> object:
        del sequence  # pymavlink counts by itself
        data = definitions[0](**sensor_fields).pack(simulator)
        received = autopilot.parse_buffer(data)
        data = definitions[1](**control_fields).pack(autopilot)
        return received, simulator.parse_buffer(data)

    return exchange


def _microseconds(exchange: Callable[[int], object]) -> float:
    """Return the processor time of a tick (us)."""
    began_s = time.process_time()
    for sequence in range(ROUNDS):
        exchange(sequence & 0xFF)
    return 1e6 * (time.process_time() - began_s) / ROUNDS


def measure_codec(session: Session) -> list[Measurement]:
    """Measure `hil-codec`."""
    values = _tick_values()
    own, peer = _own_codec(*values), _pymavlink(*values)
    costs_us, peers_us = [], []
    for _ in range(session.repetitions("hil-codec")):
        costs_us.append(_microseconds(own))
        peers_us.append(_microseconds(peer))
    session.report(f"hil-codec: {costs_us[-1]:.1f} us; pymavlink {peers_us[-1]:.1f} us")
    return [Measurement("hil-codec", tuple(costs_us), Reference("pymavlink", tuple(peers_us)))]


def _telemetry() -> list[Frame]:
    """Return the frames of all ticks."""
    framer, frames = Framer(), list[Frame]()
    messages = [dialect.by_name(name) for name in TELEMETRY]
    fields = [
        ("time_usec" if any(f.name == "time_usec" for f in message.fields) else "time_boot_ms")
        for message in messages
    ]
    for tick in range(RECORDED_TICKS):
        for message, field in zip(messages, fields, strict=True):
            time_us = tick * TICK_US
            stamp = {field: time_us if field == "time_usec" else time_us // 1000}
            values = message.values(**{**_ramp(message, 0.001 * tick), **stamp})
            frames += framer.feed(codec.encode(message, values, tick & 0xFF, SYSTEM, COMPONENT))
    return frames


def _ramp(message: MessageType, value: float) -> dict[str, float | tuple[float, ...]]:
    """Return the fields of a message: every real number `value`, every integer zero."""
    numbers = {field: value if field.type == "float" else 0 for field in message.fields}
    return {
        field.name: (number,) * field.array_length if field.array_length else number
        for field, number in numbers.items()
    }


def _record_us(frames: list[Frame], path: Path) -> float:
    """Return the processor time of the recorder per message (us), with the index at the end."""
    path.unlink(missing_ok=True)
    recorder = Recorder(path)
    began_s = time.process_time()
    for frame in frames:
        recorder.record(frame)
    recorder.finish()
    return 1e6 * (time.process_time() - began_s) / len(frames)


def _append_us(frames: list[Frame], path: Path) -> float:
    """Return the processor time of a file to which the same bytes are appended (us)."""
    began_s = time.process_time()
    with path.open("wb") as file:
        for frame in frames:
            file.write(frame.raw)
    return 1e6 * (time.process_time() - began_s) / len(frames)


def measure_recorder(session: Session) -> list[Measurement]:
    """Measure `recorder`."""
    frames = _telemetry()
    costs_us, floors_us = [], []
    for _ in range(session.repetitions("recorder")):
        costs_us.append(_record_us(frames, session.folder / "recorder.mcap"))
        floors_us.append(_append_us(frames, session.folder / "recorder.bytes"))
    session.report(f"recorder: {costs_us[-1]:.2f} us a message; append {floors_us[-1]:.2f} us")
    return [Measurement("recorder", tuple(costs_us), Reference("plain append", tuple(floors_us)))]
