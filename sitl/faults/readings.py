"""Faults of the instruments, between what they measure and what the autopilot hears.

A silent instrument leaves no record, or in the sample of the AHRS no freshness bits and zeros in
its place."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from numpy.random import Generator

from mavlink_io.frames import STANDARD_GRAVITY_MPS2, offset_to_geodetic
from mavlink_io.records import (
    ACCELEROMETER_FRESH,
    GYRO_FRESH,
    MAGNETOMETER_FRESH,
    PRESSURE_FRESH,
    Altimeter,
    Battery,
    GpsFix,
    SensorFrame,
)
from sitl.core.sensors import Sensors
from sitl.faults.catalogue import Fault
from sitl.faults.timeline import FaultState, Running

MEAN_OUTAGE_S = 1.0
"""Of an intermittent instrument."""
HPA_PER_M = 1025.0 * STANDARD_GRAVITY_MPS2 / 100.0
"""What the pressure altitude of a lying pressure sensor is reckoned by."""
MAX_RANGE_M, MAX_VOLTAGE_V = 600.0, 60.0
"""As far as a lie goes: the messages carry no more."""

SensorRecord = Any
"""One of ``mavlink_io.records``: a NamedTuple."""
AddError = Callable[[SensorRecord, float], SensorRecord]


class Instrument(NamedTuple):
    """Where an instrument's readings stand in ``Sensors`` and what lies when it lies."""

    record: str
    """Field of ``Sensors``."""
    spans: dict[str, tuple[float, float]]
    """Fields of the record that hold what it measures, and between which values garbage lies."""
    shift: AddError
    fresh: int = 0
    """Bits of ``fields_updated``, for a part of the AHRS's sample."""


def _add_to_fields(*fields: str) -> AddError:
    return lambda record, error: record._replace(
        **{name: getattr(record, name) + error for name in fields}
    )


def _vector_fields(stem: str, unit: str) -> tuple[str, str, str]:
    return f"{stem}_x_{unit}", f"{stem}_y_{unit}", f"{stem}_z_{unit}"


def _shift_pressure(frame: SensorFrame, error_hpa: float) -> SensorFrame:
    altitude_m = frame.pressure_altitude_m - error_hpa / HPA_PER_M
    return frame._replace(
        pressure_hpa=frame.pressure_hpa + error_hpa, pressure_altitude_m=altitude_m
    )


def _shift_echo(echo: Altimeter, error_m: float) -> Altimeter:
    return echo._replace(range_m=min(max(0.0, echo.range_m + error_m), MAX_RANGE_M))


def _shift_charge(report: Battery, error_v: float) -> Battery:
    return report._replace(voltage_v=min(max(0.0, report.voltage_v + error_v), MAX_VOLTAGE_V))


def _shift_fix(fix: GpsFix, error_m: float) -> GpsFix:
    latitude, longitude = offset_to_geodetic(error_m, error_m, fix.lat_deg, fix.lon_deg)
    return fix._replace(lat_deg=latitude, lon_deg=longitude)


_GYRO, _ACCELEROMETER = _vector_fields("gyro", "radps"), _vector_fields("accel", "mps2")
_MAGNETOMETER, _DVL = _vector_fields("mag", "gauss"), _vector_fields("velocity", "mps")

INSTRUMENTS: dict[str, Instrument] = {
    "gyro": Instrument(
        "frame", dict.fromkeys(_GYRO, (-5.0, 5.0)), _add_to_fields(*_GYRO), GYRO_FRESH
    ),
    "accelerometer": Instrument(
        "frame",
        dict.fromkeys(_ACCELEROMETER, (-40.0, 40.0)),
        _add_to_fields(*_ACCELEROMETER),
        ACCELEROMETER_FRESH,
    ),
    "magnetometer": Instrument(
        "frame",
        dict.fromkeys(_MAGNETOMETER, (-2.0, 2.0)),
        _add_to_fields(*_MAGNETOMETER),
        MAGNETOMETER_FRESH,
    ),
    "pressure": Instrument(
        "frame",
        {"pressure_hpa": (0.0, 5000.0), "pressure_altitude_m": (-40.0, 10.0)},
        _shift_pressure,
        PRESSURE_FRESH,
    ),
    "gps": Instrument("gps", {"lat_deg": (-90.0, 90.0), "lon_deg": (-180.0, 180.0)}, _shift_fix),
    "dvl": Instrument("dvl", dict.fromkeys(_DVL, (-10.0, 10.0)), _add_to_fields(*_DVL)),
    "altimeter": Instrument("altimeter", {"range_m": (0.3, 30.0)}, _shift_echo),
    "battery": Instrument(
        "battery", {"voltage_v": (0.0, 60.0), "remaining": (0.0, 1.0)}, _shift_charge
    ),
    "encoder": Instrument(
        "duct",
        {"rudder": (-1.0, 1.0), "elevator": (-1.0, 1.0)},
        _add_to_fields("rudder", "elevator"),
    ),
}


def apply(
    sensors: Sensors, running: tuple[Running, ...], time_us: int, tick_s: float, chance: Generator
) -> tuple[Sensors, tuple[Running, ...]]:
    """What is heard of ``sensors`` under ``running`` faults, which remember what they hold or hold
    back."""
    remembered = list(running)
    for at, each in enumerate(running):
        instrument = INSTRUMENTS.get(each.fault.unit)
        if instrument is None:
            continue
        record = _new_record(sensors, instrument)
        heard, memory = _apply_to_record(
            each.fault, each.memory, record, instrument, time_us, tick_s, chance
        )
        sensors = _replace_record(sensors, instrument, heard)
        remembered[at] = Running(each.fault, memory)
    return sensors, tuple(remembered)


def _new_record(sensors: Sensors, instrument: Instrument) -> SensorRecord | None:
    """The new record of an instrument; None where it is not due or already silenced."""
    record = getattr(sensors, instrument.record)
    return record if not instrument.fresh or record.fields_updated & instrument.fresh else None


def _replace_record(
    sensors: Sensors, instrument: Instrument, record: SensorRecord | None
) -> Sensors:
    if not instrument.fresh:
        alone: dict[str, Any] = {instrument.record: record}
        return sensors._replace(**alone)
    frame = sensors.frame
    measured: dict[str, Any] = {name: getattr(record, name, 0.0) for name in instrument.spans}
    others = frame.fields_updated & ~instrument.fresh
    fresh = others if record is None else others | instrument.fresh
    return sensors._replace(frame=frame._replace(**measured, fields_updated=fresh))


def _apply_to_record(
    fault: Fault,
    memory: FaultState,
    record: SensorRecord | None,
    instrument: Instrument,
    time_us: int,
    tick_s: float,
    chance: Generator,
) -> tuple[SensorRecord | None, FaultState]:
    """What a faulty instrument lets through of a record, None for nothing."""
    if fault.kind == "delayed":
        return _delay(fault, memory, record, time_us)
    if fault.kind == "intermittent":
        memory = memory._replace(silent=_step_outage(memory.silent, fault.sizes[0], tick_s, chance))
        return (None if memory.silent else record), memory
    if record is None or fault.kind == "off":
        return None, memory
    match fault.kind:
        case "stuck":
            values = memory.values or tuple(getattr(record, name) for name in instrument.spans)
            held = record._replace(**dict(zip(instrument.spans, values, strict=True)))
            return held, memory._replace(values=values)
        case "wrong":
            return instrument.shift(record, fault.sizes[0]), memory
        case "drifting":
            return instrument.shift(
                record, fault.sizes[0] * (time_us - fault.from_us) * 1e-6
            ), memory
        case "garbage":
            return record._replace(
                **{name: chance.uniform(*span) for name, span in instrument.spans.items()}
            ), memory
        case _:
            if time_us - memory.passed_us < fault.sizes[0] * 1e6:
                return None, memory
            return record, memory._replace(passed_us=time_us)


def _delay(
    fault: Fault, memory: FaultState, record: SensorRecord | None, time_us: int
) -> tuple[SensorRecord | None, FaultState]:
    """The newest record whose delay is over; it keeps its own time."""
    queue = (
        memory.queue
        if record is None
        else (*memory.queue, (time_us + round(fault.sizes[0] * 1e6), record))
    )
    due = [waiting for at_us, waiting in queue if at_us <= time_us]
    return (due[-1] if due else None), memory._replace(queue=queue[len(due) :])


def _step_outage(silent: bool, share: float, tick_s: float, chance: Generator) -> bool:
    """A two-state Markov chain that is silent for ``share`` of the time, ``MEAN_OUTAGE_S`` at
    once."""
    returning = tick_s / MEAN_OUTAGE_S
    leaving = returning * share / (1.0 - share)
    return chance.random() >= returning if silent else chance.random() < leaving
