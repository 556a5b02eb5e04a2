"""Faults of the sensors, applied to their output before it is sent to the autopilot.

A silent sensor leaves no record. In the sample of IMU, magnetometer and pressure it leaves zeros
and no bits in ``fields_updated``.
"""

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
from sitl.faults.catalogue import ScheduledFault
from sitl.faults.timeline import FaultState, Running

MEAN_OUTAGE_S = 1.0
"""Mean duration of one outage of an intermittent sensor."""
HPA_PER_M = 1025.0 * STANDARD_GRAVITY_MPS2 / 100.0
"""Pressure per metre of sea water, for the pressure altitude of a faulty pressure sensor."""
MAX_RANGE_M, MAX_VOLTAGE_V = 600.0, 60.0
"""Largest values that the messages can carry."""

SensorRecord = Any
"""One of the NamedTuples of ``mavlink_io.records``."""
AddError = Callable[[SensorRecord, float], SensorRecord]
"""Return a record with an error added, in the sensor's unit (SI)."""


class Instrument(NamedTuple):
    """Location of a sensor's reading in ``Sensors``, and how its faults change it."""

    record: str
    """Field of ``Sensors``."""
    ranges: dict[str, tuple[float, float]]
    """Measured fields of the record, each with the range of garbage values."""
    add_error: AddError
    fresh_bits: int = 0
    """Bits of ``fields_updated`` for a sensor that is part of HIL_SENSOR, else 0."""


def _add_to_fields(*fields: str) -> AddError:
    """Return a function that adds an error to each of the fields."""
    return lambda record, error: record._replace(
        **{name: getattr(record, name) + error for name in fields}
    )


def _vector_fields(stem: str, unit: str) -> tuple[str, str, str]:
    """Return the field names of a vector."""
    return f"{stem}_x_{unit}", f"{stem}_y_{unit}", f"{stem}_z_{unit}"


def _shift_pressure(frame: SensorFrame, error_hpa: float) -> SensorFrame:
    """Add an error to the pressure and the matching one to the pressure altitude."""
    altitude_m = frame.pressure_altitude_m - error_hpa / HPA_PER_M
    return frame._replace(
        pressure_hpa=frame.pressure_hpa + error_hpa, pressure_altitude_m=altitude_m
    )


def _shift_echo(echo: Altimeter, error_m: float) -> Altimeter:
    """Add an error to the range, within the limits of the message."""
    return echo._replace(range_m=min(max(0.0, echo.range_m + error_m), MAX_RANGE_M))


def _shift_charge(report: Battery, error_v: float) -> Battery:
    """Add an error to the voltage, within the limits of the message."""
    return report._replace(voltage_v=min(max(0.0, report.voltage_v + error_v), MAX_VOLTAGE_V))


def _shift_fix(fix: GpsFix, error_m: float) -> GpsFix:
    """Shift the position by an error to the north and to the east."""
    latitude, longitude = offset_to_geodetic(error_m, error_m, fix.lat_deg, fix.lon_deg)
    return fix._replace(lat_deg=latitude, lon_deg=longitude)


_GYRO, _ACCELEROMETER = _vector_fields("gyro", "radps"), _vector_fields("accel", "mps2")
_MAGNETOMETER, _DVL = _vector_fields("mag", "gauss"), _vector_fields("velocity", "mps")

INSTRUMENTS: dict[str, Instrument] = {
    "gyro": Instrument(
        record="frame",
        ranges=dict.fromkeys(_GYRO, (-5.0, 5.0)),
        add_error=_add_to_fields(*_GYRO),
        fresh_bits=GYRO_FRESH,
    ),
    "accelerometer": Instrument(
        record="frame",
        ranges=dict.fromkeys(_ACCELEROMETER, (-40.0, 40.0)),
        add_error=_add_to_fields(*_ACCELEROMETER),
        fresh_bits=ACCELEROMETER_FRESH,
    ),
    "magnetometer": Instrument(
        record="frame",
        ranges=dict.fromkeys(_MAGNETOMETER, (-2.0, 2.0)),
        add_error=_add_to_fields(*_MAGNETOMETER),
        fresh_bits=MAGNETOMETER_FRESH,
    ),
    "pressure": Instrument(
        record="frame",
        ranges={"pressure_hpa": (0.0, 5000.0), "pressure_altitude_m": (-40.0, 10.0)},
        add_error=_shift_pressure,
        fresh_bits=PRESSURE_FRESH,
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
    sensors: Sensors, running: tuple[Running, ...], time_us: int, tick_s: float, rng: Generator
) -> tuple[Sensors, tuple[Running, ...]]:
    """Apply ``running`` faults to the sensor output; return it with the new fault states."""
    updated = list(running)
    for index, item in enumerate(running):
        instrument = INSTRUMENTS.get(item.fault.unit)
        if instrument is None:
            continue
        record = _new_record(sensors, instrument)
        record, memory = _apply_to_record(
            item.fault, item.memory, record, instrument, time_us, tick_s, rng
        )
        sensors = _replace_record(sensors, instrument, record)
        updated[index] = Running(item.fault, memory)
    return sensors, tuple(updated)


def _new_record(sensors: Sensors, instrument: Instrument) -> SensorRecord | None:
    """Return the new record of a sensor; None if it has none in this tick."""
    record = getattr(sensors, instrument.record)
    is_new = not instrument.fresh_bits or record.fields_updated & instrument.fresh_bits
    return record if is_new else None


def _replace_record(
    sensors: Sensors, instrument: Instrument, record: SensorRecord | None
) -> Sensors:
    """Replace the reading of a sensor; None removes it."""
    if not instrument.fresh_bits:
        replacement: dict[str, Any] = {instrument.record: record}
        return sensors._replace(**replacement)
    frame = sensors.frame
    measured: dict[str, Any] = {name: getattr(record, name, 0.0) for name in instrument.ranges}
    other_bits = frame.fields_updated & ~instrument.fresh_bits
    bits = other_bits if record is None else other_bits | instrument.fresh_bits
    return sensors._replace(frame=frame._replace(**measured, fields_updated=bits))


def _apply_to_record(
    fault: ScheduledFault,
    memory: FaultState,
    record: SensorRecord | None,
    instrument: Instrument,
    time_us: int,
    tick_s: float,
    rng: Generator,
) -> tuple[SensorRecord | None, FaultState]:
    """Return the record that a faulty sensor outputs (None for nothing) and the fault's state."""
    if fault.kind == "delayed":
        return _delay(fault, memory, record, time_us)
    if fault.kind == "intermittent":
        memory = memory._replace(silent=_step_outage(memory.silent, fault.sizes[0], tick_s, rng))
        return (None if memory.silent else record), memory
    if record is None or fault.kind == "off":
        return None, memory
    match fault.kind:
        case "stuck":
            values = memory.values or tuple(getattr(record, name) for name in instrument.ranges)
            stuck = record._replace(**dict(zip(instrument.ranges, values, strict=True)))
            return stuck, memory._replace(values=values)
        case "wrong":
            return instrument.add_error(record, fault.sizes[0]), memory
        case "drifting":
            return instrument.add_error(
                record, fault.sizes[0] * (time_us - fault.from_us) * 1e-6
            ), memory
        case "garbage":
            return record._replace(
                **{name: rng.uniform(*limits) for name, limits in instrument.ranges.items()}
            ), memory
        case _:
            if time_us - memory.passed_us < fault.sizes[0] * 1e6:
                return None, memory
            return record, memory._replace(passed_us=time_us)


def _delay(
    fault: ScheduledFault, memory: FaultState, record: SensorRecord | None, time_us: int
) -> tuple[SensorRecord | None, FaultState]:
    """Return the newest record whose delay is over, with its original time stamp."""
    queue = (
        memory.queue
        if record is None
        else (*memory.queue, (time_us + round(fault.sizes[0] * 1e6), record))
    )
    due = [delayed for due_us, delayed in queue if due_us <= time_us]
    return (due[-1] if due else None), memory._replace(queue=queue[len(due) :])


def _step_outage(silent: bool, share: float, tick_s: float, rng: Generator) -> bool:
    """Advance a two-state Markov chain that is silent for the fraction ``share`` of the time.

    Per tick dt: P(silent -> active) = dt / T, P(active -> silent) = dt / T share / (1 - share),
    for the mean outage T = ``MEAN_OUTAGE_S``.
    """
    p_end = tick_s / MEAN_OUTAGE_S
    p_start = p_end * share / (1.0 - share)
    return rng.random() >= p_end if silent else rng.random() < p_start
